// Rays over the scene's triangles by a tree of boxes, in typed arrays: for direct light at surfels (leaf_light.ts).
// Source: I. Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007 (bins).

const bins = 12,
  fewest = 4, // triangles of a leaf that is not parted
  deepest = 62;

interface Work {
  node: number;
  begin: number;
  end: number;
  depth: number;
}

export class Rays {
  readonly diagonal: number;
  /** Of the last closest(): the triangle, -1 where there is none; how far; weights of its second and third corner. */
  triangle = -1;
  distance = Infinity;
  u = 0;
  v = 0;
  /** Whether its front was met: corners counterclockwise. */
  front = true;
  private readonly boxes: Float32Array; // [node][6]
  private readonly first: Int32Array; // the left one of two nodes, or the first triangle where there is a count
  private readonly count: Uint16Array;
  private readonly order: Uint32Array;
  private readonly corners: Float32Array; // [ordered triangle]: corner, edge, edge
  private readonly stack = new Int32Array(2 * deepest + 4);

  /** `positions`: nine numbers a triangle. */
  constructor(positions: Float32Array) {
    const n = positions.length / 9;
    this.boxes = new Float32Array(6 * Math.max(1, 2 * n));
    this.first = new Int32Array(Math.max(1, 2 * n));
    this.count = new Uint16Array(Math.max(1, 2 * n));
    this.order = Uint32Array.from({ length: n }, (_, i) => i);
    this.build(positions, n);
    const corners = (this.corners = new Float32Array(9 * n));
    for (let i = 0; i < n; ++i)
      for (let k = 0; k < 3; ++k) {
        const t = 9 * this.order[i]!;
        corners[9 * i + k] = positions[t + k]!;
        corners[9 * i + 3 + k] = positions[t + 3 + k]! - positions[t + k]!;
        corners[9 * i + 6 + k] = positions[t + 6 + k]! - positions[t + k]!;
      }
    const [x, y, z, X, Y, Z] = this.boxes;
    this.diagonal = n > 0 ? Math.hypot(X! - x!, Y! - y!, Z! - z!) : 0;
  }

  private build(positions: Float32Array, n: number): void {
    const bounds = new Float32Array(6 * n),
      { boxes, order, first, count } = this;
    for (let t = 0; t < n; ++t)
      for (let k = 0; k < 3; ++k) {
        const a = positions[9 * t + k]!,
          b = positions[9 * t + 3 + k]!,
          c = positions[9 * t + 6 + k]!;
        bounds[6 * t + k] = Math.min(a, b, c);
        bounds[6 * t + 3 + k] = Math.max(a, b, c);
      }
    const middle = (t: number, axis: number): number => bounds[6 * t + axis]! + bounds[6 * t + 3 + axis]!;
    let nodes = 1;
    const works: Work[] = [{ node: 0, begin: 0, end: n, depth: 0 }];
    for (let work = works.pop(); work; work = works.pop()) {
      const { node, begin, end, depth } = work,
        box = boxes.subarray(6 * node, 6 * node + 6);
      enclose(bounds, order, begin, end, box);
      let split = end - begin > fewest && depth < deepest ? part(bounds, order, begin, end, middle) : -1;
      // All in one place, or all that a leaf cannot count.
      if (split < 0 && end - begin > 0xffff) split = (begin + end) >> 1;
      if (split < 0) {
        first[node] = begin;
        count[node] = end - begin;
        continue;
      }
      first[node] = nodes;
      works.push({ node: nodes, begin, end: split, depth: depth + 1 });
      works.push({ node: nodes + 1, begin: split, end, depth: depth + 1 });
      nodes += 2;
    }
  }

