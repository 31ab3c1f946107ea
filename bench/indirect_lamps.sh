#!/usr/bin/env bash
# Lamps at random places, over direct-to-indirect transport: pictures of their indirect light against the path tracer's,
# the reference's own noise taken off by two of them, and brought to 32 dB by up to 64 times the paths, in dB of four
# times the mean. A lamp stands over a random surfel that faces up, the eye over another, near it, and looks at the
# lamp; where nothing is lit, or the eye is inside something, another place is taken. One JSON object a line: of each
# lamp, then of each scene.
#   LAMPS=20 SPP=64 SIZE=32x24 SURFELS=0 SCENES="room level courtyard cornell" scripts/bench indirect-lamps
#   BAKE="...;..." RENDER="..."   more options of either; several bakes, with ; between them, are seen at the same
#                                 places, which the first of them chooses; SEED=1 of the places
source "$(dirname "$0")/common.sh"
out=out/indirect_lamps
mkdir -p $out
need python3-numpy
TOOL=$tool DATA=$data OUT=$out /usr/bin/python3 - <<'P'
import json, math, os, struct, subprocess, sys
import numpy as np

env = os.environ
tool, data, out = env["TOOL"], env["DATA"], env["OUT"]
lamps, spp, size = int(env.get("LAMPS", 20)), int(env.get("SPP", 64)), env.get("SIZE", "32x24")
surfels, seed = env.get("SURFELS", "0"), int(env.get("SEED", 1))
meshes = f"{data}/meshes"
# File, heights over the floor as parts of the box's height, how far the eye stands, of the same.
scenes = {
    "room": (f"{meshes}/room.glb", (0.2, 0.7), 0.6),
    "level": (f"{meshes}/zdm2_level.glb", (0.02, 0.06), 0.12),
    "courtyard": (f"{out}/courtyard.obj", (0.1, 0.6), 0.6),
    "cornell": (f"{out}/cornell.obj", (0.2, 0.8), 0.6),
}


def run(*words):
    done = subprocess.run([tool, "--json", *map(str, words)], capture_output=True, text=True)
    if done.returncode and "no pixel is covered" in done.stderr:  # the eye sees nothing
        return dict(mean_a=0, mean_b=0, rmse=0), ""
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: {done.stderr}")
    return json.loads(done.stdout), done.stderr


def say(name, **line):
    print(json.dumps(dict(name=name, **line)), flush=True)


def courtyard(path):
    """Walls around a floor, a porch on pillars along one side; a quad a side, split by the bake."""
    quads = []

    def box(a, b, inwards=False):
        for axis in range(3):
            for side in (0, 1):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                p = [0, 0, 0]
                p[axis] = (a, b)[side][axis]
                corners = []
                for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    q = list(p)
                    q[u], q[v] = (a, b)[s][u], (a, b)[t][v]
                    corners.append(q)
                quads.append(corners if (side == 1) != inwards else corners[::-1])

    box((-6, 0, -6), (6, 5, 6), True)
    quads[:] = [q for q in quads if not all(c[1] == 5 for c in q)]  # open to the sky
    for x in (-4.5, -1.5, 1.5, 4.5):
        box((x - 0.25, 0, -3.25), (x + 0.25, 3, -2.75))
    box((-6, 3, -6), (6, 3.3, -2.6))
    box((1, 0, 1.5), (2.5, 1.2, 3))
    with open(path, "w") as f:
        f.write("mtllib courtyard.mtl\nusemtl stone\n")
        for q in quads:
            for c in q:
                f.write("v %g %g %g\n" % tuple(c))
        for i in range(len(quads)):
            f.write("f %d %d %d %d\n" % tuple(4 * i + k for k in (1, 2, 3, 4)))
    with open(os.path.join(os.path.dirname(path), "courtyard.mtl"), "w") as f:
        f.write("newmtl stone\nKd 0.6 0.55 0.45\n")


def surfels_of(path):
    """Places and normals, as docs/file-format.md has them."""
    raw = open(path, "rb").read()
    length = struct.unpack_from("<I", raw, 12)[0]
    document, bulk = json.loads(raw[20 : 20 + length]), raw[20 + length + 8 :]
    s = document["extensions"]["LAMBENT_transfer"]["transfer"]["surfels"]

    def view(index, kind):
        v = document["bufferViews"][index]
        start = v.get("byteOffset", 0)
        return np.frombuffer(bulk[start : start + v["byteLength"]], kind)

    packed, low, high = view(s["places"], np.uint64), np.array(s["min"]), np.array(s["max"])
    last = (1 << 21) - 1
    at = np.stack([(packed >> np.uint64(21 * c)) & np.uint64(last) for c in range(3)], 1) / last
    fold = view(s["directions"], np.uint32)
    x, y = (fold & 65535) / 65535 * 2 - 1, (fold >> 16) / 65535 * 2 - 1
    z = 1 - abs(x) - abs(y)
    over = np.maximum(-z, 0)
    n = np.stack([x - np.copysign(over, x), y - np.copysign(over, y), z], 1)
    return low + at * (high - low), n / np.linalg.norm(n, axis=1, keepdims=True)


