// The scale of false colours.
/** Transfer at the ends of the false-colour scale, at exposure 0: those of open surfaces stay below 0.33. */
export const falseColorEnd = 0.25;
/** Of errors of a fit, relative. */
export const fitErrorEnd = 0.1;

/** False colours show transfer, which no automatic exposure is measured from. */
export const falseColorGain = (exposure: number | 'auto'): number => (exposure === 'auto' ? 1 : 2 ** exposure);
