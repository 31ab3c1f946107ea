"""PRT features of a scan, as human-reconstruction data sets keep them.
    prt_features.py [MESH] [FOLDER]      a made figure where no mesh is given
"""
import sys

import lambent
import numpy as np


def made_figure(rows=60, columns=80):
    """A body with a waist and folds, closed."""
    t, p = np.meshgrid(np.linspace(0, np.pi, rows)[1:-1], np.arange(columns) / columns * 2 * np.pi, indexing="ij")
    radius = np.sin(t) * (0.35 + 0.12 * np.cos(3 * t) + 0.04 * np.cos(8 * p) * np.sin(t)**2)
    v = np.stack([radius * np.cos(p), np.cos(t), radius * np.sin(p)], 2).reshape(-1, 3)
    v = np.concatenate([v, [[0, 1, 0], [0, -1, 0]]])
    i, j = np.meshgrid(np.arange(rows - 3), np.arange(columns), indexing="ij")
    a, b = (i * columns + j).ravel(), (i * columns + (j + 1) % columns).ravel()
    ring, last = np.arange(columns), (rows - 3) * columns + np.arange(columns)
    f = np.concatenate([np.stack([a, b, a + columns], 1), np.stack([b, b + columns, a + columns], 1),
                        np.stack([np.full(columns, len(v) - 2), np.roll(ring, -1), ring], 1),
                        np.stack([np.full(columns, len(v) - 1), last, np.roll(last, -1)], 1)])
    return v, f


def mesh_of_file(path):
    """Vertices and faces in the file's order and numbers, from what the loader made of them."""
    scene = lambent.load(path)
    vertices = np.zeros((scene.input_count, 3))
    vertices[scene.input] = scene.vertices
    return vertices, scene.input[scene.faces]


def main(mesh=None, folder="out/prt"):
    v, f = mesh_of_file(mesh) if mesh else made_figure()
    prt, faces = lambent.prt_features(v, f, order=3, convention="pifu")
    print(*lambent.save_prt_features(folder, prt, faces, "pifu"), sep="\n")
    lights = lambent.environment_features(["sky:elevation=20", "uniform:0.5"], convention="pifu")
    np.save(f"{folder}/env_sh.npy", lights)
    shade = prt @ lights[0]  # irradiance at each vertex, shadows in it
    print(f"{len(v)} vertices, irradiance {shade.min():.3f} to {shade.max():.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
