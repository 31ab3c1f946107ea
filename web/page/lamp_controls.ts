// Lamps that move in the page: their list, their handles, and what else the page shows or leaves out where they alone
// light the scene.
import type { Lamp } from '../src/index.js';
import { get } from './dom.js';
import { Handles } from './handles.js';
import { lampHandles } from './lamp_handles.js';
import { LampPanel, stateOfLamps, takeLamps, type LampState } from './lamps.js';
import { showLightTime } from './statistics.js';
import type { Viewer } from './viewer.js';

/** What is of environments, or of transfer by them. */
const ofEnvironments = [
  ...['env-row', 'height-row', 'background-row', 'free-row', 'spin-row', 'order-row', 'window-row'],
  ...['turn', 'reset-light', 'light-hint', 'light-keys', 'light-keys-what'],
];
const ofLamps = ['lamp-hint', 'lamp-keys', 'lamp-keys-what'];

export class LampControls {
  private readonly panel: LampPanel;
  private readonly handles: Handles;

  /** `changed` is told whenever a hand has changed lamps or paint. */
  constructor(
    private readonly viewer: Viewer,
    private readonly changed: (to: LampState) => void,
  ) {
    this.panel = new LampPanel(
      () => viewer.indirect,
      () => this.change(),
    );
    const lamps = (): readonly Lamp[] => viewer.indirect?.movingLamps ?? [];
    this.handles = new Handles({
      camera: viewer.camera,
      radius: () => viewer.indirect?.bounds.radius ?? 1,
      wanted: () =>
        lampHandles(lamps, (index, lamp) => {
          this.panel.set(index, lamp);
          this.panel.follow(index, lamp);
        }),
    });
  }

  /** To the scene that there is; nothing where it has no such light. */
  take(state: LampState): void {
    if (!this.viewer.indirect) return;
    takeLamps(this.viewer.indirect, state);
    this.change();
  }

  private change(): void {
    const { viewer } = this;
    document.body.dataset['light'] = 'coming';
    this.handles.show();
    viewer.changeLight();
    this.changed(stateOfLamps(viewer.indirect!));
  }

  show(): void {
    const byLamps = this.viewer.indirect !== undefined;
    for (const id of ofEnvironments) if (byLamps || !id.endsWith('-row')) get(id).hidden = byLamps;
    if (!byLamps) for (const id of ofEnvironments.slice(0, 5)) get(id).hidden = false;
    for (const id of ofLamps) get(id).hidden = !byLamps;
    get('picture').setAttribute(
      'aria-label',
      `The scene. Drag or use the arrow keys to look around${byLamps ? '' : '; with Shift, to turn the light'}.`,
    );
    this.panel.show();
    this.handles.show();
  }

  place(): void {
    this.handles.place();
  }
  settled(isSettled: boolean): void {
    document.body.dataset['light'] = isSettled ? 'settled' : 'coming';
    if (this.viewer.indirect) showLightTime(this.viewer.indirect.times);
  }
}
