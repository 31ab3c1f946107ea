#!/usr/bin/env bash
# Lightmaps on the command line: against the path tracer, by groups, terms, exported.
set -uo pipefail
source "$(dirname "$0")/expect.sh"

# Lightmaps: a box with a glowing ceiling, and a sky.
cat >box.mtl <<'M'
newmtl wall
Kd 0.7 0.6 0.5
newmtl lamp
Kd 0.5 0.5 0.5
Ke 4 3 2
M
cat >box.obj <<'O'
mtllib box.mtl
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 1 0
v 2 1 0
v 0.5 0.99 0.5
v 1.5 0.99 0.5
v 1.5 0.99 1.5
v 0.5 0.99 1.5
usemtl wall
f 4 3 2 1
f 1 2 6 5
usemtl lamp
f 7 8 9 10
O
view="--camera 3,0.8,4,1,0.4,0.7,40 --size 48x32 --background none"
expect 0 'charts' bake box.obj --transfer lightmap --sky uniform:0.3,0.4,0.6 --light-groups --texels-per-unit 20 \
  --samples 512 --bounces 2 -o map.glb
for picture in map.lamp.exr map.sky.exr; do [ -s $picture ] && ok || bad "$picture is missing"; done
expect 0 'relit' render map.glb $view --spp 256 -o map_lit.exr
expect 0 'paths' reference box.obj --lamps --env uniform:0.3,0.4,0.6 --bounces 2 --spp 256 $view -o map_truth.exr
alike 35 "lightmapped and path-traced boxes" map_lit.exr map_truth.exr
expect 0 'relit' render map.glb $view --lamp lamp=0.1,0.2,0 --lamp sky=0,0,1 -o dimmed.exr
for part in radiosity albedo product; do expect 0 'relit' render map.glb $view --show $part -o map_$part.png; done
# Without --samples, to an error: as fine and with as many rays as light asks for.
expect 0 'error +[0-9.]+% RMS' bake box.obj --transfer lightmap --sky uniform:0.3,0.4,0.6 --bounces 2 \
  --quality preview -o by_error.glb
expect 0 'relit' render by_error.glb $view --spp 256 -o by_error.exr
alike 35 "a box baked to an error and path-traced" by_error.exr map_truth.exr
expect 2 'says how many rays' bake box.obj --transfer lightmap --samples 64 --error 2% -o x.glb
expect 2 'leave --samples, --order' bake box.obj --transfer lightmap --order 3 --error 2% -o x.glb
expect 2 'not measured of hemicubes' bake box.obj --transfer lightmap --gather hemicube --error 2% -o x.glb
cmp -s map_radiosity.png map_product.png && bad "radiosity and product are the same picture" || ok
expect 2 'product' render map.glb $view --show colour -o x.png
expect 0 'lamps' bake box.obj --transfer lightmap --gather hemicube --atlas 64x64 --samples 300 -o cube.glb
expect 0 'texels' export map.glb --three map_three
expect 0 'texels' export map.glb --godot map_godot
expect 0 'map_moz.glb' export map.glb --moz-lightmap map_moz.glb
expect 0 'LambentImporter.cs' export map.glb --unity map_unity --per-object
expect 0 'map_own.layers.exr' export map.glb --godot map_own --per-object --godot-version 4.3
expect 2 'godot-version' export map.glb --godot x --godot-version 4.2
expect 2 'godot' export map.glb --three x --godot-version 4.4
expect 2 'need --env' export map.glb --three x --probes map.glb
expect 1 'no light in free space' export map.glb --three x --probes map.glb --env uniform:1
expect 2 'needs --env' export map.glb --three-probes x
expect 1 'no light in free space' export map.glb --three-probes x --env uniform:1
expect 2 'says nothing here' export map.glb --three x --env uniform:1
expect 2 'one file holds it all' export map.glb --moz-lightmap x.glb --sky-columns
expect 2 'goes with --web alone' export map.glb --three x --camera 1,2,3,4,5,6,40
expect 2 'goes with --three' export map.glb --npy x --per-object
expect 1 'no harmonics' export map.glb --three x --sky-columns
expect 0 '"fraction":' bake box.obj --samples 16 --progress json -o told.glb
for left in x.exr x.lamp.exr x.three.glb x.json; do absent "$left"; done
expect 0 'lamps' bake box.obj --transfer lightmap --directional sh:2 --atlas 64x64 --samples 64 -o sh2.glb
expect 0 'sh2_godot.3.exr' export sh2.glb --godot sh2_godot
expect 0 'sh2_three.3.exr' export sh2.glb --three sh2_three
for picture in map_three.lamp.exr map_three.sky.exr map_godot.lamp.exr map_godot.sky.exr sh2_godot.0.exr \
  sh2_three.0.exr; do [ -s $picture ] && ok || bad "$picture is missing"; done
# Reflections one by one.
expect 0 'receivers' bake box.obj --transfer lightmap --light-groups --atlas 64x64 --samples 64 --bounces 2 --terms \
  -o terms.glb
for part in emission bounce:0 bounce:1 bounce:2 sum:2 product; do expect 0 'relit' render terms.glb $view \
  --show $part -o terms_${part/:/_}.exr; done
expect 0 'PSNR +(inf|[6-9][0-9])' compare terms_sum_2.exr terms_product.exr
cmp -s terms_bounce_1.exr terms_bounce_2.exr && bad "two reflections are the same picture" || ok
expect 2 'terms 0 to 2, not 3' render terms.glb $view --show sum:3 -o x.png
expect 0 'holds lamps alone' render map.glb $view --env uniform:1 -o lone.png
expect 2 'window: does not go with lamps alone' render map.glb $view --window hann -o x.png
expect 2 'no group' render map.glb $view --lamp chandelier=1,1,1 -o x.png
# A lamp dimmed in the bake is the lamp dimmed after it, and in the reference; a part left out is left out everywhere.
expect 0 'lamps' bake box.obj --transfer lightmap --sky uniform:0.3,0.4,0.6 --light-groups --texels-per-unit 20 \
  --samples 512 --bounces 2 --lamp lamp=0.1,0.2,0 --lamp sky=0,0,1 -o dim.glb
