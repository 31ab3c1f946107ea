#!/usr/bin/env bash
# What each last reflection keeps, costs and loses: glossy bakes against the path tracer under the same band-limited
# light, direct light, one JSON object a line. First by outgoing basis, then by order and roughness; exposed so that the
# picture's mean is a fifth. Needs the data folder (LAMBENT_DATA, or ../shared/data) for all but spheres.
#   SAMPLES=4096 SPP=2048 SIZE=96x96 SCENES="sphere shaderball" ORDERS="3 5 8" BASES=yes scripts/bench matrices
# Some outgoing bases alone: OUTGOING="map directional:64" SCENES= scripts/bench matrices
# Pictures go to out/matrices/. A ship of order 8 takes 9 kB at each of 104k receivers.
source "$(dirname "$0")/common.sh"
out=out/matrices samples=${SAMPLES:-4096} spp=${SPP:-2048} size=${SIZE:-96x96}
mkdir -p $out
# A unit sphere, by latitude and longitude: a mirrored view turns twice as fast as the normal, so its triangles must be
# small.
python3 - >$out/sphere.obj <<'P'
from math import sin, cos, pi
n, m = 384, 192
for j in range(m + 1):
    for i in range(n):
        t, p = pi * j / m, 2 * pi * i / n
        print("v %.7f %.7f %.7f" % (sin(t) * cos(p), cos(t), sin(t) * sin(p)))
for j in range(m + 1):
    for i in range(n):
        t, p = pi * j / m, 2 * pi * i / n
        print("vn %.7f %.7f %.7f" % (sin(t) * cos(p), cos(t), sin(t) * sin(p)))
for j in range(m):
    for i in range(n):
        a, b, c, d = j * n + i + 1, j * n + (i + 1) % n + 1, (j + 1) * n + (i + 1) % n + 1, (j + 1) * n + i + 1
        if j > 0: print("f %d//%d %d//%d %d//%d" % (a, a, b, b, c, c))
        if j < m - 1: print("f %d//%d %d//%d %d//%d" % (a, a, c, c, d, d))
P
scene_of() {
  case $1 in
    sphere) echo $out/sphere.obj ;;
    dutch_ship) ls "$data"/meshes/dutch_ship/*.gl* | head -n 1 ;;
    *) echo "$data/meshes/$1.glb" ;;
  esac
}
env=sky:elevation=35,azimuth=60
[ ! -f "$data/environments/chinese_garden_512.hdr" ] || env=$data/environments/chinese_garden_512.hdr

# measure SCENE BRDF ORDER LABEL OPTIONS...: of bake
measure() {
  local scene=$1 brdf=$2 order=$3 label=$4 file to truth half
  shift 4
  file=$(scene_of "$scene")
  [ -f "$file" ] || { echo "skipped: no $scene" >&2; return; }
  to=$out/${scene}_$(tr ':=,/' '____' <<<"${brdf}_${order}_$label")
  truth=$out/${scene}_$(tr ':=,/' '____' <<<"${brdf}_$order")
  $tool bake "$file" --transfer matrix --brdf "$brdf" --order "$order" --bounces 0 --samples "$samples" "$@" \
    -o "$to.glb" --json >"$to.bake.json" 2>/dev/null
  $tool render "$to.glb" --env "$env" --size "$size" --spp 64 --window none --background none -o "$to.exr" \
    --json >"$to.render.json"
  if [ ! -f "$truth.exr" ]; then
    for half in 1 2; do
      $tool reference "$file" --brdf "$brdf" --env "$env" --light-order "$order" --bounces 0 --spp $((spp / 2)) \
        --seed $half --size "$size" --background none -o "${truth}_$half.exr" >/dev/null
    done
    $tool compare "${truth}_1.exr" "${truth}_2.exr" --mean -o "$truth.exr" --json >"$truth.mean"
    exposure_of "$truth.mean" >"$truth.exposure"
    $tool compare "${truth}_1.exr" "${truth}_2.exr" --exposure="$(cat "$truth.exposure")" --json >"$truth.json"
  fi
  $tool compare "$to.exr" "$truth.exr" --exposure="$(cat "$truth.exposure")" -o "${to}_error.png" --json \
    >"$to.error.json"
  python3 - "$scene" "$brdf" "$order" "$label" "$to" "$truth.json" <<'P'
import json, sys
scene, brdf, order, label, to, truth = sys.argv[1:7]
bake, render, error, noise = (json.load(open(p)) for p in (to + ".bake.json", to + ".render.json", to + ".error.json",
                                                           truth))
print(json.dumps({"name": "matrices", "scene": scene, "brdf": brdf, "order": int(order), "outgoing": label,
                  "ours": error["psnr"], "limit": noise["psnr"] + 6.02,
                  "ratio": error["psnr"] / (noise["psnr"] + 6.02), "unit": "dB",
                  "limit_is": "the noise of the reference", "mean_ratio": error["mean_a"] / error["mean_b"],
                  "rows": bake["rows"], "bytes_per_receiver": bake["bytes_per_receiver"],
                  "receivers": bake["receivers"],
                  "bake_seconds": bake["seconds"]["trace"] + bake["seconds"]["bounce"],
                  "relight_ms": 1e3 * render["relight_seconds"]}), flush=True)
P
}
rm -f $out/*.json $out/*.exr
scenes=${SCENES-sphere shaderball dutch_ship}
if [ "${BASES:-yes}" = yes ]; then
  all="map svd:4 svd:6 svd:12 svd:16 sh:5 hemisphere:5 hsh:5 directional:25 directional:64"
  for outgoing in ${OUTGOING:-$all}; do
    measure shaderball ggx:roughness=0.6 5 "$outgoing" --incident-order 5 --outgoing "$outgoing"
  done
fi
if [ "${BASES:-yes}" = yes ] && [ -z "${OUTGOING:-}" ]; then
  measure shaderball ggx:roughness=0.6 5 factors --incident-order 5 --factors
  measure shaderball ggx:roughness=0.6 5 cpca:128,8 --incident-order 5 --compress cpca:128,8
  for outgoing in map phong; do
    measure shaderball phong:exponent=8 5 "$outgoing" --incident-order 5 --outgoing "$outgoing"
  done
fi
for scene in $scenes; do
  for roughness in 0.2 0.4 0.7; do
    for order in ${ORDERS:-3 5 8}; do measure $scene ggx:roughness=$roughness $order map --incident-order $order; done
  done
done
