"""What `lambent export` writes for Godot, Unity and three.js, read back as they read it, layer by layer: by the
formulas of their shaders and the layouts of their loaders (docs/engines.md names their sources). They themselves are
not run."""
import json
import os
import re
import sys
import tempfile
import unittest

import numpy as np
from exr import read_exr, read_rgb
from made import run

repository = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(repository, "integrations", "blender", "lambent_bake"))
import glb as glb_module  # noqa: E402

BOX = """mtllib box.mtl
o room
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
v 0.5 1.8 0.5
v 1.5 1.8 0.5
v 1.5 1.8 1.5
v 0.5 1.8 1.5
usemtl wall
f 4 3 2 1
f 1 2 6 5
o lamp
usemtl lamp
f 7 8 9 10
o step: a/b
usemtl wall
v 0.2 0 1.2
v 0.8 0 1.2
v 0.8 0.6 0.9
v 0.2 0.6 0.9
f 11 12 13 14
"""
MATERIALS = "newmtl wall\nKd 0.7 0.6 0.5\nnewmtl lamp\nKd 0 0 0\nKe 6 5 4\n"
normals = np.random.default_rng(1).normal(size=(12, 3))
normals /= np.linalg.norm(normals, axis=1, keepdims=True)


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def text_of(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def parse(text):
    """Godot's text resources: sections, and in each the properties as Python values; calls are (name, arguments)."""
    number, name = r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?", r"[A-Za-z_][A-Za-z_0-9]*(?:\[[A-Za-z]+\])?"
    tokens = re.findall(r'"(?:\\.|[^"\\])*"|' + number + "|" + name + r"|\S", text)
    at = 0

    def value():
        nonlocal at
        token = tokens[at]
        at += 1
        if token[0] == '"':
            return json.loads(token)
        if token in ("true", "false"):
            return token == "true"
        if token == "[":
            return items("]")
        if token == "{":
            pairs = {}
            while tokens[at] != "}":
                key = value()
                assert tokens[at] == ":", tokens[at]
                at += 1
                pairs[key] = value()
                at += tokens[at] == ","
            at += 1
            return pairs
        if re.match(r"[-+0-9.]", token):
            return float(token) if re.search(r"[.e]", token) else int(token)
        assert tokens[at] == "(", (token, tokens[at])
        at += 1
        return token, items(")")

    def items(end):
        nonlocal at
        out = []
        while tokens[at] != end:
            out.append(value())
            at += tokens[at] == ","
        at += 1
        return out
    sections = []
    while at < len(tokens):
        if tokens[at] == "[":
            name, at, head = tokens[at + 1], at + 2, {}
            while tokens[at] != "]":
                key = tokens[at]
                assert tokens[at + 1] == "="
                at += 2
                head[key] = value()
            at += 1
            sections.append((name, head, {}))
        else:
            key = tokens[at]
            assert tokens[at + 1] == "=", tokens[at:at + 3]
            at += 2
            sections[-1][2][key] = value()
    return sections


def three_irradiance(c, n):
    """shGetIrradianceAt() of three.js, of coefficients (9 or 4, ..., 3)."""
    x, y, z = n
    e = 0.886227 * c[0] + 2 * 0.511664 * (c[1] * y + c[2] * z + c[3] * x)
    if len(c) == 9:
        e = e + 2 * 0.429043 * (c[4] * x * y + c[5] * y * z + c[7] * x * z) + c[6] * (0.743125 * z * z - 0.247708) + \
            0.429043 * c[8] * (x * x - y * y)
    return e


def godot_capture(c, n):
    """Ambient light of a lightmap capture in Godot's scene shader, of 9 coefficients."""
    x, y, z = n
    return 0.886227 * c[0] + 1.023327 * (c[1] * y + c[2] * z + c[3] * x) + \
        0.858086 * (c[4] * x * y + c[5] * y * z + c[7] * x * z) + 0.247708 * c[6] * (3 * z * z - 1) + \
        0.429043 * c[8] * (x * x - y * y)


def unity_light(c, n):
    """ShadeSH9() of Unity's shaders, from SphericalHarmonicsL2's numbers as SetSHCoefficients packs them."""
    x, y, z = n
    return c[3] * x + c[1] * y + c[2] * z + c[0] - c[6] + c[4] * x * y + c[5] * y * z + 3 * c[6] * z * z + \
        c[7] * z * x + c[8] * (x * x - y * y)


def look_up(picture, uv):
    h, w = picture.shape[:2]
    x, y = np.clip(uv[:, 0] * w - 0.5, 0, w - 1), np.clip(uv[:, 1] * h - 0.5, 0, h - 1)
    i, j = np.minimum(x.astype(int), w - 2), np.minimum(y.astype(int), h - 2)
    s, t = (x - i)[:, None], (y - j)[:, None]
    return (1 - t) * ((1 - s) * picture[j, i] + s * picture[j, i + 1]) + \
        t * ((1 - s) * picture[j + 1, i] + s * picture[j + 1, i + 1])


class Engines(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.held = tempfile.TemporaryDirectory()
        cls.old = os.getcwd()
        os.chdir(cls.held.name)
        write("box.obj", BOX)
        write("box.mtl", MATERIALS)
        common = ["--transfer", "lightmap", "--sky", "uniform:0.3,0.4,0.6", "--texels-per-unit", "12", "--samples",
                  "128", "--bounces", "2"]
        run("bake", "box.obj", *common, "-o", "flat.glb")
        run("bake", "box.obj", *common, "--light-groups", "-o", "groups.glb")
        run("bake", "box.obj", *common, "--directional", "sh:2", "-o", "bent.glb")
        run("bake", "box.obj", "--lattice", "3,2,4", "--samples", "128", "--bounces", "1", "-o", "free.glb")

    @classmethod
    def tearDownClass(cls):
        os.chdir(cls.old)
        cls.held.cleanup()

    def export(self, *arguments):
        return json.loads(run("export", *arguments, "--json"))

    def layers(self, path):
        """The slices that Godot cuts an imported picture into."""
        settings = text_of(path + ".import")
        self.assertIn('importer="2d_array_texture"', settings)
        self.assertIn("slices/horizontal=1", settings)
        count = int(re.search(r"slices/vertical=(\d+)", settings)[1])
        picture = read_rgb(path)
        self.assertEqual(len(picture) % count, 0)
        return picture.reshape(count, -1, *picture.shape[1:])

    def test_godot_and_unity_see_what_three_sees(self):
        self.export("bent.glb", "--three", "three")
        probe = np.stack([read_rgb(f"three.{k}.exr") for k in range(4)])
        lit = probe[0].min(2) > 0.05
        for version in ("4.3", "4.4", "4.5", "4.6"):
            self.export("bent.glb", "--godot", "godot", "--godot-version", version)
            layers = self.layers("godot.layers.exr")
            self.assertEqual(len(layers), 4)
            np.testing.assert_array_equal(layers, np.stack([read_rgb(f"godot.{k}.exr") for k in range(4)]))
            for n in normals:
                x, y, z = n
                if version == "4.3":
                    ours = layers[0] * 0.282095 + 0.32573 * (layers[1] * y + layers[2] * z + layers[3] * x)
                else:
                    m = 2 * layers[1:] - 1
                    ours = layers[0] * (1 + 4 * (m[0] * y + m[1] * z + m[2] * x))
                off = np.abs(ours[lit] - three_irradiance(probe, n)[lit] / np.pi).max(1)
                # Texels beyond the surface are means of neighbours', and a mean of packed layers is not that of light.
                self.assertLessEqual(np.mean(off > 0.01), 0 if version == "4.3" else 0.01)
                self.assertLess(np.median(off), 0.002)
        self.export("bent.glb", "--unity", "unity")
        color, direction = read_rgb("unity.color.exr"), read_exr("unity.direction.exr")
        d = np.stack([direction[c] for c in "RGB"], 2) - 0.5
        luminance, w = np.array([0.2126, 0.7152, 0.0722]), direction["A"]
        sure = lit & (np.linalg.norm(d, axis=2) < 0.49) & (w > 0.1)  # not cut off to a length of 1
        self.assertGreater(sure.sum(), 150)
        for n in normals:
            ours = (color @ luminance) * (d @ (n * [-1, 1, 1]) + 0.5) / np.maximum(w, 1e-4)  # Unity's x is mirrored
            theirs = three_irradiance(probe, n) @ luminance / np.pi
            off = np.abs(ours[sure] - theirs[sure])  # and beyond the surface, as above
            self.assertLess(np.mean(off > 0.02), 0.1)
            self.assertLess(np.median(off), 0.002)

    def test_godot_resource(self):
        for version in ("4.3", "4.4", "4.5", "4.6"):
            self.export("bent.glb", "--godot", "room", "--godot-version", version, "--probes", "free.glb", "--env",
                        "sky:elevation=30")
            sections = parse(text_of("room.tres"))
            self.assertEqual([s[0] for s in sections], ["gd_resource", "ext_resource", "resource"])
            self.assertEqual(sections[0][1], {"type": "LightmapGIData", "load_steps": 2, "format": 3})
            self.assertTrue(os.path.exists(sections[1][1]["path"]))
            data = sections[2][2]
            textures = [("ExtResource", ["1"])]
            if version == "4.3":
                self.assertEqual(data["light_textures"], textures)
                self.assertNotIn("_uses_packed_directional", data)
            else:
                self.assertEqual(data["lightmap_textures"], ("Array[TextureLayered]", [textures]))
                self.assertIs(data["_uses_packed_directional"], True)
            self.assertIs(data["uses_spherical_harmonics"], True)
            users = np.array(data["user_data"], object).reshape(-1, 4)
            nodes = {n["name"] for n in glb_module.Glb.load("room.godot.glb").json["nodes"] if "mesh" in n}
            self.assertEqual({u[0][1][0] for u in users}, {"../" + re.sub('[.:@/"%]', "_", n) for n in nodes})
            self.assertTrue(all(u[1] == ("Rect2", [0, 0, 1, 1]) and u[2] == 0 and u[3] == -1 for u in users))
            self.assertEqual("lightprobe_hash" in data["probe_data"], version == "4.6")
        manifest = json.loads(text_of("room.godot.json"))
        self.assertEqual({u["name"] for u in manifest["users"]}, {re.sub('[.:@/"%]', "_", n) for n in nodes})
        script = text_of("lambent_lightmap.gd")
        for name in ("add_user", "clear_users", "light_data", "@tool", "EditorScript"):
            self.assertIn(name, script)
        self.walk(data["probe_data"])

    def walk(self, data):
        """The tree, as lightmap_tap_sh_light() walks it."""
        points = np.array(data["points"][1], float).reshape(-1, 3)
        sh = np.array(data["sh"][1]).reshape(len(points), 9, 4)[..., :3]
        cells = np.array(data["tetrahedra"][1]).reshape(-1, 4)
        tree = np.array(data["bsp"][1], np.int32).reshape(-1, 6)
        planes = tree[:, :4].copy().view(np.float32).astype(float)
        p = points[cells]
        volume = np.abs(np.linalg.det(p[:, 1:] - p[:, :1])).sum() / 6
        box = np.array(data["bounds"][1])
        self.assertAlmostEqual(volume / np.prod(box[3:]), 1, 4)
        rng = np.random.default_rng(2)
        for place in np.concatenate([box[:3] + rng.random((300, 3)) * box[3:], points]):
            node = 0
            while node >= 0:
                after = tree[node, 4 if planes[node, :3] @ place > planes[node, 3] else 5]
                self.assertTrue(after < 0 or after > node)
                node = after
            corners = points[cells[-node - 1]]
            weights = np.linalg.solve(np.vstack([corners.T, np.ones(4)]), [*place, 1])
            self.assertGreater(weights.min(), -1e-4)
            self.assertLess(weights.max(), 1 + 1e-4)
        three = self.probes_of_three()
        np.testing.assert_allclose(points, np.array(three["positions"]).reshape(-1, 3), rtol=1e-5)
        theirs = np.array(three["sh"]).reshape(-1, 9, 3)
        for n in normals:
            np.testing.assert_allclose([godot_capture(c, n) for c in sh],
                                       [three_irradiance(c, n) / np.pi for c in theirs], atol=1e-4)

    def probes_of_three(self):
        self.export("flat.glb", "--three", "t", "--probes", "free.glb", "--env", "sky:elevation=30")
        return json.loads(text_of("t.probes.json"))

    def test_unity_manifest(self):
        self.export("flat.glb", "--unity", "u", "--per-object", "--probes", "free.glb", "--env", "sky:elevation=30")
        manifest = json.loads(text_of("u.unity.json"))
        self.assertEqual(manifest["version"], 1)
        self.assertFalse(manifest["directional"])
        for lightmap in manifest["lightmaps"]:
            self.assertTrue(os.path.exists(lightmap["color"]), lightmap)
        nodes = {n["name"] for n in glb_module.Glb.load("u.unity.glb").json["nodes"] if "mesh" in n}
        self.assertEqual({o["name"] for o in manifest["objects"]}, nodes)
        self.assertEqual(sorted(o["lightmap"] for o in manifest["objects"]), list(range(len(nodes))))
        three, probes = self.probes_of_three(), manifest["probes"]
        places = np.array(probes["positions"]).reshape(-1, 3) * [-1, 1, 1]
        np.testing.assert_allclose(places, np.array(three["positions"]).reshape(-1, 3), rtol=1e-5)
        for n in normals:
            ours = [unity_light(c, n * [-1, 1, 1]) for c in np.array(probes["sh"]).reshape(-1, 9, 3)]
            theirs = [three_irradiance(c, n) / np.pi for c in np.array(three["sh"]).reshape(-1, 9, 3)]
            np.testing.assert_allclose(ours, theirs, atol=1e-4)
        for name, members in (("LambentLightmap.cs", ("lightmapIndex", "lightmapScaleOffset", "lightmapsMode",
                                                      "bakedProbes", "lightmapDir", "lightmapColor")),
                              ("Editor/LambentImporter.cs", ("probePositions", "TextureImporterType.Lightmap"))):
            text = text_of(name)
            for member in members:
                self.assertIn(member, text)
            self.assertEqual(text.count("{"), text.count("}"))

    def test_probes_under_an_even_sky(self):
        write("speck.obj", "v 0 0 0\nv 0.01 0 0\nv 0 0 0.01\nf 1 2 3\n")
        run("bake", "speck.obj", "--lattice", "2,2,2", "--lattice-box", "-3,-3,-3,3,3,3", "--samples", "256", "-o",
            "speck.glb")
        self.export("flat.glb", "--unity", "even", "--probes", "speck.glb", "--env", "uniform:1,0.5,0.25")
        for c in np.array(json.loads(text_of("even.unity.json"))["probes"]["sh"]).reshape(-1, 9, 3):
            for n in normals:  # irradiance / pi of a sky of radiance L is L
                np.testing.assert_allclose(unity_light(c, n), [1, 0.5, 0.25], rtol=0.02)

    def test_an_atlas_an_object(self):
        self.export("flat.glb", "--godot", "whole")
        told = self.export("flat.glb", "--godot", "own", "--per-object")
        self.assertEqual({o["name"] for o in told["objects"]}, {"room", "lamp", "step: a/b"})
        self.export("flat.glb", "--three", "own3", "--per-object")
        moz = glb_module.Glb.load("own3.three.glb")
        self.assertEqual(len({m["extensions"]["MOZ_lightmap"]["index"] for m in moz.json["materials"]
                              if "MOZ_lightmap" in m.get("extensions", {})}), 3)
        picture, slices = read_rgb("whole.exr"), self.layers("own.layers.exr")
        users = np.array(parse(text_of("own.tres"))[2][2]["user_data"], object).reshape(-1, 4)
        self.assertEqual(len(slices), 3)
        a, b = glb_module.Glb.load("whole.godot.glb"), glb_module.Glb.load("own.godot.glb")
        looked = 0
        for one, other in zip([n for n in a.json["nodes"] if "mesh" in n], [n for n in b.json["nodes"] if "mesh" in n]):
            self.assertEqual(one["name"], other["name"])
            user = next(u for u in users if u[0][1][0] == "../" + re.sub('[.:@/"%]', "_", one["name"]))
            rect = user[1][1]
            for p, q in zip(a.json["meshes"][one["mesh"]]["primitives"], b.json["meshes"][other["mesh"]]["primitives"]):
                uv, own = (g.array(x["attributes"]["TEXCOORD_1"]).astype(float) for g, x in ((a, p), (b, q)))
                index = a.array(p["indices"]) if "indices" in p else np.arange(len(uv))
                corners = index.reshape(-1, 3)
                for weights in ((1, 0, 0), (0.2, 0.3, 0.5), (0.6, 0.1, 0.3)):
                    here = np.einsum("k,tkc->tc", weights, uv[corners])
                    there = np.einsum("k,tkc->tc", weights, own[corners]) * rect[2:] + rect[:2]
                    np.testing.assert_allclose(look_up(picture, here), look_up(slices[user[2]], there), atol=2e-3)
                    looked += len(here)
        self.assertGreater(looked, 15)

    def test_groups_add_up(self):
        self.export("groups.glb", "--godot", "g")
        self.export("groups.glb", "--unity", "gu")
        total = read_rgb("g.lamp.exr") + read_rgb("g.sky.exr")
        np.testing.assert_allclose(self.layers("g.layers.exr")[0], total, rtol=2e-3, atol=1e-3)
        np.testing.assert_allclose(read_rgb("gu.color.exr"), total, rtol=2e-3, atol=1e-3)
        self.export("groups.glb", "--moz-lightmap", "moz.glb")
        materials = glb_module.Glb.load("moz.glb").json["materials"]
        told = [m["extensions"]["MOZ_lightmap"] for m in materials if "MOZ_lightmap" in m.get("extensions", {})]
        self.assertTrue(told and all(t["texCoord"] == 1 and t["intensity"] > 0 for t in told))

    def test_sky_columns(self):
        write("floor.obj", "v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\nf 1 2 3 4\n")
        run("bake", "floor.obj", "--receivers", "texels", "--order", "3", "--atlas", "16x16", "--samples", "1024",
            "-o", "prt.glb")
        for target, snippet in (("--three", "lambent_sky.glsl"), ("--godot", "lambent_sky.gdshaderinc"),
                                ("--unity", "LambentSky.hlsl")):
            self.export("prt.glb", target, "s", "--sky-columns", "--env", "uniform:1,0.5,0.25")
            told = json.loads(text_of("s.sky.json"))
            self.assertEqual((told["order"], len(told["pictures"])), (3, 9))
            light = np.array(told["coefficients"]).reshape(9, 3)
            columns = np.stack([read_rgb(f"s.sky.{k}.exr") for k in range(9)])
            if target == "--godot":
                np.testing.assert_array_equal(self.layers("s.sky.layers.exr"), columns)
            total = np.einsum("kc,kyxc->yxc", light, columns)
            seen = total[(np.abs(columns[0]).max(2) > 0.2)]
            np.testing.assert_allclose(seen[np.abs(seen[:, 0] - 1) < 0.5], np.array([[1, 0.5, 0.25]]).repeat(
                (np.abs(seen[:, 0] - 1) < 0.5).sum(), 0), rtol=0.01)  # an open floor sends out what the sky has
            text = text_of(snippet)
            self.assertIn("9", text)

    def test_attributes_of_other_programs_stay(self):
        places = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2], [0, 2, 0], [2, 2, 0]], np.float32)
        made = glb_module.Glb()
        made.json["scenes"][0]["nodes"] = [made.push("nodes", {"mesh": 0, "name": "corner"})]
        made.push("meshes", {"primitives": [{"attributes": {
            "POSITION": made.accessor(places, bounds=True), "_ID": made.accessor(np.arange(6, dtype=np.float32))},
            "indices": made.accessor(np.array([3, 2, 1, 3, 1, 0, 0, 1, 5, 0, 5, 4], np.uint32))}]})
        made.save("corner.glb")
        run("bake", "corner.glb", "--transfer", "lightmap", "--sky", "uniform:1", "--atlas", "32x32", "--samples", "16",
            "-o", "cornered.glb")
        baked = glb_module.Glb.load("cornered.glb")
        attributes = baked.json["meshes"][0]["primitives"][0]["attributes"]
        number = baked.array(attributes["_ID"]).astype(int)
        self.assertGreater(len(number), 6)  # charts part at the crease
        np.testing.assert_array_equal(baked.array(attributes["POSITION"]), places[number])


if __name__ == "__main__":
    unittest.main()
