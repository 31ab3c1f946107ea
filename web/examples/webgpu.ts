// A baked scene in WebGPURenderer (or its WebGL 2 backend, where there is no WebGPU), under a light that turns.
import { FloatType, PerspectiveCamera, Scene, Vector3, WebGPURenderer } from 'three/webgpu';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';
import { bakedScene, LambentTransferPlugin, Lighting } from 'lambent-three';
import { nodes } from 'lambent-three/webgpu';

const renderer = new WebGPURenderer({ antialias: true });
await renderer.init();
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);

const loader = new GLTFLoader().register((parser) => new LambentTransferPlugin(parser, nodes));
const gltf = await loader.loadAsync('scene.glb'),
  baked = bakedScene(gltf)!;
baked.transfer.check(renderer);
const light = Lighting.fromEquirectangular(await new HDRLoader().setDataType(FloatType).loadAsync('sky.hdr'));
light.intensity = 3;

const scene = new Scene().add(gltf.scene),
  camera = new PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 50);
camera.position.set(3, 2.5, 4.5);
const controls = new OrbitControls(camera, renderer.domElement);
controls.target.set(0, 0.6, 0);
controls.update();

const slider = document.querySelector('input')!,
  draw = (): void => renderer.render(scene, camera);
function turn(): void {
  light.rotation.setFromAxisAngle(new Vector3(0, 1, 0), (slider.valueAsNumber * Math.PI) / 180);
  baked.relight(light);
  draw();
}
controls.addEventListener('change', draw);
slider.addEventListener('input', turn);
turn();
