#!/usr/bin/env bash
# Peak memory of whole bakes against what --memory allows: JSON lines. The limit is that of the same bake with no
# bounces (scene and result alone, no working memory to speak of) plus --memory. KINDS=rooms: buildings alone;
# KINDS=ranks: a bake by one, two and four processes alone.
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
scene=$data/meshes/armadillo.obj
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
peak() {  # peak resident bytes of a command, its result to $out/result.json
  python3 - "$@" <<'P'
import resource, subprocess, sys
subprocess.run(sys.argv[2:], stdout=open(sys.argv[1], "w"), check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024)
P
}
if [ -z "${KINDS:-}" ]; then
  base=$(peak "$out/result.json" $tool bake "$scene" --ground --bounces 0 --samples 256 -o "$out/a.glb" --json)
  for memory in 150000000 300000000 1000000000; do
    used=$(peak "$out/result.json" $tool bake "$scene" --ground --bounces 3 --samples 256 --memory $memory \
      -o "$out/a.glb" --json)
    python3 - $used $base $memory "$out/result.json" <<'P'
import json, sys
used, base, memory = map(int, sys.argv[1:4])
r = json.load(open(sys.argv[4]))
print(json.dumps({"name": "bake_memory", "ours": used, "limit": base + memory, "ratio": used / (base + memory),
                  "unit": "bytes",
                  "limit_is": "scene and result, plus --memory", "memory": memory, "operator_kept": r["operator_kept"],
                  "aim": "<= 1"}))
P
  done
fi

launcher=${MPIRUN:-$(command -v mpirun || command -v mpiexec.hydra || true)}
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
flags=()
[ -n "$launcher" ] && "$launcher" --version 2>&1 | grep -q 'Open MPI' && flags=(--oversubscribe --bind-to none)
python3 "$(dirname "$0")/made_building.py" 6 "$out/building.obj"
# The most that any of one, two and four processes has. Two sizes: what each has beside receivers drops out.
if [ "${KINDS:-}" != rooms ] && [ -n "$launcher" ]; then
  for edge in 0.4 "${EDGE:-0.2}"; do
    for ranks in 1 2 4; do
      bytes=$(peak "$out/result.json" "$launcher" "${flags[@]}" -np $ranks "$tool" --threads 1 bake \
        "$out/building.obj" --max-edge "$edge" --order 6 --samples "${SAMPLES:-64}" --checkpoint off \
        -o "$out/r.glb" --json)
      python3 - "$bytes" $ranks "$out/result.json" <<'P'
import json, sys
r, ranks = json.load(open(sys.argv[3])), int(sys.argv[2])
print(json.dumps({"name": "ranks_memory_peak", "ranks": ranks, "ours": int(sys.argv[1]),
                  "unit": "bytes of any process", "receivers": r["receivers"],
                  "operator": r["operator_bytes"] / ranks, "result": r["bytes"]}))
P
    done
  done
fi
[ "${KINDS:-}" != ranks ] || exit 0

# Buildings room by room, by one process and by RANKS (4): the most that any process of each bake has, beside a bake of
# the whole. SAMPLES (64) rays a receiver.
for building in "$data/meshes/zdm2_level.glb" "$out/building.obj --max-edge 0.2"; do
  # shellcheck disable=SC2206
  bake=("$tool" bake $building --order 3 --samples "${SAMPLES:-64}" -o "$out/l.glb" --json)
  by_rooms=("${bake[@]}" --rooms auto)
  whole=$(peak "$out/result.json" "${bake[@]}" --denoise off --bounces 8)
  rooms=$(peak "$out/result.json" "${by_rooms[@]}")
  ranks=0
  [ -z "$launcher" ] || ranks=$(peak "$out/ranks.json" "$launcher" "${flags[@]}" -np "${RANKS:-4}" "${by_rooms[@]}")
  python3 - "$whole" "$rooms" "$ranks" "$out/result.json" "$(basename "${building%% *}")" <<'P'
import json, sys
whole, rooms, ranks = map(int, sys.argv[1:4])
r = json.load(open(sys.argv[4]))
print(json.dumps({"name": "rooms_memory", "scene": sys.argv[5], "ours": rooms, "limit": whole, "ratio": rooms / whole,
                  "of_a_rank": ranks, "unit": "bytes", "limit_is": "a bake of the whole", "receivers": r["receivers"],
                  "aim": "< 1", "rooms": r["rooms"]}))
P
done
