/** What a user can be told about a file or a device: one sentence, fit for the page. */
export class LambentError extends Error {
  override name = 'LambentError';
}

/** The file may be shown as any other, but holds no transfer, or no longer. */
export class NoTransferError extends LambentError {}
