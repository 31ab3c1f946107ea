// Loops in nodes. Loops within loops take names, which three's types do not know.
import type { Node } from 'three/webgpu';
import { int, Loop } from 'three/tsl';

type Int = Node<'int'>;

const namedLoop = Loop as unknown as (range: object, body: (index: Record<string, Int>) => void) => void;
export const loop = (count: Int, name: string, body: (i: Int) => void): void =>
  namedLoop({ start: int(0), end: count, type: 'int', condition: '<', name }, (index) => body(index[name]!));
