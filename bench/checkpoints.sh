#!/usr/bin/env bash
# What keeping work costs, and what it takes to go on: JSON lines. Bakes with and without a checkpoint take turns, and
# the least of ROUNDS (5) counts. KINDS: some alone.
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
scene=$data/meshes/armadillo.obj
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
TOOL=$tool ROUNDS=${ROUNDS:-5} python3 - "$scene" "$out" <<'P'
import json, os, resource, signal, subprocess, sys, time

scene, out = sys.argv[1:3]
tool, rounds = os.environ["TOOL"], int(os.environ["ROUNDS"])
kinds = {"diffuse": ["--samples", "1024"],
         "matrix": ["--transfer", "matrix", "--brdf", "ggx:roughness=0.4", "--samples", "256", "--order", "4",
                    "--incident-order", "3", "--bounces", "2"],
         "lightmap": ["--transfer", "lightmap", "--sky", "uniform:1", "--atlas", "256x256", "--samples", "512"]}

def command(options, checkpoint):
    return [tool, "bake", scene, "--ground", *options, "--checkpoint", checkpoint, "-o", out + "/x.glb", "--json"]

def bake(options, checkpoint):
    return json.loads(subprocess.run(command(options, checkpoint), check=True, capture_output=True).stdout)

for kind in os.environ.get("KINDS", " ".join(kinds)).split():
    options = kinds[kind]
    seconds = {"off": [], out + "/kept": []}
    for _ in range(rounds):
        for checkpoint in seconds:
            began, spent = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN)
            bake(options, checkpoint)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds[checkpoint].append((time.time() - began, after.ru_utime + after.ru_stime - spent.ru_utime -
                                        spent.ru_stime))
    (without, busy_without), (kept, busy) = (map(min, zip(*s)) for s in seconds.values())
    print(json.dumps({"name": "checkpoint_cost", "kind": kind, "ours": kept, "peer": without, "ratio": kept / without,
                      "ratio_of_processor_time": busy / busy_without,
                      "unit": "seconds", "peer_is": "the same bake with --checkpoint off", "aim": "<= 1.03"}),
          flush=True)

# Killed as its bounces begin, and gone on with.
options, folder = ["--samples", "1024", "--bounces", "8"], out + "/kept"
process = subprocess.Popen(command(options, folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
while not os.path.exists(folder + "/bounces.pieces"):
    time.sleep(0.001)
process.send_signal(signal.SIGKILL)
process.wait()
size = os.path.getsize(folder + "/tracing.pieces")
r = bake(options, folder)
print(json.dumps({"name": "checkpoint_resume", "ours": r["seconds"]["trace"], "bytes": size,
                  "seconds_a_gigabyte": r["seconds"]["trace"] / (size / 1e9), "unit": "seconds", "aim": "<= 2"}))
P
