// The page's own sky against that of the command line.
import { expect, it } from 'vitest';
import { parseSky, skyMap } from '../page/sky.ts';
import { projectLatLong } from '../src/index.ts';
import { haveTool, lambentJson } from './tool.ts';

it('reads the names that the command line gives its skies', () => {
  expect(parseSky('sky')).toEqual({ elevation: 35, azimuth: 45, turbidity: 3, ground: 0.2, sun: true });
  expect(parseSky('sky:elevation=-1.5,azimuth=400,turbidity=5,ground=0.5,sun=off,width=64')).toEqual({
    elevation: -1.5,
    azimuth: 400,
    turbidity: 5,
    ground: 0.5,
    sun: false,
  });
  for (const name of ['garden.hdr', 'skyline.exr', 'sky:elevation=91', 'sky:elevation=x', 'sky:colour=3'])
    expect(parseSky(name), name).toBeUndefined();
});

it
  .skipIf(!haveTool)
  .each([
    'elevation=35,azimuth=45',
    'elevation=4,azimuth=-120,turbidity=6,ground=0.6',
    'elevation=88,turbidity=1.8',
    'elevation=0.1,azimuth=200',
    'elevation=-1.5,sun=off',
  ])('is the sky of the command line: %s', (spec) => {
  const { coefficients } = lambentJson('env', `sky:${spec}`, '--order', '6', '--window', 'none') as {
      coefficients: number[][];
    },
    ours = projectLatLong(skyMap(parseSky(`sky:${spec}`)!), 6);
  const theirs = coefficients.flat();
  let apart = 0,
    size = 0;
  ours.forEach((v, i) => ((apart += (v - theirs[i]!) ** 2), (size += theirs[i]! ** 2)));
  // The maps' texels move the sun by up to a third of a degree.
  expect(Math.sqrt(apart / size)).toBeLessThan(0.01);
});
