#!/usr/bin/env bash
# The pictures of zonal lobes in the README, into build/pictures: a figure that walks (needs LAMBENT_DATA's
# CesiumMan.glb), and a vase with a relief of jade and of stone, as thrown and twisted. Some three minutes, most of them
# walks of light through jade.
source "$(dirname "$0")/common.sh"
out=build/pictures
mkdir -p $out
light="--env sky:elevation=30,azimuth=70,turbidity=3 --background none --spp 32"
if [ -f "$data/meshes/CesiumMan.glb" ]; then
  $tool bake "$data/meshes/CesiumMan.glb" --transfer zonal --lobes 4 --samples 1024 -o $out/man.glb >&2
  $tool render $out/man.glb --animation 0 --frames 0:1.6:0.4 $light --size 180x300 --tone none --exposure -1.6 \
    -o $out/walk.png
else
  echo "skipped: no $data/meshes/CesiumMan.glb" >&2
fi
# A profile turned about y, and one repetition of ridges that wind.
awk 'function radius(v) {
    lip = 0.18 * exp(-((v - 1) / 0.08) ^ 2); foot = 0.12 * exp(-(v / 0.1) ^ 2)
    return 0.55 + 0.35 * sin(3.3 * v + 0.3) * (1 - 0.35 * v) + lip - foot
  }
  BEGIN { n = 160; m = 120; tau = 2 * atan2(0, -1)
    for (j = 0; j <= m; ++j) for (i = 0; i <= n; ++i) { a = tau * i / n; v = j / m; r = radius(v)
      printf "v %.6f %.6f %.6f\nvt %.6f %.6f\n", r * sin(a), 2.2 * v, r * cos(a), i / n, v }
    for (j = 0; j < m; ++j) for (i = 0; i < n; ++i) { a = j * (n + 1) + i + 1; b = a + 1; c = a + n + 1; d = c + 1
      printf "f %d/%d %d/%d %d/%d\nf %d/%d %d/%d %d/%d\n", a, a, b, b, c, c, b, b, d, d, c, c } }' >$out/vase.obj
awk 'BEGIN { n = 128; tau = 2 * atan2(0, -1)
    for (j = 0; j <= n; ++j) for (i = 0; i <= n; ++i) { u = i / n; v = j / n
      ridge = (0.5 + 0.5 * sin(tau * (2 * u + 0.35 * sin(tau * v)))) ^ 1.5
      printf "v %.6f %.6f %.6f\n", u, v, 0.2 * ridge * (0.7 + 0.3 * cos(2 * tau * v)) }
    for (j = 0; j < n; ++j) for (i = 0; i < n; ++i) { a = j * (n + 1) + i + 1; b = a + 1; c = a + n + 1; d = c + 1
      printf "f %d %d %d\nf %d %d %d\n", a, b, c, b, d, c } }' >$out/swirl.obj
$tool patch $out/swirl.obj --size 96 --lobes 4 --subsurface sigma_s=110,130,90,sigma_a=3,0.5,2,g=0.6,eta=1.3 \
  --samples ${WALKS:-1024} -o $out/jade.lpt >&2
$tool patch $out/swirl.obj --size 96 --lobes 4 --samples 1024 -o $out/stone.lpt >&2
for what in jade stone; do
  for deform in "" "--deform twist:140,y"; do
    exposure=-1.2
    [ $what = stone ] && exposure=-2.2
    $tool render $out/vase.obj --transfer-texture $out/$what.lpt --tile 6,4 $deform $light --size 220x330 \
      --tone none --exposure $exposure --camera 0,2.2,5.2,0,1.1,0,30 \
      -o $out/$what${deform:+-twisted}.png
  done
done
