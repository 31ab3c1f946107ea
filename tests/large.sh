#!/usr/bin/env bash
# What is larger than one file or than the memory, as a user meets it, at sizes that take a moment.
set -uo pipefail
source "$(dirname "$0")/expect.sh"

sky=sky:elevation=40,width=128
shot=(--env $sky --size 64x48 --exposure 0 --tone none)
"$tool" bake corner.obj --max-edge 0.12 --samples 32 -o one.glb >/dev/null 2>&1
expect 0 'receivers' bake corner.obj --max-edge 0.12 --samples 32 --bin-limit 64KiB -o "a set.gltf"
bins=("a set".[0-9]*.bin)
[ ${#bins[@]} -ge 3 ] && ok || bad "one transfer of several pieces lies in ${#bins[@]} files"
for bin in "${bins[@]}"; do [ "$(stat -c %s "$bin")" -le 65536 ] && ok || bad "$bin is larger than was asked for"; done
"$tool" render one.glb "${shot[@]}" -o one.png >/dev/null 2>&1
expect 0 '' render "a set.gltf" "${shot[@]}" -o set.png
cmp -s one.png set.png && ok || bad "render has another picture of a .gltf"
expect 0 '"kind": ?"baked"' inspect "a set.gltf" --json
"$tool" bake corner.obj --max-edge 0.3 --transfer blocks --cube 16 -o blocks.gltf >/dev/null 2>&1
expect 0 '' relight blocks.gltf --env $sky --frames 2
expect 0 'clusters' compress "a set.gltf" --cpca 4,2 -o clusters.gltf
expect 0 'clusters' compress one.glb --cpca 4,2 -o clusters.glb
for name in clusters.gltf clusters.glb; do
  "$tool" render $name "${shot[@]}" -o ${name/./_}.png >/dev/null 2>&1 || bad "render $name"
done
cmp -s clusters_gltf.png clusters_glb.png && ok || bad "compress makes other clusters of a .gltf"
# Its own place, and a smaller set: what it had before goes.
expect 0 'clusters' compress "a set.gltf" --cpca 4,2 -o "a set.gltf"
[ -z "$(ls "a set.2.bin" 2>/dev/null)" ] && [ -e "a set.0.bin" ] && ok || bad "files of a set that was replaced: $(ls)"
expect 0 'receivers' bake "a set.gltf" --samples 16 -o again.glb
expect 0 'receivers' bake corner.obj --max-edge 0.12 --samples 32 -o "b.gltf"
expect 0 'receivers' bake --again b.gltf corner.obj -o c.gltf
cmp -s b.0.bin c.0.bin && ok || bad "--again of a .gltf has other bytes"
mkdir elsewhere
cp b.gltf elsewhere
expect 1 'was not found' render elsewhere/b.gltf "${shot[@]}" -o x.png
head -c 1000 b.0.bin >elsewhere/b.0.bin
expect 1 'is truncated' render elsewhere/b.gltf "${shot[@]}" -o x.png
expect 2 'bin-limit' bake corner.obj --samples 16 --bin-limit 1MB -o x.glb
expect 2 'bin.limit' bake corner.obj --samples 16 --bin-limit 1KB -o x.gltf
ln -s b.gltf link.gltf
expect 1 'is a link' bake corner.obj --samples 16 -o link.gltf
expect 1 'this command reads it' bake b.gltf --samples 16 -o b.gltf
absent x.gltf

# Too large for a .glb: said before a ray is traced, with what to say instead.
began=$(date +%s)
expect 2 'a .glb holds 4 GiB: write a .gltf \(-o huge.gltf\)' bake corner.obj --transfer matrix \
  --brdf ggx:roughness=0.3 \
  --max-edge 0.006 --order 10 --incident-order 7 --precision single --samples 1000000 -o huge.glb
[ $(($(date +%s) - began)) -lt 120 ] && ok || bad "a result that is too large was not refused before it was traced"

# Rows that memory has no room for go through a file, or are traced again: the same bytes.
"$tool" bake corner.obj --max-edge 0.1 --samples 512 --bounces 2 --denoise off -o roomy.glb >/dev/null 2>&1
for scratch in . off; do
  "$tool" bake corner.obj --max-edge 0.1 --samples 512 --bounces 2 --denoise off --memory 16300000 --scratch $scratch \
    -o narrow.glb --json >stdout 2>stderr || bad "--scratch $scratch: $(cat stderr)"
  cmp -s roomy.glb narrow.glb && ok || bad "--scratch $scratch has other bytes"
  grep -q '"operator_kept": *1.0' stdout
  [ $? -eq $([ $scratch = off ] && echo 1 || echo 0) ] && ok || bad "--scratch $scratch: $(cat stdout)"
done
[ -z "$(ls -A | grep lambent-rows)" ] && ok || bad "rows were left behind"
expect 2 'scratch: is no folder' bake corner.obj --samples 16 --scratch nowhere -o x.glb

# Rooms.
expect 0 'joined' bake corner.obj --max-edge 0.3 --samples 64 --rooms auto -o rooms.glb
expect 0 'joined' bake --again rooms.glb corner.obj -o again.glb
cmp -s rooms.glb again.glb && ok || bad "--again of rooms has other bytes"
# A building of many rooms takes no more memory by rooms than as a whole, but for what threads hold at a moment.
python3 "$source_dir/bench/made_building.py" 6 building.obj
peak() {  # the most resident KiB of a bake
  python3 - "$@" <<'P'
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
P
}
if ! grep -q __asan_init "$tool"; then  # whose allocator keeps what is freed
  building=("$tool" bake building.obj --max-edge 0.2 --order 3 --samples 64 --checkpoint off -o building.glb)
  whole=$(peak "${building[@]}" --denoise off --bounces 8)
  rooms=$(peak "${building[@]}" --rooms auto)
  [ $((10 * rooms)) -lt $((11 * whole)) ] && ok || bad "a bake by rooms takes $rooms KiB, one of the whole $whole"
fi
cat >rooms.json <<'J'
{"rooms": [{"name": "left", "min": [0, 0, 0], "max": [1, 2, 2]}, {"name": "right", "min": [1, 0, 0], "max": [2, 2, 2]}]}
J
expect 0 'rooms +2, ' bake corner.obj --max-edge 0.3 --samples 64 --rooms rooms.json -o rooms.glb
echo '{"rooms": [{"name": "a", "nodes": ["nobody"]}]}' >rooms.json
expect 1 'rooms.json: room 0: there is no node "nobody"' bake corner.obj --samples 64 --rooms rooms.json -o x.glb
echo '{"rooms": 3}' >rooms.json
expect 1 'rooms.json: is no JSON object' bake corner.obj --samples 64 --rooms rooms.json -o x.glb
for more in "--bounces 2" "--transfer lightmap" "--light sh:3" "--lattice 2,2,2" "--receivers patches" \
  "--denoise on"; do
  # shellcheck disable=SC2086
  expect 2 'rooms|denoise|--' bake corner.obj --samples 64 --rooms auto $more -o x.glb
done
expect 2 'rooms' bake corner.obj --samples 64 --rooms-error 0.1 -o x.glb
finish
