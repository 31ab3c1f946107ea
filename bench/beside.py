#!/usr/bin/env python3
# Panels of 8-bit RGB pictures side by side: beside.py OUT.png WIDTHxHEIGHT FILE.png:PANEL/COUNT ..., panel PANEL (from
# 0) of COUNT of equal width. `lambent compare -o` writes three: a picture, the truth, their difference, below a line of
# names, which is left out.
import struct, sys, zlib


def load(path):
    data, at, packed = open(path, "rb").read(), 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    if depth != 8 or colour not in (2, 6):
        sys.exit(f"{path}: not 8-bit RGB")
    each = 3 if colour == 2 else 4
    raw, rows, above = zlib.decompress(packed), [], bytes(width * each)
    for y in range(height):
        line = raw[y * (width * each + 1) : (y + 1) * (width * each + 1)]
        row = bytearray(line[1:])
        for i in range(len(row)):
            left = row[i - each] if i >= each else 0
            up, corner = above[i], above[i - each] if i >= each else 0
            guess = left + up - corner
            paeth = min((abs(guess - v), k, v) for k, v in enumerate((left, up, corner)))[2]
            row[i] = row[i] + (0, left, up, (left + up) // 2, paeth)[line[0]] & 255
        rows.append([bytes(row[each * x : each * x + 3]) for x in range(width)])
        above = bytes(row)
    return rows


out, joined = sys.argv[1], None
height = int(sys.argv[2].split("x")[1])
for text in sys.argv[3:]:
    path, part = text.rsplit(":", 1)
    panel, count = map(int, part.split("/"))
    rows = load(path)
    width = len(rows[0]) // count
    names = 11 if width < 256 else 22  # larger letters
    cut = [row[panel * width : (panel + 1) * width] for row in rows[names : names + height]]
    joined = cut if joined is None else [a + b for a, b in zip(joined, cut)]


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def filtered(row, above):  # Paeth, which photographs pack best by
    line = bytearray([4])
    for i, value in enumerate(row):
        left, up, corner = row[i - 3] if i >= 3 else 0, above[i], above[i - 3] if i >= 3 else 0
        guess = left + up - corner
        line.append(value - min((abs(guess - v), k, v) for k, v in enumerate((left, up, corner)))[2] & 255)
    return bytes(line)


flat = [b"".join(row) for row in joined]
packed = zlib.compress(b"".join(filtered(r, a) for r, a in zip(flat, [bytes(len(flat[0]))] + flat)), 9)
header = struct.pack(">IIBBBBB", len(joined[0]), len(joined), 8, 2, 0, 0, 0)
open(out, "wb").write(
    b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
)
