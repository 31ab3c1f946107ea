#!/usr/bin/env bash
# Bakes by several processes, as a user starts them: the bytes of one, whatever their number; one that is killed ends
# the job, and any number goes on from what all have kept.
# usage: ranks.sh LAMBENT [MOMENTS] [KIND...]; the launcher is MPIRUN, or mpirun of Open MPI, or MPICH's. Exit code 77
# where there is none, or the tool is built without MPI.
set -uo pipefail
tool=$(readlink -f "$1")
moments=${2:-3}
shift; [ $# -gt 0 ] && shift
launcher=${MPIRUN:-$(command -v mpirun || command -v mpiexec.hydra)}
[ -n "$launcher" ] || { echo "no mpirun"; exit 77; }
if "$launcher" --version 2>&1 | grep -q 'Open MPI'; then
  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  start=("$launcher" --oversubscribe --bind-to none --mca btl "self,vader" --mca btl_vader_single_copy_mechanism none)
else
  start=("$launcher")
fi
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 1
RANDOM=${SEED:-1}
failures=0
passed=0
ok() { passed=$((passed + 1)); }
bad() { echo "FAILED: $*"; failures=$((failures + 1)); }
# by RANKS ARGUMENTS...
by() {
  local n=$1
  shift
  "${start[@]}" -np "$n" "$tool" "$@" </dev/null
}

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
v 1.0 -0.1 0.5
v 1.5 -0.1 0.5
v 1.5 -0.1 1.0
v 1.0 -0.1 1.0
v 1.0 0.41 0.5
v 1.5 0.41 0.5
v 1.5 0.41 1.0
v 1.0 0.41 1.0
usemtl wall
f 4 3 2 1
f 1 2 6 5
f 18 17 16 15
f 11 15 16 12
f 12 16 17 13
f 13 17 18 14
f 14 18 15 11
usemtl lamp
f 7 8 9 10
f 10 9 8 7
O
by 1 bake box.obj --samples 16 -o x.glb >/dev/null 2>stderr || { cat stderr; exit 1; }
by 2 bake box.obj --samples 16 -o x.glb >/dev/null 2>stderr ||
  { grep -q 'built without MPI' stderr && echo "built without MPI" && exit 77; cat stderr; exit 1; }

glossy="--order 3 --incident-order 3 --view-map 16 --brdf ggx:roughness=0.4"
declare -A kinds=(
  [default]="--order 4 --max-edge 0.3 --error 10%"
  [diffuse]="--max-edge 0.07 --samples 64 --bounces 2"
  [again]="--max-edge 0.09 --samples 64 --bounces 2 --memory 12MB --scratch off"
  [terms]="--max-edge 0.1 --samples 64 --terms --light sh:3+lamps:2@sky:elevation=40"
  [texels]="--receivers texels --atlas 64x64 --samples 64 --bounces 2"
  [lattice]="--max-edge 0.15 --samples 64 --lattice 6,6,6 --compress cpca:8,2"
  [matrix]="--transfer matrix $glossy --max-edge 0.12 --samples 32 --bounces 2"
  [paths]="--transfer matrix $glossy --max-edge 0.15 --samples 16 --bounces 1 --simulate paths"
  [zonal]="--transfer zonal --order 4 --max-edge 0.2 --samples 32 --lobes 2"
  [glossy_zonal]="--transfer zonal $glossy --outgoing svd:2 --max-edge 0.25 --samples 16 --lobes 1"
  [blocks]="--transfer blocks --max-edge 0.12 --cube 16"
  [lightmap]="--transfer lightmap --atlas 96x96 --samples 32 --light-groups --sky uniform:0.3 --bounces 2"
  [converge]="--transfer lightmap --atlas 64x64 --samples 32 --bounces converge:1e-3"
  [seidel]="--transfer lightmap --atlas 64x64 --samples 32 --bounces converge:1e-3 --solver gauss-seidel"
  [directional]="--transfer lightmap --atlas 64x64 --samples 32 --directional sh:2 --bounces 2"
  [view]="--max-edge 0.2 --samples 32 --fix-view auto --size 48x32 --spp 4"
  [rooms]="--max-edge 0.2 --samples 64 --rooms rooms.json --rooms-error 0.001"
  [fields]="--max-edge 0.2 --samples 4096 --order 2 --rooms rooms.json --rooms-error 0.1"
  [alone]="--transfer lightmap --atlas 32x32 --samples 32 --bounces converge:1e-2 --solver southwell"
)
echo '{"rooms": [{"name": "a", "min": [0,-1,0], "max": [0.7,2,2]}, {"name": "b", "min": [0.7,-1,0], "max": [1.3,2,0.7]},
  {"name": "c", "min": [0.7,-1,0.7], "max": [1.3,2,2]}, {"name": "d", "min": [1.3,-1,0], "max": [2,2,2]}]}' >rooms.json
