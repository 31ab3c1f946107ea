// The recurrences of sh.ts in nodes, as glsl_harmonics.ts has them in GLSL.
import type { Node } from 'three/webgpu';
import { float } from 'three/tsl';
import { legendre, shIndex } from './sh.js';

/** Visits the first order^2 harmonics at the direction `n`: a coefficient's index and its value there. */
export function nodeHarmonics(
  order: number,
  n: Node<'vec3'>,
  use: (index: number, value: Node<'float'>) => void,
): void {
  let c: Node<'float'> = float(1),
    s: Node<'float'> = float(0);
  for (let m = 0; m < order; ++m) {
    let before: Node<'float'> = float(0),
      q: Node<'float'> = float(legendre.diagonal[m]);
    for (let l = m; l < order; ++l) {
      if (l > m) {
        const next = n.z
          .mul(q)
          .mul(legendre.a(l, m))
          .add(before.mul(legendre.b(l, m)))
          .toVar();
        before = q;
        q = next;
      }
      use(shIndex(l, m), q.mul(c));
      if (m > 0) use(shIndex(l, -m), q.mul(s));
    }
    const along: Node<'float'> = c.mul(n.x).sub(s.mul(n.y)).toVar();
    s = c.mul(n.y).add(s.mul(n.x)).toVar();
    c = along;
  }
}
