#!/usr/bin/env bash
# Truth for patches (local-deformable-prt, Fig. 5): a sheet that carries a relief as a texture of lobes, flat, bent and
# twisted, against the path-traced geometry of that relief. One JSON line a case; pictures (lobes, truth) in
# build/patches.
source "$(dirname "$0")/common.sh"
[ -d "$data/textures" ] || { echo "skipped: no $data/textures" >&2; exit 0; }
out=build/patches
mkdir -p $out
# A sheet of 5 x 5 in 40 x 40 cells, in the plane y = 0.
awk 'BEGIN { n = 40
  for (j = 0; j <= n; ++j) for (i = 0; i <= n; ++i)
    printf "v %g 0 %g\nvt %g %g\n", 5 * i / n - 2.5, 5 * j / n - 2.5, i / n, 1 - j / n
  for (j = 0; j < n; ++j) for (i = 0; i < n; ++i) { a = j * (n + 1) + i + 1; b = a + 1; c = a + n + 1; d = c + 1
    printf "f %d/%d %d/%d %d/%d\nf %d/%d %d/%d %d/%d\n", a, a, c, c, b, b, b, b, c, c, d, d } }' >$out/sheet.obj
light="--env sky:elevation=35,azimuth=60,turbidity=3 --light-order 6"
for map in Rock020 Tiles036; do
  heights="$data/textures/${map}_1K_Displacement.jpg"
  $tool patch "$heights" --depth ${DEPTH:-0.1} --size 128 --samples 1024 --lobes 4 --albedo 0.8 -o $out/$map.lpt >&2
  for deform in bend:0.01,x,y bend:-100,x,y twist:60,x; do
    name=$out/$map-${deform%%,*}
    # The middle third, seen from straight above where it is flat.
    view="--deform $deform $light --size 160x160 --background none --camera 0.001,30,0,0,0,0,3.2"
    $tool render $out/sheet.obj --transfer-texture $out/$map.lpt --tile 5,5 $view --spp 64 -o $name-lobes.exr >&2
    $tool reference $out/sheet.obj --displace "$heights" --depth ${DEPTH:-0.1} --tile 5,5 $view --bounces 3 \
      --spp ${SPP:-256} -o $name-truth.exr >&2
    $tool compare $name-lobes.exr $name-truth.exr --exposure -2 --json >$name.json
    $tool compare $name-lobes.exr $name-truth.exr --exposure -2 -o $name.png >&2
    echo "{\"name\": \"zonal_patch\", \"heights\": \"$map\", \"deform\": \"$deform\"," \
      "\"ours\": $(number psnr $name.json), \"limit\": 30, \"unit\": \"dB\"," \
      "\"limit_is\": \"what we ask for\", \"rmse\": $(number rmse $name.json), \"aim\": \">= 1\"}"
  done
done
