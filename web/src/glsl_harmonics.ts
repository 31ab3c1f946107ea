// The recurrences of sh.ts as GLSL without loops.
import { legendre, shIndex } from './sh.js';

/**
 * GLSL that visits the first order^2 harmonics at the direction `n`, a vec3. `use` is given a coefficient's index and
 * the expression of its value there, and answers with a statement, or with nothing.
 */
export function glslHarmonics(order: number, use: (index: number, value: string) => string): string {
  const number = (x: number): string => x.toExponential(9);
  const lines = ['float c = 1.0, s = 0.0, q0, q1, q2, t;'];
  const add = (line: string): void => void (line && lines.push(line));
  for (let m = 0; m < order; ++m) {
    add(`q1 = ${number(legendre.diagonal[m]!)}; q2 = 0.0;`);
    for (let l = m; l < order; ++l) {
      if (l > m)
        add(`q0 = ${number(legendre.a(l, m))} * n.z * q1 + ${number(legendre.b(l, m))} * q2; q2 = q1; q1 = q0;`);
      add(use(shIndex(l, m), 'q1 * c'));
      if (m > 0) add(use(shIndex(l, -m), 'q1 * s'));
    }
    add('t = c * n.x - s * n.y; s = c * n.y + s * n.x; c = t;');
  }
  return lines.join('\n  ');
}
