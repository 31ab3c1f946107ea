#!/usr/bin/env bash
# Other columns and stores on the command line: lobes and lamps, factors, fixed views, clusters, blocks.
set -uo pipefail
source "$(dirname "$0")/expect.sh"
expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 64 -o corner.glb

# Light of harmonics and lamps, and of lobes alone: the bake agrees with the reference under the same projection of the
# light.
sun=sky:elevation=55,azimuth=120,width=256
shot="--camera 3,2,4,1,0.5,1,40 --size 48x32 --background none"
for light in "sh:5+lamps:2@$sun" directional:16 compact:16 steerable:4; do
  none=()
  [ $light = steerable:4 ] && none=(--window none)
  expect 0 'lobe' bake corner.obj --max-edge 0.1 --samples 1024 --light "$light" -o lamps.glb
  expect 0 '(sharpness|turned copy about)' inspect lamps.glb
  # shellcheck disable=SC2086
  expect 0 'relit' render lamps.glb --env $sun --env-rotate 20,0,0 "${none[@]}" $shot --spp 256 -o lamps_lit.exr
  # shellcheck disable=SC2086
  expect 0 'paths' reference corner.obj --max-edge 0.1 --env $sun --env-rotate 20,0,0 --light-basis lamps.glb $shot \
    --spp 256 -o lamps_truth.exr
  alike 40 "baked and path-traced corners under $light" lamps_lit.exr lamps_truth.exr --exposure -3
done
# Turned copies of one lobe are harmonics in other words, and turn as they do; lobes that stand still do not.
for light in sh:4 steerable:4 compact:16; do
  none=(--window none)
  [ $light = compact:16 ] && none=()
  expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 256 --denoise off --precision single --light $light \
    -o ${light%:*}.glb
  # shellcheck disable=SC2086
  expect 0 'relit' render ${light%:*}.glb --env $sun --env-rotate 75,20,-40 "${none[@]}" $shot -o ${light%:*}_turned.exr
done
alike 90 "steerable lobes and harmonics" steerable_turned.exr sh_turned.exr --exposure -3
for light in sh steerable; do  # neither rings if nothing is said
  # shellcheck disable=SC2086
  expect 0 'relit' render $light.glb --env $sun --env-rotate 75,20,-40 $shot -o ${light}_held.exr
done
alike 90 "steerable lobes and harmonics without ringing" steerable_held.exr sh_held.exr --exposure -3
# shellcheck disable=SC2086
expect 0 ' 0\.0 % darker than black' render steerable.glb --env $sun --env-rotate 75,20,-40 $shot -o steerable_held.png
expect 0 '16 compact lobes' inspect compact.glb
expect 0 '"lobe_kind": "band_limited"' inspect steerable.glb --json
expect 0 'of 4 bands' inspect steerable.glb
expect 2 'window: of steerable lobes is auto or none' render steerable.glb --env $sun --window hann -o x.png
expect 2 'window: shapes harmonics' render compact.glb --env $sun --window none -o x.png
expect 2 'light-order: counts bands' render compact.glb --env $sun --light-order 2 -o x.png
# The page draws them, where it has been built.
if "$tool" export compact.glb --web site_lobes >/dev/null 2>stderr || grep -q 'scripts/web' stderr; then ok; else
  bad "the page refuses lobes of light: $(cat stderr)"
fi
expect 2 'lattice: is lit by harmonics alone' bake corner.obj --light compact:16 --lattice 2,2,2 -o x.glb
expect 2 'subsurface: is of harmonics alone' bake corner.obj --light steerable:3 --subsurface marble -o x.glb
expect 2 'light: lobes without harmonics' bake corner.obj --light steerable:3 --transfer matrix -o x.glb
for light in compact: compact:9 compact:257 compact:x steerable steerable:0 steerable:17 steerable:2.5; do
  expect 2 '^lambent: --light: ' bake corner.obj --light $light -o x.glb
done
expect 2 'env: is needed' render lamps.glb -o x.png
expect 0 'lamps? that stands? out, not 64' bake corner.obj --samples 64 --bounces 0 --light sh:5+lamps:64@$sun \
  -o lamps.glb
expect 0 'order 3,' bake corner.obj --samples 64 --light sh:3+lamps:4@uniform:1 -o lamps.glb
# Lamps that move, and what is lost; lobes along their way; in free space.
expect 0 'order 3 and 2 lobes' bake corner.obj --samples 64 --lattice 2,2,2 \
  --light sh:3+lamps:1@$sun+lamps:1@$sun+lamps:1@sky:elevation=55,azimuth=150,width=256 -o lamps.glb
