"""Bake with lambent: light of lamps, sky and their reflections into a picture over the scene (with one for each lamp,
to be dimmed afterwards), or light transport that a web page relights. Properties > Scene > Bake with lambent, or from
Python: bpy.ops.lambent.bake(), in `blender -b FILE -P SCRIPT` too."""
import os
import shutil
import tempfile

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, IntVectorProperty, PointerProperty
from bpy.props import StringProperty

from . import result, run, scene

bl_info = {
    "name": "Bake with lambent", "author": "the lambent authors", "version": (0, 1, 0), "blender": (3, 4, 0),
    "location": "Properties > Scene > Bake with lambent", "category": "Render",
    "description": "Lightmaps with light groups, precomputed light transport, light in free space"}


class LambentPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__
    tool: StringProperty(name="lambent", subtype="FILE_PATH", description="The program; empty: as found on the path")

    def draw(self, _):
        self.layout.prop(self, "tool")


class LambentSettings(bpy.types.PropertyGroup):
    kind: EnumProperty(name="Bake", default="LIGHTMAP", items=[
        ("LIGHTMAP", "Lightmap", "The light of lamps and world, with its reflections, in a picture over all objects"),
        ("PRT", "Light transport", "How the scene answers to any sky, for a page that relights it"),
        ("LATTICE", "Transport and free space", "The same, and light at points of a lattice, for what moves")])
    selected: BoolProperty(name="Selected objects only", description="Others cast shadows and stay as they are")
    light_groups: BoolProperty(name="Light groups", default=True, description="A picture for each lamp, to be dimmed")
    texels: FloatProperty(name="Texels a metre", default=0, min=0, soft_max=512, description="0: as fine as the light "
                          "asks for; with a number of rays, as 1024 x 1024 texels come to")
    quality: EnumProperty(name="Quality", default="good", items=[
        ("preview", "Preview", "10 % off, in the mean of squares"), ("good", "Good", "2.5 % off, lightmaps 2 %"),
        ("final", "Final", "1 % off, with finer texels or meshes"),
        ("error", "To an error", "As many rays as the error takes"),
        ("rays", "By rays", "So many rays for each receiver: its noise is not looked at, nor is what is between")])
    error: FloatProperty(name="Error", default=2, min=0.1, max=100, subtype="PERCENTAGE",
                         description="Of the light, in the mean of squares over all surfaces")
    samples: IntProperty(name="Rays", default=512, min=1, max=65536, description="For each texel or vertex")
    bounces: IntProperty(name="Reflections", default=4, min=0, max=64)
    order: IntProperty(name="Bands", default=6, min=1, max=16, description="Of the sky's spherical harmonics")
    lattice: IntVectorProperty(name="Lattice", default=(8, 8, 8), min=1, max=64, description="Points along X, Y, Z")
    output: StringProperty(name="Output", subtype="FILE_PATH", default="//lambent.glb",
                           description="The baked GLB, for the web too; pictures are written beside it")


def output_path(settings):
    path = bpy.path.abspath(settings.output)
    if settings.output.startswith("//") and not bpy.data.filepath:
        path = os.path.join(tempfile.gettempdir(), settings.output[2:])
    if not path.endswith(".glb"):
        path += ".glb"
    return path


def accuracy(settings):
    return {"error": ["--error", f"{settings.error:.6g}%"], "rays": ["--samples", str(settings.samples)]}.get(
        settings.quality, ["--quality", settings.quality])


def arguments_of(settings, given, sky, output):
    out = ["bake", given, "--bounces", str(settings.bounces), *accuracy(settings)]
    if settings.kind == "LIGHTMAP":
        out += ["--transfer", "lightmap"]
        if settings.texels > 0:
            out += ["--texels-per-unit", f"{settings.texels:.9g}"]
        if settings.light_groups:
            out.append("--light-groups")
        if sky:
            out += ["--sky", sky]
    else:
        out += ["--order", str(settings.order)]
    if settings.kind == "LATTICE":  # Blender's Y is glTF's -Z
        lattice = settings.lattice
        out += ["--lattice", f"{lattice[0]},{lattice[2]},{lattice[1]}"]
    return out + ["-o", output]


def reached(said):
    """What the bake says of its error and size, as a line; `said`: its summary."""
    certificate, number = said.get("certificate"), said.get("receivers", 0)
    line = f"{number:,} receivers"
    if certificate:
        line = f"{100 * certificate['error']:.1f} % off (within {200 * certificate['uncertain']:.1f}), {line}"
    return line


class Bake:
    """What one bake needs from its start to its end."""

    def __init__(self, context):
        self.settings, self.notes = context.scene.lambent, []
        self.folder, self.run = tempfile.mkdtemp(prefix="lambent-"), None
        try:
            shown = result.is_shown(context.scene)
            if shown:  # light is baked of the scene, not of its picture
                result.show(context, False)
                context.view_layer.update()
            self.items = scene.collect(context, self.settings.selected, self.notes)
            if not any(i.wanted for i in self.items):
                raise run.Failed("nothing to bake: no visible object with faces" +
                                 (" is selected" if self.settings.selected else ""))
            given = os.path.join(self.folder, "scene.glb")
            scene.write_scene(context, self.items, given, self.notes)
            sky = scene.write_sky(context, self.folder) if self.settings.kind == "LIGHTMAP" else None
            self.output = output_path(self.settings)
            os.makedirs(os.path.dirname(self.output) or ".", exist_ok=True)
            self.run = run.Run(arguments_of(self.settings, given, sky, self.output))
        except Exception:
            self.close()
            raise

    def finish(self, context):
        said = self.run.result()
        self.notes += [m for m in self.run.messages if m.startswith("warning:")]
        if self.settings.kind == "LIGHTMAP":
            stem = self.output[:-4]
            groups = said.get("groups") or []
            pictures = said.get("pictures") or []
            if not pictures:
                raise run.Failed("the baker wrote no pictures: is there a lamp, a glowing material or a lit world?")
            labels = groups if len(groups) == len(pictures) else ["all"] * len(pictures)
            name = os.path.basename(stem)
            result.apply(context, self.items, self.output, list(zip(labels, pictures)), name, self.notes)
        context.scene["lambent_output"] = self.output
        context.scene["lambent_reached"] = reached(said)
        context.scene["lambent_notes"] = "\n".join(self.notes)

    def close(self):
        if self.run:
            self.run.cancel()
        shutil.rmtree(self.folder, ignore_errors=True)


