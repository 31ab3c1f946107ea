"""Blender's scene as the baker reads it: every visible object and instance as it is drawn, modifiers applied, each
corner of each triangle with its number, so that the lightmap's coordinates find their way back. Lamps in watts, as
Blender has them: radiant intensity, irradiance and radiance beside the emission of materials."""
import math
import os

import bpy
import mathutils
import numpy as np

from . import glb as glb_module
from . import materials

GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class Item:
    """One object or instance, as triangles' corners in its own space."""

    def __init__(self, name, source, instancer, matrix):
        self.name, self.source, self.instancer, self.matrix = name, source, instancer, matrix
        self.first = 0  # number of its first corner
        self.loops = self.places = self.normals = self.uv = self.materials = None
        self.slots, self.in_place, self.wanted = [], False, True

    def corners(self):
        return len(self.places)


def corner_normals(mesh):
    out = np.empty(3 * len(mesh.loops), np.float32)
    if hasattr(mesh, "calc_normals_split"):  # until 4.0
        mesh.calc_normals_split()
        mesh.loops.foreach_get("normal", out)
    else:
        mesh.corner_normals.foreach_get("vector", out)
    return out.reshape(-1, 3)


def read_mesh(item, mesh):
    """False of a mesh without triangles."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        return False
    loops, index = np.empty(3 * count, np.int32), np.empty(count, np.int32)
    mesh.loop_triangles.foreach_get("loops", loops)
    mesh.loop_triangles.foreach_get("material_index", index)
    vertices, places = np.empty(len(mesh.loops), np.int32), np.empty(3 * len(mesh.vertices), np.float32)
    mesh.loops.foreach_get("vertex_index", vertices)
    mesh.vertices.foreach_get("co", places)
    item.loops, item.places = loops, places.reshape(-1, 3)[vertices[loops]]
    item.normals = corner_normals(mesh)[loops]
    layer = next((u for u in mesh.uv_layers if u.active_render and not u.name.startswith("Lightmap")),
                 next((u for u in mesh.uv_layers if not u.name.startswith("Lightmap")), None))
    if layer is not None:
        uv = np.empty(2 * len(mesh.loops), np.float32)
        layer.data.foreach_get("uv", uv)
        item.uv = uv.reshape(-1, 2)[loops]
    item.materials = index
    return True


def can_take_uv(source, corners):
    """Whether lightmap coordinates fit the object's own mesh: no other's, of this file, that no modifier changes."""
    if source.type != "MESH" or source.library or source.data.library or source.override_library:
        return False
    return source.data.users == 1 and not any(m.show_viewport or m.show_render for m in source.modifiers) and \
        len(source.data.loops) == corners


def collect(context, selected_only, notes):
    """Items of all that is drawn; those that were asked for are `wanted`. Others cast shadows and reflect."""
    depsgraph = context.evaluated_depsgraph_get()
    items, hidden, taken = [], 0, set()
    for instance in depsgraph.object_instances:
        obj, source = instance.object, instance.object.original
        if obj.type not in GEOMETRY or not instance.show_self:
            continue
        instancer = instance.parent.original if instance.is_instance and instance.parent else None
        if source.hide_render or (instancer and instancer.hide_render) or source.get("lambent_lit"):
            hidden += 1
            continue
        if instancer == source and source.name in taken:  # a text or curve comes again as the mesh that it makes
            continue
        name, number = source.name, 2
        while name in taken:
            name, number = f"{source.name}_{number}", number + 1
        taken.add(name)
        item = Item(name, source, instancer, mathutils.Matrix(instance.matrix_world))
        try:
            mesh = obj.to_mesh()
        except RuntimeError:
            mesh = None
        if mesh is None:
            continue
        read = read_mesh(item, mesh)
        loops = len(mesh.loops)
        item.slots = [s.material.original if s.material else None for s in obj.material_slots] or [None]
        obj.to_mesh_clear()
        if not read:
            continue
        item.in_place = instancer is None and can_take_uv(source, loops)
        item.wanted = not selected_only or (instancer or source).select_get()
        item.first = items[-1].first + items[-1].corners() if items else 0
        items.append(item)
    shown = {i.source.name for i in items} | {i.instancer.name for i in items if i.instancer}
    out = [o.name for o in context.scene.objects
           if o.type in GEOMETRY and o.name not in shown and not o.get("lambent_lit")]
    if out or hidden:
        notes.append(f"hidden, or without faces, and left out: {', '.join(sorted(set(out))) or hidden}")
    return items


def turned(v):
    """Blender's axes to glTF's: Z up to Y up."""
    return np.stack([v[:, 0], v[:, 2], -v[:, 1]], 1).astype(np.float32)


def write_item(glb, item, looks):
    world = np.array(item.matrix)
    places = item.places @ world[:3, :3].T + world[:3, 3]
    with np.errstate(all="ignore"):
        normals = item.normals @ np.linalg.pinv(world[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    mirrored = np.linalg.det(world[:3, :3]) < 0
    primitives = []
    for slot in np.unique(item.materials):
        corner = np.flatnonzero(np.repeat(item.materials == slot, 3)).reshape(-1, 3)
        if mirrored:
            corner = corner[:, [0, 2, 1]]
        corner = corner.ravel()
        number = item.first + corner  # in two parts, each of which a float holds
        attributes = {"POSITION": glb.accessor(turned(places[corner]), bounds=True),
                      "NORMAL": glb.accessor(turned(normals[corner])),
                      "_CORNER": glb.accessor(np.stack([number // 65536, number % 65536], 1).astype(np.float32))}
        if item.uv is not None:
            uv = item.uv[corner]
            attributes["TEXCOORD_0"] = glb.accessor(np.stack([uv[:, 0], 1 - uv[:, 1]], 1).astype(np.float32))
        material = item.slots[min(slot, len(item.slots) - 1)]
        primitives.append({"attributes": attributes, "material": looks(material)})
    add_node(glb, {"name": item.name, "mesh": glb.push("meshes", {"name": item.name, "primitives": primitives})})


def add_node(glb, node):
    glb.json["scenes"][0]["nodes"].append(glb.push("nodes", node))


def glowing_shape(glb, name, places, faces, radiance):
    strength = max(max(radiance), 1e-12)
    glb.use("KHR_materials_emissive_strength")
    material = glb.push("materials", {
        "name": name, "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
        "emissiveFactor": [c / strength for c in radiance],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}})
    mesh = glb.push("meshes", {"name": name, "primitives": [{
        "attributes": {"POSITION": glb.accessor(turned(places), bounds=True)},
        "indices": glb.accessor(np.asarray(faces, np.uint32).ravel()), "material": material}]})
    add_node(glb, {"name": name, "mesh": mesh})


def ball(levels=2):
    v = [np.array(p, float) for p in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    f = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        cut, faces = {}, []
        for a, b, c in f:
            mid = []
            for p, q in ((a, b), (b, c), (c, a)):
                key = (min(p, q), max(p, q))
                if key not in cut:
                    cut[key] = len(v)
                    v.append((v[p] + v[q]) / np.linalg.norm(v[p] + v[q]))
                mid.append(cut[key])
            faces += [(a, mid[0], mid[2]), (mid[0], b, mid[1]), (mid[2], mid[1], c), tuple(mid)]
        f = faces
    return np.array(v), np.array(f)


def flat_lamp(light, matrix):
    """Corners and faces of an area light, which shines along its -Z, and its area."""
    a, b = light.size, light.size if light.shape in ("SQUARE", "DISK") else light.size_y
    if light.shape in ("SQUARE", "RECTANGLE"):
        local = np.array([(-a, -b, 0), (-a, b, 0), (a, b, 0), (a, -b, 0)]) / 2
        faces = [(0, 1, 2), (0, 2, 3)]
    else:
        t = -np.arange(32) / 32 * 2 * np.pi
        local = np.stack([np.cos(t) * a, np.sin(t) * b, 0 * t], 1) / 2
        faces = [(0, i, i + 1) for i in range(1, 31)]
    m = np.array(matrix)
    places = local @ m[:3, :3].T + m[:3, 3]
    p = places[np.array(faces)]
    cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    if np.dot(cross.sum(0), -m[:3, 2]) < 0:  # a mirrored lamp
        faces = [f[::-1] for f in faces]
    return places, faces, 0.5 * np.linalg.norm(cross, axis=1).sum()


def write_lamp(glb, name, light, matrix, notes):
    color = np.array(light.color) * light.energy * 2**getattr(light, "exposure", 0.0)  # 4.5 and later
    if getattr(light, "use_temperature", False):
        color = color * np.array(light.temperature_color)
    if not getattr(light, "normalize", True):
        notes.append(f'lamp "{name}": is taken as one whose power does not grow with its size')
    place, back = matrix.translation, matrix.to_3x3().normalized() @ mathutils.Vector((0, 0, 1))
    if light.use_nodes:
        notes.append(f'lamp "{name}": its nodes are not read')
    if color.max() <= 0:
        return
    if light.type == "AREA":
        places, faces, area = flat_lamp(light, matrix)
        if area > 0:
            # As Cycles has it: until 4.0 a quarter of the power over the area, from then on power over pi.
            glowing_shape(glb, name, places, faces, color / ((math.pi if bpy.app.version >= (4, 0) else 4) * area))
        if getattr(light, "spread", math.pi) < math.pi - 1e-3:
            notes.append(f'lamp "{name}": its spread is left out: it shines to all sides of its front')
        return
    radius = getattr(light, "shadow_soft_size", 0.0)
    if light.type == "POINT" and radius > 0.005:
        v, f = ball()
        p = radius * v[f]
        area = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
        glowing_shape(glb, name, radius * v + np.array(place), f, color / (math.pi * area))
        return
    kind = {"POINT": "point", "SPOT": "spot", "SUN": "directional"}[light.type]
    power = color if light.type == "SUN" else color / (4 * math.pi)
    item = {"name": name, "type": kind, "color": (power / power.max()).tolist(), "intensity": float(power.max())}
    if light.type == "SPOT":
        outer = min(light.spot_size / 2, math.pi / 2 - 1e-4)
        item["spot"] = {"innerConeAngle": outer * (1 - light.spot_blend), "outerConeAngle": outer}
        if radius > 0.005:
            notes.append(f'lamp "{name}": a spot is a point here: its radius is left out')
    if light.type == "SUN" and light.angle > math.radians(2):
        notes.append(f'lamp "{name}": its angle is left out: its shadows are sharp')
    lights = glb.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
    lights.append(item)
    glb.use("KHR_lights_punctual")
    # glTF's lamps shine along -Z of a node whose axes are Y-up.
    d = mathutils.Vector((-back.x, -back.z, back.y))
    turn = mathutils.Vector((0, 0, -1)).rotation_difference(d)
    add_node(glb, {"name": name, "translation": [place.x, place.z, -place.y],
                   "rotation": [turn.x, turn.y, turn.z, turn.w],
                   "extensions": {"KHR_lights_punctual": {"light": len(lights) - 1}}})


def write_scene(context, items, path, notes):
    glb, textures, known = glb_module.Glb(), {}, {}

    def looks(material):
        key = material.name_full if material else None
        if key not in known:
            known[key] = materials.write_material(glb, materials.read_material(material, notes), textures, notes)
        return known[key]
    for item in items:
        write_item(glb, item, looks)
    taken = set()
    for instance in context.evaluated_depsgraph_get().object_instances:
        source = instance.object.original
        if source.type != "LIGHT" or source.hide_render or not instance.show_self:
            continue
        name, number = source.name, 2
        while name in taken:
            name, number = f"{source.name}_{number}", number + 1
        taken.add(name)
        write_lamp(glb, name, source.data, mathutils.Matrix(instance.matrix_world), notes)
    glb.save(path)


def write_sky(context, folder):
    """The world as `--sky` takes it; None of a black one. Whatever its nodes are, Cycles draws them, as a panorama
    whose middle is +X: that of lambent's maps."""
    world = context.scene.world
    if world is None:
        return None
    if not world.use_nodes or world.node_tree is None:
        color = tuple(world.color)
        return "uniform:%.9g,%.9g,%.9g" % color if max(color) > 0 else None
    output = world.node_tree.get_output_node("CYCLES") or world.node_tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        return None
    node = output.inputs["Surface"].links[0].from_node
    if node.type == "BACKGROUND" and not node.inputs["Color"].is_linked and not node.inputs["Strength"].is_linked:
        color = [c * node.inputs["Strength"].default_value for c in tuple(node.inputs["Color"].default_value)[:3]]
        return "uniform:%.9g,%.9g,%.9g" % tuple(color) if max(color) > 0 else None
    path = os.path.join(folder, "world.exr")
    scene = bpy.data.scenes.new("lambent world")
    camera = bpy.data.cameras.new("lambent world")
    eye = bpy.data.objects.new("lambent world", camera)
    try:
        scene.world, scene.camera = world, eye
        scene.collection.objects.link(eye)
        eye.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
        camera.type = "PANO"
        owner = camera if hasattr(camera, "panorama_type") else camera.cycles  # 4.x; 3.x
        owner.panorama_type = "EQUIRECTANGULAR"
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.use_denoising = 4, False
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1024, 512, 100
        scene.render.filepath = path
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(eye)
        bpy.data.cameras.remove(camera)
    return path
