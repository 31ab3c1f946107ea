#!/usr/bin/env python3
"""A hall with bumpy stones in it, of so many triangles whatever that takes, as a .glb with a place in an atlas for each
patch (TEXCOORD_1). Usage: made_hall.py TRIANGLES OUT.glb"""
import json
import struct
import sys

import numpy as np

stones, hall = 21, 4  # stones of six patches each; floor, ceiling and walls of hall x hall patches, walls of hall
patches = 6 * stones + 2 * hall * hall + 4 * hall
wanted, path = int(sys.argv[1]), sys.argv[2]
m = max(2, round((wanted / 2 / patches) ** 0.5))
grid = np.linspace(0, 1, m + 1, dtype=np.float64)
s, t = (a.ravel() for a in np.meshgrid(grid, grid, indexing="ij"))
random = np.random.default_rng(1)
wide, tall, columns = 40.0, 8.0, int(np.ceil(patches**0.5))
corner = np.arange(m * (m + 1)).reshape(m, m + 1)[:, :m].ravel()
quads = np.stack([corner, corner + m + 1, corner + 1, corner + 1, corner + m + 1, corner + m + 2], 1).reshape(-1, 3)
parts = {"floor": [], "wall": [], "stone": []}


def add(name, p, outwards):
    """A patch of (m + 1)^2 points; fronts lie along `outwards`, a vector a point."""
    a = p.reshape(m + 1, m + 1, 3)
    n = np.cross(np.gradient(a, axis=0), np.gradient(a, axis=1)).reshape(-1, 3)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    turned = np.sum(n * outwards) < 0
    k = sum(map(len, parts.values()))
    uv = (np.stack([k % columns + 0.1 + 0.8 * s, k // columns + 0.1 + 0.8 * t], 1)) / columns
    parts[name].append((p, -n if turned else n, uv, quads[:, ::-1] if turned else quads))


for i in range(hall):
    for j in range(hall):
        x, z = (i + s) * wide / hall - wide / 2, (j + t) * wide / hall - wide / 2
        ripple = 0.02 * np.sin(3 * x) * np.sin(3 * z)
        add("floor", np.stack([x, ripple, z], 1), np.array([0, 1, 0]))
        add("wall", np.stack([x, tall + 0 * x, z], 1), np.array([0, -1, 0]))
    for side in range(4):
        along, up = (i + s) * wide / hall - wide / 2, tall * t
        x = [along, along, -wide / 2 + 0 * s, wide / 2 + 0 * s][side]
        z = [-wide / 2 + 0 * s, wide / 2 + 0 * s, along, along][side]
        add("wall", np.stack([x, up, z], 1), np.array([[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0]][side]))
for stone in range(stones):
    middle = np.array([random.uniform(-16, 16), random.uniform(1, 4), random.uniform(-16, 16)])
    size, phase = random.uniform(0.8, 2.5), random.uniform(0, 6, 3)
    for axis in range(3):
        for side in (-1, 1):
            d = np.zeros((len(s), 3))
            d[:, axis], d[:, (axis + 1) % 3], d[:, (axis + 2) % 3] = side, 2 * s - 1, 2 * t - 1
            d /= np.linalg.norm(d, axis=1, keepdims=True)
            bumps = 1 + 0.1 * np.prod(np.sin(d * [9, 8, 7] + phase), axis=1)
            add("stone", middle + size * bumps[:, None] * d, d)

bulk, views, accessors, meshes = bytearray(), [], [], []


def accessor(values, kind, component, **more):
    views.append(dict(buffer=0, byteOffset=len(bulk), byteLength=values.nbytes))
    bulk.extend(values.tobytes())
    bulk.extend(b"\0" * (-len(bulk) % 4))
    count = values.size if kind == "SCALAR" else len(values)
    accessors.append(dict(bufferView=len(views) - 1, componentType=component, count=count, type=kind, **more))
    return len(accessors) - 1


for material, (name, own) in enumerate(parts.items()):
    p, n, uv = (np.concatenate([part[k] for part in own]).astype(np.float32) for k in range(3))
    first = np.cumsum([0] + [len(part[0]) for part in own])
    index = np.concatenate([part[3] + f for part, f in zip(own, first)]).astype(np.uint32)
    box = dict(min=p.min(0).tolist(), max=p.max(0).tolist())
    attributes = dict(POSITION=accessor(p, "VEC3", 5126, **box), NORMAL=accessor(n, "VEC3", 5126),
                      TEXCOORD_1=accessor(uv, "VEC2", 5126))
    indices = accessor(index, "SCALAR", 5125)
    meshes.append(dict(primitives=[dict(attributes=attributes, indices=indices, material=material)]))
colors = dict(floor=[0.6, 0.5, 0.4, 1], wall=[0.7, 0.7, 0.7, 1], stone=[0.5, 0.3, 0.2, 1])
document = dict(
    asset=dict(version="2.0", generator="made_hall.py"), scene=0, scenes=[dict(nodes=[0, 1, 2])],
    nodes=[dict(mesh=i, name=name) for i, name in enumerate(parts)], meshes=meshes,
    materials=[dict(name=n, pbrMetallicRoughness=dict(baseColorFactor=colors[n], metallicFactor=0)) for n in parts],
    buffers=[dict(byteLength=len(bulk))], bufferViews=views, accessors=accessors)
text = json.dumps(document).encode()
text += b" " * (-len(text) % 4)
with open(path, "wb") as f:
    f.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(bulk)))
    f.write(struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(bulk), 0x004E4942) + bulk)
print(json.dumps(dict(triangles=len(quads) * patches, patches=patches)))
