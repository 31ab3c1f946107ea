#!/usr/bin/env bash
# The first picture that anyone makes: no option but the floor under a scan, under three skies, against the path tracer.
# One JSON object a picture. PSNR, dB, is against two references of different seeds with their noise left out, at the
# same exposure and tone: `ours` is the same bake without deringing (--window none) against the same bands of light (aim
# 38), which ring in both, and lies between `least` and `most`; `held` is the picture that is shown, kept from ringing,
# against those; `whole` that against all of the light, which no 6 bands hold, and `whole_plain` without deringing.
# `reference_noise_psnr` is what the references' own noise would allow a plain PSNR; where it is low, dark places bias
# `ours` downwards, since displays clip. Of the PNG: parts of the pixels that are burnt out (aim 2 %) or negative, shown
# black. Textures bend no normals in the reference, as bakes at vertices have none. Pictures and error maps go to
# out/first/; bakes and references that are there are not made again. Needs the data folder (LAMBENT_DATA, or
# ../shared/data).
#   SPP=128 SIZE=96x72 ONLY=room scripts/bench first
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
out=out/first spp=${SPP:-128} size=${SIZE:-96x72}
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
      for light in six whole; do
        [ $light = six ] && bands=(--light-order 6) || bands=()
        # shellcheck disable=SC2086
        [ -f ${pair}_$light$half.exr ] || $tool reference "$file" $options --env "$sky" "${bands[@]}" --bounces 3 \
          --no-normal-maps --spp $((spp / 2)) --size "$size" --background none --seed $half \
          -o ${pair}_$light$half.exr >/dev/null
      done
    done
    for kind in "" _plain; do
      for light in six whole; do
        $tool compare $pair$kind.exr ${pair}_${light}1.exr --half ${pair}_${light}2.exr --exposure auto --tone neutral \
          -o $pair${kind}_$light.png --json >$pair${kind}_$light.json
      done
    done
    python3 - "$name" "$env" $out/$name.json $pair <<'P'
import json, sys
name, env, bake, pair = sys.argv[1:5]
read = lambda path: json.load(open(path))
bake, display = read(bake), read(pair + "_shown.json")["display"]
plain, held, whole, whole_plain = (read(pair + kind + ".json")
                                   for kind in ("_plain_six", "_six", "_whole", "_plain_whole"))
said = lambda of: of["without_noise"]["psnr"]
print(json.dumps({"name": "first", "scene": name, "env": env, "ours": said(plain), "limit": 38,
                  "ratio": said(plain) / 38, "unit": "dB", "limit_is": "aim", "least": plain["without_noise"]["least"],
                  "most": plain["without_noise"]["most"], "held": said(held), "whole": said(whole),
                  "whole_plain": said(whole_plain), "flip": plain["flip"], "whole_flip": whole["flip"],
                  "reference_noise_psnr": plain["without_noise"]["noise"], "white": display["white"],
                  "negative": display["negative"], "receivers": bake["receivers"], "bake_error": bake["error"]}),
      flush=True)
P
  done
done <<<"$scenes"
