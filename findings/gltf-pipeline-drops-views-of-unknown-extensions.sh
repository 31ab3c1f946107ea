#!/usr/bin/env bash
# gltf-pipeline 4.3.1 (npm), a valid GLB whose root extension, unknown to the tool, names a buffer view of its own.
#
# Expected: the extension is kept with its data, or dropped as a whole.
#
# Seen: the extension's JSON is kept, letter by letter, while the buffer view that it names is taken out, because
# nothing else refers to it, and the views behind it move up by one. The extension's number now names another view, or
# none. Neither the program nor asset.generator says a word, and its own exit code is 0.
#
# Whoever writes bulk data behind an extension has to tell such a file from a good one by themselves: by keeping the
# number of buffer views, and the length of the buffer, as they were written.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund --no-save --prefix "$folder" gltf-pipeline@4.3.1 >/dev/null
python3 - <<'P'
import json, struct
triangle = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
data = struct.pack("<4f", 1, 2, 3, 4)
normals = struct.pack("<9f", *([0, 0, 1] * 3))
binary = triangle + data + normals
views = [{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 16},
         {"buffer": 0, "byteOffset": 52, "byteLength": 36}]
gltf = {"asset": {"version": "2.0", "generator": "made by hand"}, "extensionsUsed": ["ACME_data"],
        "extensions": {"ACME_data": {"bufferView": 1}}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
                       "max": [1, 1, 0]},
                      {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": views, "buffers": [{"byteLength": len(binary)}]}
text = json.dumps(gltf).encode()
text += b" " * (-len(text) % 4)
binary += b"\0" * (-len(binary) % 4)
chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
open("in.glb", "wb").write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
P
node_modules/.bin/gltf-pipeline -i in.glb -o out.glb >said.txt 2>&1
python3 - <<'P'
import json, struct
bytes_ = open("out.glb", "rb").read()
gltf = json.loads(bytes_[20:20 + struct.unpack_from("<I", bytes_, 12)[0]])
kept = gltf.get("extensions", {}).get("ACME_data")
views = gltf["bufferViews"]
used = sorted({a["bufferView"] for a in gltf["accessors"]})
print("extension kept:", kept, "| views:", len(views), "of 3 | views of accessors:", used)
assert kept == {"bufferView": 1}, "the extension is no longer kept as it was"
assert len(views) == 2 and 16 not in [v["byteLength"] for v in views], "the extension's view is no longer dropped"
assert used == [0, 1], "the number no longer names another's view"
assert gltf["asset"].get("generator") == "made by hand", "the tool names itself now"
P
if grep -iE 'warn|acme|extension' said.txt; then echo "the tool now says something"; exit 1; fi
echo "as described: gltf-pipeline 4.3.1 keeps an unknown extension and drops its data"