expect 0 'relit' render dim.glb $view --show radiosity --spp 256 -o dim_lit.exr
expect 0 'relit' render map.glb $view --show radiosity --spp 256 --lamp lamp=0.1,0.2,0 --lamp sky=0,0,1 -o dim_after.exr
alike 50 "lamps dimmed in a bake and after it" dim_lit.exr dim_after.exr
expect 0 'paths' reference box.obj --lamps --lamp lamp=0 --exclude wall --bounces 0 --spp 1 $view -o x.exr
expect 2 'needs --lamps' reference box.obj --env uniform:1 --lamp lamp=2 -o x.exr
expect 2 'no lamp "nobody"' bake box.obj --transfer lightmap --lamp nobody=2 -o x.glb
expect 2 'no part or material "nobody"' bake box.obj --exclude nobody -o x.glb
expect 2 'no lamps' bake box.obj --transfer lightmap --light-units watt -o x.glb
expect 0 'applications' bake box.obj --transfer lightmap --atlas 64x48 --samples 64 --bounces converge:1e-3 \
  --solver southwell --direct separate --json -o map2.glb
for picture in map2.direct.exr map2.indirect.exr; do [ -s $picture ] && ok || bad "$picture is missing"; done
expect 0 'gmres' bench solvers --samples 8 --residual 0.3 --plot-residual 0.2
expect 0 '"residual"' bench solvers box.obj --receivers texels --atlas 48x48 --samples 16 --residual 0.1 \
  --plot-residual 0.01 --json
expect 0 'not reached' bench solvers box.obj --samples 16 --most 1
expect 1 'nothing gives light' bench solvers corner.obj
expect 2 'subcommand' bench
expect 2 'residual' bench solvers --residual 0
expect 0 'lamps' bake box.obj --transfer lightmap --receivers patches --samples 64 -o patches.glb
expect 0 'relit' render patches.glb $view -o patches.exr
expect 0 'lamps' bake box.obj --transfer lightmap --directional hl2 --atlas 64x64 --samples 64 -o hl2.glb
expect 0 'relit' render hl2.glb $view -o hl2.exr
expect 1 'sh:2 or sh:3' export hl2.glb --godot x
expect 0 'receivers' bake box.obj --receivers texels --atlas 64x64 --order 3 --samples 64 -o prt.glb
expect 1 'no lamps' export prt.glb --three x
expect 0 'lambent_sky.glsl' export prt.glb --three prt_sky --sky-columns --env sky:elevation=30
[ -s prt_sky.sky.8.exr ] && [ -s prt_sky.sky.json ] && ok || bad "sky columns are missing"
expect 0 'relit' render prt.glb --env sky:elevation=30 $view -o prt.exr
# Pictures of light groups add up to that of all; clusters are lamps too, and so are those beside harmonics.
expect 0 'texels' bake box.obj --transfer lightmap --sky uniform:0.3,0.4,0.6 --texels-per-unit 20 --samples 512 \
  --bounces 2 -o whole_map.glb
expect 0 'whole_three.exr' export whole_map.glb --three whole_three
# MOZ_lightmap's numbers: under an even sky of radiance L an open floor receives pi L, which is white times intensity.
printf 'v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\nf 1 2 3 4\n' >floor.obj
expect 0 'texels' bake floor.obj --transfer lightmap --sky uniform:0.5,0.5,0.5 --texels-per-unit 8 --samples 256 \
  -o floor.glb
expect 0 'floor_three.three.glb' export floor.glb --three floor_three
grep -aoE '"intensity":[0-9.]+' floor_three.three.glb | awk -F: '
  { if ($2 < 1.55 || $2 > 1.60) bad = 1 } END { exit bad || NR != 1 }' && ok || bad "irradiance is not pi L"
expect 0 'rank' compress map.glb --cpca 200,2 -o map_clusters.glb
smaller map_clusters.glb map.glb
expect 0 'clusters_three.sky.exr' export map_clusters.glb --three clusters_three
expect 0 'PSNR +(inf|[3-9][0-9])' compare clusters_three.sky.exr map_three.sky.exr
for thread_count in 1 2; do "$tool" bake box.obj --transfer lightmap --atlas 64x64 --samples 64 \
  --threads $thread_count -o map_$thread_count.glb >/dev/null 2>&1; done
cmp -s map_1.glb map_2.glb && ok || bad "1 and 2 threads give different lightmaps"
expect 1 'nothing gives light' bake corner.obj --transfer lightmap -o x.glb
expect 2 'need at least' bake box.obj --transfer lightmap --atlas 4x4 -o x.glb
expect 2 'limit' bake box.obj --transfer lightmap --texels-per-unit 1e9 -o x.glb
expect 2 'receivers texels' bake box.obj --transfer lightmap --receivers vertices --atlas 64x64 -o x.glb
expect 2 'bounces' bake box.obj --transfer lightmap --bounces converge:nan -o x.glb
expect 2 'no material' bake box.obj --transfer lightmap --emit sofa=1,1,1 -o x.glb
expect 2 'env' render prt.glb -o x.png
expect 2 'lamps' reference box.obj -o x.png
expect 1 'diffuse transfer of harmonics at vertices' export map.glb --npy features
finish
