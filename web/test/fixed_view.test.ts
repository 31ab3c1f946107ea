// Fixed views: where their rectangle stands, and files that lie about theirs.
import { describe, expect, it } from 'vitest';
import { PerspectiveCamera, Vector3, type Mesh } from 'three';
import { readFixedView, type FixedPicture } from '../src/fixed_view.ts';
import type { TransferSource } from '../src/kinds.ts';

const whole = { width: 4, height: 2, eye: [3, 2, 4], target: [0, 0.5, -1], fov: 40, coverage: 0 };
async function read(
  change: Record<string, unknown> = {},
  coverage = new Float32Array(8).fill(1),
): Promise<{ picture: FixedPicture; shown: Mesh[] }> {
  const shown: Mesh[] = [],
    source = {
      extension: { parts: [], view: { ...whole, ...change } },
      bufferView: () => Promise.resolve(coverage.buffer),
      showInstead: (mesh: Mesh) => void shown.push(mesh),
    } as unknown as TransferSource;
  return { picture: await readFixedView(source, 8), shown };
}

describe('a fixed view', () => {
  it('stands where the camera that was baked sees it fill the picture', async () => {
    const { picture, shown } = await read(),
      { mesh, view } = picture,
      camera = new PerspectiveCamera(view.fov, view.width / view.height, 0.1, 100);
    expect(shown).toEqual([mesh]);
    camera.position.copy(view.eye);
    camera.lookAt(view.target);
    camera.updateMatrixWorld();
    mesh.updateMatrixWorld();
    const corners = mesh.geometry.getAttribute('position'),
      places = mesh.geometry.getAttribute('lambentPlace');
    for (let i = 0; i < 4; ++i) {
      const at = new Vector3().fromBufferAttribute(corners, i).applyMatrix4(mesh.matrixWorld).project(camera);
      expect(((at.x + 1) / 2) * 4).toBeCloseTo(places.getX(i), 5);
      expect(((1 - at.y) / 2) * 2).toBeCloseTo(places.getY(i), 5); // rows from the top
    }
    expect(mesh.material).toMatchObject({ transparent: false });
    const partly = await read({}, new Float32Array(8).fill(0.5));
    expect(partly.picture.mesh.material).toMatchObject({ transparent: true });
  });

  const broken: [string, RegExp, Record<string, unknown>, Float32Array<ArrayBuffer>?][] = [
    ['a width of nothing', /size of the fixed view/, { width: 0 }],
    ['a width that is absurd', /size of the fixed view/, { width: 1e9, height: 8e-9 }],
    ['other pixels than receivers', /as many pixels/, { width: 5 }],
    ['no eye', /looks from/, { eye: [1, 2] }],
    ['a target that is no number', /looks from/, { target: [0, null, 0] }],
    ['a target that is no finite number', /looks from/, { target: [0, Infinity, 0] }],
    ['a camera in its target', /looks nowhere/, { target: whole.eye }],
    ['a view of half of all', /"fov"/, { fov: 180 }],
    ['a view that is no number', /"fov"/, { fov: NaN }],
    ['no coverage', /no "coverage"/, { coverage: -1 }],
    ['a coverage too few', /one coverage a pixel/, {}, new Float32Array(7)],
    ['a coverage above 1', /coverage is out of range/, {}, new Float32Array(8).fill(2)],
    ['a coverage that is no number', /coverage is out of range/, {}, new Float32Array(8).fill(NaN)],
  ];
  for (const [name, why, change, coverage] of broken)
    it(`is refused in a sentence: ${name}`, () => expect(read(change, coverage)).rejects.toThrow(why));
});
