"""Precomputed light transport: bake how a scene shadows and scatters light, once; then relight it for ever.

    scene = lambent.load("bunny.obj")                 # or lambent.Scene(vertices, faces)
    baked = lambent.bake(scene, order=6, progress=True)
    colours = baked.relight("sky:elevation=30")       # float32 (receivers, 3)

docs/python.md says more. Options are those of the command line, with _ for -.
"""
import json as _json
import os as _os
import types as _types

import numpy as _np

from . import _lambent
from ._lambent import Environment, Error, Image, Scene, load, load_image
from ._progress import reporting as _reporting

__version__ = _lambent.version
__all__ = ["Baked", "Environment", "Error", "Image", "Scene", "bake", "compare", "difference", "environment",
           "environment_features", "load", "load_image", "open", "plan", "prt_features", "reference",
           "save_prt_features", "sh", "sky", "vertex_normals"]


def _failure(where, message):
    error = Error(f"{where}: {message}")
    error.where, error.usage = where, True
    return error


def _text(value):
    if isinstance(value, (tuple, list, _np.ndarray)):
        return ",".join(_text(v) for v in value)
    if isinstance(value, (float, _np.floating)):
        return repr(float(value))
    return str(value)


def _options(fields, options):
    """A request's JSON of Python's values: the table says what each option takes, and judges it."""
    out = {}
    for name, value in options.items():
        kind = fields.get(name, ("",))[0]
        if value is None:
            continue
        if kind == "text" and isinstance(value, (int, float, tuple, list, _np.number, _np.ndarray, _os.PathLike)) \
                and not isinstance(value, bool):
            value = _text(value)
        elif kind == "list" and isinstance(value, (str, _os.PathLike)):
            value = [str(value)]
        elif isinstance(value, (_np.number, _np.bool_)):
            value = value.item()
        elif isinstance(value, (tuple, list)):
            value = [_text(v) for v in value]
        out[name] = value
    try:
        return _json.dumps(out, allow_nan=False)
    except (TypeError, ValueError) as e:
        raise _failure("options", str(e)) from None


def _image(value):
    if isinstance(value, Image):
        return value
    if isinstance(value, (str, _os.PathLike)):
        return load_image(_os.fspath(value))
    return Image(_np.asarray(value))


def environment(light):
    """An Environment: itself, what a text names (a file, "uniform:..", "sky:.."), or an array (height, width, 3)."""
    if isinstance(light, Environment):
        return light
    if isinstance(light, (str, _os.PathLike)):
        return Environment(_os.fspath(light))
    return Environment(_image(light))


def sky(**options):
    """The analytic sky: elevation, azimuth (degrees), turbidity, ground (albedo), sun ("on", "off")."""
    return Environment("sky:" + ",".join(f"{k}={_text(v)}" for k, v in options.items()))


def _scene_and_options(scene, options):
    if isinstance(scene, Scene):
        return scene, options
    return None, {**options, "scene": _os.fspath(scene)}


def bake(scene, progress=None, **options):
    """Bakes a Scene, or the file that a path names, into a Baked.

    `options` are those of `lambent bake` (docs/options.md) with _ for -: transfer, order, samples, bounces, ground, ...
    The same options give the same bytes as there. `progress`: a callable (stage, fraction), or True for a bar. Ctrl-C
    and what the callable raises end the work soon. Raises Error.
    """
    scene, options = _scene_and_options(scene, options)
    with _reporting(progress) as report:
        return Baked(_lambent.bake(scene, _options(_lambent.bake_fields, options), report))


def plan(scene, **options):
    """What such a bake would take: a dict of request, receivers, bytes and seconds."""
    scene, options = _scene_and_options(scene, options)
    return _json.loads(_lambent.plan(scene, _options(_lambent.bake_fields, options), None))


def open(path):  # noqa: A001
    """Reads a baked file; transfer is used in place, in the mapped file."""
    return Baked(_lambent.open(_os.fspath(path)))


