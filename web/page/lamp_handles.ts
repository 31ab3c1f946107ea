// Handles of lamps: a number over each in the picture. A spot has another one, where it shines.
import { Vector3 } from 'three';
import type { Lamp } from '../src/index.js';
import type { Wanted } from './handles.js';

/** `lamps` are those that there are now; `move` is given one that stands elsewhere. */
export const lampHandles = (lamps: () => readonly Lamp[], move: (index: number, lamp: Lamp) => void): Wanted[] =>
  lamps().flatMap(({ kind, off }, i) => {
    const one = (first: 0 | 3): Wanted => ({
      text: String(i + 1),
      name: `Lamp ${i + 1}, ${kind}${first === 3 ? ': where it shines' : ''}`,
      looks: { target: first === 3, off: off ?? false },
      at: () => {
        const lamp = lamps()[i];
        return lamp && new Vector3().fromArray(lamp.numbers, first);
      },
      move: (to) => {
        const moved = movedTo(lamps()[i]!, first, to);
        if (moved) move(i, moved);
      },
    });
    return kind === 'sun' ? [] : kind === 'spot' ? [one(0), one(3)] : [one(0)];
  });

/** A lamp takes what it shines at with it; it does not shine at itself. */
function movedTo(lamp: Lamp, first: 0 | 3, to: Vector3): Lamp | undefined {
  const numbers = [...lamp.numbers],
    short = (x: number): number => Number(x.toPrecision(6));
  to.toArray().forEach((v, k) => {
    if (first === 0 && lamp.kind === 'spot') numbers[3 + k] = short(numbers[3 + k]! + v - numbers[k]!);
    numbers[first + k] = short(v);
  });
  return lamp.kind === 'spot' && [0, 1, 2].every((k) => numbers[k] === numbers[3 + k])
    ? undefined
    : { ...lamp, numbers };
}
