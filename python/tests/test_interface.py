"""Stubs say what is there; all of it says what it does; harmonics and pictures."""
import ast
import inspect
import os
import pathlib

import lambent
import made
import numpy as np


def parameters(f):
    return [p.name for p in inspect.signature(f).parameters.values() if p.name != "self"]


class Interface(made.Case):
    def test_stubs(self):
        with open(os.path.join(os.path.dirname(lambent.__file__), "__init__.pyi"), encoding="utf-8") as f:
            stubs = ast.parse(f.read())
        functions = {s.name: s for s in stubs.body if isinstance(s, ast.FunctionDef)}
        classes = {s.name: s for s in stubs.body if isinstance(s, ast.ClassDef)}
        said = set(functions) | (set(classes) - {"_Sh"}) | {"sh"}
        self.assertEqual(said, set(lambent.__all__))

        def check(stub, f):
            a = stub.args
            names = [x.arg for x in [*a.args, a.vararg, *a.kwonlyargs, a.kwarg] if x]
            try:
                self.assertEqual([n for n in names if n != "self"], parameters(f), stub.name)
            except ValueError:  # of C++
                for n in names:
                    self.assertTrue(n == "self" or n in f.__doc__, (stub.name, n))
        for name, stub in functions.items():
            check(stub, getattr(lambent, name))
            self.assertTrue(getattr(lambent, name).__doc__, name)
        for member in classes["_Sh"].body:
            check(member, getattr(lambent.sh, member.name))
        for name, stub in classes.items():
            if name in ("_Sh", "Error"):
                continue
            kind = getattr(lambent, name)
            members = {m.name for m in stub.body} - {"__init__", "_repr_png_"}
            self.assertEqual(members, {m for m in dir(kind) if not m.startswith("_")}, name)
            self.assertTrue(kind.__doc__)

    def test_harmonics(self):
        d = np.random.default_rng(2).normal(size=(50, 3))
        d /= np.linalg.norm(d, axis=1)[:, None]
        x, y, z = d.T
        k = np.sqrt([1 / (4 * np.pi), 3 / (4 * np.pi), 15 / (4 * np.pi), 5 / (16 * np.pi), 15 / (16 * np.pi)])
        expected = np.stack([0 * x + k[0], -k[1] * y, k[1] * z, -k[1] * x, k[2] * x * y, -k[2] * y * z,
                             k[3] * (3 * z * z - 1), -k[2] * x * z, k[4] * (x * x - y * y)], 1)
        np.testing.assert_allclose(lambent.sh.evaluate(3, d), expected, atol=1e-6)
        c = np.arange(1.0, 10)
        np.testing.assert_allclose(lambent.sh.project(3, lambda e: lambent.sh.evaluate(3, e) @ c), c, atol=1e-5)
        angle = 0.7
        R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]) \
            @ np.array([[1, 0, 0], [0, np.cos(1.1), -np.sin(1.1)], [0, np.sin(1.1), np.cos(1.1)]])
        np.testing.assert_allclose(expected @ lambent.sh.rotate(c, R), lambent.sh.evaluate(3, d @ R) @ c, atol=2e-5)
        rgb = np.stack([c, 2 * c, -c], 1)
        np.testing.assert_allclose(lambent.sh.rotate(rgb, R)[:, 1], 2 * lambent.sh.rotate(c, R), atol=1e-5)
        two = lambent.sh.multiply(c[:4], c[5:], 3)
        values = (expected[:, :4] @ c[:4]) * (expected[:, :4] @ c[5:])
        np.testing.assert_allclose(lambent.sh.evaluate(3, d) @ two, values, atol=2e-4)
        sh = lambent.sh
        for function, *bad in ((sh.rotate, c[:5], R), (sh.rotate, c, 2 * R), (sh.evaluate, 17, d), (sh.convert, c, "x"),
                               (sh.multiply, c, c[:3]), (sh.evaluate, 3, d[0])):
            self.assertRaises(lambent.Error, function, *bad)

    def test_convert(self):
        c, t = np.random.default_rng(1).normal(size=(2, 9)).astype(np.float32)
        signs = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])  # (-1)^m
        for same in ("lambent", "filament", "directx"):
            np.testing.assert_array_equal(lambent.sh.convert(c, same), c)
        for signed in ("three", "pifu", "icon"):
            np.testing.assert_array_equal(lambent.sh.convert(c, signed), c * signs)
        bands = np.array([1] + [2 / 3] * 3 + [1 / 4] * 5)
        np.testing.assert_allclose(lambent.sh.convert(c, "gltf-ibl"), c * bands * np.pi, rtol=1e-6)
        for name in ("lambent", "three", "pifu", "unity", "godot", "gltf-ibl"):
            product = lambent.sh.convert(c, name).astype(float) @ lambent.sh.convert(t, name, transfer=True)
            self.assertAlmostEqual(product, float(c.astype(float) @ t), places=5)
        self.assertEqual(len(lambent.sh.convert(np.ones(16), "unity")), 9)

    def test_environments(self):
        env = lambent.environment("uniform:1,2,3")
        np.testing.assert_allclose(env.project(2)[0], np.array([1, 2, 3]) * np.sqrt(4 * np.pi), rtol=1e-5)
        rng = np.random.default_rng(4).random((16, 32, 3)).astype(np.float32)
        made_env = lambent.environment(rng)
        np.testing.assert_array_equal(made_env.image.array, rng)
        y = np.arange(17) / 16 * np.pi
        weight = 2 * np.pi / 32 * (np.cos(y[:-1]) - np.cos(y[1:]))
        expected = (rng * weight[:, None, None]).sum((0, 1)) / np.sqrt(4 * np.pi)
        np.testing.assert_allclose(made_env.project(1)[0], expected, rtol=1e-4)
        sky = lambent.sky(elevation=30, sun="off")
        self.assertEqual(sky.image.width, 1024)
        np.testing.assert_array_equal(sky.image.array, lambent.environment("sky:elevation=30,sun=off").image.array)
        self.assertEqual(sky._repr_png_()[:8], b"\x89PNG\r\n\x1a\n")
        back = lambent.sh.reconstruct(sky.project(4)).project(4)
        np.testing.assert_allclose(back, sky.project(4), atol=1e-2)

    def test_pictures(self):
        a = np.random.default_rng(3).random((12, 20, 3)).astype(np.float32)
        picture = lambent.Image(a)
        np.testing.assert_array_equal(picture.array, a)
        picture.save(pathlib.Path(self.path("a.exr")))
        np.testing.assert_allclose(lambent.load_image(self.path("a.exr")).array, a, rtol=1e-3, atol=1e-4)
        b = a + np.float32(0.25)
        self.assertAlmostEqual(lambent.compare(picture, b)["rmse"], 0.25, places=6)
        self.assertEqual(lambent.compare(a, a)["psnr"], float("inf"))
        self.assertGreater(lambent.difference(a, b).width, 20)
        with self.assertRaises(lambent.Error):
            lambent.compare(a, a[:, :5])
        with self.assertRaises(lambent.Error):
            picture.save(self.path("a.bmp"))

    def test_bar(self):
        import contextlib
        import io
        scene, said = lambent.Scene(*made.sphere(1)), io.StringIO()
        with contextlib.redirect_stderr(said):
            lambent.bake(scene, samples=8, progress=True)
        self.assertRegex(said.getvalue(), "measuring the error: *100")


if __name__ == "__main__":
    made.unittest.main()
