#!/usr/bin/env bash
# Bakes of every kind, killed at random moments and gone on with: the finished file has the bytes of one that ran
# through.
# usage: kill_and_resume.sh LAMBENT [MOMENTS a kind] [KIND...]
set -uo pipefail
tool=$1
moments=${2:-3}
shift; [ $# -gt 0 ] && shift
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 1
RANDOM=${SEED:-1}
failures=0
bad() { echo "FAILED: $*"; failures=$((failures + 1)); }
now() { date +%s%N; }

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
f 10 9 8 7
v 1.0 0.01 0.5
v 1.5 0.01 0.5
v 1.5 0.01 1.0
v 1.0 0.01 1.0
v 1.0 0.41 0.5
v 1.5 0.41 0.5
v 1.5 0.41 1.0
v 1.0 0.41 1.0
usemtl wall
f 11 12 13 14
f 18 17 16 15
f 11 15 16 12
f 12 16 17 13
f 13 17 18 14
f 14 18 15 11
O
glossy="--order 4 --incident-order 3 --view-map 16"
declare -A kinds=(
  [diffuse]="--max-edge 0.08 --samples 512 --bounces 4"
  [direct]="--max-edge 0.08 --samples 512 --bounces 0"
  [again]="--max-edge 0.1 --samples 512 --bounces 3 --memory 22MB --scratch off"
  [terms]="--max-edge 0.1 --samples 512 --terms"
  [lobes]="--max-edge 0.1 --samples 256 --light sh:4+lamps:2@sky:elevation=40"
  [texels]="--receivers texels --atlas 96x96 --samples 512 --bounces 2"
  [patches]="--receivers patches --max-edge 0.12 --samples 256 --bounces 2"
  [lattice]="--max-edge 0.1 --samples 1024 --lattice 8,8,8"
  [matrix]="--transfer matrix $glossy --max-edge 0.12 --samples 256 --bounces 2 --brdf ggx:roughness=0.4"
  [paths]="--transfer matrix $glossy --max-edge 0.12 --samples 128 --bounces 2 --simulate paths"
  [factors]="--transfer matrix $glossy --factors --max-edge 0.05 --samples 512 --brdf ggx:roughness=0.4"
  [zonal]="--transfer zonal --max-edge 0.2 --samples 256 --lobes 3"
  [glossy_zonal]="--transfer zonal $glossy --outgoing svd:2 --max-edge 0.2 --samples 128 --lobes 2"
  [subsurface]="--subsurface sigma_s=4,sigma_a=0.2 --max-edge 0.1 --samples 256 --bounces 2"
  [blocks]="--transfer blocks --max-edge 0.16 --cube 32"
  [lightmap]="--transfer lightmap --atlas 128x128 --samples 256 --light-groups --sky uniform:0.3 --bounces 3"
  [converge]="--transfer lightmap --atlas 96x96 --samples 256 --bounces converge:1e-4"
  [rooms]="--max-edge 0.15 --samples 128 --rooms rooms.json --rooms-error 0.0005"
  [fields]="--max-edge 0.2 --samples 4096 --order 2 --rooms rooms.json --rooms-error 0.1"
  [haar]="--light haar:16,keep=0.1 --max-edge 0.16"
  [indirect]="--transfer indirect --max-edge 0.15 --surfels 1024"
  [directional]="--transfer lightmap --atlas 96x96 --samples 128 --directional sh:2 --bounces 2"
)
echo '{"rooms": [{"name": "a", "min": [0,-1,0], "max": [1,2,2]}, {"name": "b", "min": [1,-1,0], "max": [2,2,1]},
  {"name": "c", "min": [1,-1,1], "max": [2,2,2]}]}' >rooms.json
[ $# -gt 0 ] || set -- $(printf '%s\n' "${!kinds[@]}" | sort)

total=0
resumed=0
for kind in "$@"; do
  # shellcheck disable=SC2206
  options=(${kinds[$kind]})
  began=$(now)
  "$tool" bake box.obj "${options[@]}" --checkpoint off -o whole.glb >/dev/null 2>stderr || bad "$kind: $(cat stderr)"
  took=$((($(now) - began) / 1000))  # microseconds
  for ((i = 0; i < moments; ++i)); do
    rm -rf part.*
    wait_for=$(((RANDOM * 32768 + RANDOM) % took))
    "$tool" bake box.obj "${options[@]}" --checkpoint part.checkpoint -o part.glb >/dev/null 2>stderr &
    pid=$!
    sleep "$(printf '%d.%06d' $((wait_for / 1000000)) $((wait_for % 1000000)))"
    kill -9 $pid 2>/dev/null
    wait $pid 2>/dev/null
    code=$?
    [ $code -eq 137 ] || [ $code -eq 0 ] || bad "$kind: exit $code before it was killed: $(cat stderr)"
    # Some of them twice.
    if [ $((RANDOM % 4)) -eq 0 ]; then
      "$tool" bake box.obj "${options[@]}" --checkpoint part.checkpoint -o part.glb >/dev/null 2>stderr &
      pid=$!
      sleep "$(printf '0.%06d' $((wait_for % 1000000 / 2)))"
      kill -9 $pid 2>/dev/null
      wait $pid 2>/dev/null
    fi
    if ! "$tool" bake box.obj "${options[@]}" --checkpoint part.checkpoint -o part.glb --json >stdout 2>stderr; then
      bad "$kind, killed after $wait_for us: $(cat stderr)"
      continue
    fi
    grep -q '"resumed"' stdout && resumed=$((resumed + 1))
    cmp -s whole.glb part.glb || bad "$kind, killed after $wait_for us: other bytes"
    for picture in whole.*.exr; do
      [ ! -e "$picture" ] || cmp -s "$picture" "part.${picture#whole.}" || bad "$kind: $picture differs"
    done
    [ -z "$(find . -name '*.lambent-part*' -o -name '*.checkpoint')" ] || bad "$kind: left behind: $(ls -d part.*)"
    total=$((total + 1))
  done
  rm -f whole.*
  echo "$kind: a bake of $((took / 1000)) ms, killed $moments times"
done
echo "$total bakes killed, $resumed of them went on from what they had kept; $failures failures"
[ $failures -eq 0 ] && { [ "$moments" -lt 3 ] || [ $resumed -gt 0 ]; }
