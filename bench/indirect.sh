#!/usr/bin/env bash
# Lamps that move, over direct-to-indirect transport: what a bake takes and weighs, what one lamp that has moved takes
# (shadow rays apart), and how far it is from the path tracer; beside diffuse transfer and a lightmap baked anew. One
# JSON object a line.
#   SCENE=../shared/data/meshes/room.glb EDGE=0.2 SURFELS=16384 SAMPLES=1024 SPP=512 SIZE=160x120 scripts/bench indirect
#   LAMP=X,Y,Z EYE=EX,EY,EZ,TX,TY,TZ,FOV       where the lamp and the camera are; pictures go to out/indirect/
source "$(dirname "$0")/common.sh"
out=out/indirect scene=${SCENE:-$LAMBENT_DATA/meshes/room.glb} edge=${EDGE:-0.2} surfels=${SURFELS:-16384}
samples=${SAMPLES:-1024} spp=${SPP:-512} size=${SIZE:-160x120}
lamp=${LAMP:-0.5,3.5,0.7} eye=${EYE:-4.5,3,4.5,0,1.5,0,70}
near=$(python3 -c "x, y, z = map(float, '$lamp'.split(',')); print(x + 0.2, y, z, sep=',')")  # where it is moved to
mkdir -p $out
shot=(--camera "$eye" --size "$size")
clock() { date +%s.%N; }
took() { python3 -c "print($(clock) - $1)"; }

start=$(clock)
$tool --json bake "$scene" --transfer indirect --surfels "$surfels" --samples "$samples" --max-edge "$edge" \
  -o $out/indirect.glb >$out/indirect.json
indirect_seconds=$(took "$start")
$tool --json bake "$scene" --samples 64 --max-edge "$edge" -o $out/diffuse.glb >$out/diffuse.json
$tool --json render $out/indirect.glb --lamp "point@$lamp=100" --show indirect "${shot[@]}" --spp 16 \
  --move "1@0:$lamp;1:$near" --frames 0:1:0.2 -o $out/frames.exr >$out/frames.json
$tool --json render $out/indirect.glb --lamp "point@$lamp=100" --show indirect "${shot[@]}" --spp 16 \
  -o $out/ours.exr >$out/ours.json
# The scene with a lamp of its own, for lightmaps.
python3 - "$scene" "$lamp" $out/lit.glb <<'P'
import json, struct, sys
data = open(sys.argv[1], "rb").read()
length = struct.unpack_from("<I", data, 12)[0]
document, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
light = {"type": "point", "intensity": 100, "name": "lamp"}
document.setdefault("extensions", {})["KHR_lights_punctual"] = {"lights": [light]}
document["extensionsUsed"] = sorted(set(document.get("extensionsUsed", []) + ["KHR_lights_punctual"]))
document["nodes"].append({"translation": [float(x) for x in sys.argv[2].split(",")],
                          "extensions": {"KHR_lights_punctual": {"light": 0}}})
document["scenes"][document.get("scene", 0)]["nodes"].append(len(document["nodes"]) - 1)
text = json.dumps(document).encode()
text += b" " * (-len(text) % 4)
open(sys.argv[3], "wb").write(struct.pack("<III", 0x46546C67, 2, 20 + len(text) + len(rest)) +
                              struct.pack("<II", len(text), 0x4E4F534A) + text + rest)
P
for half in 1 2; do
  $tool reference "$scene" --lamp "point@$lamp=100" --no-direct --bounces 24 --spp $((spp / 2)) --seed $half \
    --background none "${shot[@]}" -o $out/truth_$half.exr >/dev/null
done
$tool --json compare $out/truth_1.exr $out/truth_2.exr >$out/noise.json
$tool --json compare $out/ours.exr $out/truth_1.exr >$out/error.json
start=$(clock)
$tool --json bake $out/lit.glb --transfer lightmap --receivers vertices --max-edge "$edge" --samples "$samples" \
  --bounces converge:0.001 --light-units lumen -o $out/lightmap.glb >$out/lightmap.json
lightmap_seconds=$(took "$start")
# The same light by either: all of it, where the lightmap's vertices draw soft shadows and the other sharp ones.
$tool --json render $out/indirect.glb --lamp "point@$lamp=100" "${shot[@]}" --spp 16 -o $out/all.exr >/dev/null
$tool --json render $out/lightmap.glb "${shot[@]}" --background none --spp 16 -o $out/lightmap.exr >/dev/null
$tool --json compare $out/all.exr $out/lightmap.exr >$out/same.json
python3 - $out "$indirect_seconds" "$lightmap_seconds" <<'P'
import json, sys
out, bake, lightmap = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
read = lambda name: json.load(open(f"{out}/{name}.json"))
b, d, f = read("indirect"), read("diffuse"), read("frames")
say = lambda **line: print(json.dumps(line))
n = b["receivers"]
say(name="indirect prepared", seconds=bake, limit=60, ratio=bake / 60, surfels=b["indirect"]["surfels"])
# Diffuse transfer of 6 bands in three channels of halves: 216 bytes a receiver.
quarter = n * 216 / 4
say(name="indirect bytes", ours=b["bytes"], limit=quarter, ratio=b["bytes"] / quarter, receivers=n,
    diffuse_bytes=d["bytes"])
ms = 1e3 * f["relight_seconds"]
say(name="indirect lamp moved, ms", ours=ms, limit=16, ratio=ms / 16, receivers=n,
    shadow_rays=1e3 * f["shadow_ray_seconds"], bounces=1e3 * f["solve_seconds"], read=1e3 * f["read_seconds"])
say(name="indirect against a lightmap baked anew", ours=f["relight_seconds"], peer=lightmap,
    ratio=lightmap / f["relight_seconds"], aim=500)
say(name="indirect and the lightmap, both with direct light", psnr=read("same").get("psnr"))
say(name="indirect error", **{k: v for k, v in read("error").items() if isinstance(v, (int, float))},
    noise_psnr=read("noise").get("psnr"))
P
