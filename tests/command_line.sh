#!/usr/bin/env bash
# The command-line tool as a user meets it: exit codes, one line an error, nothing half-written, pictures that agree.
set -uo pipefail
source "$(dirname "$0")/expect.sh"

expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 256 -o corner.glb
expect 0 '"error"' bake corner.obj --max-edge 0.2 --samples 256 --json -o corner.glb
expect 0 '"time": 90' bake corner.obj --time 1.5min --dry-run --json
expect 2 'parsecs unit not recognized' bake corner.obj --time 5parsecs -o x.glb
expect 2 'parsecs unit not recognized' check corner.obj --time 5parsecs --env uniform:1 -o x.html
expect 0 '"order": 6' inspect corner.glb --json
expect 0 'vertices' inspect corner.obj
expect 0 '"scale"' inspect corner.glb --view-error view_error.png --camera 3,2,4,1,0.5,1,40 --size 64x48 --json
expect 2 'needs a baked file' inspect corner.obj --view-error view_error.png
expect 0 'relit' render corner.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 256 -o a.exr \
  --background none
expect 0 'paths' reference corner.obj --max-edge 0.2 --env uniform:1,0.5,0.25 --light-order 6 \
  --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 64 -o b.exr --background none
expect 0 'PSNR' compare a.exr b.exr -o difference.png
figure='([0-9.]+|inf)'
says="without noise $figure dB \($figure to $figure; $figure by the display.s slope\)"
expect 0 "$says; the references. own allows inf dB" \
  compare a.exr b.exr --half b.exr
expect 0 '"without_noise"' compare a.exr b.exr --half b.exr --json
expect 1 'is not like b.exr' compare a.exr b.exr --half difference.png
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
# So do requests to draw.
printf '{"baked": "corner.glb", "env": "uniform:1", "size": "16x16", "spp": 1, "output": "asked.png"}' >draw.json
expect 0 'relit' render --request draw.json
expect 0 'relit' render corner.glb --env uniform:1 --size 16x16 --spp 1 -o said.png
cmp -s asked.png said.png && ok || bad "a request in JSON draws another picture than the options"
expect 0 'relit' render --request draw.json --show albedo -o over.png
cmp -s asked.png over.png && bad "options do not go over the request" || ok
printf '{"baked": "corner.glb", "windows": "none"}' >wrong.json
expect 1 'wrong.json: "windows" is no field' render --request wrong.json -o x.png
printf '[]' >wrong.json
expect 1 'wrong.json: the request is not a JSON object' render --request wrong.json -o x.png
expect 1 'none.json.*no such file' render --request none.json -o x.png
expect 2 'baked: is needed' render --env uniform:1 -o x.png
expect 2 'output: is needed' render corner.glb --env uniform:1
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

# For NumPy, by the 6 vertices of corner.obj, of which a bake may have more: the file's header says its shape.
expect 1 'its mesh was split' export corner.glb --npy features
"$tool" bake corner.obj --samples 64 -o six.glb >/dev/null 2>&1
expect 0 ' 6 vertices, 36 numbers each' export six.glb --npy features --convention lambent
head -c 128 features/prt.npy | LC_ALL=C grep -aq "NUMPY.*'<f4'.*(6, 36)" && ok ||
  bad "features/prt.npy has another header"
expect 0 'bounce0.txt' export six.glb --npy features
[ "$(wc -lw <features/bounce/bounce0.txt | tr -s ' ')" = " 6 216" ] && ok || bad "bounce0.txt is no 6 x 36 numbers"
expect 2 'convention: must be one of' export six.glb --npy features --convention x
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
expect 2 'simulate paths' bake corner.obj --transfer matrix --simulate paths --light sh:3+lamps:1@sky:elevation=55 \
  -o x.glb
expect 2 'light: does not go with lightmaps.* --receivers texels' bake corner.obj --transfer lightmap \
  --light sh:3+lamps:1@sky:elevation=55 -o x.glb
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

# Disk full: /dev/full cannot take a neighbour, a small file system can fill up where mounting is allowed.
mkdir small
if mount -t tmpfs -o size=32k tmpfs small 2>/dev/null; then
  expect 1 'cannot be written' bake corner.obj --max-edge 0.2 --samples 16 -o small/x.glb
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
