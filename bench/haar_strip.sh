#!/usr/bin/env bash
# The strip of a sun in the README, into out/haar-strip/strip.png: a gate and a fence by harmonics of order 16, by the
# 200 largest wavelets of the light out of fewer bytes, and path-traced; then a JSON line of each of the first two:
# decibels against the last, bytes a receiver, seconds of relighting. Some three minutes.
#   SPP=512 SIZE=288x216 HAAR=haar:128 scripts/bench haar-strip
source "$(dirname "$0")/common.sh"
out=out/haar-strip size=${SIZE:-256x192} spp=${SPP:-256} haar=${HAAR:-haar:64,error=0.07}
mkdir -p $out
python3 - $out/gate.obj <<'P'
import sys
# Corners of boxes, and a floor that ends under none of them.
boxes = [((-1.5, 0, -0.9), (-1.2, 1.5, -0.6)), ((-0.1, 0, -0.9), (0.2, 1.5, -0.6)),
         ((-1.6, 1.5, -0.95), (0.3, 1.75, -0.55))]
boxes += [((0.55 + 0.17 * i, 0, -0.78), (0.61 + 0.17 * i, 0.9, -0.72)) for i in range(6)]
boxes += [((0.5, 0.62, -0.77), (1.5, 0.7, -0.73))]
with open(sys.argv[1], "w") as f:
    f.write("v -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\nf 4 3 2 1\n")
    for k, (low, high) in enumerate(boxes):
        for x in (low[0], high[0]):
            for y in (low[1], high[1]):
                for z in (low[2], high[2]):
                    f.write(f"v {x:g} {y:g} {z:g}\n")
        for face in (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3):
            f.write("f " + " ".join(str(5 + 8 * k + i) for i in face) + "\n")
P
light="--env ${SKY:-sky:elevation=32,azimuth=-62,turbidity=3}"
view=(--camera "0.5,2.6,4.6,-0.05,0.55,-0.1,32" --size "$size" --background none)
mesh="--max-edge ${EDGE:-0.05}"
# shellcheck disable=SC2086
{
  $tool bake $out/gate.obj $mesh --order 16 --samples 4096 --bounces 0 -o $out/harmonics.glb
  $tool bake $out/gate.obj $mesh --light $haar --bounces 0 -o $out/wavelets.glb
  $tool render $out/harmonics.glb $light "${view[@]}" --spp 16 -o $out/harmonics.exr --json >$out/harmonics_drawn.json
  $tool render $out/wavelets.glb $light --terms 200 "${view[@]}" --spp 16 -o $out/wavelets.exr --json \
    >$out/wavelets_drawn.json
  for half in 1 2; do
    $tool reference $out/gate.obj $light "${view[@]}" --bounces 1 --spp $((spp / 2)) --seed $half \
      -o $out/truth_$half.exr
  done
} >&2
$tool compare $out/truth_1.exr $out/truth_2.exr --json >$out/truth.json
exposure=$(exposure_of $out/truth.json)
for name in harmonics wavelets; do
  $tool compare $out/$name.exr $out/truth_1.exr --half $out/truth_2.exr --exposure="$exposure" \
    -o $out/$name.png --json >$out/$name.json
  $tool inspect $out/$name.glb --json >$out/${name}_inspected.json
done
python3 bench/beside.py $out/strip.png "$size" $out/harmonics.png:0/3 $out/wavelets.png:0/3 $out/wavelets.png:1/3
for name in harmonics wavelets; do
  bytes=$(number bytes $out/${name}_inspected.json) receivers=$(number receivers $out/${name}_drawn.json)
  echo "{\"name\": \"haar_strip_$name\", \"ours\": $(number sloped $out/$name.json), \"unit\": \"dB\"," \
    "\"bytes_a_receiver\": $((bytes / receivers))," \
    "\"relight_seconds\": $(number relight_seconds $out/${name}_drawn.json)}"
done