class LAMBENT_OT_bake(bpy.types.Operator):
    """Bake the scene's light"""
    bl_idname, bl_label, bl_options = "lambent.bake", "Bake", {"REGISTER", "UNDO"}
    bake = timer = None

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT"

    def start(self, context):
        try:
            self.bake = Bake(context)
            return True
        except (run.Failed, OSError, ValueError) as error:
            self.report({"ERROR"}, f"lambent: {error}")
            return False

    def end(self, context):
        try:
            self.bake.finish(context)
            for note in self.bake.notes:
                self.report({"WARNING"}, f"lambent: {note}")
            self.report({"INFO"}, f"lambent: {self.bake.output}, {context.scene['lambent_reached']}")
            return {"FINISHED"}
        except (run.Failed, OSError, ValueError) as error:
            self.report({"ERROR"}, f"lambent: {error}")
            return {"CANCELLED"}
        finally:
            self.bake.close()

    def execute(self, context):  # from Python: it ends when the bake has ended
        if not self.start(context):
            return {"CANCELLED"}
        self.bake.run.wait()
        return self.end(context)

    def invoke(self, context, _):
        if bpy.app.background:
            return self.execute(context)
        if not self.start(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self.timer = manager.event_timer_add(0.2, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.leave(context)
            self.bake.close()
            self.report({"INFO"}, "lambent: cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        code = self.bake.run.poll()
        context.window_manager.progress_update(100 * self.bake.run.fraction)
        context.workspace.status_text_set(
            f"lambent: {self.bake.run.stage}  {100 * self.bake.run.fraction:.0f} %    (Esc cancels)")
        if code is None:
            return {"RUNNING_MODAL"}
        self.leave(context)
        return self.end(context)

    def leave(self, context):
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)


class LAMBENT_OT_switch(bpy.types.Operator):
    """Show the baked light, or the scene's own materials and lamps"""
    bl_idname, bl_label, bl_options = "lambent.switch", "Baked light or original", {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return "lambent_shown" in context.scene

    def execute(self, context):
        result.show(context, not result.is_shown(context.scene))
        return {"FINISHED"}


class LAMBENT_OT_forget(bpy.types.Operator):
    """Take the baked light out of the scene; files stay"""
    bl_idname, bl_label, bl_options = "lambent.forget", "Remove baked light", {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return "lambent_shown" in context.scene

    def execute(self, context):
        result.forget(context)
        for obj in context.scene.objects:
            if obj.type == "MESH" and not obj.data.library:
                result.free_layers(obj.data)
        del context.scene["lambent_shown"]
        return {"FINISHED"}


class LAMBENT_PT_bake(bpy.types.Panel):
    bl_label, bl_idname = "Bake with lambent", "LAMBENT_PT_bake"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "scene"

    def draw(self, context):
        settings, layout = context.scene.lambent, self.layout
        layout.use_property_split = True
        layout.prop(settings, "kind")
        own = {"LIGHTMAP": ("selected", "light_groups", "texels"), "PRT": ("order",), "LATTICE": ("order", "lattice")}
        expert = {"error": ("error",), "rays": ("samples",)}
        for name in (*own[settings.kind], "quality", *expert.get(settings.quality, ()), "bounces"):
            layout.prop(settings, name)
        layout.prop(settings, "output")
        layout.operator("lambent.bake", icon="RENDER_STILL")
        if "lambent_reached" in context.scene:
            layout.label(text=context.scene["lambent_reached"], icon="CHECKMARK")
        if "lambent_shown" in context.scene:
            shown = result.is_shown(context.scene)
            layout.operator("lambent.switch", text="Show original" if shown else "Show baked light")
            layout.operator("lambent.forget")
        for group in bpy.data.node_groups:  # lamps, to be dimmed
            if shown_lamps(context.scene) and group.name.startswith(result.GROUP):
                for node in group.nodes:
                    if node.type == "RGB":
                        layout.prop(node.outputs[0], "default_value", text=node.label)
        for note in str(context.scene.get("lambent_notes", "")).splitlines():
            layout.label(text=note, icon="INFO")


def shown_lamps(blender_scene):
    return result.is_shown(blender_scene)


classes = (LambentPreferences, LambentSettings, LAMBENT_OT_bake, LAMBENT_OT_switch, LAMBENT_OT_forget, LAMBENT_PT_bake)


def register():
    for cls in classes:
        bpy.utils.register_class(cls)
    bpy.types.Scene.lambent = PointerProperty(type=LambentSettings)


def unregister():
    del bpy.types.Scene.lambent
    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
