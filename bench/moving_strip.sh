#!/usr/bin/env bash
# The strip of objects that move in the README, into out/moving-strip: a red ball that rolls, a green box and a lamp in
# the demo's courtyard in the evening, reflecting onto it and onto one another. Two minutes.
source "$(dirname "$0")/common.sh"
out=out/moving-strip
mkdir -p $out
[ -f $out/courtyard.glb ] || $tool demo -o $out --spp 1 --detail 0.4 >&2
python3 - $out <<'P'
import json, math, sys
out = sys.argv[1]
def write(name, vertices, faces):
    with open(f"{out}/{name}.obj", "w") as f:
        f.write(f"mtllib all.mtl\nusemtl {name}\n")
        f.writelines("v %g %g %g\n" % v for v in vertices)
        f.writelines("f " + " ".join(str(i + 1) for i in face) + "\n" for face in faces)
def ball(radius, rows=16, columns=32):
    at = lambda t, p: (radius * math.sin(t) * math.cos(p), radius * math.cos(t), -radius * math.sin(t) * math.sin(p))
    vertices = [at(math.pi * i / rows, 2 * math.pi * j / columns) for i in range(rows + 1) for j in range(columns)]
    faces = []
    for i in range(rows):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            faces += [(a, a + columns, b)] * (i > 0) + [(b, a + columns, b + columns)] * (i + 1 < rows)
    return vertices, faces
corners = [(x, y, z) for x in (-.4, .4) for y in (-.4, .4) for z in (-.4, .4)]
write("red", *ball(0.45))
write("lamp", *ball(0.25))
write("green", corners, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
open(f"{out}/all.mtl", "w").write("newmtl red\nKd .9 .12 .08\nnewmtl green\nKd .15 .7 .2\n"
                                  "newmtl lamp\nKd .2 .2 .2\nKe 14 11 7\n")
paths = {"red": ([0, 2], [[-1.6, .45, 1.2], [1.3, .45, 1.5, 0, 0, -369]]),
         "green": ([0, 2], [[2.0, .4, 1.6, 20, 0, 0], [-1.2, .4, 2.1, 110, 0, 0]]),
         "lamp": ([0, 1, 2], [[-0.6, .5, 2.0], [0.1, .8, 2.3], [1.7, 1.1, .2]])}
for name, (times, places) in paths.items():
    json.dump({"times": times, "places": places}, open(f"{out}/{name}.json", "w"))
P
$tool bake $out/courtyard.glb --order 4 --bounces 2 --samples 256 --terms --lattice 16,6,16 -o $out/yard.glb >&2
objects=()
for name in red green lamp; do
  $tool bake $out/$name.obj --max-edge 0.15 --order 4 --samples 256 --bounces 0 -o $out/$name.glb >&2
  kept=--transfer
  [ $name = lamp ] && kept=--radiance
  $tool field $out/$name.glb $kept -o $out/$name.field.glb >&2
  objects+=(--place $name=$out/$name.field.glb@0,0,0 --move $name=$out/$name.json)
done
$tool render $out/yard.glb --env sky:elevation=1.5,azimuth=60 --camera 0.95,1.95,7.6,-0.05,1.0,-0.3,42 "${objects[@]}" \
  --frames 0:2:1 --size 300x240 --spp 32 -o $out/moving.png
