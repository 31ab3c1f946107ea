"""glTF 2.0 binary (GLB) to and from numpy arrays. Blender's own importer is not asked: as Debian 12 ships it, it fails
on meshes with the numpy beside it."""
import json
import struct
import zlib

import numpy as np

COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}


class Glb:
    """A document and its binary data, to be written or as it was read."""

    def __init__(self, document=None, data=b""):
        self.json = document or {"asset": {"version": "2.0", "generator": "lambent for Blender"}, "scene": 0,
                                 "scenes": [{"nodes": []}], "nodes": []}
        self.data = bytearray(data)

    def push(self, key, item):
        self.json.setdefault(key, []).append(item)
        return len(self.json[key]) - 1

    def use(self, extension):
        used = self.json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def view(self, content):
        self.data += b"\0" * (-len(self.data) % 4)
        at = len(self.data)
        self.data += content
        return self.push("bufferViews", {"buffer": 0, "byteOffset": at, "byteLength": len(content)})

    def accessor(self, array, bounds=False):
        """float32 (n, 2..4) or (n,), or uint32 (n,)."""
        array = np.ascontiguousarray(array)
        kind = {np.dtype(np.float32): 5126, np.dtype(np.uint32): 5125}[array.dtype]
        shape = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        item = {"bufferView": self.view(array.tobytes()), "componentType": kind, "count": len(array), "type": shape}
        if bounds:
            item["min"], item["max"] = array.min(0).tolist(), array.max(0).tolist()
        return self.push("accessors", item)

    def save(self, path):
        if self.data:
            self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        with open(path, "wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + (8 + len(data) if data else 0)))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            if data:
                file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)

    @staticmethod
    def load(path):
        with open(path, "rb") as file:
            content = file.read()
        magic, _, total = struct.unpack_from("<4sII", content)
        if magic != b"glTF" or total > len(content):
            raise ValueError(f"{path} is no GLB, or cut short")
        at, document, data = 12, None, b""
        while at + 8 <= total:
            length, kind = struct.unpack_from("<I4s", content, at)
            chunk = content[at + 8:at + 8 + length]
            if kind == b"JSON":
                document = json.loads(chunk)
            elif kind == b"BIN\0":
                data = chunk
            at += 8 + length
        return Glb(document, data)

    def array(self, index):
        """An accessor's values, (n, components) or (n,)."""
        item = self.json["accessors"][index]
        view = self.json["bufferViews"][item["bufferView"]]
        kind, width = np.dtype(TYPES[item["componentType"]]), COMPONENTS[item["type"]]
        at = view.get("byteOffset", 0) + item.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        raw = np.ndarray((item["count"], width), kind, bytes(self.data), at, (stride, kind.itemsize))
        return raw.copy() if width > 1 else raw[:, 0].copy()


def png(pixels):
    """Rows from the top, uint8 (height, width, 3 or 4), as a PNG's bytes."""
    height, width, channels = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], 1).tobytes()

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    head = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 6)) + chunk(b"IEND", b"")
