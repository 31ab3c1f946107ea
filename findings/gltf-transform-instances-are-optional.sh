#!/usr/bin/env bash
# glTF-Transform 4.5.1 (npm: core, extensions, functions), instance(), which its `optimize` command applies by default
# to five copies of a mesh and more.
#
# Expected: a file whose copies stand only in EXT_mesh_gpu_instancing lists that extension as required, since a reader
# without it cannot show the scene; or the nodes stay beside it for such readers.
#
# Seen: the eight nodes become one without a place of its own, and the extension is listed in extensionsUsed alone. A
# reader that does not know it loads the file without an error and shows one copy, at the origin.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund --no-save --prefix "$folder" @gltf-transform/core@4.5.1 \
  @gltf-transform/extensions@4.5.1 @gltf-transform/functions@4.5.1 >/dev/null
cat >try.mjs <<'J'
import { Document, NodeIO } from '@gltf-transform/core';
import { EXTMeshGPUInstancing } from '@gltf-transform/extensions';
import { instance } from '@gltf-transform/functions';
const document = new Document();
const buffer = document.createBuffer();
const place = document.createAccessor().setType('VEC3').setBuffer(buffer)
  .setArray(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]));
const mesh = document.createMesh().addPrimitive(document.createPrimitive().setAttribute('POSITION', place));
const scene = document.createScene();
for (let i = 0; i < 8; ++i) scene.addChild(document.createNode().setMesh(mesh).setTranslation([2 * i, 0, 0]));
await document.transform(instance());
const io = new NodeIO().registerExtensions([EXTMeshGPUInstancing]);
const { json } = await io.writeJSON(document);
const shown = json.nodes.filter((node) => node.mesh !== undefined);
console.log('nodes with a mesh:', shown.length, '| used:', json.extensionsUsed, '| required:', json.extensionsRequired);
const fits = shown.length === 1 && json.extensionsUsed?.includes('EXT_mesh_gpu_instancing') &&
  !(json.extensionsRequired ?? []).includes('EXT_mesh_gpu_instancing') && !shown[0].translation;
if (!fits) throw new Error('the behaviour has changed');
J
node try.mjs
echo "as described: glTF-Transform 4.5.1 does not require the extension that its copies need"
