// Direct light at surfels -> indirect light, all bounces (docs/indirect.md; relight/indirect.cpp): x = G P R (d + U x).
// Exit radiance of white surfaces throughout. Bounce by bounce, so that a frame does as many as it has time for.
import { kernelSlots, type IndirectOperator } from './indirect_file.js';

const powers = 12, // of the operator, for its spectral radius
  morePowers = 3; // where it was known before the paint changed

export class IndirectSolve {
  /** Indirect light of gathering surfels, [surfel][3]. */
  x: Float32Array;
  /** How far x is from what the equation asks, over the light of the first bounce; Infinity before any bounce. */
  residual = Infinity;
  /** Since the light last changed. */
  bounces = 0;
  private before: Float32Array;
  private readonly next: Float32Array;
  private readonly ancestor: Uint32Array; // gathering surfel of each leaf
  private readonly shares: Float32Array; // of nodes in the mean of the node above
  private readonly albedos: Float32Array; // of leaves
  private readonly sent: Float32Array; // what each node sends out, [node][4]
  private readonly reach: Float32Array; // how much of what a leaf sends out all rows take together
  private readonly slowest: Float32Array; // the light that dies away slowest
  private radius = [0, 0, 0]; // spectral, by channel
  private omega = [2, 2, 2];

  constructor(readonly operator: IndirectOperator) {
    const { surfels: s, gatherLevel, gathering } = operator,
      levels = s.counts.length,
      leaves = s.counts[levels - 1]!,
      nodes = s.firstNode[levels]!;
    this.x = new Float32Array(3 * gathering);
    this.before = new Float32Array(3 * gathering);
    this.next = new Float32Array(3 * gathering);
    this.sent = new Float32Array(4 * nodes);
    this.albedos = s.albedos.slice();
    this.ancestor = new Uint32Array(leaves);
    for (let i = 0; i < leaves; ++i) {
      let at = i;
      for (let l = levels - 1; l > gatherLevel; --l) at = s.parents[this.firstParent(l) + at]!;
      this.ancestor[i] = at;
    }
    const areas = new Float64Array(nodes);
    areas.set(s.areas, s.firstNode[levels - 1]);
    this.shares = new Float32Array(nodes);
    for (let l = levels - 1; l > 0; --l) {
      const below = s.firstNode[l]!,
        above = s.firstNode[l - 1]!,
        parents = this.firstParent(l);
      for (let i = 0; i < s.counts[l]!; ++i) areas[above + s.parents[parents + i]!]! += areas[below + i]!;
      for (let i = 0; i < s.counts[l]!; ++i)
        this.shares[below + i] = areas[below + i]! / areas[above + s.parents[parents + i]!]!;
    }
    this.reach = this.reachOf();
    this.slowest = new Float32Array(3 * gathering).fill(1);
    this.findRadius(powers);
  }

  /** The gathering surfel whose light a leaf has. */
  gatheringOf(leaf: number): number {
    return this.ancestor[leaf]!;
  }

  private firstParent(level: number): number {
    const { firstNode, counts } = this.operator.surfels;
    return firstNode[level]! - counts[0]!;
  }

  private reachOf(): Float32Array {
    const { rows, surfels: s } = this.operator,
      reach = new Float32Array(s.firstNode.at(-1)!);
    for (let e = 0; e < rows.nodes.length; ++e) reach[rows.nodes[e]!]! += rows.shares[e]!;
    for (let l = 1; l < s.counts.length; ++l)
      for (let i = 0; i < s.counts[l]!; ++i) {
        const node = s.firstNode[l]! + i;
        reach[node]! += this.shares[node]! * reach[s.firstNode[l - 1]! + s.parents[this.firstParent(l) + i]!]!;
      }
    return reach.subarray(s.firstNode.at(-2));
  }

  /** Repaints leaves, [leaf][3]; x stays, for the bounces to come. */
  paint(albedos: ArrayLike<number>): void {
    this.albedos.set(albedos);
    this.findRadius(morePowers);
    this.restart();
  }

  /** The light has changed: what follows goes on from the light that there is. */
  restart(): void {
    this.bounces = 0;
    this.residual = Infinity;
    this.omega = [2, 2, 2];
  }

