// Light in free space from `lambent export BAKED --three-probes PREFIX --env SKY`, as a grid of probes of three.js
// (r187 and newer). Needs nothing but three.js:
//
//   import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
//   scene.add(await loadProbes(LightProbeGridWebGL, 'light/room.probes.json'));
//
// and LightProbeGrid for WebGPURenderer.
import { Data3DTexture, HalfFloatType, LinearFilter, RGBAFormat } from 'three';

export async function loadProbes(GridClass, url) {
  const read = async (address) => {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
    return answer;
  };
  const { size, position, resolution, atlas } = await (await read(url)).json();
  const values = await (await read(new URL(atlas.file, new URL(url, document.baseURI)))).arrayBuffer();
  const texture = new Data3DTexture(new Uint16Array(values), atlas.width, atlas.height, atlas.depth);
  texture.format = RGBAFormat;
  texture.type = HalfFloatType;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.unpackAlignment = 1;
  texture.needsUpdate = true;
  const grid = new GridClass(...size, ...resolution);
  grid.position.fromArray(position);
  grid.updateBoundingBox();
  grid.texture = texture;
  return grid;
}
