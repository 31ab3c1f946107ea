"""What Blender scenes have in them: no UVs, modifiers, linked files, instanced and mirrored collections, what is
hidden."""
import os
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy  # noqa: E402
import mathutils  # noqa: E402
import numpy as np  # noqa: E402
from common import *  # noqa: E402,F403
from lambent_bake import glb, result, run, scene as scene_module  # noqa: E402


def settings_for(texels=8, samples=64, **values):
    s = bpy.context.scene.lambent
    s.kind, s.quality, s.texels, s.samples, s.bounces = "LIGHTMAP", "rays", texels, samples, 2
    for key, value in values.items():
        setattr(s, key, value)
    return s


def bake():
    try:
        return bpy.ops.lambent.bake()
    except RuntimeError as error:  # Blender raises an operator's errors
        return str(error)


def scene_glb():
    return glb.Glb.load(bpy.context.scene.lambent.output)


def notes():
    return bpy.context.scene.get("lambent_notes", "")


# A file to link from.
empty_scene()
tool = box("tool", (-0.2, -0.2, 0), (0.2, 0.2, 0.4), material("steel", (0.4, 0.4, 0.5)))
library = os.path.join(folder, "library.blend")
bpy.ops.wm.save_as_mainfile(filepath=library)

scene = empty_scene()
check("nothing to bake" in bake(), "an empty scene is an error in one line")
floor = plane("floor", [(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], None)
settings_for()
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
check("gives light" in bake() and not bpy.data.objects["floor"].data.uv_layers,
      "so is a scene without light; nothing changes")
lamp("sun", "SUN", (0, 0, 5), 3, angle=0.0)

grey = material("grey", (0.5,) * 3)
wavy = plane("wavy", [(1, 1, 0.2), (2, 1, 0.2), (2, 2, 0.2), (1, 2, 0.2)], grey)
wavy.modifiers.new("Subdivision", "SUBSURF").levels = 2
wavy.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.1
twins = [box("twin", (-0.2, -0.2, 0), (0.2, 0.2, 0.5), grey) for _ in range(1)]
twin = bpy.data.objects.new("other twin", twins[0].data)
scene.collection.objects.link(twin)
twins[0].location, twin.location = (-1.5, 1.5, 0), (-2.3, 1.5, 0)
parts = bpy.data.collections.new("parts")
wedge = mesh_object("wedge", [(0, 0, 0), (1, 0, 0), (0, 0.6, 0), (0, 0, 0.7)],
                    [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], grey, parts)
for k, (place, size) in enumerate([((-1.5, -1.5, 0), (1, 1, 1)), ((1.5, -1.5, 0), (-1, 1, 1))]):
    instance = bpy.data.objects.new(f"instance {k}", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", parts
    instance.location, instance.scale = place, size
    scene.collection.objects.link(instance)
with bpy.data.libraries.load(library, link=True) as (there, here):
    here.objects = ["tool"]
scene.collection.objects.link(bpy.data.objects["tool"])
ghost = box("ghost", (-5, -5, 3), (5, 5, 3.2), grey)  # would put all into shadow
ghost.hide_render = True
tucked = box("tucked", (-5, -5, 4), (5, 5, 4.2), grey)
bpy.context.view_layer.update()
tucked.hide_set(True)
bare = bpy.data.objects.new("bare", bpy.data.meshes.new("bare"))
scene.collection.objects.link(bare)
text = bpy.data.objects.new("letter", bpy.data.curves.new("letter", "FONT"))
text.data.body, text.data.extrude, text.location = "L", 0.1, (0, -2.5, 0.2)
scene.collection.objects.link(text)
before = {o.name: [s.material for s in o.material_slots] for o in scene.objects}
count = len(scene.objects)
check(bake() == {"FINISHED"}, "a scene of all that is baked")
names = {o.name for o in scene.objects if o.get("lambent_lit")}
check({"wavy lit", "twin lit", "other twin lit", "wedge lit", "wedge_2 lit", "tool lit", "letter lit"} == names,
      "instances, twins, modifiers, texts and linked objects have lit copies")
check("Lightmap" in floor.data.uv_layers and floor.material_slots[0].material.get("lambent_lit"),
      "an object of its own, without UVs and material before, has both")
check("ghost" in notes() and "tucked" in notes() and "bare" in notes(), "what is hidden or empty is named")
image = next(n.image for g in bpy.data.node_groups for n in g.nodes if n.type == "TEX_IMAGE")


def light_at(obj, place):
    """The lightmap where a point of a mesh is nearest, in the world."""
    mesh, best = obj.data, (1e9, None)
    mesh.calc_loop_triangles()
    inside = obj.matrix_world.inverted() @ mathutils.Vector(place)
    for t in mesh.loop_triangles:
        corners = [mesh.vertices[v].co for v in t.vertices]
        near = mathutils.geometry.closest_point_on_tri(inside, *corners)
        if (near - inside).length < best[0]:
            uv = [mathutils.Vector((*mesh.uv_layers["Lightmap"].data[i].uv, 0)) for i in t.loops]
            best = ((near - inside).length, mathutils.geometry.barycentric_transform(near, *corners, *uv))
    x, y = int(best[1].x * image.size[0]), int(best[1].y * image.size[1])
    return pixels(image)[min(y, image.size[1] - 1), min(x, image.size[0] - 1)].mean()


check(abs(light_at(floor, (2.6, 2.6, 0)) - 3 / np.pi) < 0.03, "the open floor under a sun of 3 W/m2 has 3 / pi")
mirrored = bpy.data.objects["wedge_2 lit"]
check(mirrored.matrix_world.determinant() < 0, "the mirrored instance stays mirrored")
a, b = light_at(bpy.data.objects["wedge lit"], (-1.2, -1.3, 0.2)), light_at(mirrored, (1.2, -1.3, 0.2))
check(abs(a - b) < 0.05 * a and a > 0.2, f"both wedges are lit alike on their slopes: {a:.3f} and {b:.3f}")
glb_size = os.path.getsize(bpy.path.abspath(scene.lambent.output))
check(glb_size > 10000, "the GLB for the web is there")
check(all(o.hide_render for o in scene.objects if o.name in ("instance 0", "twin", "wavy", "tool")),
      "originals are hidden")
bpy.ops.lambent.switch()
check(all([s.material for s in o.material_slots] == before[o.name] for o in scene.objects
          if o.name in before and o.name != "floor") and not scene.objects["wavy"].hide_render,
      "one click shows the originals")
bpy.ops.lambent.switch()
check(bake() == {"FINISHED"} and len([o for o in scene.objects if o.get("lambent_lit")]) == 7,
      "baked again, nothing piles up")
bpy.ops.lambent.forget()
check(len(scene.objects) == count and not floor.data.uv_layers, "and all of it can be taken out again")

# Selected objects alone.
for o in scene.objects:
    o.select_set(o.name == "floor")
settings_for(selected=True)
check(bake() == {"FINISHED"} and not any(o.get("lambent_lit") for o in scene.objects), "one selected object")
check(not any(s.material and s.material.get("lambent_lit") for s in twins[0].material_slots), "others stay as they are")
for o in scene.objects:
    o.select_set(False)
check("selected" in bake(), "nothing selected is an error")

# To an error: as the program asks for it, and as it says that it has reached it.
settings_for(selected=False, quality="preview", texels=0)
check(bake() == {"FINISHED"}, "a lightmap to a quality, its texels as the light asks for")
held = scene_glb().json["extensions"]["LAMBENT_transfer"]
asked = held["provenance"]["request"]
check(asked["quality"] == "preview" and "samples" not in asked and "texels_per_unit" not in asked,
      "which is what the program was asked")
check("% off (within" in scene["lambent_reached"], scene["lambent_reached"])
settings_for(quality="error", error=12, texels=4)
check(bake() == {"FINISHED"}, "to an error of one's own")
asked = scene_glb().json["extensions"]["LAMBENT_transfer"]["provenance"]["request"]
check(asked["error"] == "12%" and asked["texels_per_unit"] == 4, "which is what the program was asked")
bpy.ops.lambent.forget()
for kind in ("PRT", "LATTICE"):
    for quality in ("preview", "error", "rays"):
        settings_for(kind=kind, quality=quality, error=20, samples=32, order=3, lattice=(3, 2, 4))
        check(bake() == {"FINISHED"}, f"{kind}: {scene['lambent_reached']}")
check("lattice" in scene_glb().json["extensions"]["LAMBENT_transfer"], "which has the lattice")

# Progress and cancelling.
settings_for(kind="LIGHTMAP", texels=60, samples=20000)
work = lambent_bake.Bake(bpy.context)
for _ in range(600):
    time.sleep(0.05)
    if work.run.poll() is not None or 0.005 < work.run.fraction < 0.9:
        break
check(0 < work.run.fraction < 1 and work.run.process.poll() is None,
      f"progress: {work.run.stage} {work.run.fraction:.3f}")
start = time.time()
work.close()
check(work.run.process.poll() == 1 and time.time() - start < 10 and not os.path.exists(work.folder),
      "cancelled, nothing left")
os.environ["LAMBENT"] = "/nowhere/lambent"
check("not found" in bake(), "a program that is not there is an error in one line")
