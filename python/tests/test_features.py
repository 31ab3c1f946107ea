"""PRT features against closed forms, the bake, and numbers of the public script of PIFu."""
import lambent
import made
import numpy as np

SIGNS = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])  # (-1)^m


def two():
    """A ball that floats above a block."""
    v, f = made.sphere(1)
    w, g = made.cube(1)
    return np.concatenate([v * 0.5 + [0, 1.1, 0.2], w * [1.2, 0.3, 0.9]]), np.concatenate([f, g + len(v)])


class Features(made.Case):
    def test_open_sphere(self):
        """A convex body shadows nothing above its own tangent planes, but for its facets' share."""
        v, f = made.sphere(4)
        prt, faces = lambent.prt_features(v, f)
        self.assertEqual((prt.dtype, prt.shape, faces.dtype), (np.float32, (len(v), 9), np.int64))
        np.testing.assert_array_equal(faces, f)
        bands = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)
        expected = SIGNS * bands * lambent.sh.evaluate(3, v)
        np.testing.assert_allclose(prt, expected, atol=0.02)
        unity = lambent.sh.convert((prt * SIGNS).T, "unity", True).T
        for name, ours in (("lambent", prt * SIGNS), ("three", prt), ("unity", unity)):
            other, _ = lambent.prt_features(v, f, convention=name)
            np.testing.assert_allclose(other, ours, rtol=1e-6)

    def test_normals(self):
        v, f = made.bowl(2)
        a, b, c = (v[f[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        face /= np.linalg.norm(face, axis=1)[:, None]
        sums = np.zeros_like(v)
        for k in range(3):
            p, q, r = (v[f[:, (k + i) % 3]] for i in range(3))
            cosine = ((q - p) * (r - p)).sum(1) / np.linalg.norm(q - p, axis=1) / np.linalg.norm(r - p, axis=1)
            np.add.at(sums, f[:, k], np.arccos(cosine)[:, None] * face)
        sums /= np.linalg.norm(sums, axis=1)[:, None]
        np.testing.assert_allclose(lambent.vertex_normals(v, f), sums, atol=1e-6)

    def test_against_their_loop(self):
        """The public script's sum, over our own plain intersections in numpy, with the same many directions."""
        v, f = two()
        normals = lambent.vertex_normals(v, f).astype(float)
        rng, n, runs = np.random.default_rng(5), 1600, 24
        lift = 1e-3 * np.ptp(v, axis=0).min()
        a, e, g = v[f[:, 0]], v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]
        totals = []
        for _ in range(runs):
            theta, phi = np.arccos(1 - 2 * rng.random(n)), 2 * np.pi * rng.random(n)
            d = np.stack([-np.sin(theta) * np.cos(phi), -np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
            basis = lambent.sh.evaluate(3, d * [-1, -1, 1]).astype(float)
            p = np.cross(d[:, None], g[None])
            det = (p * e).sum(2)
            values = np.zeros((len(v), 9))
            for i, origin in enumerate(v + lift * normals):
                s = origin - a
                with np.errstate(divide="ignore", invalid="ignore"):
                    u = (p * s).sum(2) / det
                    q = np.cross(s, e)
                    w, t = d @ q.T / det, (q * g).sum(1) / det
                hit = ((u >= 0) & (w >= 0) & (u + w <= 1) & (t > 0)).any(1)
                values[i] = ((d @ normals[i]).clip(0) * ~hit) @ basis * 4 * np.pi / n
            totals.append(values)
        totals = np.array(totals)
        noise = totals.std(0, ddof=1).mean() / np.sqrt(runs)
        prt, _ = lambent.prt_features(v, f, samples=1 << 14)
        self.assertLess(np.abs(prt - totals.mean(0)).max(), 5 * noise)
        self.assertLess(np.sqrt(((prt - totals.mean(0))**2).mean()), 1.5 * noise)

    def test_public_script(self):
        """Means of 8 runs of apps/prt_util.py (PIFu, f0a9c99) at its 40^2 directions, with trimesh 5.0.0rc1 and numpy
        1.24, at some vertices of three meshes; one run is off by sigma RMS, so these means by sigma / sqrt(8)."""
        for name, (v, f) in {"bowl": made.bowl(2), "cube": made.cube(3), "two": two()}.items():
            vertices, values, sigma = PUBLIC[name]
            prt, _ = lambent.prt_features(v, f)
            off = prt[vertices] - np.array(values)
            self.assertLess(np.sqrt((off**2).mean()), 2 * sigma / 8**0.5, name)
            self.assertLess(np.abs(off).max(), 5 * sigma / 8**0.5, name)

    def test_export(self):
        v, f = made.cube(3)
        made.write_obj(self.path("c.obj"), v, f)
        self.run_tool("bake", self.path("c.obj"), "-o", self.path("c.glb"), "--order", 3, "--bounces", 0,
                      "--samples", 1024, "--ground")
        baked = lambent.open(self.path("c.glb"))
        mean = baked.by_input_vertex(baked.values[:, 0, 0].astype(np.float32))
        for convention, factor in (("pifu", SIGNS), ("icon", SIGNS), ("lambent", 1), ("three", SIGNS), ("filament", 1),
                                   ("unity", lambent.sh.convert(np.ones(9), "unity", transfer=True)), ("directx", 1)):
            out = self.path(convention)
            self.run_tool("export", self.path("c.glb"), "--npy", out, "--convention", convention)
            if convention == "pifu":
                values, faces = np.loadtxt(out + "/bounce/bounce0.txt"), np.load(out + "/bounce/face.npy")
            elif convention == "icon":
                values, faces = np.load(out + "/bounce.npy"), np.load(out + "/face.npy")
            else:
                values, faces = np.load(out + "/prt.npy"), np.load(out + "/faces.npy")
                self.assertEqual(values.dtype, np.float32)
            np.testing.assert_allclose(values, np.pi * mean * factor, rtol=1e-5, atol=1e-6)
            self.assertEqual({frozenset(t) for t in faces.tolist()}, {frozenset(t) for t in f.tolist()})
        self.run_tool("bake", self.path("c.obj"), "-o", self.path("split.glb"), "--bounces", 0, "--max-edge", 0.1)
        with self.assertRaises(Exception):
            self.run_tool("export", self.path("split.glb"), "--npy", self.path("split"))
        features = lambent.prt_features(v, f)
        for convention in ("pifu", "icon", "three"):
            paths = lambent.save_prt_features(self.path("p" + convention), *features, convention)
            read = np.loadtxt(paths[0]) if paths[0].endswith(".txt") else np.load(paths[0])
            np.testing.assert_allclose(read, features[0], atol=1e-7)
            np.testing.assert_array_equal(np.load(paths[1]), f)

    def test_export_refuses(self):
        room = self.room()
        self.run_tool("bake", room, "-o", self.path("colour.glb"), "--samples", 16)
        self.run_tool("bake", room, "-o", self.path("zonal.glb"), "--samples", 16, "--transfer", "zonal")
        import subprocess
        for arguments, message in ((("colour.glb", "--npy", "x"), "has coloured bounces"),
                                   (("zonal.glb", "--npy", "x"), "takes diffuse transfer"),
                                   (("colour.glb", "--npy", "x", "--convention", "y"), "--convention: must be one of")):
            done = subprocess.run([made.tool, "export", *arguments], cwd=self.folder, capture_output=True, text=True,
                                  check=False)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(message, done.stderr)

    def test_light(self):
        """Features times an environment's coefficients: irradiance with shadows."""
        v, f = two()
        prt, _ = lambent.prt_features(v, f)
        lights = lambent.environment_features(["uniform:0.5,1,2", "sky:elevation=50"])
        self.assertEqual((lights.dtype, lights.shape), (np.float32, (2, 9, 3)))
        baked = lambent.bake(lambent.Scene(v, f), order=3, bounces=0, samples=1024)
        ball = np.arange(18)  # of which no vertex is split
        exit_radiance = baked.by_input_vertex(baked.relight("sky:elevation=50"))[ball]
        np.testing.assert_allclose((prt @ lights[1])[ball] / np.pi, exit_radiance, rtol=0.05, atol=0.02)

    def test_bad(self):
        v, f = made.sphere(1)
        cases = [((v * [1, 1, 0], f), "vertices: lie in a plane"), ((v, f, 0), "order: "), ((v, f + 99), "faces"),
                 ((v, f, 3, "x"), "convention: must be one of"), ((v * np.nan, f), "vertices")]
        for arguments, message in cases:
            with self.assertRaisesRegex(lambent.Error, message):
                lambent.prt_features(*arguments)
        with self.assertRaisesRegex(lambent.Error, "normals: has"):
            lambent.prt_features(v, f, normals=v[1:])


PUBLIC = {  # mesh: vertices, their features, sigma of one run
    "bowl": ([0, 2, 7, 20, 33, 60], [
        [0.875, 0.014, 0.004, 1.006, 0.023, 0.008, -0.244, 0.014, 0.414],
        [0.413, 0.623, -0.002, -0.005, -0.009, -0.003, -0.301, 0.003, -0.516],
        [0.892, 0.983, 0.312, -0.002, -0.005, 0.254, -0.187, -0.001, -0.387],
        [0.877, 0.018, 0.390, 0.934, 0.025, 0.010, -0.143, 0.308, 0.356],
        [0.888, 0.013, 0.946, -0.393, -0.006, 0.015, 0.381, -0.303, 0.061],
        [0.890, -0.446, -0.448, -0.801, 0.287, 0.179, -0.095, 0.271, 0.180],
    ], 0.0328),
    "cube": ([0, 5, 13, 27, 40, 55], [
        [0.894, -0.602, -0.606, -0.578, 0.280, 0.312, 0.024, 0.266, -0.013],
        [0.887, -0.725, -0.004, -0.717, 0.423, 0.009, -0.240, -0.013, -0.005],
        [0.887, 0.729, 0.013, -0.727, -0.441, 0.007, -0.255, -0.016, -0.001],
        [0.881, 0.010, 0.722, 0.717, 0.016, 0.009, 0.121, 0.430, 0.207],
        [0.891, 1.027, 0.009, -0.002, -0.005, 0.010, -0.250, -0.001, -0.425],
        [0.885, 0.006, 1.020, -0.003, 0.003, 0.010, 0.488, -0.003, -0.002],
    ], 0.0326),
    "two": ([3, 8, 12, 17, 19, 25], [
        [0.064, -0.022, 0.023, -0.001, 0.001, -0.016, 0.051, -0.000, 0.043],
        [0.834, 0.078, 0.715, 0.681, 0.079, 0.022, 0.166, 0.427, 0.249],
        [0.499, -0.189, 0.635, -0.003, 0.003, -0.283, 0.414, -0.002, 0.104],
        [0.358, -0.048, -0.486, -0.003, 0.003, 0.082, 0.393, 0.002, 0.129],
        [0.886, 0.589, -0.586, -0.587, -0.295, -0.273, 0.002, 0.267, -0.006],
        [0.877, -0.584, 0.585, 0.580, -0.274, -0.278, -0.001, 0.284, -0.010],
    ], 0.0305),
}

if __name__ == "__main__":
    made.unittest.main()
