"""Scenes, and what the tests of the Blender add-on share."""
import os
import sys

import bpy
import numpy as np

addons, folder = sys.argv[sys.argv.index("--") + 1:][:2]
sys.path.insert(0, addons)
import lambent_bake  # noqa: E402

lambent_bake.register()


def check(condition, text):
    if not condition:
        raise AssertionError(text)
    print("ok:", text)


def empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if not hasattr(bpy.types.Scene, "lambent"):
        lambent_bake.register()
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.use_denoising = "CPU", False
    scene.view_settings.view_transform = "Standard"
    scene.lambent.output = os.path.join(folder, "out.glb")
    return scene


def material(name, color, glow=None):
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    nodes, links = m.node_tree.nodes, m.node_tree.links
    nodes.clear()
    out = nodes.new("ShaderNodeOutputMaterial")
    shader = nodes.new("ShaderNodeEmission" if glow else "ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*(glow or color), 1)
    links.new(shader.outputs[0], out.inputs["Surface"])
    return m


def mesh_object(name, places, faces, look, collection=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(places, [], faces)
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(obj)
    if look is not None:
        mesh.materials.append(look)
    return obj


def box(name, low, high, look, collection=None):
    (x0, y0, z0), (x1, y1, z1) = low, high
    v = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0), (x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)]
    f = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return mesh_object(name, v, f, look, collection)


def plane(name, corners, look):
    return mesh_object(name, corners, [(0, 1, 2, 3)], look)


def lamp(name, kind, place, energy, **values):
    light = bpy.data.lights.new(name, kind)
    light.energy = energy
    for key, value in values.items():
        setattr(light, key, value)
    obj = bpy.data.objects.new(name, light)
    obj.location = place
    bpy.context.scene.collection.objects.link(obj)
    return obj


def camera(place, target, lens=35):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    obj = bpy.data.objects.new("Camera", data)
    bpy.context.scene.collection.objects.link(obj)
    obj.location = place
    import mathutils
    obj.rotation_euler = (mathutils.Vector(target) - mathutils.Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = obj


def pixels(image):
    out = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(out)
    return out.reshape(image.size[1], image.size[0], image.channels)[..., :3].astype(float)


def render(name, samples=32, size=(320, 240)):
    """The camera's picture, linear, rows from the bottom; and NAME.png to look at."""
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100
    settings, path = scene.render.image_settings, os.path.join(folder, name)
    settings.file_format, settings.color_depth, scene.render.filepath = "OPEN_EXR", "32", path + ".exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path + ".exr")
    image.colorspace_settings.name = "Non-Color"
    out = pixels(image)
    bpy.data.images.remove(image)
    save_png(path + ".png", out)
    return out


def displayed(linear):
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9)**(1 / 2.4) - 0.055)


def save_png(path, linear):
    from lambent_bake import glb
    with open(path, "wb") as file:
        file.write(glb.png(np.rint(displayed(linear[::-1]) * 255).astype(np.uint8)))


def psnr(a, b):
    return -10 * np.log10(((displayed(a) - displayed(b))**2).mean())
