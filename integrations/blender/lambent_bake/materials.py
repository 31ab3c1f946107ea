"""What of Blender's materials a bake reads: one colour or picture of what is reflected, one of what glows."""
import numpy as np

from . import glb as glb_module


class Look:
    """A material as a bake sees it."""

    def __init__(self, name):
        self.name, self.color, self.image = name, (0.8, 0.8, 0.8), None
        self.metallic, self.roughness, self.alpha = 0.0, 0.5, 1.0
        self.glow, self.glow_image, self.two_sided = (0.0, 0.0, 0.0), None, True


def socket(node, *names):
    return next((node.inputs[n] for n in names if n in node.inputs), None)


def read_color(put, where, notes, black=(0.0, 0.0, 0.0)):
    """(factor, image) of a colour's socket."""
    if put is None:
        return black, None
    value = tuple(put.default_value)[:3] if hasattr(put.default_value, "__len__") else (put.default_value,) * 3
    if not put.is_linked:
        return value, None
    node = put.links[0].from_node
    while node.type == "REROUTE" and node.inputs[0].is_linked:
        node = node.inputs[0].links[0].from_node
    if node.type == "TEX_IMAGE" and node.image is not None:
        return (1.0, 1.0, 1.0), node.image
    if node.type == "RGB":
        return tuple(node.outputs[0].default_value)[:3], None
    notes.append(f"{where}: a colour comes from a node of type {node.bl_label}, which is not read: its own value is "
                 "taken")
    return value, None


def read_number(put, where, notes, otherwise):
    if put is None:
        return otherwise
    if put.is_linked:
        notes.append(f"{where}: {put.name} comes from a node, which is not read: its own value is taken")
    return float(put.default_value)


def read_shader(node, look, notes, share=1.0):
    where = f'material "{look.name}"'
    if node.type == "BSDF_PRINCIPLED":
        color, look.image = read_color(socket(node, "Base Color"), where, notes)
        look.color = tuple(share * c for c in color)
        look.metallic = read_number(socket(node, "Metallic"), where, [], 0.0)
        look.roughness = read_number(socket(node, "Roughness"), where, [], 0.5)
        look.alpha = read_number(socket(node, "Alpha"), where, notes, 1.0)
        glow, look.glow_image = read_color(socket(node, "Emission Color", "Emission"), where, notes)
        strength = read_number(socket(node, "Emission Strength"), where, notes, 1.0)
        look.glow = tuple(share * strength * c for c in glow)
        if read_number(socket(node, "Transmission Weight", "Transmission"), where, notes, 0.0) > 0:
            notes.append(f"{where}: transmission is left out: light does not pass through it")
    elif node.type in ("BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_ANISOTROPIC"):
        color, look.image = read_color(socket(node, "Color"), where, notes)
        look.color = tuple(share * c for c in color)
        look.metallic = 0.0 if node.type == "BSDF_DIFFUSE" else 1.0
    elif node.type == "EMISSION":
        glow, look.glow_image = read_color(socket(node, "Color"), where, notes)
        strength = read_number(socket(node, "Strength"), where, notes, 1.0)
        look.glow = tuple(share * strength * c for c in glow)
        if share == 1.0:
            look.color = (0.0, 0.0, 0.0)
    elif node.type == "ADD_SHADER":
        look.color = (0.0, 0.0, 0.0)
        for put in node.inputs:
            if put.is_linked:
                read_shader(put.links[0].from_node, look, notes, share)
    else:
        notes.append(f"{where}: a shader of type {node.bl_label} is not read: grey is taken")


def read_material(material, notes):
    if material is None:
        return Look("default")
    look = Look(material.name)
    look.two_sided = not material.use_backface_culling
    if not material.use_nodes or material.node_tree is None:
        look.color = tuple(material.diffuse_color)[:3]
        return look
    output = material.node_tree.get_output_node("CYCLES") or material.node_tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        look.color = (0.0, 0.0, 0.0)
        return look
    read_shader(output.inputs["Surface"].links[0].from_node, look, notes)
    return look


def image_png(image, notes):
    """An image's bytes as a PNG, sRGB as glTF wants colours; None where it has no pixels."""
    width, height = image.size
    if width == 0 or height == 0:
        notes.append(f'image "{image.name}" is missing: its material has no texture in the bake')
        return None
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)[::-1]
    if image.channels == 1:
        pixels = np.repeat(pixels, 3, 2)
    color = pixels[..., :3]
    if image.is_float or image.colorspace_settings.name not in ("sRGB",):
        color = np.where(color <= 0.0031308, 12.92 * color, 1.055 * np.maximum(color, 1e-9)**(1 / 2.4) - 0.055)
    out = np.concatenate([color, pixels[..., 3:4]], 2) if image.channels == 4 else color
    return glb_module.png(np.rint(np.clip(out, 0, 1) * 255).astype(np.uint8))


def write_material(glb, look, textures, notes):
    def texture(image):
        if image is None:
            return None
        if image.name_full not in textures:
            content = image_png(image, notes)
            textures[image.name_full] = None if content is None else glb.push("textures", {"source": glb.push(
                "images", {"bufferView": glb.view(content), "mimeType": "image/png", "name": image.name})})
        return textures[image.name_full]
    pbr = {"baseColorFactor": [min(max(c, 0.0), 1.0) for c in look.color] + [look.alpha],
           "metallicFactor": look.metallic, "roughnessFactor": look.roughness}
    item = {"name": look.name, "pbrMetallicRoughness": pbr, "doubleSided": look.two_sided}
    picture = texture(look.image)
    if picture is not None:
        pbr["baseColorTexture"] = {"index": picture}
    if look.alpha < 1:
        item["alphaMode"] = "BLEND"
    strength = max(look.glow)
    if strength > 0:
        item["emissiveFactor"] = [max(c, 0.0) / strength for c in look.glow]
        item["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        glb.use("KHR_materials_emissive_strength")
        glowing = texture(look.glow_image)
        if glowing is not None:
            item["emissiveTexture"] = {"index": glowing}
    return glb.push("materials", item)
