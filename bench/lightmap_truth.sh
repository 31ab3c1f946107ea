#!/usr/bin/env bash
# Lightmaps against the path tracer, under the same lamps and sky: one JSON object a scene. Needs the data folder
# (LAMBENT_DATA, or ../shared/data). The truth is the mean of two independent pictures, whose distance tells the noise
# that is left in it.
#   SPP=4096 SIZE=320x240 SCENES="cornell_box cornell_box_rounded room zdm2_level" scripts/bench lightmap-truth
# Pictures go to out/lightmaps/.
source "$(dirname "$0")/common.sh"
out=out/lightmaps spp=${SPP:-4096} size=${SIZE:-320x240}
mkdir -p $out

# measure FILE CAMERA BAKE_OPTIONS... -- LAMPS...: what lights the scene, for bake and reference alike
measure() {
  local file=$data/meshes/$1 camera=$2 name=${1%.*} to half bake=() sky=() shared=()
  shift 2
  [[ " ${SCENES:-cornell_box cornell_box_rounded room zdm2_level} " == *" $name "* ]] || return 0
  [ -f "$file" ] || { echo "skipped: no $name" >&2; return 0; }
  while [ "$1" != -- ]; do bake+=("$1"); shift; done
  shift
  while [ $# -gt 0 ]; do
    if [ "$1" = --sky ]; then sky=("$2"); else shared+=("$1" "$2"); fi
    shift 2
  done
  to=$out/$name
  $tool bake "$file" --transfer lightmap --bounces 8 \
    --memory "${MEMORY:-8GiB}" "${bake[@]}" "${shared[@]}" ${sky:+--sky "${sky[@]}"} -o "$to.glb" --json \
    >"$to.bake.json" 2>/dev/null
  $tool render "$to.glb" --camera="$camera" --size "$size" --spp 64 --background none -o "$to.exr" >/dev/null
  if [ ! -f "$to.truth.exr" ]; then
    for half in 1 2; do
      $tool reference "$file" --lamps "${shared[@]}" ${sky:+--env "${sky[@]}"} --camera="$camera" --size "$size" \
        --bounces 9 --spp $((spp / 2)) --seed $half \
        --background none -o "${to}_$half.exr" >/dev/null
    done
    $tool compare "${to}_1.exr" "${to}_2.exr" --mean -o "$to.truth.exr" --json >"$to.mean.json"
  fi
  # Exposed so that the picture's mean is a fifth.
  local exposure
  exposure=$(exposure_of "$to.mean.json")
  $tool compare "${to}_1.exr" "${to}_2.exr" --exposure="$exposure" --json >"$to.noise.json"
  $tool compare "$to.exr" "$to.truth.exr" --exposure="$exposure" -o "${to}_error.png" --json >"$to.error.json"
  python3 - "$name" "$to" <<'P'
import json, sys
name, to = sys.argv[1:3]
bake, error, noise = (json.load(open(f"{to}.{part}.json")) for part in ("bake", "error", "noise"))
print(json.dumps({"name": "lightmap_truth", "scene": name, "ours": error["psnr"], "limit": noise["psnr"] + 6.02,
                  "ratio": error["psnr"] / (noise["psnr"] + 6.02),
                  "unit": "dB", "limit_is": "the noise of the reference",
                  "mean_ratio": error["mean_a"] / error["mean_b"], "flip": error["flip"],
                  "receivers": bake["receivers"],
                  "bake_seconds": bake["seconds"]["trace"] + bake["seconds"]["bounce"]}), flush=True)
P
}

measure cornell_box.obj 278,273,-800,278,273,0,38 --atlas 512x512 --samples 2048 -- --emit light=12,10,6 \
  --max-albedo 0.8
measure cornell_box_rounded.glb 0,1.5,6,0,1.5,0,40 --texels-per-unit 50 --samples 1024 -- --emit light.000=12,10,6 \
  --max-albedo 0.8 --sky sky:elevation=40,azimuth=20
measure room.glb -4.5,2.5,0,4,1.2,0,70 --texels-per-unit 20 --samples 1024 -- --sky sky:elevation=40,azimuth=340
measure zdm2_level.glb "${ZDM2_CAMERA:--60,200,260,20,120,0,70}" --texels-per-unit 0.5 --samples 512 -- \
  --emit packages/mitaman/mm-ceilinglite3.jpg=12,10,6 --sky sky:elevation=40,azimuth=30