[ $# -gt 0 ] || set -- $(printf '%s\n' "${!kinds[@]}" | sort)
counts=(2 3 5)
turn=0
for kind in "$@"; do
  # shellcheck disable=SC2206
  options=(${kinds[$kind]})
  "$tool" bake box.obj "${options[@]}" -o one.glb >/dev/null 2>stderr || { bad "$kind: $(cat stderr)"; continue; }
  n=${counts[$((turn++ % 3))]}
  case $kind in default | diffuse) several="2 3 5" ;; *) several=$n ;; esac
  for n in $several; do
    rm -f many.*
    by "$n" bake box.obj "${options[@]}" --threads $((n % 2 + 1)) --json -o many.glb >stdout 2>stderr ||
      { bad "$kind by $n ranks: $(cat stderr)"; continue; }
    cmp -s one.glb many.glb && ok || bad "$kind by $n ranks: other bytes"
    for picture in one.*.exr; do
      [ ! -e "$picture" ] || cmp -s "$picture" "many.${picture#one.}" || bad "$kind by $n ranks: $picture differs"
    done
    [ "$(grep -c '"receivers"' stdout)" -eq 1 ] && ok || bad "$kind: not one rank alone speaks"
    if [ "$kind" = alone ]; then grep -q 'by rank 0 alone' stderr && ok || bad "$kind: not said"
    else grep -q "\"count\": $n" stdout && ok || bad "$kind: no count of ranks"; fi
  done
  rm -f one.*
done

# Errors are said once; other commands are refused.
by 2 bake no_such.obj -o y.glb >stdout 2>stderr
[ $? -eq 1 ] && [ "$(grep -c '^lambent:' stderr)" -eq 1 ] && grep -q 'no_such.obj' stderr && ok ||
  bad "a scene that is not there: $(cat stderr)"
by 2 inspect box.obj >stdout 2>stderr
[ $? -ne 0 ] && [ "$(grep -c '^lambent:.*only bake' stderr)" -eq 1 ] && ok || bad "inspect by ranks: $(cat stderr)"

# A rank is killed, or the whole job interrupted, at some moment after all have begun to keep work; then fewer ranks, or
# none, go on. Kept pieces are waited for, since the machine's pace is not known: a job that ends before that is done
# again with more rays.
options=(--max-edge 0.06 --bounces 3)
samples=1024
kept() { [ "$(find part.checkpoint -name '*.pieces' -size +0 2>/dev/null | wc -l)" -ge 3 ]; }
whole() {
  "$tool" bake box.obj "${options[@]}" --samples $samples -o whole.glb >/dev/null 2>stderr || bad "$(cat stderr)"
}
whole
resumed=0
for ((i = 0; i < moments; ++i)); do
  rm -rf part.*
  by 3 bake box.obj "${options[@]}" --samples $samples --threads 1 --checkpoint part.checkpoint -o part.glb \
    >stdout 2>stderr &
  job=$!
  until kept || ! kill -0 $job 2>/dev/null; do sleep 0.01; done
  ms=$((RANDOM % 500))
  sleep "$(printf '0.%03d' $ms)"
  # Those of this job: the launcher's, or their launcher's, children.
  ranks=($(for p in $(pgrep -f -- "part.checkpoint -o part.glb"); do
    [ "$(readlink "/proc/$p/exe")" = "$tool" ] && [ "$(readlink "/proc/$p/cwd")" = "$dir" ] && echo "$p"
  done))
  how="a rank killed"
  if [ $((i % 3)) -eq 2 ]; then how="interrupted" && pkill -INT -P $job
  elif [ ${#ranks[@]} -gt 0 ]; then kill -9 "${ranks[$((RANDOM % ${#ranks[@]}))]}" 2>/dev/null; fi
  wait $job
  code=$?
  if [ $code -eq 0 ] && [ $samples -lt 100000 ]; then
    samples=$((samples * 2)) i=$((i - 1))
    whole
    continue
  fi
  if [ -e part.glb ]; then  # the file may be whole by the time that its last writer is killed
    cmp -s part.glb whole.glb || bad "$how: exit $code, and half a file is there"
    expected=any
  else
    expected=resumed
  fi
  on=("$tool")  # or two ranks, or five
  [ $((i % 3)) -eq 0 ] || on=(by $((i % 3 * 3 - 1)))
  "${on[@]}" bake box.obj "${options[@]}" --samples $samples --checkpoint part.checkpoint -o part.glb --json \
    >stdout 2>stderr || { bad "$how after $ms ms (exit $code), going on: $(cat stderr)"; continue; }
  if grep -q '"resumed"' stdout; then resumed=$((resumed + 1)); [ $expected = any ] || ok
  elif [ $expected = resumed ]; then bad "$how after $ms ms: what was kept was not taken up"; fi
  cmp -s whole.glb part.glb && ok || bad "$how after $ms ms: other bytes"
  [ -z "$(find . -name '*.lambent-part*' -o -name '*.checkpoint')" ] && ok || bad "$how: left behind: $(ls)"
done
echo "$passed passed, $failures failed; $resumed of $moments jobs went on from what was kept"
[ $failures -eq 0 ]
