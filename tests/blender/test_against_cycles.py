"""Bake, hide, render with the lightmap as emission; then the same picture with what Cycles bakes onto the same UVs."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bpy  # noqa: E402
import numpy as np  # noqa: E402
from common import *  # noqa: E402,F403

texels = float(os.environ.get("LAMBENT_BLENDER_TEXELS", 24))
scene = empty_scene()
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.05, 0.08, 0.12, 1)
white, red, blue = material("white", (0.75,) * 3), material("red", (0.7, 0.15, 0.1)), material("blue", (0.1, 0.2, 0.7))
plane("floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], white)
plane("back", [(-2, 2, 0), (2, 2, 0), (2, 2, 3), (-2, 2, 3)], white)
plane("left", [(-2, -2, 0), (-2, 2, 0), (-2, 2, 3), (-2, -2, 3)], red)
plane("right", [(2, 2, 0), (2, -2, 0), (2, -2, 3), (2, 2, 3)], blue)
box("block", (-1.1, 0.1, 0), (-0.3, 0.9, 1.4), white)
small = box("cube", (-0.35, -0.35, -0.35), (0.35, 0.35, 0.35), white)
small.location, small.rotation_euler, small.scale = (0.9, -0.2, 0.36), (0, 0, 0.5), (1, -1, 1)
lamp("ceiling", "AREA", (0, 0, 2.9), 60, shape="RECTANGLE", size=1.2, size_y=0.8, color=(1, 0.95, 0.85))
lamp("bulb", "POINT", (1.2, 1.0, 1.8), 25, shadow_soft_size=0.12)
lamp("spot", "SPOT", (-1.6, -1.6, 2.2), 80, spot_size=1.0, spot_blend=0.3, shadow_soft_size=0.0)
scene.objects["spot"].rotation_euler = (0.9, 0, -0.78)
sun = lamp("sun", "SUN", (0, 0, 5), 0.4, angle=0.0)
sun.rotation_euler = (0.5, 0.3, 0)
camera((0, -5.2, 1.7), (0, 0.6, 1.0))
settings = scene.lambent
settings.kind, settings.texels, settings.bounces = "LIGHTMAP", texels, 8
settings.quality, settings.samples = os.environ.get("LAMBENT_BLENDER_QUALITY", "rays"), 1024
settings.output = os.path.join(folder, "room.glb")
check(bpy.ops.lambent.bake() == {"FINISHED"}, "a room with four kinds of lamps is baked")
print(f"measured: {scene['lambent_reached']}")
groups = sorted(n.label for g in bpy.data.node_groups for n in g.nodes if n.type == "RGB")
check(groups == ["bulb", "ceiling", "sky", "spot", "sun"], f"each lamp has a picture: {groups}")
ours = render("room_lambent")
lit = {o.name: [s.material for s in o.material_slots] for o in scene.objects if o.type == "MESH"}

# What Cycles bakes onto the same UVs: light without colour, of the original materials and lamps.
bpy.ops.lambent.switch()
first = next(n.image for g in bpy.data.node_groups for n in g.nodes if n.type == "TEX_IMAGE")
target = bpy.data.images.new("cycles", *first.size, float_buffer=True)
target.colorspace_settings.name = "Non-Color"
for obj in scene.objects:
    obj.select_set(obj.type == "MESH")
    if obj.type == "MESH":
        bpy.context.view_layer.objects.active = obj
        obj.data.uv_layers.active = obj.data.uv_layers["Lightmap"]
        for slot in obj.material_slots:
            nodes = slot.material.node_tree.nodes
            node = nodes.get("target") or nodes.new("ShaderNodeTexImage")
            node.name, node.image = "target", target
            nodes.active = node
scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.diffuse_bounces = 1024, 9, 9
scene.cycles.sample_clamp_indirect, scene.cycles.blur_glossy = 0, 0
scene.render.bake.margin = 4
bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=4, use_clear=True)
theirs_map = pixels(target)
ours_map = sum(pixels(n.image) for g in bpy.data.node_groups for n in g.nodes if n.type == "TEX_IMAGE")
both = (theirs_map.min(2) > 0.01) & (ours_map.min(2) > 0.01)
ratio = ours_map[both].mean(1) / theirs_map[both].mean(1)
print(f"measured: texels {both.sum()}, median of ours over Cycles' {np.median(ratio):.4f}, "
      f"tenth to nine tenths {np.quantile(ratio, 0.1):.3f} to {np.quantile(ratio, 0.9):.3f}")
save_png(os.path.join(folder, "map_lambent.png"), ours_map)
save_png(os.path.join(folder, "map_cycles.png"), theirs_map)


# The same lit materials, with Cycles' picture in place of ours.
bpy.ops.lambent.switch()
group = next(g for g in bpy.data.node_groups if g.name.startswith("lambent light"))
for k, node in enumerate(n for n in group.nodes if n.type == "TEX_IMAGE"):
    node.image = target
dimmers = [n for n in group.nodes if n.type == "RGB"]
for k, node in enumerate(dimmers):
    node.outputs[0].default_value = (1, 1, 1, 1) if k == 0 else (0, 0, 0, 1)
theirs = render("room_cycles_bake")
difference = psnr(ours, theirs)
print(f"measured: PSNR of the two pictures {difference:.1f} dB")
# And the original under Cycles, with nothing baked.
bpy.ops.lambent.switch()
scene.cycles.max_bounces = 9
original = render("room_original", samples=64)
print(f"measured: PSNR of the lightmap's picture and Cycles' own of the scene {psnr(ours, original):.1f} dB")
check(abs(np.median(ratio) - 1) < 0.02, "the median agrees within 2 %")
check(difference >= 35, "the pictures agree to 35 dB")
