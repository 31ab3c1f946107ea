"""Arrays against a file read by plain numpy from docs/file-format.md; and the input's vertices."""
import json
import struct

import lambent
import made
import numpy as np


def read_baked(path):
    """The extension, and a function that gives a buffer view as an array: GLB 2.0, docs/file-format.md."""
    with open(path, "rb") as f:
        data = f.read()
    magic, version, length, json_length = struct.unpack_from("<4sIII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    document = json.loads(data[20:20 + json_length])
    binary = data[20 + json_length + 8:]

    def values(view, dtype):
        v = document["bufferViews"][view]
        start = v.get("byteOffset", 0)
        return np.frombuffer(binary[start:start + v["byteLength"]], dtype)
    return document, document["extensions"]["LAMBENT_transfer"], values


def plain_transfer(path):
    _, extension, values = read_baked(path)
    t = extension["transfer"]
    data = values(t["bufferView"], "<f2" if t["precision"] == "half" else "<f4")
    rows, columns = t.get("rows", 1), t["order"]**2
    blocks = data.reshape(-1, rows, t["channels"], columns, 16)
    return np.concatenate([np.moveaxis(b, 3, 0) for b in blocks])[:t["receivers"]]


class Arrays(made.Case):
    def test_transfer(self):
        room = self.room()
        for options in ({"order": 3}, {"order": 2, "precision": "single"}, {"bounces": 0},
                        {"transfer": "matrix", "order": 2, "incident_order": 3}):
            baked = lambent.bake(room, samples=32, **options)
            baked.save(self.path("b.glb"))
            opened = lambent.open(self.path("b.glb"))
            plain = plain_transfer(self.path("b.glb"))
            for b in (baked, opened):
                np.testing.assert_array_equal(b.values, plain)
                self.assertEqual(b.transfer.dtype, plain.dtype)
                self.assertFalse(b.transfer.flags.writeable)
            with self.assertRaises(ValueError):
                opened.transfer[:] = 0
            where = opened.transfer.__array_interface__["data"][0]
            del opened, b  # the array keeps its file
            self.assertNotEqual(where, 0)

    def test_transfer_is_in_place(self):
        lambent.bake(self.room(), samples=16).save(self.path("b.glb"))
        baked = lambent.open(self.path("b.glb"))
        a, b = baked.transfer, baked.transfer
        self.assertEqual(a.__array_interface__["data"], b.__array_interface__["data"])
        address = a.__array_interface__["data"][0]
        with open("/proc/self/maps", encoding="utf-8") as maps:
            ranges = [([int(x, 16) for x in line.split()[0].split("-")], line) for line in maps]
        inside = [line for (low, high), line in ranges if low <= address < high]
        self.assertTrue(inside[0].rstrip().endswith("b.glb"))
        del baked, b
        self.assertTrue(np.isfinite(a.astype(np.float32)).all())

    def test_relight(self):
        baked = lambent.bake(self.room(), samples=64, order=4)
        env = lambent.environment("sky:elevation=20,azimuth=70")
        light = env.project(4)
        expected = np.einsum("rxck,kc->rc", baked.values.astype(np.float64), light)
        for given in (env, "sky:elevation=20,azimuth=70", light, np.asfortranarray(light.astype(np.float64))):
            np.testing.assert_allclose(baked.relight(given), expected, atol=2e-6 * np.abs(light).sum())
        out = np.zeros((baked.receivers, 3), np.float32)
        self.assertIs(baked.relight(light, out=out), out)
        np.testing.assert_allclose(out, expected, atol=2e-6 * np.abs(light).sum())
        for wrong in (np.zeros((3, 3), np.float32), np.zeros((baked.receivers, 3)), out[::2], out[:, ::-1], "x",
                      np.asfortranarray(out)):
            with self.assertRaisesRegex(lambent.Error, "^out: must be"):
                baked.relight(light, out=wrong)
        out.setflags(write=False)
        with self.assertRaisesRegex(lambent.Error, "^out: must be"):
            baked.relight(light, out=out)
        with self.assertRaises(lambent.Error):
            baked.relight(light[:9])

    def test_lamps_and_lobes(self):
        baked = lambent.bake(self.room(), transfer="lightmap", receivers="vertices", light_groups=True, samples=32)
        self.assertEqual(baked.groups, ["lamp"])
        np.testing.assert_allclose(baked.relight(None, lamp="lamp=2"), 2 * baked.relight(), rtol=1e-6)
        lobes = lambent.bake(self.room(), light="sh:2+lamps:1@sky:elevation=40", samples=32)
        self.assertEqual(lobes.lobes.shape, (1, 4))
        np.testing.assert_allclose(np.linalg.norm(lobes.lobes[:, :3], axis=1), 1, atol=1e-5)
        self.assertEqual(lobes.project("sky:elevation=40").shape, (5, 3))

    def test_scene_arrays(self):
        v, f = made.bowl()
        scene = lambent.Scene(v, f)
        np.testing.assert_array_equal(scene.vertices, v.astype(np.float32))
        np.testing.assert_array_equal(scene.faces, f)
        made.write_obj(self.path("bowl.obj"), v, f)
        loaded = lambent.load(self.path("bowl.obj"))
        np.testing.assert_array_equal(scene.normals, loaded.normals)
        a, b = lambent.bake(scene, samples=32), lambent.bake(loaded, samples=32)
        np.testing.assert_array_equal(a.transfer, b.transfer)
        self.assertEqual(a.request["samples"], 32)


class InputVertices(made.Case):
    def check(self, scene, v):
        baked = lambent.bake(scene, samples=32, bounces=0)
        baked.save(self.path("b.glb"))
        opened = lambent.open(self.path("b.glb"))
        for b in (baked, opened):
            pairs = b.input_receivers
            where = b.scene.vertices.astype(np.float64) + b.scene.origin
            places = np.full((b.receivers, 3), np.nan)  # of receivers, by the scene's vertices
            seen = b.front != 0xFFFFFFFF
            places[b.front[seen]] = where[seen]
            np.testing.assert_allclose(places[pairs[:, 1]], v[pairs[:, 0]], rtol=1e-6, atol=1e-6)
            self.assertEqual(len(b.input_vertices), len(v))
            self.assertEqual(set(pairs[:, 1]), set(b.front[seen & (b.front != 0xFFFFFFFF)]) - self.made_only(b))
        # A value that is the place of each receiver comes back as the input's places.
        used = np.unique(pairs[:, 0])
        back = opened.by_input_vertex(places.astype(np.float32))
        np.testing.assert_allclose(back[used], v[used], rtol=1e-5, atol=1e-5)
        np.testing.assert_array_equal(back[np.setdiff1d(np.arange(len(v)), used)], 0)
        np.testing.assert_array_equal(opened.input_vertices == -1, ~np.isin(np.arange(len(v)), used))
        np.testing.assert_array_equal(opened.input_receivers, baked.input_receivers)
        return opened

    @staticmethod
    def made_only(b):
        made_ones = b.scene.input == 0xFFFFFFFF if len(b.scene.input) == len(b.front) else np.zeros(len(b.front), bool)
        return set(b.front[made_ones]) - set(b.front[~made_ones])

    def test_split_at_creases(self):
        v, f = made.cube(3)
        baked = self.check(lambent.Scene(v, f), v)
        self.assertGreater(baked.receivers, len(v))  # corners have three
        corners = np.bincount(baked.input_receivers[:, 0])
        self.assertEqual(np.sort(corners)[-8:].tolist(), [3] * 8)

    def test_unused_and_shuffled(self):
        v, f = made.sphere()
        order = np.random.default_rng(1).permutation(len(v) + 7)
        w = np.concatenate([v, 9 + np.arange(21.0).reshape(7, 3)])
        shuffled = np.empty_like(w)
        shuffled[order] = w
        baked = self.check(lambent.Scene(shuffled, order[f]), shuffled)
        self.assertEqual((baked.input_vertices == -1).sum(), 7)

    def test_files(self):
        v, f = made.cube(2)
        made.write_obj(self.path("c.obj"), v, f)
        self.check(lambent.load(self.path("c.obj")), v)
        with open(self.path("c.ply"), "w", encoding="utf-8") as out:
            out.write(f"ply\nformat ascii 1.0\nelement vertex {len(v)}\nproperty float x\nproperty float y\n"
                      f"property float z\nelement face {len(f)}\nproperty list uchar int vertex_indices\nend_header\n")
            out.writelines(f"{x} {y} {z}\n" for x, y, z in v)
            out.writelines(f"3 {a} {b} {c}\n" for a, b, c in f)
        self.check(lambent.load(self.path("c.ply")), v)
        far = v + [4e5, 0, 5e6]
        made.write_obj(self.path("far.obj"), far, f)
        self.check(lambent.load(self.path("far.obj")), far)

    def test_plain_reader(self):
        v, f = made.cube(2)
        lambent.bake(lambent.Scene(v, f), samples=8, ground=True, max_edge=0.7).save(self.path("b.glb"))
        document, extension, values = read_baked(self.path("b.glb"))
        self.assertEqual(extension["inputVertices"], len(v))
        met = set()
        for part in extension["parts"]:
            primitive = document["meshes"][document["nodes"][part["node"]]["mesh"]]["primitives"][part["primitive"]]
            accessor = document["accessors"][primitive["attributes"]["POSITION"]]
            places = values(accessor["bufferView"], "<f4")[accessor.get("byteOffset", 0) // 4:][:3 * accessor["count"]]
            for place, number in zip(places.reshape(-1, 3), values(part["input"], "<u4")):
                if number != 0xFFFFFFFF:
                    np.testing.assert_allclose(place, v[number], atol=1e-6)
                    met.add(int(number))
        self.assertEqual(met, set(range(len(v))))

    def test_broken_map(self):
        v, f = made.cube(1)
        lambent.bake(lambent.Scene(v, f), samples=8).save(self.path("b.glb"))
        with open(self.path("b.glb"), "rb") as file:
            data = file.read()
        count = struct.unpack_from("<I", data, 12)[0]
        for change, message in ((lambda e: e.update(inputVertices=7), "vertex 7 of the input is not there"),
                                (lambda e: e.update(inputVertices=-1), "\"inputVertices\" is missing or out of range"),
                                (lambda e: e.update(inputVertices="8"), "\"inputVertices\" is missing or out of range"),
                                (lambda e: e["parts"][0].update(input=10**6), "does not exist"),
                                (lambda e: e["parts"][0].update(input=e["transfer"]["bufferView"]), "holds"),
                                (lambda e: e["parts"][0].pop("input"), "where there are 24 vertices as they came")):
            document = json.loads(data[20:20 + count])
            change(document["extensions"]["LAMBENT_transfer"])
            text = json.dumps(document).encode().ljust(count + 40)
            text += b" " * (-len(text) % 4)
            with open(self.path("c.glb"), "wb") as file:
                rest = data[20 + count:]
                head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
                file.write(head + text + rest)
            with self.assertRaises(lambent.Error) as raised:
                lambent.open(self.path("c.glb"))
            self.assertIn(message, str(raised.exception))
            self.assertNotIn("\n", str(raised.exception))

    def test_as_they_come(self):
        v, f = made.sphere()
        lambent.bake(lambent.Scene(v, f), samples=8).save(self.path("b.glb"))
        _, extension, _ = read_baked(self.path("b.glb"))
        self.assertEqual(extension["inputVertices"], len(v))
        self.assertNotIn("input", extension["parts"][0])
        np.testing.assert_array_equal(lambent.open(self.path("b.glb")).front,
                                      lambent.open(self.path("b.glb")).input_vertices)


if __name__ == "__main__":
    made.unittest.main()
