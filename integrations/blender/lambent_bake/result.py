"""A baked lightmap back in Blender: a picture for each light group, a layer of UVs, materials that show them; the
originals are kept, and one click goes from one to the other."""
import bpy
import numpy as np

from . import glb as glb_module

FRONT, BACK = "Lightmap", "Lightmap back"
GROUP = "lambent light"


def read_places(path, corners):
    """Coordinates of every corner on the front and on the back, NaN where a side has none."""
    glb = glb_module.Glb.load(path)
    front, back = np.full((corners, 2), np.nan, np.float32), np.full((corners, 2), np.nan, np.float32)
    for mesh in glb.json.get("meshes", []):
        numbers = {}
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            ours = primitive.get("extensions", {}).get("LAMBENT_transfer", {})
            if ours.get("viewerOnly"):
                if attributes["POSITION"] in numbers and "indices" in primitive:
                    number, layer = numbers[attributes["POSITION"]], max(
                        int(k[9:]) for k in attributes if k.startswith("TEXCOORD_"))
                    uv, used = glb.array(attributes[f"TEXCOORD_{layer}"]), glb.array(primitive["indices"])
                    back[number[used]] = uv[used]
                continue
            layer = f"TEXCOORD_{ours.get('texCoord', 1)}"
            if "_CORNER" not in attributes or layer not in attributes:
                continue
            parts = glb.array(attributes["_CORNER"]).astype(np.int64)
            number = parts[:, 0] * 65536 + parts[:, 1]
            numbers[attributes["POSITION"]] = number
            front[number] = glb.array(attributes[layer])
    for uv in (front, back):
        uv[:, 1] = 1 - uv[:, 1]
    return front, back


def loop_values(item, uv, loops):
    """Values of triangles' corners at the loops of the object's mesh, and whether all corners of each loop agree."""
    out, known = np.zeros((loops, 2), np.float32), np.zeros(loops, bool)
    there = ~np.isnan(uv[:, 0])
    out[item.loops[there]] = uv[there]
    known[item.loops[there]] = True
    agree = bool(np.all(np.abs(out[item.loops[there]] - uv[there]) < 1e-5))
    return out, agree, known


def set_layer(mesh, name, values):
    layer = mesh.uv_layers.get(name)
    if layer is None:
        active, render = mesh.uv_layers.active_index, next((u.name for u in mesh.uv_layers if u.active_render), None)
        layer = mesh.uv_layers.new(name=name, do_init=False)
        if layer is None:
            raise ValueError(f'mesh "{mesh.name}" has no room for another layer of UVs: it has eight')
        if render is not None:  # the scene's own textures keep theirs
            mesh.uv_layers.active_index = active
            mesh.uv_layers[render].active_render = True
    layer.data.foreach_set("uv", np.ascontiguousarray(values, np.float32).ravel())


def free_layers(mesh):
    for name in (FRONT, BACK):
        if name in mesh.uv_layers:
            mesh.uv_layers.remove(mesh.uv_layers[name])


