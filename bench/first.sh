#!/usr/bin/env bash
# The first picture that anyone makes: no option but the floor under a scan, under three skies, against the path tracer.
# One JSON object a picture. PSNR, dB, is against two references of different seeds with their noise left out, at the
# same exposure and tone: `ours` is the same bake without deringing (--window none) against the same bands of light (aim
# 38), which ring in both, and lies between `least` and `most`; `held` is the picture that is shown, kept from ringing,
# against those; `whole` that against all of the light, which no 6 bands hold, and `whole_plain` without deringing.
# `reference_noise_psnr` is what the references' own noise would allow a plain PSNR. Where it is low, displays, which
# clip it at black, make `ours` less than it is (a picture of 3,000 paths had 26 dB against two of 64), so references
# get twice the paths, from SPP on, until they have NOISE dB, or MOST paths; `sloped` has no such bias, to first order.
# `black`: the part of what the references show lit (above a twentieth of white) that the picture shows with less than a
# tenth of that. Of the PNG: parts of the pixels that are burnt out (aim 2 %) or negative, shown black. Textures bend no
# normals in the reference, as bakes at vertices have none. Pictures and error maps go to out/first/; bakes and
# references that are there are not made again, pictures are. WHOLE=0 leaves the whole light out. Needs the data folder
# (LAMBENT_DATA, or ../shared/data).
#   SPP=128 NOISE=32 MOST=4096 SIZE=48x36 ONLY=room ENVS=noon_grass_1k WHOLE=0 scripts/bench first
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
out=${OUT:-out/first} spp=${SPP:-128} noise=${NOISE:-32} most=${MOST:-4096} size=${SIZE:-48x36} lights="six whole"
[ "${WHOLE:-1}" = 1 ] || lights=six
mkdir -p "$out"
[ -f "$out/demo/courtyard.glb" ] || $tool demo -o "$out/demo" --spp 1 >/dev/null

# trace SEED PATHS OUTPUT: a reference.
trace() {
  # shellcheck disable=SC2086
  $tool reference "$file" $options "${view[@]}" "${bands[@]}" --bounces 3 --no-normal-maps --spp "$2" \
    --background none --seed "$1" -o "$3" >/dev/null
}
# The two halves of the reference: each becomes the mean of itself and as many paths of another seed, until they do.
references() {
  local paths=$((spp / 2)) seed=3 half says=$pair.noise.json
  trace 1 $paths "${pair}_one.exr"
  trace 2 $paths "${pair}_two.exr"
  while [ $((4 * paths)) -le "$most" ]; do
    $tool compare "${pair}_one.exr" "${pair}_one.exr" --half "${pair}_two.exr" --exposure auto --tone neutral \
      --json >"$says"
    python3 - "$says" "$noise" <<'P' && break
import json, sys
sys.exit(json.load(open(sys.argv[1]))["without_noise"]["noise"] < float(sys.argv[2]))
P
    for half in one two; do
      trace $seed $paths "${pair}_more.exr"
      $tool compare "${pair}_$half.exr" "${pair}_more.exr" --mean -o "${pair}_mean.exr" >/dev/null
      mv "${pair}_mean.exr" "${pair}_$half.exr"
      seed=$((seed + 1))
    done
    paths=$((2 * paths))
  done
  rm -f "$says" "${pair}_more.exr"
  mv "${pair}_one.exr" "${pair}_${light}1.exr"
  mv "${pair}_two.exr" "${pair}_${light}2.exr"
}

scenes="bunny|$data/meshes/bunny.obj|--ground
armadillo|$data/meshes/armadillo.obj|--ground
room|$data/meshes/room.glb|
cornell_box_rounded|$data/meshes/cornell_box_rounded.glb|
dutch_ship|$data/meshes/dutch_ship/dutch_ship_medium_1k.gltf|
zdm2_level|$data/meshes/zdm2_level.glb|
courtyard|$out/demo/courtyard.glb|"
while IFS='|' read -r name file options; do
  [ -z "${ONLY:-}" ] || [ "$ONLY" = "$name" ] || continue
  baked=$out/$name.glb
  # shellcheck disable=SC2086
  [ -f "$out/$name.json" ] || { $tool bake "$file" $options -o "$baked" --json >"$out/part.json" &&
    mv "$out/part.json" "$out/$name.json"; }
  for env in ${ENVS:-noon_grass_1k chinese_garden_1k circus_arena_1k}; do
    pair=$out/${name}_$env view=(--env "$data/environments/$env.hdr" --size "$size")
    $tool render "$baked" "${view[@]}" --background none -o "$pair.exr" >/dev/null
    $tool render "$baked" "${view[@]}" --background none --window none -o "${pair}_plain.exr" >/dev/null
    $tool render "$baked" "${view[@]}" -o "$pair.png" --json >"${pair}_shown.json"
    for light in $lights; do
      [ $light = six ] && bands=(--light-order 6) || bands=()
      [ -f "${pair}_${light}2.exr" ] || references
      for kind in "" _plain; do
        $tool compare "$pair$kind.exr" "${pair}_${light}1.exr" --half "${pair}_${light}2.exr" --exposure auto \
          --tone neutral -o "$pair${kind}_$light.png" --json >"$pair${kind}_$light.json"
      done
    done
    python3 - "$name" "$env" "$out/$name.json" "$pair" "$lights" <<'P'
import json, sys
name, env, bake, pair, lights = sys.argv[1:6]
read = lambda path: json.load(open(path))
bake, display, plain, held = read(bake), read(pair + "_shown.json")["display"], read(pair + "_plain_six.json"), \
    read(pair + "_six.json")
said = lambda of: of["without_noise"]["psnr"]
line = {"name": "first", "scene": name, "env": env, "ours": said(plain), "limit": 38, "ratio": said(plain) / 38,
        "unit": "dB", "limit_is": "aim", "least": plain["without_noise"]["least"],
        "most": plain["without_noise"]["most"], "sloped": plain["without_noise"]["sloped"],
        "held": said(held), "flip": plain["flip"],
        "reference_noise_psnr": plain["without_noise"]["noise"], "black": plain["black"], "black_held": held["black"],
        "white": display["white"], "negative": display["negative"], "receivers": bake["receivers"],
        "traced": bake.get("traced"), "bake_error": bake["error"], "bake_noise": bake["certificate"]["noise"]}
if "whole" in lights:
    whole, whole_plain = read(pair + "_whole.json"), read(pair + "_plain_whole.json")
    line |= {"whole": said(whole), "whole_plain": said(whole_plain), "whole_flip": whole["flip"]}
print(json.dumps(line), flush=True)
P
  done
done <<<"$scenes"
