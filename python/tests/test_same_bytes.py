"""Python and the command line make the same bytes of the same request."""
import warnings

import lambent
import made

SKY = "sky:elevation=40,turbidity=4"
M, Z, L, K = ({"transfer": kind} for kind in ("matrix", "zonal", "lightmap", "blocks"))
requests = [
    {}, {"order": 1}, {"order": 3}, {"order": 8}, {"precision": "single"}, {"bounces": 0}, {"bounces": 1},
    {"bounces": "7"}, {"seed": 9}, {"samples": 33}, {"ground": True}, {"max_edge": 0.5}, {"max_albedo": 0.3},
    {"shadows": "off"}, {"terms": True}, {"memory": 300000000}, {"receivers": "patches"},
    {"receivers": "texels", "atlas": "64x64"}, {"receivers": "texels", "texels_per_unit": 8}, {"light": "sh:4"},
    {"light": "sh:2+lamps:2@" + SKY}, {"light": "directional:12"}, {"exclude": "lamp"}, {"exclude": ["lamp", "red"]},
    {"emit": "white=1,2,3"}, {"lattice": (2, 3, 2)}, {"lattice": "2,2,2", "lattice_box": (-1, .9, -1, 1, 1.5, 1)},
    {"lattice": "2,2,2", "lattice_order": 2}, {"compress": "cpca:2,3"}, {"fix_light": SKY},
    {"fix_view": "auto", "size": "24x16", "spp": 2}, {"membrane": 0.4}, {"subsurface": "marble:300", "samples": 16},
    {"order": 2, "ground": True, "seed": 3, "precision": "single"},
    {**M, "order": 3, "incident_order": 3}, {**M, "order": 3, "outgoing": "sh:3", "incident_order": 3},
    {**M, "order": 3, "outgoing": "phong", "brdf": "phong:exponent=9"}, {**M, "factors": True, "order": 3},
    {**M, "order": 2, "view_map": 16, "outgoing": "svd:4", "brdf": "ggx:roughness=0.4"},
    {**Z}, {**Z, "lobes": 2}, {**Z, "order": 3, "brdf": "ggx:roughness=0.5", "incident_order": 3},
    {**L, "atlas": "64x64"}, {**L, "atlas": "64x64", "light_groups": True}, {**L, "atlas": "64x64", "sky": SKY},
    {**L, "atlas": "64x64", "directional": "sh:2"}, {**L, "atlas": "64x64", "direct": "separate"},
    {**L, "atlas": "64x64", "bounces": "converge:1e-3"}, {**L, "receivers": "vertices", "lamp_samples": 8},
    {**L, "receivers": "vertices", "order": 2}, {**L, "receivers": "vertices", "lamp": "lamp=2", "seed": 4},
    {**K, "cube": 16}, {**K, "cube": 32, "visibility": "bits:3"},
]


def arguments(request):
    """The same request for the command line."""
    for name, value in request.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            yield option
        elif isinstance(value, list):
            for v in value:
                yield from (option, v)
        else:
            yield from (option, ",".join(map(str, value)) if isinstance(value, tuple) else str(value))


class SameBytes(made.Case):
    def test_requests(self):
        self.assertGreaterEqual(len(requests), 50)
        room = self.room()
        scene = lambent.load(room)
        kinds = set()
        for request in requests:
            with self.subTest(request=request), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if "samples" not in request and request.get("transfer") != "blocks" and "membrane" not in request:
                    request = {**request, "samples": 32}
                self.run_tool("bake", room, "-o", self.path("tool.glb"), *arguments(request))
                baked = lambent.bake(scene, **request)
                pictures = baked.save(self.path("python.glb"))
                self.assertEqual(self.bytes("tool.glb"), self.bytes("python.glb"))
                for picture in pictures:
                    name = picture[len(self.path("python")):]
                    self.assertEqual(self.bytes("tool" + name), self.bytes("python" + name))
                kinds.add(baked.info["kind"])
        self.assertEqual(kinds, {"diffuse", "matrix", "factors", "zonal", "blocks"})

    def bytes(self, name):
        with open(self.path(name), "rb") as f:
            return f.read()

    def test_same_line(self):
        import subprocess
        room = self.room()
        for request in ({"order": 99}, {"samples": 0}, {"lobes": 3}, {"exclude": "sofa"}, {**L, "brdf": "x"}):
            tool = subprocess.run([made.tool, "bake", room, "-o", self.path("x.glb"), *arguments(request)],
                                  capture_output=True, text=True, check=False)
            with self.assertRaises(lambent.Error) as raised:
                lambent.bake(room, **request)
            line = str(raised.exception)
            said = tool.stderr.strip().splitlines()[-1]
            self.assertNotIn("\n", line)
            if raised.exception.where.startswith("--"):
                self.assertEqual("lambent: " + line, said)
            self.assertTrue(raised.exception.usage)
        with self.assertRaisesRegex(lambent.Error, "^lobs: is no field of such a request$"):
            lambent.bake(room, lobs=3)
        with self.assertRaisesRegex(lambent.Error, "none.obj: no such file$"):
            lambent.load(self.path("none.obj"))

    def test_render_and_compare(self):
        room = self.room()
        self.run_tool("bake", room, "-o", self.path("b.glb"), "--samples", "64")
        for name in ("t.exr", "t.png"):
            self.run_tool("render", self.path("b.glb"), "--env", SKY, "--size", "48x40", "--spp", "4", "-o", name)
        baked = lambent.open(self.path("b.glb"))
        for env in (SKY, lambent.environment(SKY)):
            picture = baked.render(env, size="48x40", spp=4)
            picture.save(self.path("p.exr")), picture.save(self.path("p.png"))
            self.assertEqual(self.bytes("t.exr"), self.bytes("p.exr"))
            self.assertEqual(self.bytes("t.png"), self.bytes("p.png"))
        self.assertEqual(picture._repr_png_(), self.bytes("p.png"))
        self.run_tool("reference", room, "--env", SKY, "--size", "48x40", "--spp", "4", "-o", self.path("r.exr"))
        lambent.reference(room, SKY, size="48x40", spp=4).save(self.path("q.exr"))
        self.assertEqual(self.bytes("r.exr"), self.bytes("q.exr"))
        import json
        said = json.loads(self.run_tool("compare", self.path("t.exr"), self.path("r.exr"), "--json"))
        found = lambent.compare(self.path("t.exr"), self.path("r.exr"))
        for key in ("rmse", "relative_mse", "psnr", "flip", "mean_a", "mean_b", "pixels"):
            self.assertEqual(said[key], found[key])


if __name__ == "__main__":
    made.unittest.main()