def make_copy(item, collection):
    """The object as it is drawn, as triangles of its own."""
    count = len(item.places)
    mesh = bpy.data.meshes.new(item.name + " lit")
    mesh.from_pydata(item.places.tolist(), [], np.arange(count).reshape(-1, 3).tolist())
    mesh.polygons.foreach_set("material_index", np.minimum(item.materials, len(item.slots) - 1).astype(np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(count // 3, bool))
    for material in item.slots:
        mesh.materials.append(material)
    if item.uv is not None:
        set_layer(mesh, "UVMap", item.uv)
    if hasattr(mesh, "use_auto_smooth"):  # until 4.0
        mesh.use_auto_smooth = True
    mesh.normals_split_custom_set(item.normals.tolist())
    obj = bpy.data.objects.new(item.name + " lit", mesh)
    obj.matrix_world = item.matrix
    obj["lambent_lit"] = True
    collection.objects.link(obj)
    return obj


def make_group(name, pictures):
    """A group of nodes whose output is light: each lamp's picture times a colour, to dim it. On backs, that of the
    back's coordinates."""
    group = bpy.data.node_groups.get(name)
    if group is None:
        group = bpy.data.node_groups.new(name, "ShaderNodeTree")
        if hasattr(group, "interface"):  # 4.x
            group.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketColor")
        else:
            group.outputs.new("NodeSocketColor", "Light")
    nodes, links = group.nodes, group.links
    kept = {n.label: tuple(n.outputs[0].default_value) for n in nodes if n.type == "RGB"}
    nodes.clear()
    out = nodes.new("NodeGroupOutput")
    front, back, facing = nodes.new("ShaderNodeUVMap"), nodes.new("ShaderNodeUVMap"), nodes.new("ShaderNodeNewGeometry")
    front.uv_map, back.uv_map = FRONT, BACK
    place = nodes.new("ShaderNodeMixRGB")
    links.new(facing.outputs["Backfacing"], place.inputs[0])
    links.new(front.outputs[0], place.inputs[1])
    links.new(back.outputs[0], place.inputs[2])
    total = None
    for k, (label, image) in enumerate(pictures):
        picture, dimmer, product = (nodes.new(kind) for kind in
                                    ("ShaderNodeTexImage", "ShaderNodeRGB", "ShaderNodeMixRGB"))
        picture.image, picture.interpolation, picture.extension = image, "Linear", "EXTEND"
        picture.location, dimmer.location = (0, -300 * k), (0, -300 * k - 200)
        dimmer.label = label
        dimmer.outputs[0].default_value = kept.get(label, (1, 1, 1, 1))
        product.blend_type, product.inputs[0].default_value, product.location = "MULTIPLY", 1, (300, -300 * k)
        links.new(place.outputs[0], picture.inputs[0])
        links.new(picture.outputs[0], product.inputs[1])
        links.new(dimmer.outputs[0], product.inputs[2])
        if total is None:
            total = product.outputs[0]
            continue
        plus = nodes.new("ShaderNodeMixRGB")
        plus.blend_type, plus.inputs[0].default_value, plus.location = "ADD", 1, (500, -300 * k)
        links.new(total, plus.inputs[1])
        links.new(product.outputs[0], plus.inputs[2])
        total = plus.outputs[0]
    out.location = (800, 0)
    links.new(total, out.inputs[0])
    return group


def base_socket(material):
    """(socket of the colour that is reflected, socket and strength of the one that glows) of a copy's surface."""
    output = material.node_tree.get_output_node("CYCLES") or material.node_tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        return output, None, None, None
    node = output.inputs["Surface"].links[0].from_node
    names = {"BSDF_PRINCIPLED": ("Base Color",), "BSDF_DIFFUSE": ("Color",)}.get(node.type, ())
    color = next((node.inputs[n] for n in names if n in node.inputs), None)
    glow = next((node.inputs[n] for n in ("Emission Color", "Emission") if n in node.inputs), None)
    strength = node.inputs.get("Emission Strength")
    if node.type == "EMISSION":
        glow, strength = node.inputs["Color"], node.inputs["Strength"]
    return output, color, glow, strength


def make_material(material, group, name):
    """A copy that glows with what the original reflects of the light, and with what it gives itself."""
    lit = material.copy() if material else bpy.data.materials.new(name)
    lit.name, lit["lambent_lit"] = name, True
    lit.use_nodes = True
    nodes, links = lit.node_tree.nodes, lit.node_tree.links
    if material and not material.use_nodes:
        principled = next((n for n in nodes if n.type == "BSDF_PRINCIPLED"), None)
        if principled:
            principled.inputs["Base Color"].default_value = tuple(material.diffuse_color)
    output, color, glow, strength = base_socket(lit)
    if output is None:
        output = nodes.new("ShaderNodeOutputMaterial")
    light, product, shine = (nodes.new(k) for k in ("ShaderNodeGroup", "ShaderNodeMixRGB", "ShaderNodeEmission"))
    light.node_tree, product.blend_type = group, "MULTIPLY"
    product.inputs[0].default_value = 1
    for i, node in enumerate((light, product, shine)):
        node.location = (output.location.x - 600 + 200 * i, output.location.y - 300)
    links.new(light.outputs[0], product.inputs[1])

    def follow(put, into):
        if put.is_linked:
            links.new(put.links[0].from_socket, into)
        else:
            into.default_value = tuple(put.default_value)
    if color is not None:
        follow(color, product.inputs[2])
    else:
        product.inputs[2].default_value = (0, 0, 0, 1) if glow is not None else (0.8, 0.8, 0.8, 1)
    links.new(product.outputs[0], shine.inputs["Color"])
    final = shine.outputs[0]
    if glow is not None and (glow.is_linked or max(tuple(glow.default_value)[:3]) > 0):
        own, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
        follow(glow, own.inputs["Color"])
        if strength is not None:
            own.inputs["Strength"].default_value = strength.default_value
        links.new(final, both.inputs[0])
        links.new(own.outputs[0], both.inputs[1])
        final = both.outputs[0]
    links.new(final, output.inputs["Surface"])
    return lit


def load_picture(path, name):
    image = bpy.data.images.get(name)
    if image is not None:
        image.filepath = path
        image.reload()
    else:
        image = bpy.data.images.load(path)
        image.name = name
    image.colorspace_settings.name = "Non-Color"  # linear, as it is
    image["lambent"] = True
    return image


def apply(context, items, glb_path, pictures, name, notes):
    """pictures: (label, path) of each light group. Objects that cannot take UVs of their own (instances, those of
    linked files, those whose modifiers change them) get copies beside them."""
    corners = items[-1].first + items[-1].corners()
    front, back = read_places(glb_path, corners)
    forget(context)
    group = make_group(f"{GROUP} {name}",
                       [(label, load_picture(path, f"{name} {label}")) for label, path in pictures])
    collection = bpy.data.collections.get("lambent") or bpy.data.collections.new("lambent")
    if collection.name not in context.scene.collection.children:
        context.scene.collection.children.link(collection)
    lit, copies = {}, 0

    def lit_material(material):
        key = material.name_full if material else None
        if key not in lit:
            lit[key] = make_material(material, group, f"{material.name if material else 'default'} lit")
        return lit[key]
    for item in items:
        if not item.wanted:
            continue
        own = slice(item.first, item.first + item.corners())
        sides = [(FRONT, front[own])]
        if not np.all(np.isnan(back[own])):
            sides.append((BACK, back[own]))
        obj = item.source
        if item.in_place:
            values = [(label, *loop_values(item, uv, len(obj.data.loops))) for label, uv in sides]
            item.in_place = all(v[2] for v in values)
        if item.in_place:
            free_layers(obj.data)
            for label, uv, _, _ in values:
                set_layer(obj.data, label, uv)
            if not obj.material_slots:
                obj.data.materials.append(None)
            obj["lambent_original"] = [s.material.name if s.material else "" for s in obj.material_slots]
            obj["lambent_materials"] = [lit_material(s.material).name for s in obj.material_slots]
        else:
            copy = make_copy(item, collection)
            for label, uv in sides:
                set_layer(copy.data, label, np.nan_to_num(uv))
            for i, material in enumerate(item.slots):
                copy.data.materials[i] = lit_material(material)
            hidden = item.instancer or obj
            hidden["lambent_hidden"] = True
            copies += 1
    for material in lit.values():
        material.use_fake_user = True
    if copies:
        notes.append(f"{copies} objects share their mesh, are linked or have modifiers: triangles of their own stand "
                     'for them in the collection "lambent"')
    show(context, True)


def is_shown(scene):
    return bool(scene.get("lambent_shown"))


def show(context, lit):
    """The baked light, or the scene as it was."""
    for obj in context.scene.objects:
        names = obj.get("lambent_materials" if lit else "lambent_original")
        if names is not None:
            for slot, name in zip(obj.material_slots, names):
                slot.material = bpy.data.materials.get(name) if name else None
        hidden = lit if obj.get("lambent_hidden") else not lit if obj.get("lambent_lit") else None
        if hidden is None:
            continue
        obj.hide_render = hidden
        if obj.name in context.view_layer.objects:  # not in a collection that the view leaves out
            obj.hide_set(hidden)
    context.scene["lambent_shown"] = lit


def forget(context):
    """The scene as it was before a bake: copies and lit materials go, UVs and pictures stay until the next."""
    show(context, False)
    for obj in list(context.scene.objects):
        if obj.get("lambent_lit"):
            mesh = obj.data
            bpy.data.objects.remove(obj)
            if mesh.users == 0:
                bpy.data.meshes.remove(mesh)
            continue
        for key in ("lambent_hidden", "lambent_original", "lambent_materials"):
            if key in obj:
                del obj[key]
    for material in list(bpy.data.materials):
        if material.get("lambent_lit"):
            bpy.data.materials.remove(material)
