#!/usr/bin/env bash
# OpenEXR 3.1.5 (Debian 12: openexr 3.1.5-5), exrenvmap -l -b, which its help says gives at N what a white diffuse
# surface with normal N would show.
#
# Expected: such a surface under radiance 1 + P_l(y)/2 shows 1 + a_l P_l(y)/2, with the cosine lobe's a_1 = 2/3 and
# a_2 = 1/4 (Ramamoorthi and Hanrahan, 2001); an even environment stays what it is.
#
# Seen, of a latitude-longitude map of 512 by 256 floats: an even environment comes out as 1.004 to 1.013, a_1 as 0.64
# and a_2 as 0.16, a third too weak: the map is blurred by something wider than a cosine. An even map of 64 by 32 is
# darkened instead, to 0.993 to 0.996. Without -b all bands come through as they are.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq openexr=3.1.5-5 libopenexr-3-1-30=3.1.5-5 libimath-3-1-29=3.1.6-1 >/dev/null 2>&1
for package in *.deb; do dpkg -x "$package" root; done
LD_LIBRARY_PATH=$(dirname "$(find "$folder/root" -name 'libOpenEXR-*.so*' | head -n 1)")
export LD_LIBRARY_PATH
cat >maps.py <<'P'
import math, struct, subprocess, zlib

def attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value

# An uncompressed map of floats, a latitude a row from the pole down.
def write(path, width, value):
    height = width // 2
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(c + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    header = struct.pack("<II", 20000630, 2) + b"".join(
        attribute(*a) for a in (("channels", "chlist", channels), ("compression", "compression", b"\0"),
                                ("dataWindow", "box2i", window), ("displayWindow", "box2i", window),
                                ("lineOrder", "lineOrder", b"\0"), ("pixelAspectRatio", "float", struct.pack("<f", 1)),
                                ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
                                ("screenWindowWidth", "float", struct.pack("<f", 1)),
                                ("envmap", "envmap", b"\0"))) + b"\0"
    row = 8 + 12 * width
    with open(path, "wb") as f:
        f.write(header)
        f.write(b"".join(struct.pack("<Q", len(header) + 8 * height + row * y) for y in range(height)))
        for y in range(height):
            v = value(math.sin(math.pi / 2 - math.pi * y / (height - 1)))
            f.write(struct.pack("<ii", y, 12 * width) + struct.pack("<f", v) * (3 * width))

# The green of each row's first pixel, of halves in tiles under zlib.
def read(path):
    data = open(path, "rb").read()
    at, names = 8, {}
    while data[at]:
        end = data.index(b"\0", at)
        name, at = data[at:end].decode(), data.index(b"\0", end + 1) + 1
        size = struct.unpack_from("<I", data, at)[0]
        names[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    x0, y0, x1, y1 = struct.unpack("<4i", names["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    wide, high, mode = struct.unpack("<IIB", names["tiles"])
    assert mode == 0 and names["compression"] == b"\3"
    across, found = (width + wide - 1) // wide, [0.0] * height
    for tile in range(across * ((height + high - 1) // high)):
        start = struct.unpack_from("<Q", data, at + 1 + 8 * tile)[0]
        x, y, _, _, size = struct.unpack_from("<5i", data, start)
        if x:
            continue
        columns, rows = min(wide, width), min(high, height - y * high)
        raw = data[start + 20:start + 20 + size]
        if size < 6 * columns * rows:
            steps = bytearray(zlib.decompress(raw))
            for i in range(1, len(steps)):
                steps[i] = (steps[i - 1] + steps[i] - 128) & 255
            half = (len(steps) + 1) // 2
            raw = bytearray(len(steps))
            raw[0::2], raw[1::2] = steps[:half], steps[half:]
        for r in range(rows):
            found[y * high + r] = struct.unpack_from("<e", raw, 6 * columns * r + 2 * columns)[0]
    return found

def converted(width, value, *options):
    write("in.exr", width, value)
    subprocess.run(["root/usr/bin/exrenvmap", "-l", *options, "-w", "128", "in.exr", "out.exr"], check=True)
    return read("out.exr")

def bands(*options):
    one = converted(512, lambda y: 1 + 0.5 * y, *options)
    two = converted(512, lambda y: 1 + 0.25 * (3 * y * y - 1), *options)
    first = one[0] - one[-1]  # of P_1: 1 above, -1 below; of P_2: 1 at the poles, -1/2 about the middle
    return first, (0.5 * (two[0] + two[-1]) - two[len(two) // 2]) / 0.75

even, small = converted(512, lambda y: 1.0, "-b"), converted(64, lambda y: 1.0, "-b")
first, second = bands("-b")
assert all(abs(a - 1) < 0.01 for a in bands()), "what is not blurred is not as it was"
print("even: %.4f to %.4f, of a small map %.4f to %.4f; a_1 = %.4f, a_2 = %.4f"
      % (min(even), max(even), min(small), max(small), first, second))
assert 1.002 < min(even) and max(even) < 1.015 and 0.99 < min(small) and max(small) < 0.997
assert abs(first - 0.643) < 0.01 and abs(second - 0.160) < 0.01, "the blur is another"
P
python3 maps.py
echo "as described: exrenvmap 3.1.5 -b loses a third of the second band"
