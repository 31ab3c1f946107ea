"""Small scenes and what the tests share."""
import os
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

tool = os.environ.get("LAMBENT", "lambent")


def sphere(levels=2, radius=1.0):
    """An octahedron, split and pushed out: vertices float64 (V, 3), faces int64 (F, 3), each vertex once."""
    v = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    f = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    for _ in range(levels):
        middles, faces = {}, []

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                m = np.add(v[a], v[b])
                middles[key] = len(v)
                v.append(list(m / np.linalg.norm(m)))
            return middles[key]
        for a, b, c in f:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            faces += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        f = faces
    return np.array(v, float) * radius, np.array(f, np.int64)


def bowl(levels=2):
    """A sphere with a dent that shadows itself."""
    v, f = sphere(levels)
    v[:, 1] -= 0.9 * np.exp(-4 * (v[:, 0]**2 + v[:, 2]**2)) * (v[:, 1] > 0)
    return v, f


def cube(n=2):
    """A cube of 6 n n quads whose vertices are shared at its edges, so that creases split them."""
    index, v, f = {}, [], []

    def at(p):
        if p not in index:
            index[p] = len(v)
            v.append(np.array(p) / n * 2 - 1)
        return index[p]
    for axis in range(3):
        for side in (0, n):
            for i in range(n):
                for j in range(n):
                    corners = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, i + di, j + dj
                        corners.append(at(tuple(p)))
                    a, b, c, d = corners if side else corners[::-1]
                    f += [[a, b, c], [a, c, d]]
    return np.array(v, float), np.array(f, np.int64)


def write_obj(path, v, f, head=""):
    with open(path, "w", encoding="utf-8") as out:
        out.write(head)
        out.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in v.tolist())
        out.writelines(f"f {a} {b} {c}\n" for a, b, c in (f + 1).tolist())


def run(*arguments):
    """What the tool prints, run in the working folder; its own line where it fails."""
    done = subprocess.run([tool, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return done.stdout


class Case(unittest.TestCase):
    """With a folder of its own."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, name):
        return os.path.join(self.folder, name)

    def run_tool(self, *arguments):
        done = subprocess.run([tool, *map(str, arguments)], capture_output=True, text=True, cwd=self.folder,
                              check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def room(self):
        """A box on a red and a white floor with a lamp above, as an OBJ."""
        with open(self.path("room.mtl"), "w", encoding="utf-8") as out:
            out.write("newmtl red\nKd 0.8 0.1 0.1\nnewmtl white\nKd 0.7 0.7 0.7\nnewmtl lamp\nKd 0 0 0\nKe 5 5 4\n")
        lines, count = ["mtllib room.mtl\n"], 0

        def mesh(material, v, f):
            nonlocal count
            lines.append(f"o {material}\nusemtl {material}\n")
            lines.extend(f"v {x!r} {y!r} {z!r}\n" for x, y, z in v.tolist())
            lines.extend("f " + " ".join(str(i + 1 + count) for i in face) + "\n" for face in f.tolist())
            count += len(v)
        v, f = cube(1)
        mesh("white", v * 0.4 + [0, 0.41, 0], f)
        grid = np.array([[x, 0.0, z] for x in (-1.5, -0.75, 0, 0.75, 1.5) for z in (-1.5, -0.75, 0, 0.75, 1.5)])
        quads = np.array([[i * 5 + j, i * 5 + j + 1, i * 5 + j + 6, i * 5 + j + 5] for i in range(4) for j in range(4)])
        mesh("red", grid, quads)
        mesh("lamp", np.array([[-.3, 2.0, -.3], [.3, 2, -.3], [.3, 2, .3], [-.3, 2, .3]]), np.array([[0, 1, 2, 3]]))
        with open(self.path("room.obj"), "w", encoding="utf-8") as out:
            out.writelines(lines)
        return self.path("room.obj")
