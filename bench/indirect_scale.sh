#!/usr/bin/env bash
# Direct to indirect light as scenes grow to millions of triangles: a hall made by bench/made_hall.py, prepared at each
# of SIZES (triangles), with some 100,000 texels as receivers; then one lamp moved by a step, all leaves lit anew or
# LEAVES of them a frame. Seconds by the clock, and of processors, which other work on the machine does not touch; a
# frame's are the difference of 51 frames and 2, pictures of 32 by 24 included. One JSON object a line.
#   SIZES="100000 300000 1000000 2300000" ATLAS=400x400 BAKE="..." LEAVES=4096 scripts/bench indirect-scale
source "$(dirname "$0")/common.sh"
need python3-numpy
out=out/indirect_scale
mkdir -p $out
for size in ${SIZES:-100000 300000 1000000 2300000}; do
  /usr/bin/python3 bench/made_hall.py "$size" $out/hall.glb >$out/hall.json
  TIMEFORMAT='{"clock": %R, "user": %U, "system": %S}'
  { time $tool --json bake $out/hall.glb --transfer indirect --receivers texels --atlas "${ATLAS:-400x400}" ${BAKE:-} \
    -o $out/indirect.glb >$out/bake.json; } 2>$out/time.txt
  for leaves in 0 ${LEAVES:-4096}; do
    for step in 1 0.02; do
      { time $tool --threads 1 --json render $out/indirect.glb --lamp point@3,6,2=400 --show indirect --at receivers \
        --size 32x24 --spp 1 --camera -15,5,-12,0,2,0,70 --move '1@0:3,6,2;1:3.4,6,2' --frames 0:1:$step \
        --frame-leaves $leaves -o $out/frames.png >$out/frames_$leaves.json 2>/dev/null; } \
        2>$out/time_${leaves}_$step.txt
    done
  done
  python3 - $out 0 ${LEAVES:-4096} <<'P'
import json, math, os, sys
out = sys.argv[1]
read = lambda name: json.load(open(f"{out}/{name}.json"))
made, b = read("hall"), read("bake")
took = json.loads(open(f"{out}/time.txt").read().strip().splitlines()[-1])
cpu, n = took["user"] + took["system"], made["triangles"]
first = f"{out}/first.json"
if n < 150000 or not os.path.exists(first):
    json.dump(dict(n=n, cpu=cpu), open(first, "w"))
start = json.load(open(first))
growth = (n * math.log(n)) / (start["n"] * math.log(start["n"]))
print(json.dumps(dict(name="indirect prepared, a made hall", triangles=n, receivers=b["receivers"],
                      surfels=b["indirect"]["surfels"], entries=b["indirect"]["entries"], bytes=b["bytes"],
                      seconds=took["clock"], limit=600, ratio=took["clock"] / 600, processor_seconds=round(cpu, 1),
                      grown_by=round(cpu / start["cpu"], 2), n_log_n_by=round(growth, 2))))
for leaves in sys.argv[2:]:
    f = read(f"frames_{leaves}")
    ms = 1e3 * f["relight_seconds"]
    used = lambda step: json.loads(open(f"{out}/time_{leaves}_{step}.txt").read().strip().splitlines()[-1])["user"]
    print(json.dumps(dict(name="indirect lamp moved in the hall, ms, one thread", ours=ms, limit=16, ratio=ms / 16,
                          receivers=b["receivers"], leaves=f["leaves_lit"], shadow_rays=1e3 * f["shadow_ray_seconds"],
                          bounces=1e3 * f["solve_seconds"], read=1e3 * f["read_seconds"],
                          processor=round(1e3 * (used("0.02") - used("1")) / 49, 1))))
P
done
