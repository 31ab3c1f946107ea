// What the bake is made of, shown over the scene: the lattice's points, and receivers.
import { get, input } from './dom.js';
import { LatticeBalls } from './lattice_balls.js';
import { ReceiverDots } from './receiver_dots.js';
import type { Overlay } from './state.js';
import type { Viewer } from './viewer.js';

export class OverlayControls {
  private readonly balls = new LatticeBalls();
  private readonly dots = new ReceiverDots();

  /** `changed` is told what a hand has chosen. */
  constructor(
    private readonly viewer: Viewer,
    changed: (to: Overlay[]) => void,
  ) {
    viewer.companions.add(this.balls);
    viewer.companions.add(this.dots);
    for (const id of ['show-lattice', 'show-receivers'])
      get(id).addEventListener('change', () => {
        const shown = (['lattice', 'receivers'] as const).filter((name) => input(`show-${name}`).checked);
        changed(shown);
        this.show(shown);
      });
  }

  /** Of the scene that there is now. */
  show(shown: readonly Overlay[]): void {
    const { bakedScene, bounds } = this.viewer,
      lattice = bakedScene?.lattice,
      transfer = bakedScene?.transfer.view ? undefined : bakedScene?.transfer;
    get('lattice-row').hidden = !lattice;
    get('receivers-row').hidden = !transfer;
    input('show-lattice').checked = shown.includes('lattice');
    input('show-receivers').checked = shown.includes('receivers');
    this.balls.show(shown.includes('lattice') ? lattice : undefined, bounds.radius);
    this.dots.show(shown.includes('receivers') ? transfer : undefined);
    if (lattice) get('lattice-value').textContent = lattice.points.join(' × ');
    this.viewer.invalidate();
  }
}
