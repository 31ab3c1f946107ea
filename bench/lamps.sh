#!/usr/bin/env bash
# Light bases of about equal size, each judged under the whole environment: one JSON object for each environment and
# basis. The scene is made here; environments are a clear sky with sun and, with the data folder (LAMBENT_DATA, or
# ../shared/data), some of its maps. `own` is the error against the path tracer under the basis's own projection of the
# light: what the bake adds.
#   SAMPLES=2048 SPP=512 SIZE=160x120 EDGE=0.05 scripts/bench lamps          pictures go to out/lamps/
source "$(dirname "$0")/common.sh"
out=out/lamps samples=${SAMPLES:-2048} spp=${SPP:-512} size=${SIZE:-160x120}
edge=${EDGE:-0.05}
mkdir -p $out
# A floor, a wall at the back and one at the left, a low step and two pillars.
python3 - >$out/yard.obj <<'P'
n = 0
def quad(*points):
    global n
    for p in points: print("v %g %g %g" % p)
    print("f", n + 1, n + 2, n + 3, n + 4)
    n += 4
def box(x0, y0, z0, x1, y1, z1):
    quad((x0, y1, z0), (x0, y1, z1), (x1, y1, z1), (x1, y1, z0))
    quad((x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1))
    quad((x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0))
    quad((x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0))
    quad((x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1))
quad((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2))
quad((-2, 0, -2), (2, 0, -2), (2, 1.6, -2), (-2, 1.6, -2))
quad((-2, 0, 2), (-2, 0, -2), (-2, 1.6, -2), (-2, 1.6, 2))
box(-1.2, 0.001, -1.2, -0.9, 1.4, -0.9)
box(0.4, 0.001, -0.8, 0.8, 1.1, -0.4)
box(-0.6, 0.001, 0.5, 0.9, 0.3, 1.1)
P
shot=(--camera 3.4,3.2,4.6,-0.2,0.4,-0.3,42 --size "$size" --background none)
# The mean of two independent pictures, to OUT.exr; their distance tells the noise, 6 dB less of it is left in the mean.
truth() {  # truth OUT OPTIONS...
  local to=$1 half
  shift
  for half in 1 2; do
    $tool reference $out/yard.obj --max-edge "$edge" --bounces 2 --spp $((spp / 2)) --seed $half "${shot[@]}" "$@" \
      -o "${to}_$half.exr" >/dev/null
  done
  $tool compare "${to}_1.exr" "${to}_2.exr" -o "$to.exr" --mean --json >"$to.json"
}
envs=(sky:elevation=40,azimuth=30)
for name in chinese_garden_1k studio_small_03_1k circus_arena_1k; do
  [ -f "$data/environments/$name.hdr" ] && envs+=("$data/environments/$name.hdr") || echo "skipped: no $name.hdr" >&2
done
for env in "${envs[@]}"; do
  name=$(basename "${env%%:*}" .hdr)
  truth "$out/$name" --env "$env"
  # Exposed so that the picture's mean is a fifth.
  exposure=$(exposure_of "$out/$name.json")
  for light in "sh:5+lamps:11@$env" sh:6 directional:36 sh:10; do
    to=$out/${name}_$(tr ':+' '__' <<<"${light%%@*}")
    $tool bake $out/yard.obj --max-edge "$edge" --bounces 2 --samples "$samples" --light "$light" -o "$to.glb" --json \
      >"${to}_bake.json" 2>/dev/null
    $tool render "$to.glb" --env "$env" "${shot[@]}" --spp 64 -o "$to.exr" >/dev/null
    $tool compare "$to.exr" "$out/$name.exr" --exposure="$exposure" -o "${to}_error.png" --json >"${to}_full.json"
    truth "${to}_own" --env "$env" --light-basis "$to.glb"
    $tool compare "$to.exr" "${to}_own.exr" --exposure="$exposure" -o "${to}_own_error.png" --json \
      >"${to}_own_difference.json"
    $tool compare "${to}_own_1.exr" "${to}_own_2.exr" --exposure="$exposure" --json >"${to}_noise.json"
    python3 - "$name" "${light%%@*}" "$to" <<'P'
import json, sys
name, light, to = sys.argv[1:4]
bake, full, own, noise = (json.load(open(to + end)) for end in ("_bake.json", "_full.json", "_own_difference.json",
                                                                "_noise.json"))
print(json.dumps({"name": "lamps", "env": name, "light": light, "columns": bake["order"] ** 2 + bake["lobes"],
                  "ours": full["psnr"], "limit": own["psnr"],
                  "ratio": full["psnr"] / own["psnr"], "unit": "dB", "limit_is": "the bake against its own light",
                  "flip": full["flip"],
                  "relative_rmse": full["relative_mse"] ** 0.5, "own_noise_psnr": noise["psnr"] + 6.02,
                  "receivers": bake["receivers"],
                  "bake_seconds": bake["seconds"]["trace"] + bake["seconds"]["bounce"], "bake_error": bake["error"]}),
                  flush=True)
P
  done
done
