// What a viewer tells the page, or the element, that it is in.
export interface ViewerCallbacks {
  /** A frame followed the one before it after so many milliseconds, without a pause between. */
  onFrame(milliseconds: number): void;
  onChange(): void;
  /** As of an orbit (orbit.ts). */
  onLift(degrees: number): boolean;
  onUse(what: 'orbit' | 'light'): void;
  onProblem(message: string): void;
  onRecovered(): void;
  /** The exposure was measured anew: so many stops. */
  onMeter(stops: number): void;
  /** The picture is about to be drawn. */
  onDraw?(): void;
  /** Direct to indirect light: it is still being found, or is all there. */
  onSettled?(isSettled: boolean): void;
}