class Baked:
    """A scene with its light transport."""

    def __init__(self, handle):
        self._handle = handle

    path = property(lambda self: self._handle.path, doc="Of the file that it was read from, or \"\".")
    scene = property(lambda self: self._handle.scene, doc="The Scene as it was baked.")
    receivers = property(lambda self: self._handle.receivers, doc="How many places receive light.")
    order = property(lambda self: self._handle.order, doc="Bands of the light's harmonics; 0: none.")
    lobes = property(lambda self: self._handle.lobes, doc="float32 (n, 4): axes and sharpness of the light's lobes.")
    groups = property(lambda self: self._handle.groups, doc="Names of the scene's own lamps, a column each.")
    channels = property(lambda self: self._handle.channels, doc="1, or 3 where bounces are coloured.")
    rows = property(lambda self: self._handle.rows, doc="Numbers a receiver and channel that relighting gives.")
    info = property(lambda self: _json.loads(self._handle._describe()), doc="A dict that says what it is.")
    provenance = property(lambda self: _json.loads(self._handle._provenance()), doc="A dict: what it was made by.")
    request = property(lambda self: self.provenance.get("request", {}), doc="The options that it was baked by.")
    summary = property(lambda self: _json.loads(self._handle._summary()), doc="What the bake said of itself.")
    transfer = property(
        lambda self: self._handle.transfer,
        doc="float16 or float32 (blocks, rows, channels, columns, 16), read-only and in place; see `values`.")
    terms = property(lambda self: self._handle.terms,
                     doc="As `transfer`, of direct light and each bounce (terms=True).")
    front = property(lambda self: self._handle.front, doc="uint32: receiver of each scene vertex's front.")
    back = property(lambda self: self._handle.back, doc="The same for backs; empty where all is one-sided.")

    @property
    def values(self):
        """float16 or float32 (receivers, rows, channels, columns): the transfer in plain order, a copy."""
        t = self.transfer
        return t.transpose(0, 4, 1, 2, 3).reshape(-1, *t.shape[1:4])[:self.receivers]

    @property
    def input_vertices(self):
        """int64 (V,): a receiver of each vertex of the input, in its order; -1 where it has none.

        The first, where a vertex was split at a crease; `input_receivers` has all.
        """
        out = _np.full(self._handle.input_count, -1, _np.int64)
        pairs = self.input_receivers
        out[pairs[::-1, 0]] = pairs[::-1, 1]
        return out

    @property
    def input_receivers(self):
        """uint32 (n, 2): pairs of a vertex of the input and a receiver of its front, sorted."""
        if self._handle.input_count == 0:
            raise Error("the bake does not know the vertices of its input")
        return self._handle._pairs()

    def by_input_vertex(self, values):
        """Values of receivers, (receivers, ...), for each vertex of the input, in its order: the mean where a vertex
        has several receivers, 0 where it has none."""
        values = _np.asarray(values)
        if values.ndim < 1 or values.shape[0] != self.receivers:
            raise _failure("values", f"must have {self.receivers} rows, a receiver each")
        pairs, count = self.input_receivers, self._handle.input_count
        how_many = _np.bincount(pairs[:, 0], minlength=count)
        if how_many.max(initial=0) <= 1:
            out = _np.zeros((count, *values.shape[1:]), values.dtype)
            out[pairs[:, 0]] = values[pairs[:, 1]]
            return out
        flat = values.reshape(len(values), -1)[pairs[:, 1]].astype(_np.float64)
        sums = _np.stack([_np.bincount(pairs[:, 0], weights=column, minlength=count) for column in flat.T], 1)
        means = sums / _np.maximum(how_many, 1)[:, None]
        return means.reshape(count, *values.shape[1:]).astype(values.dtype)

    def project(self, env=None, env_rotate=None, light_order=None, window=None, lamp=None):
        """float32 (columns, 3): the coefficients of an environment for this bake's columns, lobes and lamps too."""
        options = {"env_rotate": env_rotate, "light_order": light_order, "window": window, "lamp": lamp}
        env = None if env is None else environment(env)
        return self._handle._columns(_options(_lambent.draw_fields, options), env)

    def relight(self, light=None, out=None, **options):
        """T . light: float32 (receivers, 3), or (receivers, rows, 3); of diffuse bakes exit radiance of white surfaces.

        `light`: what environment() takes, with the options of project(); or coefficients (columns, 3). `out`: an array
        to write to, which saves its making.
        """
        if not (hasattr(light, "ndim") and light.ndim == 2):
            light = self.project(light, **options)
        elif options:
            raise _failure("light", "is of coefficients already: " + ", ".join(options) + " cannot change it")
        return self._handle._relight(light, out)

    def render(self, env=None, progress=None, **options):
        """A picture (of several poses a list): the options of `lambent render` but output, exposure and tone."""
        for name in ("baked", "output", "exposure", "tone"):
            if name in options:
                raise _failure(name, "is said when the picture is saved")
        if isinstance(env, (str, _os.PathLike)):
            options, env = {**options, "env": _os.fspath(env)}, None
        env = None if env is None else environment(env)
        with _reporting(progress) as report:
            frames = self._handle._render(_options(_lambent.draw_fields, options), env, report)
        return frames[0] if len(frames) == 1 else frames

    def save(self, path):
        """Writes the baked file, and a lightmap's pictures beside it, whose names it gives back."""
        return self._handle._save(_os.fspath(path))

    def __repr__(self):
        info = self.info
        return f"<lambent.Baked: {info['kind']}, {self.receivers} receivers, {info['where']}>"


