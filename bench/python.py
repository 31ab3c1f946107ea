"""The Python package, one JSON object a line (scripts/bench python). LAMBENT_PRT_UTIL=FILE: beside PIFu's
apps/prt_util.py, where trimesh and its Embree binding can be imported."""
import json
import os
import time
import types

import lambent
import numpy as np
from lambent import _lambent


def tell(name, **values):
    print(json.dumps({"name": name, **values}), flush=True)


def least(times, work):
    best = float("inf")
    for _ in range(times):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def scan(rows=250, columns=400):
    """A bumpy closed body of about rows x columns vertices."""
    theta = (np.arange(1, rows - 1) / (rows - 1) * np.pi)[:, None]
    phi = (np.arange(columns) / columns * 2 * np.pi)[None]
    radius = 1 + 0.15 * np.sin(9 * theta) * np.cos(7 * phi) + 0.03 * np.sin(31 * theta) * np.sin(29 * phi)
    v = np.stack(np.broadcast_arrays(radius * np.sin(theta) * np.cos(phi), radius * np.cos(theta),
                                     radius * np.sin(theta) * np.sin(phi)), 2).reshape(-1, 3)
    v = np.concatenate([v, [[0, 1, 0], [0, -1, 0]]])
    i, j = np.meshgrid(np.arange(rows - 3), np.arange(columns), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    f = np.concatenate([np.stack([a, b, a + columns], 1), np.stack([b, b + columns, a + columns], 1)])
    ring, top, bottom = np.arange(columns), len(v) - 2, len(v) - 1
    last = (rows - 3) * columns + ring
    f = np.concatenate([f, np.stack([np.full(columns, top), np.roll(ring, -1), ring], 1),
                        np.stack([np.full(columns, bottom), last, np.roll(last, -1)], 1)])
    return v, f


def loop_over_single_rays(scene, v, normals, n=1600):
    """Features as the public scripts make them: whole arrays of rays, of which each is traced by itself."""
    rng = np.random.default_rng(1)
    theta, phi = np.arccos(1 - 2 * rng.random(n)), 2 * np.pi * rng.random(n)
    d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
    basis = lambent.sh.evaluate(3, d).astype(float)
    lift, total, side = 1e-3 * np.ptp(v, axis=0).min(), 0, 40
    for k in range(0, n, side):
        origins = np.repeat(v + lift * normals, side, axis=0)
        directions = np.tile(d[k:k + side], (len(v), 1))
        cosine = (directions * np.repeat(normals, side, axis=0)).sum(1)
        seen = (cosine > 0) & ~_lambent.single_rays(scene, origins, directions)
        values = (seen * cosine)[:, None] * np.tile(basis[k:k + side], (len(v), 1))
        total = total + values.reshape(len(v), side, 9).sum(1)
    return total * 4 * np.pi / n


def public_script(v, f, steps=3):
    """Seconds by the clock and of one core that the public script takes, from some of its 40 equal steps of 40
    directions at all vertices, once trees and caches are there. None without LAMBENT_PRT_UTIL, its prt_util.py; what
    that imports has to be there: trimesh, and the Embree binding that trimesh takes."""
    path = os.environ.get("LAMBENT_PRT_UTIL")
    if not path:
        return None
    np.float = float  # as numpy had it when the script was written
    import trimesh
    script = types.ModuleType("prt_util")
    with open(path, encoding="utf-8") as source:
        exec(compile(source.read(), path, "exec"), script.__dict__)
    mesh, marks = trimesh.Trimesh(v, f, process=False), []
    if "embree" not in type(mesh.ray).__module__:
        raise SystemExit("LAMBENT_PRT_UTIL: trimesh has no Embree binding here")
    mesh.ray.intersects_any(mesh.vertices[:1], mesh.vertex_normals[:1])

    class Enough(Exception):
        pass

    def count(steps_of_40):
        for i in steps_of_40:
            marks.append((time.perf_counter(), time.process_time()))
            if i > steps:  # the first is apart: it meets the memory anew
                raise Enough
            yield i
    script.trimesh, script.tqdm = types.SimpleNamespace(load=lambda *_, **__: mesh), count
    try:
        script.computePRT("", 40, 2)
    except Enough:
        pass
    return 40 * np.diff(marks[1:], axis=0).mean(0)


def features():
    """Against the public script and against its loop over our single rays, at as many directions (1,600, of which
    theirs count on one side of the surface alone), at as many that count (800), and at no more noise."""
    v, f = scan()
    exact, _ = lambent.prt_features(v, f, convention="lambent", samples=4096, seed=7)
    scene, normals = lambent.Scene(v, f), lambent.vertex_normals(v, f).astype(float)
    some = np.random.default_rng(2).choice(len(v), 1000, replace=False)
    found = []
    _lambent.single_rays(scene, v[:1], normals[:1])  # builds its tree
    start = time.process_time()
    seconds = least(2, lambda: found.append(loop_over_single_rays(scene, v[some], normals[some])))
    loop_core = (time.process_time() - start) / 2 * len(v) / len(some)
    loop = seconds * len(v) / len(some)
    noise = float(np.sqrt(((found[0] - exact[some])**2).mean()))
    public = public_script(v, f)
    for samples in (1600, 800, 64):
        start = time.process_time()
        ours = least(2, lambda: lambent.prt_features(v, f, samples=samples))
        core = (time.process_time() - start) / 2  # seconds of one core, which others on the machine change less
        prt, _ = lambent.prt_features(v, f, convention="lambent", samples=samples)
        values = {"seconds": round(ours, 3), "core_seconds": round(core, 2)}
        for name, theirs in (("public_script", public), ("loop_over_single_rays", (loop, loop_core))):
            if theirs is not None:
                values |= {name + "_seconds": round(theirs[0], 1), name + "_ratio": round(theirs[0] / ours, 1),
                           name + "_core_seconds": round(theirs[1], 1),
                           name + "_core_ratio": round(theirs[1] / core, 1)}
        tell("prt_features", vertices=len(v), rays_each=samples, aim=20, **values,
             rms_error=round(float(np.sqrt(((prt - exact)**2).mean())), 5), their_rms_error=round(noise, 5))


def overhead():
    v, f = scan(120, 200)
    scene, ratios = lambent.Scene(v, f), []
    for progress in (None, lambda stage, fraction: None):
        for _ in range(5):
            start = time.perf_counter()
            baked = lambent.bake(scene, samples=512, progress=progress)
            ratios.append((time.perf_counter() - start) / baked._handle._seconds - 1)
        tell("bake from Python, beyond C++", progress=progress is not None, receivers=baked.receivers,
             seconds=round(baked._handle._seconds, 3), overhead=round(min(ratios), 5), limit=0.02)
        ratios.clear()


def relighting(n=708):  # two-sided: a million receivers
    x, z = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    v = np.stack([x, 0.1 * np.sin(x * 0.3) * np.cos(z * 0.2), z], 2).reshape(-1, 3).astype(float)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    f = np.concatenate([np.stack([a, a + 1, a + n], 1), np.stack([a + 1, a + n + 1, a + n], 1)])
    normals = np.tile([0.0, 1, 0], (len(v), 1))
    baked = lambent.bake(lambent.Scene(v, f, normals=normals), order=6, shadows="off")
    light, transfer = baked.project("sky:elevation=30"), baked.transfer
    out = np.empty((baked.receivers, 3), np.float32)
    ours = read = float("inf")
    for _ in range(15):  # in turns, so that both see the same machine
        ours = min(ours, least(2, lambda: baked.relight(light, out=out)))
        read = min(read, least(2, lambda: _lambent.sum_of_words(transfer)))
    tell("relight from numpy", receivers=baked.receivers, bytes=transfer.nbytes, milliseconds=round(1e3 * ours, 3),
         read_milliseconds=round(1e3 * read, 3), of_read_bandwidth=round(read / ours, 3), aim=0.85,
         new_array_milliseconds=round(1e3 * least(10, lambda: baked.relight(light)), 3))


for name in os.environ.get("LAMBENT_BENCH_PYTHON", "features overhead relighting").split():
    {"features": features, "overhead": overhead, "relighting": relighting}[name]()
