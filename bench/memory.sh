#!/usr/bin/env bash
# Peak memory of whole bakes against what --memory allows: JSON lines. The limit is that of the same bake with no
# bounces (scene and result alone, no working memory to speak of) plus --memory.
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