def errors(name):
    path, heights, away = scenes[name]
    if name == "courtyard":
        courtyard(path)
    if name == "cornell":  # whose walls reflect all light
        for kind in ("obj", "mtl"):
            text = open(f"{meshes}/cornell_box.{kind}").read().replace("cornell_box.mtl", "cornell.mtl")
            if kind == "mtl":
                text = text.replace("Kd 1 1 1", "Kd 0.75 0.75 0.75")
            open(f"{out}/cornell.{kind}", "w").write(text)
    of_render = env.get("RENDER", "").split()
    bakes = []
    for k, of_bake in enumerate(env.get("BAKE", "").split(";")):
        baked = f"{out}/{name}_{k}.glb"
        words = of_bake.split()
        if "--surfels" not in words:
            words += ["--surfels", surfels]
        start = os.times()
        made, _ = run("bake", path, "--transfer", "indirect", "-o", baked, *words)
        end = os.times()
        made["processor"] = end.children_user + end.children_system - start.children_user - start.children_system
        bakes.append(dict(file=baked, options=of_bake.strip(), made=made, found=[]))
    places, normals = surfels_of(bakes[0]["file"])
    tall = places[:, 1].max() - places[:, 1].min()
    floor = np.flatnonzero(normals[:, 1] > 0.9)
    random = np.random.default_rng(seed)
    for attempt in range(20 * lamps):
        if len(bakes[0]["found"]) == lamps:
            break
        under = places[random.choice(floor)]
        lamp = under + [0, tall * random.uniform(*heights), 0]
        near = floor[np.linalg.norm(places[floor] - under, axis=1) < 2 * away * tall]
        eye = places[random.choice(near)] + [0, tall * random.uniform(*heights), 0]
        if np.linalg.norm(eye - lamp) < 0.3 * away * tall:
            continue
        text = lambda *v: ",".join("%.6g" % x for x in v)
        shot = ["--camera", text(*eye, *lamp, 80), "--size", size, "--background", "none"]
        lamp_at = lambda where: ["--lamp", f"point@{text(*where)}={tall * tall:.6g}"]
        light = lamp_at(lamp)

        def draw(baked, light=light):
            look = ["--show", "indirect", "--spp", 16, *shot, "-o", f"{out}/ours.exr"]
            return run("render", baked, *light, *look, *of_render)[1]

        # Neither lamp nor eye stands inside something.
        if any("lights no surface" in draw(bakes[0]["file"], lamp_at(where)) for where in (eye, lamp)):
            continue
        # Lamps near walls are seen by a few bright paths: as many more until the references tell.
        for many in (1, 8, 64):
            for half in (1, 2):
                paths = ["--no-direct", "--bounces", 16, "--spp", many * spp, "--seed", half]
                run("reference", path, *light, *paths, *shot, "-o", f"{out}/truth_{half}.exr")
            noise = run("compare", f"{out}/truth_2.exr", f"{out}/truth_1.exr")[0]
            mean = (noise["mean_a"] + noise["mean_b"]) / 2
            noise_of_one = 20 * math.log10(4 * mean / max(noise["rmse"] / math.sqrt(2), 1e-9)) if mean > 1e-5 else 0
            if noise_of_one > 32 or mean <= 1e-5:
                break
        if noise_of_one < 20:  # next to nothing is lit
            continue
        for baked in bakes:
            draw(baked["file"])
            mine, other = (run("compare", f"{out}/ours.exr", f"{out}/truth_{half}.exr")[0] for half in (1, 2))
            # The mean of (ours - one reference) (ours - the other), whose noises have nothing in common; where it is
            # less than its own noise, that.
            squared = (mine["rmse"] ** 2 + other["rmse"] ** 2 - noise["rmse"] ** 2) / 2
            squared = max(squared, noise["rmse"] ** 2 / 2 / math.sqrt(math.prod(map(int, size.split("x")))))
            psnr = 20 * math.log10(4 * mean / math.sqrt(squared))
            baked["found"].append(psnr)
            say(f"indirect light, {name}", lamp=text(*lamp), eye=text(*eye), psnr=round(psnr, 2),
                mean=round(mine["mean_a"] / mean, 3), noise=round(noise_of_one, 1), bake=baked["options"])
            if env.get("KEEP"):
                for picture in ("ours", "truth_1"):
                    os.replace(f"{out}/{picture}.exr", f"{out}/{name}_{len(baked['found'])}_{picture}.exr")
    return bakes


for name in env.get("SCENES", " ".join(scenes)).split():
    for baked in errors(name):
        found, made = baked["found"], baked["made"]
        if not found:
            sys.exit(f"no place of {name} shows light")
        say(f"indirect light, {name}, {len(found)} lamps", worst=round(min(found), 2),
            median=round(float(np.median(found)), 2), reached=sum(f >= 35 for f in found), aim=35,
            bake=baked["options"], surfels=made["indirect"]["surfels"], entries=made["indirect"]["entries"],
            bytes=made["bytes"], processor_seconds=round(made["processor"], 1))
P