  /** What a ray meets within so far, either side of it; the triangle as it was given, or -1. */
  closest(x: number, y: number, z: number, dx: number, dy: number, dz: number, farthest: number): number {
    return this.trace(x, y, z, dx, dy, dz, farthest, false);
  }
  /** Whether anything is in the way. */
  meets(x: number, y: number, z: number, dx: number, dy: number, dz: number, farthest: number): boolean {
    return this.trace(x, y, z, dx, dy, dz, farthest, true) >= 0;
  }

  private trace(
    x: number,
    y: number,
    z: number,
    dx: number,
    dy: number,
    dz: number,
    farthest: number,
    any: boolean,
  ): number {
    const { boxes, first, count, corners, stack } = this,
      ix = 1 / (dx || 1e-30),
      iy = 1 / (dy || 1e-30),
      iz = 1 / (dz || 1e-30);
    let nearest = farthest,
      found = -1,
      top = 0;
    stack[top++] = 0;
    while (top > 0) {
      const node = stack[--top]!,
        b = 6 * node;
      const x0 = (boxes[b]! - x) * ix,
        x1 = (boxes[b + 3]! - x) * ix,
        y0 = (boxes[b + 1]! - y) * iy,
        y1 = (boxes[b + 4]! - y) * iy,
        z0 = (boxes[b + 2]! - z) * iz,
        z1 = (boxes[b + 5]! - z) * iz;
      let near = x0 < x1 ? x0 : x1,
        far = x0 < x1 ? x1 : x0;
      if (y0 < y1) {
        if (y0 > near) near = y0;
        if (y1 < far) far = y1;
      } else {
        if (y1 > near) near = y1;
        if (y0 < far) far = y0;
      }
      if (z0 < z1) {
        if (z0 > near) near = z0;
        if (z1 < far) far = z1;
      } else {
        if (z1 > near) near = z1;
        if (z0 < far) far = z0;
      }
      // Rounding of boxes to single floats.
      if (far * (1 + 1e-6) < near || far < 0 || near > nearest) continue;
      const n = count[node]!;
      if (n === 0 && first[node]! > 0) {
        // The nearer one last, so that it is looked at first.
        const left = first[node]!,
          l = 6 * left,
          ahead =
            (boxes[l]! + boxes[l + 3]! - boxes[l + 6]! - boxes[l + 9]!) * dx +
            (boxes[l + 1]! + boxes[l + 4]! - boxes[l + 7]! - boxes[l + 10]!) * dy +
            (boxes[l + 2]! + boxes[l + 5]! - boxes[l + 8]! - boxes[l + 11]!) * dz;
        stack[top++] = ahead > 0 ? left : left + 1;
        stack[top++] = ahead > 0 ? left + 1 : left;
        continue;
      }
      for (let i = first[node]!, end = i + n; i < end; ++i) {
        const c = 9 * i,
          ax = corners[c + 3]!,
          ay = corners[c + 4]!,
          az = corners[c + 5]!,
          bx = corners[c + 6]!,
          by = corners[c + 7]!,
          bz = corners[c + 8]!;
        const px = dy * bz - dz * by,
          py = dz * bx - dx * bz,
          pz = dx * by - dy * bx,
          determinant = ax * px + ay * py + az * pz;
        if (determinant === 0) continue;
        const inverse = 1 / determinant,
          tx = x - corners[c]!,
          ty = y - corners[c + 1]!,
          tz = z - corners[c + 2]!,
          u = (tx * px + ty * py + tz * pz) * inverse;
        if (!(u >= 0 && u <= 1)) continue;
        const qx = ty * az - tz * ay,
          qy = tz * ax - tx * az,
          qz = tx * ay - ty * ax,
          v = (dx * qx + dy * qy + dz * qz) * inverse;
        if (!(v >= 0 && u + v <= 1)) continue;
        const t = (bx * qx + by * qy + bz * qz) * inverse;
        if (!(t > 0 && t < nearest)) continue;
        if (any) return i;
        nearest = t;
        found = i;
        this.u = u;
        this.v = v;
        this.front = determinant > 0;
      }
    }
    this.triangle = found < 0 ? -1 : this.order[found]!;
    this.distance = found < 0 ? Infinity : nearest;
    return this.triangle;
  }
}