expect 0 'held +[0-9.]+ % of the light' render lamps.glb --env $sun --size 8x8 -o moved.png
expect 0 'lamp 1 by [0-9.]+ degrees, .* of its energy held: [0-9.]+ % of the light is lost' render lamps.glb \
  --env $sun --move 1@150,55 --size 8x8 -o moved.png
expect 0 '"lost"' render lamps.glb --env $sun --move '1@0:120,55;1:150,55' --frames 0:1:0.5 --size 8x8 \
  -o moved.png --json
expect 0 'relit' render lamps.glb --env $sun --insert corner.obj@1,0.1,1,0.2 --size 8x8 -o moved.png
expect 2 'move: there is no lamp 3 but 2' render lamps.glb --env $sun --move 3@150,55 -o x.png
expect 2 'move: needs lamps beside harmonics' render compact.glb --env $sun --move 1@150,55 -o x.png
expect 2 'move: .*lamps:COUNT@ENV' render sh.glb --env $sun --move 1@150,55 -o x.png
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
# Outgoing light in compact lobes: near what the map draws, which is what they are fitted to, and the nearer the more.
expect 0 'rows' bake corner.obj --max-edge 0.5 --samples 64 --transfer matrix --brdf ggx:roughness=0.5 --order 3 \
  --incident-order 3 --bounces 0 --outgoing directional:64 -o lobes_out.glb
expect 0 'outgoing directional, 64 lobes' inspect lobes_out.glb
expect 0 'relit' render lobes_out.glb --env sky:elevation=30 --size 24x18 --background none -o lobes_out.exr
expect 0 'relit' render whole.glb --env sky:elevation=30 --size 24x18 --background none -o whole_out.exr
alike 35 "a last reflection in compact lobes and by the map" lobes_out.exr whole_out.exr --exposure -3
expect 1 'last reflection of compact lobes, which the web page' export lobes_out.glb --web site_out
expect 1 'brdf needs a bake that kept incident light' render lobes_out.glb --env sky:elevation=30 \
  --brdf ggx:roughness=0.2 -o x.png
for outgoing in directional:3 directional:129 directional:8.5 directional:x; do
  expect 2 '^lambent: --outgoing: ' bake corner.obj --transfer matrix --outgoing $outgoing -o x.glb
done
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
expect 0 'paths' reference corner.obj --light-basis clusters.glb --env uniform:1 --size 8x8 --spp 1 -o basis.exr

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
printf '{"baked": "blocks.glb", "env": "sky:elevation=50"}' >loop.json
expect 0 'frames_per_second' relight --request loop.json --frames 2 --json
expect 2 'baked: is needed' relight --env uniform:1
expect 1 'lambent bake --transfer blocks' relight corner.glb --env uniform:1
expect 2 'method: does not go with diffuse transfer: it is for blocks' render corner.glb --env uniform:1 \
  --method haar -o x.png
expect 2 'terms: does not go with blocks: it is for fixed views and wavelets' \
  render blocks.glb --env uniform:1 --terms 50 -o x.png
expect 2 'tolerance: needs --method blocks' render blocks.glb --env uniform:1 --method haar --tolerance 0.1 -o x.png
expect 2 'window: does not go with blocks' render blocks.glb --env uniform:1 --window hann -o x.png
expect 2 '\-\-method' render blocks.glb --env uniform:1 --method wavelets -o x.png
expect 2 '\-\-visibility' bake corner.obj --transfer blocks --visibility bits:9 -o x.glb
expect 2 'cube: does not go with diffuse transfer: it is for blocks' bake corner.obj --cube 64 -o x.glb
expect 1 'more than --memory' bake corner.obj --max-edge 0.02 --transfer blocks --memory 1KB -o x.glb

# Transfer in Haar wavelets by column: few terms of the light, all of them, and texels.
expect 0 'wavelets' bake corner.obj --max-edge 0.1 --light haar:32,error=0.01 --visibility binary \
  -o haar.glb