def reference(scene, env=None, *, camera="auto", size="512x512", spp=256, bounces=3, seed=1, brdf="diffuse",
              lamps=False, background="env", light_order=0, window="none", env_rotate="", progress=None, **options):
    """Path-traces the scene, as `lambent reference` does; `options` prepare it (ground, max_edge, ...)."""
    scene = scene if isinstance(scene, Scene) else load(_os.fspath(scene))
    if options:
        scene = scene._prepared(_options(_lambent.bake_fields, options))
    light = None if env is None else environment(env)
    if light is not None and env_rotate:
        light = light.rotated(env_rotate)
    with _reporting(progress) as report:
        return _lambent.reference(scene, light, camera=_text(camera), size=size, brdf=brdf, window=window,
                                  light_order=light_order, background=background, spp=spp, bounces=bounces, seed=seed,
                                  lamps=lamps, report=report)


def compare(a, b, exposure="0", tone="none", all=False):  # noqa: A002
    """How far picture a is from reference b: a dict of rmse, relative_mse, psnr, flip, mean_a, mean_b and pixels."""
    return _lambent.compare(_image(a), _image(b), _text(exposure), tone, all)


def difference(a, b, exposure="0", tone="none"):
    """A picture of a, b and their difference in false colours."""
    return _lambent.difference(_image(a), _image(b), _text(exposure), tone)


def vertex_normals(vertices, faces):
    """float32 (V, 3): normals weighted by the corners' angles, as trimesh makes them."""
    return _lambent.features(vertices, faces, None, 1, 1, 1, 1e-3, None)[1]


def prt_features(vertices, faces, order=3, convention="pifu", normals=None, samples=1600, seed=1, offset=1e-3,
                 progress=None):
    """PRT features as human-reconstruction data sets have them: float32 (V, order^2), and the faces, int64 (F, 3).

    Direct light with shadows, the clamped cosine without 1/pi, at the mesh's own vertices in their order; rays start
    `offset` times the least extent along the normal (angle-weighted, as trimesh's, if none are given). `convention`:
    whose light coefficients they are to be multiplied by, see sh.convert; all are pi times diffuse transfer without
    bounces, "pifu" and "icon" with the signs (-1)^m.
    """
    with _reporting(progress) as report:
        values = _lambent.features(vertices, faces, normals, order, samples, seed, offset, report)[0]
    return _for_light(values, convention), _np.array(faces, _np.int64)


def _for_light(values, convention):
    return _np.ascontiguousarray(_lambent.sh_convert(values.T, convention, True).T)


def environment_features(environments, order=3, convention="pifu"):
    """float32 (N, order^2, 3): coefficients of the light of environments, with signs that go with prt_features."""
    return _np.stack([sh.convert(environment(e).project(order), convention) for e in environments])


def save_prt_features(folder, features, faces, convention="pifu"):
    """Writes features under the names that the convention's pipeline reads, in `folder`; the paths.

    pifu: bounce/bounce0.txt and bounce/face.npy; icon: bounce.npy and face.npy; others: prt.npy and faces.npy.
    """
    names = {"pifu": ("bounce/bounce0.txt", "bounce/face.npy"), "icon": ("bounce.npy", "face.npy")}
    paths = [_os.path.join(_os.fspath(folder), name) for name in names.get(convention, ("prt.npy", "faces.npy"))]
    _os.makedirs(_os.path.dirname(paths[0]), exist_ok=True)
    if paths[0].endswith(".txt"):
        _np.savetxt(paths[0], features, fmt="%.8f")
    else:
        _np.save(paths[0], features)
    _np.save(paths[1], _np.asarray(faces, _np.int64))
    return paths


def _convert(coefficients, to, transfer=False):
    """Coefficients of light, (n^2,) or (n^2, channels), as another system has them: lambent, filament, directx, three,
    pifu, icon, unity, godot, gltf-ibl. With transfer, those of transfer, to be multiplied by such light."""
    return _lambent.sh_convert(coefficients, to, transfer)


def _evaluate(order, directions):
    """float32 (n, order^2): the harmonics at directions (n, 3)."""
    return _lambent.sh_evaluate(order, directions)


def _project(order, function, exact_order=64):
    """float64 (order^2,): coefficients of a function of directions (n, 3), exact for exact_order bands."""
    return _lambent.sh_project(order, function, exact_order)


def _rotate(coefficients, rotation):
    """Coefficients, (n^2,) or (n^2, channels), of the function turned by a rotation (3, 3)."""
    return _lambent.sh_rotate(coefficients, rotation)


def _multiply(a, b, order=0):
    """Coefficients of the product of two functions, projected to `order` bands (0: the larger of theirs)."""
    return _lambent.sh_multiply(a, b, order)


def _reconstruct(coefficients, width=1024):
    """The Environment that coefficients (n^2, 3) stand for."""
    return _lambent.sh_reconstruct(coefficients, width)


sh = _types.SimpleNamespace(convert=_convert, evaluate=_evaluate, project=_project, rotate=_rotate, multiply=_multiply,
                            reconstruct=_reconstruct)
