#!/usr/bin/env bash
# The command-line tool as a user meets it: exit codes, one line an error, nothing half-written, pictures that agree.
set -uo pipefail
source "$(dirname "$0")/expect.sh"
# alike DECIBELS WHAT COMPARED...: two pictures agree to that PSNR. That of identical ones is null, and their RMSE 0.
alike() {
  local least=$1 what=$2 psnr
  shift 2
  expect 0 '"psnr"' compare "$@" --json
  psnr=$(sed -nE 's/.*"psnr": (null|-?[0-9]+)[.,].*/\1/p' stdout)
  if [ "$psnr" = null ]; then
    grep -qE '"rmse": 0\.0$' stdout && ok || bad "$what: no PSNR, though they differ"
  else
    [ -n "$psnr" ] && [ "$psnr" -ge "$least" ] && ok || bad "$what differ: PSNR ${psnr:-unreadable}, not $least"
  fi
}

expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 256 -o corner.glb
expect 0 '"error"' bake corner.obj --max-edge 0.2 --samples 256 --json -o corner.glb
expect 0 '"order": 6' inspect corner.glb --json
expect 0 'vertices' inspect corner.obj
expect 0 'relit' render corner.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 256 -o a.exr \
  --background none
expect 0 'paths' reference corner.obj --max-edge 0.2 --env uniform:1,0.5,0.25 --light-order 6 \
  --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 64 -o b.exr --background none
expect 0 'PSNR' compare a.exr b.exr -o difference.png
# Nothing lies behind the scene: what is covered counts, unless all shall.
expect 0 'covered pixels of .* \(--all counts every one\)' compare a.exr b.exr
expect 0 '"pixels": ?1536[,}]?$' compare a.exr b.exr --all --json
expect 1 'no map of the whole sphere: 2:1 is a lat-long map' env difference.png
alike 35 "baked and path-traced corners" a.exr b.exr
# A bake judged in one page, which names nothing outside itself; under light that the bands hold all of it agrees.
expect 0 '"psnr": (3[0-9]|[4-9][0-9])' check corner.obj --max-edge 0.2 --samples 256 --env uniform:1,0.5,0.25 \
  --size 48x32 --paths 256 -o check.html --json
