#!/usr/bin/env bash
# Baked pictures against path-traced ones under the same band-limited light: one JSON object for each scene and
# environment. Needs the data folder (LAMBENT_DATA, or ../shared/data). Pictures and error maps go to out/truth/.
#   SAMPLES=4096 SPP=1024 SIZE=256x256 scripts/bench truth
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
out=out/truth samples=${SAMPLES:-4096} spp=${SPP:-1024} size=${SIZE:-256x256}
order=6 bounces=3
mkdir -p $out

# name | scene | options of bake and reference | camera
scenes="bunny|bunny.obj|--ground|auto
armadillo|armadillo.obj|--ground|auto
room|room.glb|--max-edge 0.25|4,2,4,-1,1.5,-1,70
cornell|cornell_box_rounded.glb|--max-edge 0.12|0,1.5,7,0,1.5,0,40"
while IFS='|' read -r name file options camera; do
  [ -z "${ONLY:-}" ] || [ "$ONLY" = "$name" ] || continue
  # shellcheck disable=SC2086
  $tool bake "$data/meshes/$file" $options --order $order --samples "$samples" --bounces $bounces -o $out/$name.glb \
    --json >$out/$name.json
  for env in chinese_garden_1k circus_arena_1k; do
    pair=$out/${name}_$env
    $tool render $out/$name.glb --env "$data/environments/$env.hdr" --camera "$camera" --size "$size" --spp 256 \
      --window none --background none -o $pair.exr >/dev/null
    # shellcheck disable=SC2086
    for half in 1 2; do
      $tool reference "$data/meshes/$file" $options --env "$data/environments/$env.hdr" --light-order $order \
        --bounces $bounces --spp $((spp / 2)) \
        --camera "$camera" --size "$size" --background none --seed $half -o ${pair}_half$half.exr >/dev/null
    done
    $tool compare ${pair}_half1.exr ${pair}_half2.exr -o ${pair}_reference.exr --mean --json >${pair}_reference.json
    $tool compare $pair.exr ${pair}_reference.exr -o ${pair}_error.png --json >${pair}_error.json
    python3 - "$name" "$env" "$samples" "$spp" $out/$name.json ${pair}_error.json ${pair}_reference.json <<'P'
import json, sys
name, env, samples, spp = sys.argv[1:5]
bake, error, reference = (json.load(open(p)) for p in sys.argv[5:8])
print(json.dumps({"name": "truth", "scene": name, "env": env, "ours": error["psnr"], "limit": 40,
                  "ratio": error["psnr"] / 40, "unit": "dB",
                  "limit_is": "aim", "flip": error["flip"], "relative_mse": error["relative_mse"],
                  "mean_ratio": error["mean_a"] / error["mean_b"],
                  "samples": int(samples), "spp": int(spp), "receivers": bake["receivers"], "bake_error": bake["error"],
                  "reference_noise_psnr": reference["psnr"] + 6.02}))
P
  done
done <<<"$scenes"
