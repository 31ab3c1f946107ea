#!/usr/bin/env bash
# How direct to indirect light converges: a picture's error against the path tracer's as surfels grow, the reference's
# noise taken off by two of them; and what the equation does not hold by, bounce by bounce as they are summed, beside
# the iteration that is used. One JSON object a line; bench/plot_convergence.py draws them.
#   SCENES="room cornell" SPP=256 SIZE=48x36 SURFELS="512 1024 2048 4096 8192 16384 32768" \
#     scripts/bench indirect-convergence
source "$(dirname "$0")/common.sh"
out=out/convergence
mkdir -p $out
size=${SIZE:-48x36} spp=${SPP:-256}
for scene in ${SCENES:-room cornell}; do
  case $scene in
    room) file=$data/meshes/room.glb shot="--camera 4.5,3,4.5,0,1.5,0,70" at=0.5,3.5,0.7 flux=100 ;;
    cornell)
      sed 's/cornell_box.mtl/cornell.mtl/' "$data/meshes/cornell_box.obj" >$out/cornell.obj
      sed 's/Kd 1 1 1/Kd 0.75 0.75 0.75/' "$data/meshes/cornell_box.mtl" >$out/cornell.mtl
      file=$out/cornell.obj shot="--camera 278,274,-760,278,274,0,39" at=340,380,140 flux=300000 ;;
  esac
  lamp=point@$at=$flux
  for half in 1 2; do
    $tool reference "$file" --lamp $lamp --no-direct --bounces 24 --spp "$spp" --seed $half $shot --size "$size" \
      --background none -o $out/truth_$half.exr >/dev/null
  done
  $tool --json compare $out/truth_2.exr $out/truth_1.exr >$out/noise.json
  for gatherers in quarter all; do
    for surfels in ${SURFELS:-512 1024 2048 4096 8192 16384 32768}; do
      $tool --json bake "$file" --transfer indirect --surfels "$surfels" --gatherers $gatherers -o $out/baked.glb \
        >$out/bake.json 2>/dev/null
      $tool render $out/baked.glb --lamp $lamp --show indirect $shot --size "$size" --background none --spp 16 \
        -o $out/ours.exr >/dev/null
      for half in 1 2; do $tool --json compare $out/ours.exr $out/truth_$half.exr >$out/error_$half.json; done
      python3 - $out $scene $gatherers <<'P'
import json, sys
out, scene, gatherers = sys.argv[1:]
read = lambda name: json.load(open(f"{out}/{name}.json"))
one, two, noise, b = read("error_1"), read("error_2"), read("noise"), read("bake")
squared = (one["rmse"] ** 2 + two["rmse"] ** 2 - noise["rmse"] ** 2) / 2
print(json.dumps(dict(name="indirect error", scene=scene, gatherers=gatherers, surfels=b["indirect"]["surfels"],
                      gathering=b["indirect"]["gathering"], bytes=b["bytes"],
                      error=round(max(squared, 0) ** 0.5 / noise["mean_a"], 5))), flush=True)
P
    done
  done
  for bounces in 0 $(seq 1 24); do
    $tool --json render $out/baked.glb --lamp $lamp --move "1@0:$at" --frames 0:0 --frame-bounces $bounces \
      --show indirect $shot --size 16x12 --spp 1 -o $out/x.png >$out/steps.json 2>/dev/null || true
    python3 - $out $scene $bounces <<'P'
import json, sys
out, scene, bounces = sys.argv[1:]
r = json.load(open(f"{out}/steps.json"))
print(json.dumps(dict(name="indirect residual", scene=scene, summed=bounces != "0",
                      bounces=int(bounces) or r["bounces"], residual=r["residual"])), flush=True)
P
  done
done
