// Balls of three's own materials in a baked scene: they take the light of its lattice, which follows the sky.
import {
  FloatType,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  Scene,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from 'three';
import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';
import { bakedScene, LambentTransferPlugin, Lighting } from 'lambent-three';

const renderer = new WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);

const gltf = await new GLTFLoader().register((parser) => new LambentTransferPlugin(parser)).loadAsync('scene.glb'),
  baked = bakedScene(gltf)!;
const light = Lighting.fromEquirectangular(await new HDRLoader().setDataType(FloatType).loadAsync('sky.hdr'));
light.intensity = 3;

const scene = new Scene().add(gltf.scene, baked.lattice!.probeGrid(LightProbeGridWebGL)),
  camera = new PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 50);
camera.position.set(3, 2.5, 4.5);
camera.lookAt(0, 0.6, 0);
const balls = [0, 1, 2].map((i) => {
  const ball = new Mesh(new SphereGeometry(0.15, 32, 16), new MeshLambertMaterial());
  ball.position.set(0.6 * (i - 1), 0.4 + 0.3 * i, 0.3);
  return ball;
});
scene.add(...balls);

const slider = document.querySelector('input')!;
function turn(): void {
  light.rotation.setFromAxisAngle(new Vector3(0, 1, 0), (slider.valueAsNumber * Math.PI) / 180);
  baked.relight(light);
  renderer.render(scene, camera);
}
slider.addEventListener('input', turn);
turn();
