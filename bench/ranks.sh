#!/usr/bin/env bash
# Processes that bake together, over MPI: JSON lines. Two ranks of one thread beside one process of two threads, in
# turns, the least of ROUNDS (3); what goes between 2 to MOST (5) ranks; and from both a model of more of them on a
# network. A scene whose operator two ranks can keep, and one process of the same --memory cannot. RAYS (512) a
# receiver; KINDS: those whose rate is measured.
source "$(dirname "$0")/common.sh"
launcher=${MPIRUN:-$(command -v mpirun || command -v mpiexec.hydra || true)}
[ -n "$launcher" ] || { echo "skipped: no mpirun" >&2; exit 0; }
[ -d "$data/meshes" ] || { echo "skipped: no folder $data" >&2; exit 0; }
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
TOOL=$tool ROUNDS=${ROUNDS:-3} MOST=${MOST:-5} python3 - "$launcher" "$data/meshes/armadillo.obj" "$out" <<'P'
import json, math, os, resource, subprocess, sys, time

launcher, scene, out = sys.argv[1:4]
rays = os.environ.get("RAYS", "512")
tool, rounds, most = os.environ["TOOL"], int(os.environ["ROUNDS"]), int(os.environ["MOST"])
is_open_mpi = b"Open MPI" in subprocess.run([launcher, "--version"], capture_output=True).stdout
flags = ["--oversubscribe", "--bind-to", "none"] if is_open_mpi else []

def tell(name, **more):
    print(json.dumps({"name": name, **more}), flush=True)

def bake(ranks, threads, options, path):
    start = [launcher, *flags, "-np", str(ranks)] if ranks else []
    began, spent = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*start, tool, "--threads", str(threads), "bake", path, *options, "--checkpoint", "off", "-o",
                           out + "/x.glb", "--json"], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    said = json.loads(done.stdout)
    said["wall"] = time.time() - began
    said["busy"] = after.ru_utime + after.ru_stime - spent.ru_utime - spent.ru_stime
    said["work"] = said["seconds"]["trace"] + said["seconds"]["bounce"]
    return said

# A room of many boxes, where all is seen from everywhere, refined.
def room(path):
    with open(path, "w") as f:
        f.write("o room\n")
        count = 0
        def box(a, b, inwards):
            nonlocal count
            for z in (a[2], b[2]):
                for y in (a[1], b[1]):
                    for x in (a[0], b[0]):
                        f.write(f"v {x} {y} {z}\n")
            for q in ((1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)):
                f.write("f " + " ".join(str(count + i) for i in (reversed(q) if inwards else q)) + "\n")
            count += 8
        box((0, 0, 0), (10, 3, 10), True)
        for i in range(4):
            for j in range(4):
                box((1 + 2.2 * i, 0, 1 + 2.2 * j), (1.8 + 2.2 * i, 0.4 + 0.5 * ((i + j) % 3), 1.8 + 2.2 * j), False)

made = out + "/room.obj"
room(made)
kinds = {"diffuse": (scene, ["--ground", "--samples", rays, "--bounces", "3"]),
         "room": (made, ["--max-edge", "0.12", "--samples", rays, "--bounces", "3"]),
         "matrix": (scene, ["--ground", "--transfer", "matrix", "--brdf", "ggx:roughness=0.4", "--samples", "64",
                            "--order", "4", "--incident-order", "3", "--bounces", "2"]),
         "lightmap": (scene, ["--ground", "--transfer", "lightmap", "--sky", "uniform:1", "--atlas", "256x256",
                              "--samples", "256"])}
for kind in os.environ.get("KINDS", " ".join(kinds)).split():
    path, options = kinds[kind]
    one, two = [], []
    for _ in range(rounds):
        one.append(bake(0, 2, options, path))
        two.append(bake(2, 1, options, path))
    ours, peer = (min(s["work"] for s in several) for several in (two, one))
    tell("ranks_rate", kind=kind, ours=ours, peer=peer, ratio=peer / ours, unit="seconds of tracing and bounces",
         ratio_of_wall=min(s["wall"] for s in one) / min(s["wall"] for s in two),
         ratio_of_processor_time=min(s["busy"] for s in one) / min(s["busy"] for s in two),
         peer_is="one process of two threads", aim=">= 0.95 of its rate")

# What comes from others, of a receiver: a bounce's rows, and all there is (results, gathered for all). Where all ask
# for all it is a row, or a few, from each of the others.
for kind in ("diffuse", "room"):
    path, options = kinds[kind]
    alone = bake(0, 1, options, path)
    n, bounces = alone["receivers"], 3
    row = 4 * 16 * math.ceil(alone["order"] ** 2 * alone["channels"] / 16)
    core = alone["busy"] / n  # seconds of one, a receiver
    for ranks in range(2, most + 1):
        said = bake(ranks, 1, options, path)["ranks"]
        each, whole = said["bytes_per_receiver_per_bounce"], said["bytes"] / n
        tell("ranks_traffic", kind=kind, ranks=ranks, bytes_a_receiver_a_bounce=each, row_bytes=row,
             rows_from_each_other=each / row / (ranks - 1), bytes_a_receiver=whole,
             bytes_a_receiver_from_each_other=whole / (ranks - 1), receivers=n)
    # N ranks of 16 cores: each does its share of the work, and takes what is not its own.
    for gigabits in (10, 100):
        for ranks in (16, 64, 256):
            work, network = core / ranks / 16, whole / (most - 1) / (gigabits * 1.25e8)
            tell("ranks_model", kind=kind, rays=int(rays), gigabits=gigabits, ranks=ranks,
                 work=1e6 * work, network=1e6 * network, unit="seconds a million receivers",
                 share_of_ideal=work / (work + network),
                 network_is_half_at_ranks=core / 16 / network)

# More than one process may keep.
path, options = kinds["room"]
whole = bake(0, 1, options, path)
least = whole["working_memory"] - whole["operator_bytes"]
tight = [*options, "--memory", str(int(least + 0.6 * whole["operator_bytes"]))]
alone, both = bake(0, 2, tight, path), bake(2, 1, tight, path)
tell("ranks_memory", ours=both["work"], peer=alone["work"], ratio=alone["work"] / both["work"],
     kept=[alone["operator_kept"], both["operator_kept"]], unit="seconds",
     peer_is="one process of two threads, which keeps 60 % of the operator and traces the rest again")
P
