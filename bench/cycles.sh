#!/usr/bin/env bash
# The path tracer against Blender's Cycles: one JSON object for each scene and environment. Means over pixels that the
# scene covers whole, ours divided by Cycles', and the noise of that ratio, from two seeds of each. Needs Blender, the
# data folder (LAMBENT_DATA, or ../shared/data) and a script that renders a scene by Cycles with the same camera
# (LAMBENT_CYCLES, or ../shared/tools/cycles.py).
#   SPP=256 SIZE=320x240 ONLY=room scripts/bench cycles          pictures go to out/cycles/
source "$(dirname "$0")/common.sh"
cycles=${LAMBENT_CYCLES:-../shared/tools/cycles.py}
out=out/cycles spp=${SPP:-256} size=${SIZE:-320x240} bounces=3
[ -d "$data/meshes" ] && [ -f "$cycles" ] && command -v blender >/dev/null ||
  { echo "skipped: needs $data, $cycles and blender" >&2; exit 0; }
mkdir -p $out
# The bunny has no material, and ours is then not white.
{ echo "mtllib white.mtl"; echo "usemtl white"; cat "$data/meshes/bunny.obj"; } >$out/bunny.obj
printf 'newmtl white\nKd 1 1 1\n' >$out/white.mtl

# name | scene | eye | target | field of view
scenes="bunny|$out/bunny.obj|1.5,0.8,3|0,0,0|35
room|$data/meshes/room.glb|4,2,4|-1,1.5,-1|70
cornell|$data/meshes/cornell_box_rounded.glb|0,1.5,7|0,1.5,0|40"
cat >$out/compare.py <<'P'
import bpy, json, sys
import numpy as np
name, env, base = sys.argv[sys.argv.index('--') + 1:]
def load(path):
    image = bpy.data.images.load(path)
    image.alpha_mode = 'CHANNEL_PACKED'
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(-1, 4).astype(np.float64)
ours = [load(f'{base}_ours{k}.exr') for k in (1, 2)]
theirs = [load(f'{base}_cycles{k}.exr') for k in (1, 2)]
covered = (ours[0][:, 3] > 0.9999) & (ours[1][:, 3] > 0.9999)
mean = lambda p: p[covered, :3].mean(axis=0)
a, b = (mean(ours[0]) + mean(ours[1])) / 2, (mean(theirs[0]) + mean(theirs[1])) / 2
# Variance of the mean of two pictures is a quarter of that of their difference; over pixels, independent.
pixels = covered.sum()
noise_of = lambda p: (p[0][covered, :3] - p[1][covered, :3]).std(axis=0) / 2
variance = noise_of(ours) ** 2 + noise_of(theirs) ** 2
difference = (ours[0] + ours[1] - theirs[0] - theirs[1])[covered, :3] / 2
ratio = a / b
print('RESULT ' + json.dumps({'name': 'cycles', 'scene': name, 'env': env, 'ours': ratio.mean(), 'limit': 1,
                              'ratio': ratio.mean(), 'unit': 'mean radiance, ours / Cycles',
    'limit_is': 'the same picture by Cycles', 'rgb': ratio.tolist(),
    'noise_of_ratio': float((np.sqrt(variance / pixels) / b).max()),
    'rmse_over_noise': float(np.sqrt((difference ** 2).mean() / variance.mean())), 'covered': int(pixels)}))
P
while IFS='|' read -r name scene eye target fov; do
  [ -z "${ONLY:-}" ] || [ "$ONLY" = "$name" ] || continue
  for env in chinese_garden_1k circus_arena_1k; do
    base=$PWD/$out/${name}_$env
    for seed in 1 2; do
      $tool reference "$scene" --env "$data/environments/$env.hdr" --camera "$eye,$target,$fov" --size "$size" \
        --spp "$spp" --bounces $bounces \
        --background none --seed $seed -o "${base}_ours$seed.exr" >/dev/null
      blender -b --factory-startup -noaudio --python-exit-code 1 \
        --python-expr "import bpy; bpy.context.scene.cycles.seed = $seed" -P "$cycles" -- "$scene" \
        "$data/environments/$env.hdr" "${base}_cycles$seed.exr" "$eye" "$target" "$fov" "$size" "$spp" $bounces \
        >"$out/blender.log" 2>&1 </dev/null ||
        {
          tail -n 5 "$out/blender.log" >&2
          echo "Blender failed; the whole log is $out/blender.log (its importer needs python3-numpy)" >&2
          exit 1
        }
    done
    blender -b --factory-startup -noaudio --python-exit-code 1 -P $out/compare.py -- "$name" "$env" "$base" \
      2>&1 </dev/null | sed -n 's/^RESULT //p'
  done
done <<<"$scenes"
