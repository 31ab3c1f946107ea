"""One bake, a day of skies: frames of a video, and the light at every vertex of every frame.
    sky_video.py [SCENE] [FOLDER] [FRAMES]      a made pavilion where no scene is given
"""
import os
import sys
import time

import lambent
import numpy as np


def made_pavilion(n=24):
    """A slab on four pillars, over a floor."""
    vertices, faces = [], []

    def box(low, high, cells):
        low, high = np.array(low, float), np.array(high, float)
        for axis in range(3):
            for side in (0, 1):
                u, w = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
                p = np.empty((u.size, 3))
                p[:, axis], p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = side, u.ravel(), w.ravel()
                first = sum(map(len, vertices))
                a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel() + first
                quads = np.stack([a, a + cells + 1, a + cells + 2, a + 1], 1)
                quads = quads if side else quads[:, ::-1]
                vertices.append(low + p * (high - low))
                faces.extend([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    box([-3, -0.1, -3], [3, 0, 3], n)
    box([-1.5, 1.6, -1.5], [1.5, 1.8, 1.5], n // 2)
    for x in (-1.3, 1.1):
        for z in (-1.3, 1.1):
            box([x, 0.001, z], [x + 0.2, 1.599, z + 0.2], max(2, n // 6))
    return lambent.Scene(np.concatenate(vertices), np.concatenate(faces))


def main(scene=None, folder="out/video", frames=24):
    frames, scene = int(frames), lambent.load(scene) if scene else made_pavilion()
    baked = lambent.bake(scene, samples=512, progress=sys.stderr.isatty())
    os.makedirs(folder, exist_ok=True)
    light = np.empty((frames, baked.receivers, 3), np.float32)
    seconds = 0.0
    for i in range(frames):
        day = (i + 0.5) / frames
        sky = lambent.sky(elevation=round(65 * np.sin(np.pi * day), 3), azimuth=round(180 * day - 90, 3), turbidity=3)
        coefficients = baked.project(sky)
        start = time.perf_counter()
        baked.relight(coefficients, out=light[i])
        seconds += time.perf_counter() - start
        baked.render(sky, size="320x240", spp=4, background="none").save(f"{folder}/frame_{i:03}.png", exposure="0")
    np.save(f"{folder}/light.npy", baked.by_input_vertex(light.transpose(1, 0, 2)))
    print(f"{frames} frames of {baked.receivers} receivers, relit in {1e3 * seconds / frames:.3f} ms each")
    print(f"{folder}/frame_000.png ...")


if __name__ == "__main__":
    main(*sys.argv[1:])