  /** One bounce more, of direct light at leaves, [leaf][3]. Source: Golub and Varga 1961 (relight/indirect.h). */
  step(direct: Float32Array): void {
    const { next, radius, omega } = this;
    this.bounce(this.x, direct, next);
    let left = 0;
    const { x, before } = this;
    for (let i = 0; i < x.length; ++i) left += Math.abs(next[i]! - x[i]!);
    if (this.bounces === 0) {
      before.set(next);
    } else {
      for (let c = 0; c < 3; ++c) omega[c] = 1 / (1 - (omega[c]! * radius[c]! * radius[c]!) / 4);
      for (let i = 0, c = 0; i < x.length; ++i, c = c === 2 ? 0 : c + 1)
        before[i]! += omega[c]! * (next[i]! - before[i]!);
    }
    this.x = before;
    this.before = x;
    ++this.bounces;
    const light = this.firstBounce(direct);
    this.residual = light > 0 ? left / light : left > 0 ? Infinity : 0;
    if (light === 0) {
      this.x.fill(0);
      this.residual = 0;
    }
  }

  /** The sum over all rows of one bounce of this light. */
  private firstBounce(direct: Float32Array): number {
    let sum = 0;
    for (let i = 0, at = 0; i < this.reach.length; ++i)
      for (let c = 0; c < 3; ++c, ++at) sum += this.reach[i]! * this.albedos[at]! * direct[at]!;
    return sum;
  }

  /** y = G P R (direct + U x); without direct light, of what has bounced alone. */
  private bounce(x: Float32Array, direct: Float32Array | undefined, y: Float32Array): void {
    const { operator, sent, albedos, ancestor, shares } = this,
      { surfels: s, rows } = operator,
      first = 4 * s.firstNode.at(-2)!;
    for (let i = 0; i < ancestor.length; ++i) {
      const to = first + 4 * i,
        from = 3 * ancestor[i]!,
        at = 3 * i;
      sent[to] = albedos[at]! * (x[from]! + (direct ? direct[at]! : 0));
      sent[to + 1] = albedos[at + 1]! * (x[from + 1]! + (direct ? direct[at + 1]! : 0));
      sent[to + 2] = albedos[at + 2]! * (x[from + 2]! + (direct ? direct[at + 2]! : 0));
    }
    for (let l = s.counts.length - 1; l > 0; --l) {
      const below = s.firstNode[l]!,
        above = s.firstNode[l - 1]!,
        parents = this.firstParent(l);
      sent.fill(0, 4 * above, 4 * below);
      for (let i = 0; i < s.counts[l]!; ++i) {
        const to = 4 * (above + s.parents[parents + i]!),
          from = 4 * (below + i),
          share = shares[below + i]!;
        sent[to]! += share * sent[from]!;
        sent[to + 1]! += share * sent[from + 1]!;
        sent[to + 2]! += share * sent[from + 2]!;
      }
    }
    const { nodes, shares: weights } = rows;
    for (let r = 0, e = 0; r < operator.gathering; ++r) {
      let red = 0,
        green = 0,
        blue = 0;
      for (const end = rows.first[r + 1]!; e < end; ++e) {
        const w = weights[e]!,
          at = 4 * nodes[e]!;
        red += w * sent[at]!;
        green += w * sent[at + 1]!;
        blue += w * sent[at + 2]!;
      }
      y[3 * r] = red;
      y[3 * r + 1] = green;
      y[3 * r + 2] = blue;
    }
  }

  /** Entries are not negative, so that powers turn any light into the slowest to die away. */
  private findRadius(times: number): void {
    const { slowest, next, radius } = this;
    for (let k = 0; k < times; ++k) {
      this.bounce(slowest, undefined, next);
      for (let c = 0; c < 3; ++c) {
        let was = 0,
          is = 0;
        for (let i = c; i < next.length; i += 3) {
          was += slowest[i]!;
          is += next[i]!;
        }
        radius[c] = was > 0 ? Math.min(is / was, 0.999) : 0;
        // Of a black channel a seed stays, for the paint to come.
        const scale = is > 0 ? next.length / 3 / is : 0;
        for (let i = c; i < next.length; i += 3) slowest[i] = is > 0 ? next[i]! * scale : 1;
      }
    }
  }

  /** Reconstruction at every receiver by its kernels, into `out`, [receiver][4], of `light`, [surfel][3]. */
  read(out: Float32Array, light = this.x): void {
    const { operator } = this,
      { readSurfels, readWeights } = operator;
    for (let r = 0; r < operator.receivers; ++r) {
      let red = 0,
        green = 0,
        blue = 0;
      for (let k = kernelSlots * r, end = k + kernelSlots; k < end; ++k) {
        const w = readWeights[k]!;
        if (w === 0) continue;
        const at = 3 * readSurfels[k]!;
        red += w * light[at]!;
        green += w * light[at + 1]!;
        blue += w * light[at + 2]!;
      }
      out[4 * r] = red > 0 ? red : 0;
      out[4 * r + 1] = green > 0 ? green : 0;
      out[4 * r + 2] = blue > 0 ? blue : 0;
    }
  }
}
