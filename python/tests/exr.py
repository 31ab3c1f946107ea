"""OpenEXR pictures as lambent writes them (rows, ZIP, half or float), read from the format's own description."""
import struct
import zlib

import numpy as np


def read_exr(path):
    """Channel name -> float32 (height, width), the first row at the top."""
    with open(path, "rb") as file:
        data = file.read()
    assert data[:4] == b"\x76\x2f\x31\x01" and data[4] == 2 and data[5] & 0x1a == 0, path
    at, attributes = 8, {}
    while data[at]:
        end = data.index(0, at)
        name, at = data[at:end].decode(), end + 1
        at = data.index(0, at) + 1
        size, = struct.unpack_from("<I", data, at)
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    at += 1
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height, compression = x1 - x0 + 1, y1 - y0 + 1, attributes["compression"][0]
    rows = {0: 1, 2: 1, 3: 16}[compression]
    channels, listed, k = [], attributes["channels"], 0
    while listed[k]:
        end = listed.index(0, k)
        channels.append((listed[k:end].decode(), np.dtype({1: "<f2", 2: "<f4"}[listed[end + 1]])))
        k = end + 17
    out = {name: np.zeros((height, width), np.float32) for name, _ in channels}
    for offset in struct.unpack_from(f"<{-(-height // rows)}Q", data, at):
        y, size = struct.unpack_from("<iI", data, offset)
        block, count = data[offset + 8:offset + 8 + size], min(rows, height - (y - y0))
        whole = count * width * sum(kind.itemsize for _, kind in channels)
        if compression and size < whole:
            t = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
            t = np.cumsum(np.concatenate([t[:1], t[1:] - 128])) & 255
            mixed = np.empty(len(t), np.uint8)
            mixed[0::2], mixed[1::2] = t[:(len(t) + 1) // 2], t[(len(t) + 1) // 2:]
            block = mixed.tobytes()
        k = 0
        for row in range(count):
            for name, kind in channels:
                out[name][y - y0 + row] = np.frombuffer(block, kind, width, k)
                k += width * kind.itemsize
    return out


def read_rgb(path):
    picture = read_exr(path)
    return np.stack([picture[c] for c in "RGB"], 2).astype(float)