[ -z "${LAMBENT_COARSE:-}" ] && size=32 || size=16  # as coarse() bakes it
expect 0 "Haar wavelets of a cube of $size" inspect haar.glb
view=(--env sky:elevation=50,azimuth=20,sun=on --camera 3,2,4,1,0.5,1,40 --size 48x32 --background none)
expect 0 '50 wavelets of the light' render haar.glb "${view[@]}" --terms 50 -o few.exr
expect 0 'bytes_read' render haar.glb "${view[@]}" -o all.exr --json
expect 0 'shaded' render blocks.glb "${view[@]}" --brdf diffuse --method standard -o by_texels.exr
alike 35 "all wavelets and the standard basis" all.exr by_texels.exr
alike 25 "few wavelets and all" few.exr all.exr
expect 0 'texels' bake corner.obj --light haar:16,keep=0.1 --receivers texels --atlas 64x64 -o haar_texels.glb
expect 0 'wavelets of the light' render haar_texels.glb "${view[@]}" -o haar_texels.png
expect 2 'a cube of 16, 32' bake corner.obj --light haar:48 -o x.glb
expect 2 'keep=FRACTION below 1' bake corner.obj --light haar:32,keep=2 -o x.glb
expect 2 'haar is of diffuse transfer' bake corner.obj --light haar:32 --transfer matrix -o x.glb
# With bounces, against the path tracer: a floor under a red wall.
printf '%s\n' 'newmtl red' 'Kd 0.8 0.15 0.1' 'newmtl grey' 'Kd 0.6 0.6 0.6' >red.mtl
{
  echo 'mtllib red.mtl'
  grep '^v ' corner.obj
  printf '%s\n' 'usemtl grey' 'f 4 3 2 1' 'usemtl red' 'f 1 2 6 5'
} >red.obj
sky=sky:elevation=40,azimuth=60,width=256
expect 0 'wavelets' bake red.obj --max-edge 0.2 --light haar:32 --bounces 2 --samples 512 -o haar_bounced.glb
expect 0 '3 channels' inspect haar_bounced.glb
# shellcheck disable=SC2086
expect 0 'wavelets of the light' render haar_bounced.glb --env $sky $shot --spp 16 -o haar_bounced.exr
# shellcheck disable=SC2086
expect 0 'paths' reference red.obj --max-edge 0.2 --env $sky --bounces 2 $shot --spp 256 -o haar_truth.exr
alike 36 "wavelets that bounced and the path tracer" haar_bounced.exr haar_truth.exr --exposure -2
expect 2 'samples: is of the rays that bounce' bake corner.obj --light haar:32 --samples 64 -o x.glb
expect 2 'seed: is of the rays that bounce' bake corner.obj --light haar:32 --bounces 0 --seed 2 -o x.glb
# Pixels in wavelets: the picture that the receivers' make, few terms too, and with bounces.
expect 0 'a pixel' bake corner.obj --max-edge 0.1 --light haar:32,error=0.001 --visibility binary \
  --fix-view 3,2,4,1,0.5,1,40 --size 48x32 --spp 16 -o haar_view.glb
expect 0 'fixed view of 48 x 32' inspect haar_view.glb
# Said before they are traced, by what a few receivers keep.
expect 2 'size: 4000x4000 pixels in wavelets would take about' bake corner.obj --max-edge 0.1 --light haar:64,keep=0.1 \
  --fix-view 3,2,4,1,0.5,1,20 --size 4000x4000 -o x.glb
absent x.glb
expect 0 ' a pixel, .* 1,536 pixels' inspect haar_view.glb
expect 0 'bytes_read' render haar_view.glb --env sky:elevation=50,azimuth=20,sun=on --background none \
  -o haar_view.exr --json
expect 0 'shaded' render blocks.glb "${view[@]}" --brdf diffuse --method standard --spp 16 -o by_texels.exr
alike 45 "pixels' wavelets and the standard basis" haar_view.exr by_texels.exr
expect 0 '50 wavelets of the light' render haar_view.glb --env sky:elevation=50,azimuth=20,sun=on \
  --background none --terms 50 -o haar_view_few.exr
alike 25 "few wavelets of pixels and all" haar_view_few.exr haar_view.exr
expect 0 'a pixel' bake red.obj --max-edge 0.2 --light haar:32 --bounces 2 --samples 512 --memory 20MB \
  --fix-view 3,2,4,1,0.5,1,40 --size 48x32 --spp 16 -o haar_view_bounced.glb
# shellcheck disable=SC2086
expect 0 'wavelets of the light' render haar_view_bounced.glb --env $sky --background none -o haar_view_bounced.exr
alike 36 "pixels' wavelets that bounced and the path tracer" haar_view_bounced.exr haar_truth.exr --exposure -2
expect 2 'terms: counts wavelets' render view.glb --env uniform:1 --terms 5 -o x.png
expect 2 'light-order' render haar_view.glb --env uniform:1 --light-order 2 -o x.png
expect 2 'window: does not go with wavelets' render haar.glb --env uniform:1 --window hann -o x.png
expect 2 'env: is needed' render haar.glb -o x.png
expect 1 'holds transfer in wavelets' compress haar.glb --zonal 2 -o x.glb
absent x.glb
absent x.png
finish
