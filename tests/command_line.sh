#!/usr/bin/env bash
# The command-line tool as a user meets it: exit codes, one line an error, nothing half-written, pictures that agree.
set -uo pipefail
tool=$1
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
failures=0
passed=0
ok() { passed=$((passed + 1)); }
bad() { echo "FAILED: $*"; failures=$((failures + 1)); }

# expect CODE PATTERN COMMAND...: exit code, and one line on stderr that matches.
expect() {
  local code=$1 pattern=$2
  shift 2
  "$tool" "$@" >stdout 2>stderr
  local got=$?
  [ $got -eq "$code" ] || { bad "exit $got, not $code: lambent $*: $(head -c 300 stderr)"; return; }
  if [ "$code" -ne 0 ]; then
    [ "$(wc -l <stderr)" -eq 1 ] || { bad "not one line: lambent $*: $(cat stderr)"; return; }
    [ -s stdout ] && { bad "results on stdout despite failure: lambent $*"; return; }
  fi
  grep -qE "$pattern" stderr stdout || { bad "no \"$pattern\": lambent $*: $(cat stderr)"; return; }
  ok
}
absent() { [ -e "$1" ] && bad "$1 was left behind" || ok; }

# A corner of two quads and a floor, as OBJ.
cat >corner.obj <<'O'
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
f 4 3 2 1
f 1 2 6 5
O

expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 256 -o corner.glb
expect 0 '"error"' bake corner.obj --max-edge 0.2 --samples 256 --json -o corner.glb
expect 0 '"order": 6' inspect corner.glb --json
expect 0 'vertices' inspect corner.obj
expect 0 'relit' render corner.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 256 -o a.exr --background none
expect 0 'paths' reference corner.obj --max-edge 0.2 --env uniform:1,0.5,0.25 --light-order 6 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 64 -o b.exr --background none
expect 0 'PSNR' compare a.exr b.exr -o difference.png
expect 0 '"psnr"' compare a.exr b.exr --json
psnr=$(sed -n 's/.*"psnr": \([0-9]*\).*/\1/p' stdout)
[ "${psnr:-0}" -ge 35 ] && ok || bad "baked and path-traced corners differ: PSNR ${psnr:-none}"
expect 0 'relit' render corner.glb --env sky:elevation=40,azimuth=20 --env-rotate 30,10,5 --window auto --size 40x40 -o sky.png
expect 0 '0   0' env uniform:1 --order 3 -o env.png
expect 0 '' env sky:turbidity=4 --convention three --order 3 --json
expect 0 "open.glb" bake corner.obj --shadows off -o open.glb

# Light of harmonics and lamps, and of lobes alone: the bake agrees with the reference under the same projection of the light.
sun=sky:elevation=55,azimuth=120,width=256
shot="--camera 3,2,4,1,0.5,1,40 --size 48x32 --background none"
for light in "sh:5+lamps:2@$sun" directional:16; do
  expect 0 'lobe' bake corner.obj --max-edge 0.1 --samples 1024 --light "$light" -o lamps.glb
  expect 0 'sharpness' inspect lamps.glb
  # shellcheck disable=SC2086
  expect 0 'relit' render lamps.glb --env $sun --env-rotate 20,0,0 $shot --spp 256 -o a.exr
  # shellcheck disable=SC2086
  expect 0 'paths' reference corner.obj --max-edge 0.1 --env $sun --env-rotate 20,0,0 --light-basis lamps.glb $shot --spp 256 -o b.exr
  expect 0 '"psnr"' compare a.exr b.exr --exposure -3 --json
  psnr=$(sed -n 's/.*"psnr": \([0-9]*\).*/\1/p' stdout)
  [ "${psnr:-0}" -ge 40 ] && ok || bad "baked and path-traced corners under $light differ: PSNR ${psnr:-none}"
done
expect 0 'lamps that stand out, not 64' bake corner.obj --samples 64 --bounces 0 --light sh:5+lamps:64@$sun -o lamps.glb
expect 0 'order 3,' bake corner.obj --samples 64 --light sh:3+lamps:4@uniform:1 -o lamps.glb
for thread_count in 1 2; do "$tool" bake corner.obj --max-edge 0.3 --samples 64 --light sh:4+lamps:3@$sun --threads $thread_count -o threads_$thread_count.glb >/dev/null 2>&1; done
cmp -s threads_1.glb threads_2.glb && ok || bad "1 and 2 threads give different files"

# Usage: exit 2.
expect 2 'order' bake corner.obj --order 0 -o x.glb
expect 2 'order' bake corner.obj --order 1000 -o x.glb
expect 2 'samples' bake corner.obj --samples -4 -o x.glb
expect 2 'bounces' bake corner.obj --shadows off --bounces 3 -o x.glb
expect 2 'camera' render corner.glb --env uniform:1 --camera 1,2,3 -o x.png
expect 2 'size' render corner.glb --env uniform:1 --size 0x10 -o x.png
expect 2 'rotate' render corner.glb --env uniform:1 --env-rotate nan,0,0 -o x.png
expect 2 'window' render corner.glb --env uniform:1 --window square -o x.png
for light in sh: sh:0 sh:17 sh:x sh:3x harmonics:3 directional: directional:3 directional:257 directional:-1 sh:3+ sh:3+lamps sh:3+lamps: sh:3+lamps:4 \
  sh:3+lamps:4@ sh:3+lamps:0@uniform:1 sh:3+lamps:-2@uniform:1 sh:3+lamps:65@uniform:1 sh:3+lamps:x@uniform:1 sh:3+lamps:99999999999@uniform:1; do
  expect 2 '^lambent: --light: ' bake corner.obj --light "$light" -o x.glb
done
expect 2 'give one' bake corner.obj --order 3 --light sh:3 -o x.glb
expect 2 'light' bake corner.obj --transfer matrix --light directional:9 -o x.glb
expect 2 '.' bake
expect 2 '.' nonsense

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
expect 1 'nan.obj:3' bake nan.obj -o x.glb
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
expect 1 'sky' render corner.glb --env sky:elevation=900 -o x.png
expect 1 'memory' bake corner.obj --max-edge 0.1 --memory 1000 -o x.glb
expect 1 'no folder' bake corner.obj -o nowhere/x.glb
expect 1 'must end in' bake corner.obj -o x.obj
expect 1 'must end in' render corner.glb --env uniform:1 -o x.gif
expect 1 'sizes|size' compare a.exr difference.png
expect 1 'no reflection model' reference corner.obj --env uniform:1 --brdf glass -o x.png
expect 1 'roughness must lie' reference corner.obj --env uniform:1 --brdf ggx:roughness=7 -o x.png
expect 1 'nowhere.brdf.*no such file' reference corner.obj --env uniform:1 --brdf measured:nowhere.brdf -o x.png
printf '6 440 480 520 560 600 640\n0.1 0 0.2 1 1 2 3 nan 5 6\n' >nan.brdf
expect 1 'nan.brdf:2: a number is not finite' reference corner.obj --env uniform:1 --brdf measured:nan.brdf -o x.png
head -c 1000 /dev/zero >cut.binary
expect 1 'cut.binary' reference corner.obj --env uniform:1 --brdf measured:cut.binary -o x.png
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
[ -z "$(ls interrupted.glb.* 2>/dev/null)" ] && ok || bad "an interrupted bake left a temporary"

echo "$passed passed, $failures failed"
[ $failures -eq 0 ]