function enclose(bounds: Float32Array, order: Uint32Array, begin: number, end: number, box: Float32Array): void {
  box.fill(Infinity, 0, 3);
  box.fill(-Infinity, 3, 6);
  for (let i = begin; i < end; ++i)
    for (let k = 0, t = 6 * order[i]!; k < 3; ++k) {
      if (bounds[t + k]! < box[k]!) box[k] = bounds[t + k]!;
      if (bounds[t + 3 + k]! > box[3 + k]!) box[3 + k] = bounds[t + 3 + k]!;
    }
}

const areaOf = (box: Float32Array): number => {
  const x = box[3]! - box[0]!,
    y = box[4]! - box[1]!,
    z = box[5]! - box[2]!;
  return x >= 0 ? x * y + y * z + z * x : 0;
};

/** Sorts a run into two, where rays cost least; the second one's begin, or -1 where all lie in one place. */
function part(
  bounds: Float32Array,
  order: Uint32Array,
  begin: number,
  end: number,
  middle: (t: number, axis: number) => number,
): number {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  for (let i = begin; i < end; ++i)
    for (let k = 0; k < 3; ++k) {
      const m = middle(order[i]!, k);
      if (m < low[k]!) low[k] = m;
      if (m > high[k]!) high[k] = m;
    }
  const extents = [0, 1, 2].map((k) => high[k]! - low[k]!),
    axis = extents.indexOf(Math.max(...extents)),
    extent = extents[axis]!;
  if (!(extent > 0)) return -1;
  const from = low[axis]!,
    binOf = (t: number): number => Math.min(bins - 1, Math.floor(((middle(t, axis) - from) / extent) * bins));
  const boxes = Array.from({ length: bins }, () => {
      const box = new Float32Array(6);
      box.fill(Infinity, 0, 3);
      box.fill(-Infinity, 3, 6);
      return box;
    }),
    counts = new Array<number>(bins).fill(0);
  for (let i = begin; i < end; ++i) {
    const t = order[i]!,
      bin = binOf(t),
      box = boxes[bin]!;
    ++counts[bin]!;
    for (let k = 0; k < 3; ++k) {
      if (bounds[6 * t + k]! < box[k]!) box[k] = bounds[6 * t + k]!;
      if (bounds[6 * t + 3 + k]! > box[3 + k]!) box[3 + k] = bounds[6 * t + 3 + k]!;
    }
  }
  const grow = (box: Float32Array, by: Float32Array): void => {
    for (let k = 0; k < 3; ++k) {
      box[k] = Math.min(box[k]!, by[k]!);
      box[3 + k] = Math.max(box[3 + k]!, by[3 + k]!);
    }
  };
  const above = new Array<number>(bins).fill(0),
    sweep = new Float32Array(6);
  sweep.fill(Infinity, 0, 3);
  sweep.fill(-Infinity, 3, 6);
  for (let b = bins - 1, n = 0; b > 0; --b) {
    grow(sweep, boxes[b]!);
    n += counts[b]!;
    above[b] = n * areaOf(sweep);
  }
  sweep.fill(Infinity, 0, 3);
  sweep.fill(-Infinity, 3, 6);
  let best = 0,
    least = Infinity;
  for (let b = 1, n = 0; b < bins; ++b) {
    grow(sweep, boxes[b - 1]!);
    n += counts[b - 1]!;
    const cost = n * areaOf(sweep) + above[b]!;
    if (n > 0 && n < end - begin && cost < least) [best, least] = [b, cost];
  }
  if (best === 0) return -1;
  let split = begin;
  for (let i = begin; i < end; ++i)
    if (binOf(order[i]!) < best) {
      const t = order[i]!;
      order[i] = order[split]!;
      order[split++] = t;
    }
  return split;
}