[ "$(grep -o 'src="data:image/png;base64,' check.html | wc -l)" -eq 5 ] && ! grep -qE '(src|href)="[^d]' check.html &&
  ok || bad "the page of check is not whole"
expect 0 'sharper than they are' check corner.obj --samples 64 --env sky:elevation=10 --size 16x16 --paths 16 \
  -o check.html
expect 2 'transfer: lightmap' check corner.obj --transfer lightmap --env uniform:1 -o check.html
for option in '--fix-light uniform:1' '--fix-view auto' '--shadows off' '--membrane 0.5'; do
  expect 2 'not expected' check corner.obj $option --env uniform:1 -o check.html
done
expect 2 '^lambent: --size' check corner.obj --samples 16 --env uniform:1 --size 0x9 -o check.html
expect 1 'must end in .html' check corner.obj --env uniform:1 -o check.png
# Exposure and tone change a PNG alone.
expect 0 'stops, tone neutral' render corner.glb --env uniform:1 --size 16x16 --spp 1 -o shown.png
for other in '--exposure 1' '--exposure 0' '--tone agx' '--tone aces' '--tone none'; do
  expect 0 'stops, tone' render corner.glb --env uniform:1 --size 16x16 --spp 1 $other -o other.png
  cmp -s shown.png other.png && bad "$other has no effect" || ok
done
expect 0 'relit' render corner.glb --env sky:elevation=40,azimuth=20 --env-rotate 30,10,5 --window auto --size 40x40 \
  -o sky.png
# Even light has 2 sqrt(pi) in its mean, and in the others what texels of 256 x 128 and float leave.
expect 0 '^ +0 +0 +3\.54491 +3\.54491 +3\.54491$' env uniform:1 --order 3 -o env.png
awk '$1 ~ /^[0-9]+$/ && $1 > 0 { for (i = 3; i <= 5; ++i) if ($i * $i > 1e-8) bad = 1; ++n }
  END { exit bad || n != 8 }' stdout && ok || bad "even light has coefficients beside its mean: $(cat stdout)"
# three's harmonics lack the sign of odd orders m: coefficients 1, 3, 5 and 7 of nine.
expect 0 '"convention": "three"' env sky:turbidity=4 --convention three --order 3 --json
mv stdout three.json
expect 0 '"convention": "lambent"' env sky:turbidity=4 --order 3 --json
numbers() { sed -n '/"coefficients"/,/"convention"/p' "$1" | grep -oE '^ +-?[0-9.]+(e-?[0-9]+)?'; }
paste <(numbers three.json) <(numbers stdout) |
  awk '{ sign = int((NR - 1) / 3) % 2 ? -1 : 1; if ($1 != sign * $2 || $1 == 0) bad = 1 }
    END { exit bad || NR != 27 }' && ok || bad "three's convention is not ours with the signs of odd m turned"
expect 0 "open.glb" bake corner.obj --shadows off -o open.glb
# A small object in the scene's light in free space.
cat >pyramid.obj <<'O'
v 0 0 0
v 1 0 0
v 0 0 1
v 0.3 0.8 0.3
f 1 2 3
f 1 4 2
f 2 4 3
f 3 4 1
O
expect 0 'lattice' bake corner.obj --max-edge 0.4 --samples 128 --lattice 3,2,3 --lattice-order 3 \
  --lattice-box 0.1,0.1,0.1,1.9,1.9,1.9 -o lattice.glb
expect 0 'free space at 3 x 2 x 3' inspect lattice.glb
expect 0 'relit' render lattice.glb --env sky:elevation=40 --insert pyramid.obj@1,0.1,1,0.5 \
  --insert pyramid.obj@0.4,0.5,1.5,0.2 --size 40x40 -o inserted.png
expect 0 'out of the lattice' render lattice.glb --env sky:elevation=40 --insert pyramid.obj@1,3,1 --size 20x20 \
  -o inserted.png
expect 0 'lattice' bake corner.obj --transfer matrix --brdf ggx:roughness=0.5 --outgoing svd:3 --order 3 \
  --incident-order 3 --bounces 1 --samples 64 --lattice 2,2,2 -o glossy.glb
expect 0 'relit' render glossy.glb --env sky:elevation=40 --insert pyramid.obj@1,0.1,1,0.5 --size 40x40 -o inserted.png
expect 0 'simulate' bake --help
# The page of options is the table's, and requests in JSON bake what options do; again is the same file.
"$tool" options | cmp -s - "$source_dir/docs/options.md" && ok ||
  bad "docs/options.md is not what \`lambent options\` prints"
printf '{"scene": "corner.obj", "order": 3, "samples": 64, "max_edge": 0.5, "output": "request.glb"}' >request.json
expect 0 'receivers' bake --request request.json
expect 0 'receivers' bake corner.obj --order 3 --samples 64 --max-edge 0.5 -o said.glb
cmp -s request.glb said.glb && ok || bad "a request in JSON bakes another file than the options"
expect 0 'receivers' bake --again request.glb -o again.glb
cmp -s request.glb again.glb && ok || bad "a bake done again differs"
expect 0 '"receivers"' bake --request request.json --dry-run --json
printf '{"sample": 1}' >wrong.json
expect 1 'wrong.json: "sample" is no field' bake --request wrong.json -o x.glb
for option in samples seed precision lattice; do
  value=2; [ $option = precision ] && value=half; [ $option = lattice ] && value=1,1,1
  expect 2 "$option: does not go with blocks" bake corner.obj --transfer blocks --$option $value -o x.glb
done
expect 2 'solver: does not go with diffuse' bake corner.obj --solver gmres -o x.glb
expect 2 'sky: does not go with diffuse' bake corner.obj --sky uniform:1 -o x.glb
expect 2 'light-groups: does not go with diffuse' bake corner.obj --light-groups -o x.glb
expect 2 'bounces: does not go with membranes' bake corner.obj --membrane 0.5 --bounces 1 -o x.glb
absent x.glb
expect 0 'receivers' bake corner.obj --transfer matrix --simulate paths --order 3 --incident-order 3 --samples 64 \
  -o paths.glb
expect 2 'simulate: does not go with diffuse transfer: it is for matrix' bake corner.obj --simulate paths -o x.glb
expect 0 'lattice' bake corner.obj --transfer matrix --outgoing sh:3 --order 3 --incident-order 3 --bounces 0 \
  --samples 64 --lattice 1,1,1 -o rows.glb
expect 1 'rows.glb.*kind sh' render rows.glb --env sky:elevation=40 --insert pyramid.obj@1,0.1,1 -o x.png
expect 1 'corner.glb.*--lattice' render corner.glb --env sky:elevation=40 --insert pyramid.obj@1,0.1,1 -o x.png
expect 1 'missing.obj' render lattice.glb --env sky:elevation=40 --insert missing.obj@1,0.1,1 -o x.png
expect 1 'lattice: needs at least [0-9]+ bytes' bake corner.obj --lattice 64,64,64 --memory 1MB -o x.glb
expect 2 'insert' render lattice.glb --env sky:elevation=40 --insert pyramid.obj -o x.png
expect 2 'insert' render lattice.glb --env sky:elevation=40 --insert pyramid.obj@1,2 -o x.png
expect 2 'scale' render lattice.glb --env sky:elevation=40 --insert pyramid.obj@1,2,3,-1 -o x.png
expect 2 'lattice' bake corner.obj --lattice 3,3 -o x.glb
expect 2 'lattice' bake corner.obj --lattice 3,3,65 -o x.glb
expect 2 'lattice-box' bake corner.obj --lattice 3,3,3 --lattice-box 0,0,0,1,-1,1 -o x.glb
expect 2 'needs --lattice' bake corner.obj --lattice-order 3 -o x.glb
expect 2 'together' bake corner.obj --order 12 --lattice 2,2,2 --lattice-order 6 -o x.glb
for thread_count in 1 2; do "$tool" bake corner.obj --max-edge 0.3 --lattice 4,4,4 --samples 64 \
  --threads $thread_count -o threads_$thread_count.glb >/dev/null 2>&1; done
cmp -s threads_1.glb threads_2.glb && ok || bad "1 and 2 threads give different files"

# Light of harmonics and lamps, and of lobes alone: the bake agrees with the reference under the same projection of the
# light.
sun=sky:elevation=55,azimuth=120,width=256
shot="--camera 3,2,4,1,0.5,1,40 --size 48x32 --background none"
for light in "sh:5+lamps:2@$sun" directional:16; do
  expect 0 'lobe' bake corner.obj --max-edge 0.1 --samples 1024 --light "$light" -o lamps.glb
  expect 0 'sharpness' inspect lamps.glb
  # shellcheck disable=SC2086
  expect 0 'relit' render lamps.glb --env $sun --env-rotate 20,0,0 $shot --spp 256 -o lamps_lit.exr
  # shellcheck disable=SC2086
  expect 0 'paths' reference corner.obj --max-edge 0.1 --env $sun --env-rotate 20,0,0 --light-basis lamps.glb $shot \
    --spp 256 -o lamps_truth.exr
  alike 40 "baked and path-traced corners under $light" lamps_lit.exr lamps_truth.exr --exposure -3
done
expect 2 'env: is needed' render lamps.glb -o x.png
expect 0 'lamps? that stands? out, not 64' bake corner.obj --samples 64 --bounces 0 --light sh:5+lamps:64@$sun \
  -o lamps.glb
expect 0 'order 3,' bake corner.obj --samples 64 --light sh:3+lamps:4@uniform:1 -o lamps.glb
# Factors: the pictures of a matrix bake of direct light, in fewer bytes; the material is still free. Phong's lobe by
# convolution.
"$tool" bake corner.obj --max-edge 0.5 --samples 64 --transfer matrix --brdf ggx:roughness=0.5 --order 3 \
  --incident-order 3 --bounces 0 -o whole.glb >/dev/null 2>&1
expect 0 'receivers' bake corner.obj --max-edge 0.5 --samples 64 --transfer matrix --brdf phong:exponent=9 --order 3 \
  --incident-order 3 --factors --denoise off -o factors.glb
expect 0 'factors, order 3' inspect factors.glb
for f in whole factors; do expect 0 'relit' render $f.glb --env sky:elevation=30 --brdf ggx:roughness=0.5 --size 24x18 \
  --background none -o $f.exr; done
expect 0 'PSNR +([5-9][0-9]|inf)' compare factors.exr whole.exr
[ "$(stat -c %s factors.glb)" -lt "$(stat -c %s whole.glb)" ] && ok || bad "factors take more bytes than the matrix"
expect 0 'rows' bake corner.obj --samples 64 --transfer matrix --brdf phong:exponent=5 --outgoing phong --order 3 \
  --incident-order 3 -o phong.glb
expect 0 'outgoing phong' inspect phong.glb
expect 0 'relit' render phong.glb --env sky:elevation=30 --size 16x16 -o phong.png
expect 1 'phong' bake corner.obj --samples 64 --transfer matrix --brdf ggx:roughness=0.5 --outgoing phong --order 3 \
  -o x.glb
expect 1 'plain transfer' compress factors.glb --cpca 4,3 -o x.glb
expect 2 'bounces: does not go with factors' bake corner.obj --transfer matrix --factors --bounces 2 -o x.glb
expect 2 'factors' bake corner.obj --factors -o x.glb
expect 2 'factors' bake corner.obj --transfer matrix --factors --order 12 --incident-order 6 -o x.glb
# A fixed view is image relighting: the picture that the whole bake makes of that view.
expect 0 'pixel' bake corner.obj --max-edge 0.5 --samples 64 --order 4 --fix-view 3,2,4,1,0.5,0,40 --size 24x18 \
  --spp 4 -o view.glb
expect 0 'fixed view of 24 x 18' inspect view.glb
"$tool" bake corner.obj --max-edge 0.5 --samples 64 --order 4 -o whole.glb >/dev/null 2>&1
expect 0 'relit +432' render view.glb --env sky:elevation=30 --env-rotate 20,30,40 --background none -o view.exr
expect 0 'relit' render whole.glb --env sky:elevation=30 --env-rotate 20,30,40 --background none \
  --camera 3,2,4,1,0.5,0,40 --size 24x18 --spp 4 -o whole.exr
expect 0 'PSNR +(6[0-9]|[7-9][0-9]|inf)' compare view.exr whole.exr
expect 2 'camera: does not go with fixed views' render view.glb --env sky:elevation=30 --camera auto -o x.png
expect 0 'rows?' bake corner.obj --transfer matrix --brdf ggx:roughness=0.5 --order 3 --incident-order 3 \
  --samples 64 --bounces 0 --fix-view auto --size 8x8 -o view.glb
expect 0 'relit +64' render view.glb --env uniform:1,1,1 -o glossy_view.png
expect 2 'fix-view' bake corner.obj --fix-view 1,2 -o x.glb
expect 2 '4 GiB' bake corner.obj --fix-view auto --size 9000x9000 -o x.glb
expect 2 'fix-view' bake corner.obj --fix-view auto --compress cpca:2,2 -o x.glb
expect 2 'size: needs --fix-view' bake corner.obj --size 8x8 -o x.glb
# Clusters, from the bake or from its file.
expect 0 'clusters +4 of rank 3' bake corner.obj --max-edge 0.3 --samples 64 --compress cpca:4,3 -o clusters.glb
expect 0 'in 4 clusters of rank 3' inspect clusters.glb
"$tool" bake corner.obj --max-edge 0.3 --samples 64 -o whole.glb >/dev/null 2>&1
expect 0 'clusters of rank' compress whole.glb --cpca 4,3 -o clusters2.glb
for f in clusters clusters2 whole; do expect 0 'relit' render $f.glb --env sky:elevation=30 --size 24x18 \
  --background none -o $f.exr; done
expect 0 'PSNR +([3-9][0-9])' compare clusters.exr whole.exr
expect 0 'PSNR +(inf|[6-9][0-9])' compare clusters.exr clusters2.exr
expect 1 'plain transfer' compress clusters.glb --cpca 4,3 -o x.glb
expect 1 'clusters.glb' compress clusters.glb --zonal 2 -o x.glb
expect 2 'cpca' bake corner.obj --compress cpca:0,3 -o x.glb
expect 2 'cpca' bake corner.obj --compress zip -o x.glb
expect 2 'cpca' compress whole.glb -o x.glb
# No file grows: what it was made of is gone, or nothing is written. Twice is the same, and in place of itself too.
smaller() {  # smaller NEW OLD
  [ "$(stat -c %s "$1")" -le "$(stat -c %s "$2")" ] && ok ||
    bad "$1 has $(stat -c %s "$1") bytes, $2 only $(stat -c %s "$2")"
}
smaller clusters2.glb whole.glb
expect 0 'before' compress whole.glb --zonal 2 -o lobes2.glb
smaller lobes2.glb whole.glb
grep -q "$(stat -c %s whole.glb | cut -c1-2)" stdout && ok || bad "not the file's size before: $(cat stdout)"
expect 1 'would grow.*[0-9]+ bytes, and [0-9]+' compress whole.glb --cpca 64,16 -o x.glb
expect 1 'would grow' compress whole.glb --zonal 8 --precision single -o x.glb
absent x.glb
cp whole.glb itself.glb
expect 0 'clusters' compress itself.glb --cpca 4,3 -o itself.glb
cmp -s itself.glb clusters2.glb && ok || bad "compressed in place of itself a file differs"
expect 0 'lamp group' bake corner.obj --samples 64 --light sh:3+lamps:1@$sun --fix-light $sun -o fixed.glb
expect 0 'relit' render fixed.glb --size 24x24 -o fixed.png
for thread_count in 1 2; do "$tool" bake corner.obj --max-edge 0.3 --samples 64 --light sh:4+lamps:3@$sun \
  --threads $thread_count -o threads_$thread_count.glb >/dev/null 2>&1; done
cmp -s threads_1.glb threads_2.glb && ok || bad "1 and 2 threads give different files"

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

# Zonal lobes: closer with more of them, turning with what moves; a texture of them; a membrane.
expect 0 '"rms"' compress corner.glb --zonal 4 -o lobes.glb --view-error error.png --size 40x40 --json
expect 0 'zonal lobes' inspect lobes.glb
expect 0 'relit' render lobes.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 64 \
  -o lobes.exr --background none
alike 40 "lobes and harmonics" lobes.exr a.exr
expect 0 'relit' render lobes.glb --env sky:elevation=40 --deform twist:50,y --size 40x40 -o twisted.png
expect 0 'cannot turn' render corner.glb --env sky:elevation=40 --deform bend:50,x,y --size 40x40 -o bent.png
expect 0 'lobes' bake corner.obj --max-edge 0.5 --samples 64 --transfer zonal --lobes 2 -o direct.glb
expect 0 'rows' bake corner.obj --max-edge 0.5 --samples 64 --order 5 --bounces 1 \
  --brdf cook-torrance:roughness=0.3 --transfer matrix --outgoing svd:3 --view-map 32 -o rows.glb
expect 0 '"rows": 3' compress rows.glb --zonal 3 -o glossy.glb --json
expect 0 'each of 3 rows' inspect glossy.glb
expect 0 'relit' render rows.glb --env sky:elevation=40 --camera 3,0.8,4,1,0.4,0.7,40 --size 48x32 -o rows.exr \
  --background none
expect 0 'relit' render glossy.glb --env sky:elevation=40 --camera 3,0.8,4,1,0.4,0.7,40 --size 48x32 -o glossy.exr \
  --background none
alike 35 "glossy lobes and the matrix that they stand for" glossy.exr rows.exr
expect 0 'relit' render glossy.glb --env sky:elevation=40 --deform twist:50,y --size 24x24 -o glossy.png
expect 0 'lobes' bake corner.obj --max-edge 0.5 --samples 64 --order 4 --bounces 0 --transfer zonal --lobes 2 \
  --outgoing svd:2 -o direct_glossy.glb
expect 2 'view-map: does not go with zonal transfer' bake corner.obj --transfer zonal --view-map 32 -o x.glb
expect 0 'paths' reference corner.obj --env uniform:1 --deform twist:50 --size 16x16 --spp 1 -o twisted.exr
expect 0 'membrane' bake corner.obj --membrane 0.4 -o membrane.glb
expect 0 'RMS' patch sky.png --size 8 --samples 64 --lobes 3 -o relief.lpt
expect 0 'texels' render corner.obj --transfer-texture relief.lpt --tile 2,2 --env sky:elevation=40 --size 24x24 \
  -o relief.png
expect 0 'events' bake corner.obj --subsurface marble:2 --samples 16 -o through.glb
expect 0 'lost' bake corner.obj --subsurface sigma_s=0,sigma_a=0 --samples 16 -o through.glb
expect 0 'lobes' bake corner.obj --subsurface sigma_s=3,2,1,sigma_a=0.1,g=0.5,eta=1.3 --transfer zonal --lobes 3 \
  --samples 16 -o through.glb
expect 0 'RMS' patch sky.png --size 8 --samples 64 --lobes 3 --subsurface skin:5 -o skin.lpt
expect 0 'texels' render corner.obj --transfer-texture skin.lpt --env sky:elevation=40 --size 24x24 -o skin.png
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.3\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n' >pyramid.obj
expect 0 'RMS' patch pyramid.obj --size 8 --samples 64 --lobes 3 -o pyramid.lpt
expect 0 'RMS' patch pyramid.obj --size 8 --samples 16 --subsurface sigma_s=9,8,7,sigma_a=1 -o wax.lpt
printf 'v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n' >oblong.obj
expect 1 'as wide as' patch oblong.obj -o x.lpt
expect 2 'depth' patch pyramid.obj --depth 0.2 -o x.lpt
expect 2 'subsurface' bake corner.obj --subsurface jelly -o x.glb
expect 2 'sigma_a' bake corner.obj --subsurface sigma_s=1 -o x.glb
expect 2 'subsurface' bake corner.obj --subsurface marble --transfer matrix -o x.glb
expect 2 'subsurface' bake corner.obj --subsurface marble --shadows off -o x.glb
expect 2 'subsurface' patch sky.png --subsurface marble --albedo 0.2 -o x.lpt
expect 2 'subsurface' patch sky.png --subsurface sigma_s=nan,sigma_a=1 -o x.lpt
absent x.lpt
expect 1 'corner.glb: has no animations' render corner.glb --env uniform:1 --animation walk -o x.png
expect 1 'corner.obj: has no animations' reference corner.obj --env uniform:1 --animation 0 -o x.png
expect 1 'harmonics at vertices' compress lobes.glb --zonal 2 -o x.glb
expect 1 'corner.obj' render corner.obj --transfer-texture corner.obj --env uniform:1 -o x.png
head -c 200 relief.lpt >cut.lpt
expect 1 'cut.lpt' render corner.obj --transfer-texture cut.lpt --env uniform:1 -o x.png
expect 1 'missing.png: no such file' bake corner.obj --membrane missing.png -o x.glb
expect 2 '\-\-zonal: ' compress corner.glb --zonal 0 -o x.glb
expect 2 '\-\-zonal: ' compress corner.glb --zonal 100 -o x.glb
expect 2 'lobes' bake corner.obj --lobes 4 -o x.glb
expect 2 'deform' render corner.glb --env uniform:1 --deform melt:3 -o x.png
expect 2 'animation' render corner.glb --env uniform:1 --time 1 -o x.png
expect 2 'frames' render corner.glb --env uniform:1 --animation 0 --frames 3:1 -o x.png
expect 2 'membrane' bake corner.obj --membrane 1.5 -o x.glb
expect 2 'tile' render corner.obj --transfer-texture relief.lpt --tile 1 --env uniform:1 -o x.png
# Heights of 16 bits, all within four steps of 8 bits, and the same as floats; then with one that is not a number.
base64 -d <<'B' >heights.png
iVBORw0KGgoAAAANSUhEUgAAAAQAAAAEEAAAAADcCh3hAAAALUlEQVR42mMoUy7vK48t3cpQtqriZvmsclGG8g3lTaXF5XMYSm0rLlV0lgsAABW2D0qypi
RMAAAAAElFTkSuQmCC
B
base64 -d <<'B' | gzip -d >heights.exr
H4sIAAAAAAACA4VNMU4DMRBcX1JQotQU1DRAhESqRYAEJVKEFNFhzo5iZOzT2QqBii/wB15AyQ/4CMVdctblBTgXSzlI4ZVWO7M7Mzs9PCYJAKQTqhSXxg
MpjIVTv7uA1WVVJPT11ma4tYFUP2U5N0Zo9Qc3R0YtHQnF9DM86FlfwC5sqhOaCZNJ+hLVSaH4Tc543kLNl0zMuDw3GU/tkFqhYSw1tdBt3G9nJs05V+v4
S66st037Y9hpvWhLRoLZyb8IuCNr4XuY32GSZBNy5Ht+NUe359B9VVg+lhjjJPgWtwtcftboThxWBxXGeBJ87t5ndR2WPwW6gccR3gm+4rXA5UeNda/Gar
/CGP8FtnHOPTkCAAA=
B
base64 -d <<'B' | gzip -d >nan.exr
H4sIAAAAAAACA4VNMU4DMRBcX1JQImoKahogDVSLAAlKpAgposO5cxQjY5/OVgg08AX+wAsoqWj5CMVdYuvyApyLpRyk8EqrndmdmZ0cHJEEANIxlZIJ7Y
Hg2sCx353D8rIsEvpqY9Pf2ECqHvKCac2V/IObY0YNHXCZqUcYqmmPwzasqxM64zoX9CmqE1yy6yJjRQs1X3I+ZeJM5yw1fWq4gpFQ1EC3cb+e6rRgTK7i
L5g03jbpjWCr9aItGfDMjP9FwC1ZCd/C/A6TJOuQQ9+zyxm6XYfu02J1X2GMk+Cb38xx8VEjwNeL3bcY40nwuTuf1XVY/ZToTjyO8E7wlc8lLt5rrHdqtH
sWY/wXCih0PjkCAAA=
B
for heights in png exr; do
  expect 0 'RMS' patch heights.$heights --depth 5 --size 8 --samples 256 --lobes 3 -o heights_$heights.lpt
  expect 0 'texels' render corner.obj --transfer-texture heights_$heights.lpt --env sky:elevation=40 --size 24x24 \
    -o heights_$heights.exr
done
alike 50 "heights of 16 bits and floats" heights_png.exr heights_exr.exr
expect 1 'not a finite number' patch nan.exr -o x.lpt
head -c 60 heights.png >cut.png
expect 1 'cut.png' patch cut.png -o x.lpt
printf 'P6\n1 1\n255\nabc' >one.ppm
expect 1 'one.ppm' patch one.ppm -o x.lpt
# Grooves as a table, near lamps, relief as geometry.
expect 0 'grooves' patch --groove 1 --size 6 -o groove.lpt
printf 'v 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n' >card.obj
expect 0 'grooves up to' inspect groove.lpt
expect 0 'transfer texture' inspect relief.lpt --json
expect 1 'cut.lpt' inspect cut.lpt
expect 0 'grooves' render card.obj --transfer-texture groove.lpt --tile 5,0 --groove-depth 0.5 --groove-width 0.6 \
  --groove-map sky.png --env sky:elevation=40 --size 24x24 -o grooves.png
expect 0 'texels' render card.obj --transfer-texture relief.lpt --sphere-lamp 0.5,1,-0.5,0.2,5,4,3 --size 24x24 \
  -o near.png
expect 0 'relit' render lobes.glb --sphere-lamp 3,3,3,0.5,9,9,9 --env uniform:0.1 --size 24x24 -o near.png
expect 0 'paths' reference card.obj --displace sky.png --depth 0.2 --tile 2,2 --heights 16 --env uniform:1 \
  --size 16x16 --spp 1 -o displaced.exr
expect 1 'no texture coordinates' reference corner.obj --displace sky.png --env uniform:1 --size 16x16 -o x.exr
expect 1 'no grooves' render card.obj --transfer-texture relief.lpt --groove-depth 0.5 --env uniform:1 -o x.png
expect 2 'sphere-lamp: does not go with diffuse' render corner.glb --sphere-lamp 3,3,3,0.5,9,9,9 --env uniform:1 \
  -o x.png
expect 2 'radius' render lobes.glb --sphere-lamp 3,3,3,0,9,9,9 -o x.png
expect 2 'sphere-lamp' render lobes.glb --sphere-lamp 3,3,3,nan,9,9,9 -o x.png
expect 2 'not both' patch sky.png --groove 1 -o x.lpt
expect 2 'not both' patch -o x.lpt
expect 2 'grooves' patch --groove 1 --depth 0.1 -o x.lpt
expect 2 'lobes' patch --groove 1 --lobes 2 -o x.lpt
absent x.lpt
expect 2 'depth' patch --groove nan -o x.lpt
expect 2 'precision' patch --groove 1 --precision half -o x.lpt
expect 2 'below 1' patch --groove 1 --albedo 1 -o x.lpt
expect 2 'shadows' bake corner.obj --transfer zonal --outgoing svd:2 --shadows off -o x.glb
expect 0 'what was baked is left out' render corner.glb --transfer-texture relief.lpt --env uniform:1 --size 8x8 \
  -o card.png
expect 2 'lamp: does not go with transfer textures' render card.obj --transfer-texture relief.lpt --env uniform:1 \
  --lamp x=1,1,1 -o x.png
expect 0 'paths' reference card.obj --ground --displace sky.png --heights 8 --env uniform:1 --size 8x8 --spp 1 \
  -o displaced.exr
expect 0 'paths' reference corner.obj --light-basis clusters.glb --env uniform:1 --size 8x8 --spp 1 -o basis.exr
# For NumPy, by the 6 vertices of corner.obj, of which a bake may have more: the file's header says its shape.
expect 1 'its mesh was split' export corner.glb --npy features
"$tool" bake corner.obj --samples 64 -o six.glb >/dev/null 2>&1
expect 0 ' 6 vertices, 36 numbers each' export six.glb --npy features --convention lambent
head -c 128 features/prt.npy | LC_ALL=C grep -aq "NUMPY.*'<f4'.*(6, 36)" && ok ||
  bad "features/prt.npy has another header"
expect 0 'bounce0.txt' export six.glb --npy features
[ "$(wc -lw <features/bounce/bounce0.txt | tr -s ' ')" = " 6 216" ] && ok || bad "bounce0.txt is no 6 x 36 numbers"
expect 2 'convention: must be one of' export six.glb --npy features --convention x
expect 1 'diffuse transfer of harmonics at vertices' export map.glb --npy features
# The web viewer, where it has been built: the folder is there whole or not at all, and nothing of others' is replaced.
"$tool" export corner.glb --web site >/dev/null 2>stderr
if grep -q 'scripts/web' stderr; then
  echo "skipped: export and view, since the page is not built"
  expect 1 'scripts/web' view corner.glb --no-browser
  absent site
else
  expect 0 'files' export corner.glb --web site --env uniform:1,0.5,0.25 --env sky:elevation=20 --compare open.glb \
    --reference a.exr
  cmp -s corner.glb site/data/scene.glb && [ -s site/index.html ] && [ -s site/data/environment-1.exr ] && [ \
    -s site/data/reference.exr ] && ok ||
    bad "the exported folder is not whole"
  expect 0 '"mean_luminance"' inspect site/data/environment-1.exr --json
  mkdir mine && touch mine/work
  expect 1 'mine.*left alone' export corner.glb --web mine
  expect 1 'no folder' export corner.glb --web nowhere/site
  expect 1 'corner.obj' export corner.obj --web site2
  expect 1 'nowhere.hdr' export corner.glb --web site2 --env nowhere.hdr
  expect 2 'camera' export corner.glb --web site2 --camera 1,2
  expect 1 'corner.obj' view corner.obj --no-browser
  expect 1 'nowhere.hdr' view corner.glb --env nowhere.hdr --no-browser
  expect 2 'port' view corner.glb --port 70000 --no-browser
  absent site2
  [ -z "$(ls -d site?* 2>/dev/null)" ] && ok || bad "export left a temporary: $(ls -d site?*)"
fi

# Usage: exit 2.
expect 2 'order' bake corner.obj --order 0 -o x.glb
expect 2 'order' bake corner.obj --order 1000 -o x.glb
expect 2 'samples' bake corner.obj --samples -4 -o x.glb
expect 2 'bounces' bake corner.obj --shadows off --bounces 3 -o x.glb
expect 2 'exposure: is for a PNG' render corner.glb --env uniform:1 --exposure 1 -o x.exr
expect 2 'tone: is for a PNG' render corner.glb --env uniform:1 --tone agx -o x.exr
expect 2 'exposure: must be auto or stops' render corner.glb --env uniform:1 --exposure bright -o x.png
expect 2 'tone: must be .*neutral' render corner.glb --env uniform:1 --tone bright -o x.png
expect 2 'show: must be' render corner.glb --env uniform:1 --show bounce:-1 -o x.png
expect 1 'corner.glb: .*bake --terms' render corner.glb --env uniform:1 --show bounce:1 -o x.png
expect 1 'no lamps of its own' render corner.glb --show emission -o x.png
expect 2 'camera' render corner.glb --env uniform:1 --camera 1,2,3 -o x.png
expect 2 'camera: numbers must lie within 1e9' render corner.glb --env uniform:1 --camera 1e19,2,4,1,0.5,1,40 -o x.png
expect 2 'size' render corner.glb --env uniform:1 --size 0x10 -o x.png
expect 2 'rotate' render corner.glb --env uniform:1 --env-rotate nan,0,0 -o x.png
expect 2 'window' render corner.glb --env uniform:1 --window square -o x.png
expect 2 'no reflection model' reference corner.obj --env uniform:1 --brdf glass -o x.png
expect 2 'roughness must lie' reference corner.obj --env uniform:1 --brdf ggx:roughness=7 -o x.png
for light in sh: sh:0 sh:17 sh:x sh:3x harmonics:3 directional: directional:3 directional:257 directional:-1 sh:3+ \
  sh:3+lamps sh:3+lamps: sh:3+lamps:4 sh:3+lamps:4@ sh:3+lamps:0@uniform:1 sh:3+lamps:-2@uniform:1 \
  sh:3+lamps:65@uniform:1 sh:3+lamps:x@uniform:1 sh:3+lamps:99999999999@uniform:1; do
  expect 2 '^lambent: --light: ' bake corner.obj --light "$light" -o x.glb
done
expect 2 'give one' bake corner.obj --order 3 --light sh:3 -o x.glb
expect 2 'light' bake corner.obj --transfer matrix --light directional:9 -o x.glb
expect 2 'lattice: is lit by harmonics alone' bake corner.obj --light directional:9 --lattice 2,2,2 -o x.glb
expect 2 'together' bake corner.obj --light sh:12 --lattice 2,2,2 --lattice-order 6 -o x.glb
expect 2 'simulate paths' bake corner.obj --transfer matrix --simulate paths --light sh:3+lamps:1@$sun -o x.glb
expect 2 'light: does not go with zonal transfer' bake corner.obj --transfer zonal --light directional:9 -o x.glb
expect 2 'scene: is needed' bake
expect 2 'subcommand is required' nonsense

# Files that are not what they should be: exit 1, one line that names the file.
expect 1 'missing.obj.*no such file' bake missing.obj -o x.glb
: >empty.glb
expect 1 'empty.glb' bake empty.glb -o x.glb
expect 1 'empty.glb' render empty.glb --env uniform:1 -o x.png
head -c 300 corner.glb >cut.glb
expect 1 'cut.glb' render cut.glb --env uniform:1 -o x.png
expect 1 'corner.obj' render corner.obj --env uniform:1 -o x.png
echo 'v 0 0 0' >points.obj
expect 1 'points.obj.*no triangles' bake points.obj -o x.glb
printf 'v 0 0 0\nv 1 0 0\nv nan 0 1\nf 1 2 3\n' >nan.obj
expect 1 'nan.obj: no triangles: 1 faces use vertices that are not finite' bake nan.obj -o x.glb
printf 'v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 9\n' >range.obj
expect 1 'range.obj:4' bake range.obj -o x.glb
echo '{"asset":{"version":"2.0"},"buffers":[{"uri":"../secret.bin","byteLength":12}]}' >escape.gltf
expect 1 'escape.gltf' bake escape.gltf -o x.glb
expect 1 'nowhere.hdr' render corner.glb --env nowhere.hdr -o x.png
: >empty.hdr
expect 1 'empty.hdr' render corner.glb --env empty.hdr -o x.png
expect 1 'nowhere.hdr' bake corner.obj --light sh:3+lamps:4@nowhere.hdr -o x.glb
expect 1 'empty.hdr' bake corner.obj --light sh:3+lamps:4@empty.hdr -o x.glb
expect 1 'elevation' bake corner.obj --light sh:3+lamps:4@sky:elevation=900 -o x.glb
expect 1 'corner.obj' reference corner.obj --env uniform:1 --light-basis corner.obj -o x.png
expect 1 'cut.glb' reference corner.obj --env uniform:1 --light-basis cut.glb -o x.png
expect 1 'elevation must lie in' render corner.glb --env sky:elevation=900 -o x.png
expect 1 'needs at least [0-9]+ bytes .*allowed 1000$' bake corner.obj --max-edge 0.1 --memory 1000 -o x.glb
expect 1 'no folder' bake corner.obj -o nowhere/x.glb
expect 1 'must end in' bake corner.obj -o x.obj
expect 1 'must end in' render corner.glb --env uniform:1 -o x.gif
expect 1 'differ in size: 48 x 32 and ' compare a.exr difference.png
expect 1 'nowhere.brdf.*no such file' reference corner.obj --env uniform:1 --brdf measured:nowhere.brdf -o x.png
printf '6 440 480 520 560 600 640\n0.1 0 0.2 1 1 2 3 nan 5 6\n' >nan.brdf
expect 1 'nan.brdf:2: a number is not finite' reference corner.obj --env uniform:1 --brdf measured:nan.brdf -o x.png
head -c 1000 /dev/zero >cut.binary
expect 1 'cut.binary' reference corner.obj --env uniform:1 --brdf measured:cut.binary -o x.png
# All-frequency light: visibility in blocks, three roads to one picture.
expect 0 'mixed' bake corner.obj --max-edge 0.1 --transfer blocks --cube 32 -o blocks.glb
expect 0 '"cube": 32' inspect blocks.glb --json
view=(--env sky:elevation=50,azimuth=20,sun=on --camera 3,2,4,1,0.5,1,40 --size 48x32 --background none \
  --brdf phong:exponent=20,diffuse=0.3,specular=0.4)
for method in blocks standard haar:1; do expect 0 'shaded' render blocks.glb "${view[@]}" --method $method \
  -o ${method/:/_}.exr; done
for method in blocks haar_1; do
  alike 50 "$method and the standard basis" $method.exr standard.exr
done
expect 0 'shaded' render blocks.glb "${view[@]}" --indirect sh -o indirect.png
expect 0 'frames_per_second' relight blocks.glb --env sky:elevation=50 --turntable --spin-light --frames 3 --json
expect 1 'lambent bake --transfer blocks' relight corner.glb --env uniform:1
expect 2 'method: does not go with diffuse transfer: it is for blocks' render corner.glb --env uniform:1 \
  --method haar -o x.png
expect 2 'tolerance: needs --method blocks' render blocks.glb --env uniform:1 --method haar --tolerance 0.1 -o x.png
expect 2 'window: does not go with blocks' render blocks.glb --env uniform:1 --window hann -o x.png
expect 2 '\-\-method' render blocks.glb --env uniform:1 --method wavelets -o x.png
expect 2 '\-\-visibility' bake corner.obj --transfer blocks --visibility bits:9 -o x.glb
expect 2 'cube: does not go with diffuse transfer: it is for blocks' bake corner.obj --cube 64 -o x.glb
expect 1 'more than --memory' bake corner.obj --max-edge 0.02 --transfer blocks --memory 1KB -o x.glb
absent x.glb
absent x.png

# Disk full: /dev/full cannot take a neighbour, a small file system can fill up where mounting is allowed.
mkdir small
if mount -t tmpfs -o size=64k tmpfs small 2>/dev/null; then
  expect 1 'cannot be written' bake corner.obj --max-edge 0.02 --samples 16 -o small/x.glb
  [ -z "$(ls small)" ] && ok || bad "something half-written was left on the full disk: $(ls small)"
  umount small
fi

# Interrupted: no broken file, no temporary.
"$tool" bake corner.obj --max-edge 0.01 --samples 65536 -o interrupted.glb >/dev/null 2>&1 &
pid=$!
sleep 1
kill -INT $pid 2>/dev/null
wait $pid
[ $? -eq 1 ] && ok || bad "an interrupted bake did not exit with 1"
absent interrupted.glb
[ -z "$(ls -d interrupted.glb.* 2>/dev/null | grep -vx interrupted.glb.checkpoint)" ] && ok ||
  bad "an interrupted bake left a temporary"

# While it still reads: at once, in one line.
{
  printf 'ply\nformat ascii 1.0\nelement vertex 600000\nproperty float x\nproperty float y\nproperty float z\n'
  printf 'element face 200000\nproperty list uchar int vertex_indices\nend_header\n'
  awk 'BEGIN { for (i = 0; i < 600000; ++i) print i % 3, int(i / 3) % 500, i % 7
               for (i = 0; i < 200000; ++i) print 3, 3 * i, 3 * i + 1, 3 * i + 2 }'
} >slow.ply
"$tool" inspect slow.ply >/dev/null 2>stderr &
pid=$!
sleep 0.1
kill -INT $pid 2>/dev/null
wait $pid
got=$?
# A machine may be quick enough to be done.
[ $got -eq 0 ] ||
  { [ $got -eq 1 ] && grep -qx 'lambent: cancelled' stderr && ok || bad "interrupted while reading: $got"; }

finish
