#!/usr/bin/env bash
# The first picture that anyone makes: no option but the floor under a scan, under three skies, against the path tracer
# under the same bands of light. One JSON object a picture: PSNR in dB (aim 38); that of the same bake without
# deringing (--window none), which the reference has not; that which the reference's own noise allows; and what the PNG
# shows: parts of the pixels that are burnt out (aim 2 %) or negative, shown black. Pictures and error maps go to
# out/first/, and bakes and references that are there are not made again. Needs the data folder (LAMBENT_DATA, or
# ../shared/data).
#   SPP=512 SIZE=192x144 ONLY=room scripts/bench first
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
out=out/first spp=${SPP:-512} size=${SIZE:-192x144}
mkdir -p $out
[ -f $out/demo/courtyard.glb ] || $tool demo -o $out/demo --spp 1 >/dev/null

scenes="bunny|$data/meshes/bunny.obj|--ground
armadillo|$data/meshes/armadillo.obj|--ground
room|$data/meshes/room.glb|
cornell_box_rounded|$data/meshes/cornell_box_rounded.glb|
dutch_ship|$data/meshes/dutch_ship/dutch_ship_medium_1k.gltf|
zdm2_level|$data/meshes/zdm2_level.glb|
courtyard|$out/demo/courtyard.glb|"
while IFS='|' read -r name file options; do
  [ -z "${ONLY:-}" ] || [ "$ONLY" = "$name" ] || continue
  # shellcheck disable=SC2086
  [ -f $out/$name.json ] || $tool bake "$file" $options -o $out/$name.glb --json >$out/$name.json
  for env in noon_grass_1k chinese_garden_1k circus_arena_1k; do
    pair=$out/${name}_$env sky="$data/environments/$env.hdr"
    $tool render $out/$name.glb --env "$sky" --size "$size" --background none -o $pair.exr >/dev/null
    $tool render $out/$name.glb --env "$sky" --size "$size" --background none --window none -o ${pair}_plain.exr \
      >/dev/null
    $tool render $out/$name.glb --env "$sky" --size "$size" -o $pair.png --json >${pair}_shown.json
    for half in 1 2; do
      # shellcheck disable=SC2086
      [ -f ${pair}_half$half.exr ] || $tool reference "$file" $options --env "$sky" --light-order 6 --bounces 3 \
        --spp $((spp / 2)) --size "$size" --background none --seed $half -o ${pair}_half$half.exr >/dev/null
    done
    $tool compare ${pair}_half1.exr ${pair}_half2.exr -o ${pair}_reference.exr --mean --json >${pair}_reference.json
    $tool compare $pair.exr ${pair}_reference.exr -o ${pair}_error.png --json >${pair}_error.json
    $tool compare ${pair}_plain.exr ${pair}_reference.exr -o ${pair}_plain.png --json >${pair}_plain.json
    python3 - "$name" "$env" $out/$name.json ${pair}_error.json ${pair}_reference.json ${pair}_shown.json \
      ${pair}_plain.json <<'P'
import json, sys
name, env = sys.argv[1:3]
bake, error, reference, shown, plain = (json.load(open(p)) for p in sys.argv[3:8])
display = shown["display"]
print(json.dumps({"name": "first", "scene": name, "env": env, "ours": error["psnr"], "limit": 38,
                  "ratio": error["psnr"] / 38, "unit": "dB", "limit_is": "aim", "flip": error["flip"],
                  "reference_noise_psnr": reference["psnr"] + 6.02, "plain_psnr": plain["psnr"],
                  "white": display["white"],
                  "negative": display["negative"], "receivers": bake["receivers"], "bake_error": bake["error"]}),
      flush=True)
P
  done
done <<<"$scenes"
