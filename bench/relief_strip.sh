#!/usr/bin/env bash
# The strip of a brick wall half in shadow in docs/zonal.md, into out/relief-strip/strip.png: the bake without relief,
# the relief in the light that arrives, and its displaced geometry path-traced under the same six bands of light; then
# one JSON line, decibels of the second (and of the first) against the last, without its noise. Some three minutes.
#   SPP=512 SIZE=288x216 scripts/bench relief-strip
source "$(dirname "$0")/common.sh"
out=out/relief-strip size=${SIZE:-192x144} spp=${SPP:-160}
mkdir -p $out
# One repetition of bricks in running bond, two across and four courses: heights of 16 bits, and colours. Then a wall
# that faces +z, with one repetition over each unit of its texture coordinates, and a tower beside it, out of sight.
python3 - $out <<'P'
import math, random, struct, sys, zlib
out, n = sys.argv[1], 256
def png(path, rows, depth, colour):  # rows of bytes
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows), 9)
    header = struct.pack(">IIBBBBB", n, n, depth, colour, 0, 0, 0)
    open(path, "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))
random.seed(7)
bricks = {(c, b): [random.uniform(-1, 1) for _ in range(5)] for c in range(4) for b in range(2)}
waves = [(random.randint(-9, 9), random.randint(-9, 9), random.uniform(0, 6.3)) for _ in range(24)]
smooth = lambda t: (lambda s: s * s * (3 - 2 * s))(max(0.0, min(1.0, t)))
heights, colours = [], []
for y in range(n):
    high, paint = [], []
    for x in range(n):
        u, v = (x + 0.5) / n, (y + 0.5) / n
        course = int(4 * v)
        along = 2 * u + 0.5 * (course % 2)
        tone = bricks[course, int(along) % 2]
        # To the brick's edge, in sides; its face is tilted a little and rough.
        across, up = (along % 1 - 0.5) / 2, (4 * v % 1 - 0.5) / 4
        edge = min(0.25 - abs(across), 0.125 - abs(up))
        rough = sum(math.sin(6.2832 * (a * u + b * v) + p) for a, b, p in waves) / 24
        face = 0.86 + 0.06 * tone[0] + 0.4 * tone[1] * across + 0.6 * tone[2] * up
        lifted = smooth((edge - 0.005) / 0.05)
        h = 0.12 + 0.03 * rough + lifted * (face - 0.12 + 0.07 * rough)
        high += divmod(int(65535 * max(0.0, min(1.0, h))), 256)
        red = 0.5 + 0.09 * tone[3] + 0.05 * rough, 0.2 + 0.05 * tone[4] + 0.03 * rough, 0.13 + 0.03 * tone[4]
        mixed = [0.45 + (r - 0.45) * smooth((edge - 0.003) / 0.012) for r in red]
        paint += [int(255 * max(0.0, min(1.0, c)) ** (1 / 2.2)) for c in mixed]
    heights.append(high), colours.append(paint)
png(f"{out}/bricks.png", heights, 16, 0)
png(f"{out}/colours.png", colours, 8, 2)
open(f"{out}/wall.mtl", "w").write("newmtl bricks\nKd 1 1 1\nmap_Kd colours.png\nnewmtl tower\nKd 0.6 0.6 0.6\n")
cells, wide, tall = 40, 4, 3
with open(f"{out}/wall.obj", "w") as f:
    f.write("mtllib wall.mtl\nusemtl bricks\n")
    for j in range(cells + 1):
        for i in range(cells + 1):
            u, v = wide * i / cells, tall * j / cells
            f.write(f"v {u - wide / 2:g} {v:g} 0\nvt {u:g} {v:g}\nvn 0 0 1\n")
    for j in range(cells):
        for i in range(cells):
            a = j * (cells + 1) + i + 1
            f.write("f " + " ".join(f"{k}/{k}/{k}" for k in (a, a + 1, a + cells + 2, a + cells + 1)) + "\n")
    base = (cells + 1) ** 2
    f.write("usemtl tower\n")
    corners = [(x, y, z) for x in (2.2, 2.6) for y in (0, 4) for z in (0.3, 2.2)]
    f.writelines("v %g %g %g\n" % c for c in corners)
    f.write("vt 0 0\n")
    for face in (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3):
        f.write("f " + " ".join(f"{base + 1 + k}/{base + 1}" for k in face) + "\n")
P
relief="--depth 0.05"
light="--env ${SKY:-sky:elevation=30,azimuth=40,turbidity=3} --window none"
view=(--camera "0,1.5,5.2,0,1.5,0,24" --size "$size" --background none)
$tool patch $out/bricks.png $relief --size 128 --samples 1024 --bounces 2 --albedo 0.3 -o $out/bricks.lpt >&2
$tool bake $out/wall.obj --max-edge 0.2 --transfer matrix --order 6 --incident-order 6 --bounces 2 \
  --samples 1024 -o $out/wall.glb >&2
# shellcheck disable=SC2086
{
  $tool bake $out/wall.obj --max-edge 0.2 --order 6 --bounces 2 --samples 1024 -o $out/flat.glb
  $tool render $out/flat.glb $light "${view[@]}" --spp 64 -o $out/flat.exr
  $tool render $out/wall.glb --transfer-texture $out/bricks.lpt $light "${view[@]}" --spp 64 -o $out/relief.exr
  for half in 1 2; do
    $tool reference $out/wall.obj --displace $out/bricks.png $relief --heights 128 $light --light-order 6 \
      "${view[@]}" --bounces 3 --spp $((spp / 2)) --seed $half -o $out/truth_$half.exr
  done
} >&2
$tool compare $out/truth_1.exr $out/truth_2.exr --json >$out/truth.json
exposure=$(exposure_of $out/truth.json)
for name in flat relief; do
  $tool compare $out/$name.exr $out/truth_1.exr --half $out/truth_2.exr --exposure="$exposure" \
    -o $out/$name.png --json >$out/$name.json
done
python3 bench/beside.py $out/strip.png "$size" $out/flat.png:0/3 $out/relief.png:0/3 $out/relief.png:1/3
echo "{\"name\": \"relief_strip\", \"ours\": $(number sloped $out/relief.json)," \
  "\"without\": $(number sloped $out/flat.json)," \
  "\"limit\": 30, \"unit\": \"dB\", \"limit_is\": \"what we ask for\", \"exposure\": $exposure}"
