#include <lambent/pipeline/draw_request.h>

#include <lambent/core/file.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/moving_lamps.h>

#include <algorithm>
#include <charconv>

namespace lambent {
namespace {

using R = DrawRequest;

constexpr KindMask bit(DrawKind kind) { return KindMask(1) << int(kind); }
constexpr KindMask D = bit(DrawKind::diffuse), C = bit(DrawKind::clusters), Z = bit(DrawKind::lobes),
                   M = bit(DrawKind::matrix), F = bit(DrawKind::factors), L = bit(DrawKind::lamps),
                   K = bit(DrawKind::blocks), V = bit(DrawKind::fixed_view), I = bit(DrawKind::indirect),
                   W = bit(DrawKind::wavelets), T = bit(DrawKind::texture);
constexpr KindMask every = D | C | Z | M | F | L | K | V | I | W | T, distant = every & ~I;

const Option<R> table[] = {
    {"baked", &R::baked, "Files", every, "Baked file, from `lambent bake`; with --transfer-texture, any scene", 0, 0,
     nullptr, nullptr, true, true},
    {"output", &R::output, "Files", every, "Picture to write: .png (8-bit sRGB) or .exr (linear)", 0, 0, nullptr,
     nullptr, false},

    {"env", &R::env, "Light", every,
     "Environment: a .hdr or .exr file, uniform:R,G,B, or sky:elevation=35,azimuth=45,turbidity=3", 0, 0, nullptr,
     nullptr, true, true},
    {"env-rotate", &R::env_rotate, "Light", every, "YAW,PITCH,ROLL: turn the environment, degrees about +Y, +X, +Z", 0,
     0, nullptr, "env"},
    {"window", &R::window, "Light", distant & ~(L | K | W),
     "Against ringing of the harmonics: auto (light in shadow does not go below what the rest of the sky gives), hann, "
     "lanczos, or none",
     0, 0, "auto|hann|lanczos|none"},
    {"light-order", &R::light_order, "Light", distant & ~(L | K | W),
     "Use only this many bands of the baked ones; lobes are kept", 1, max_sh_order},
    {"lamp", &R::lamp, "Light", D | C | M | L | V | I,
     "NAME=R,G,B: scale a group of lamps by this colour (files baked with --light-groups, and of direct to indirect "
     "light); or a lamp that stands anywhere (the latter): sphere@X,Y,Z,RADIUS=R,G,B (radiance), point@X,Y,Z=R,G,B "
     "(flux per steradian), spot@X,Y,Z,TX,TY,TZ,ANGLE=R,G,B (towards T, within so many degrees) or "
     "sun@AZIMUTH,ELEVATION=R,G,B (irradiance); may be given again"},
    {"move", &R::move, "Light", D | C | M | V | I,
     "N@T:X,Y,Z;T:X,Y,Z;...: where lamp N is at these times, straight from one to the next (files of direct to "
     "indirect light); N@AZIMUTH,ELEVATION or N@T:AZIMUTH,ELEVATION;...: where lamp N of the light stands (files baked "
     "with --light sh:BANDS+lamps:COUNT@ENV, lamps as `inspect` lists them), and what of it is lost is said; or "
     "NAME=PATH.json: the path of an object of --place; may be given again"},
    {"lamp-bounces", &R::lamp_bounces, "Light", D,
     "How often the light of lamps among the objects of --place goes on from surface to surface of the scene", 0, 16,
     nullptr, "place"},
    {"sphere-lamp", &R::sphere_lamp, "Light", Z | T,
     "X,Y,Z,RADIUS,R,G,B: a near lamp, a sphere of that radiance; may be given again"},

    {"camera", &R::camera, "View", every & ~V, "EX,EY,EZ,TX,TY,TZ,FOV: eye, target, vertical degrees; or auto"},
    {"size", &R::size, "View", every & ~V, "Picture size, WIDTHxHEIGHT pixels"},
    {"spp", &R::spp, "View", every & ~V, "Rays a pixel", 1, 4096},
    {"background", &R::background, "View", every, "What lies behind the scene: env, or none (transparent)", 0, 0,
     "env|none"},
    {"exposure", &R::exposure, "View", every,
     "Stops that a PNG is brightened by; auto: 90 % of what is covered is shown at 0.7 or less"},
    {"tone", &R::tone, "View", every, "Curve from light to the screen, of a PNG", 0, 0, tone_names},

    {"show", &R::show, "What is shown", every & ~(K | V),
     "product of light and colour; radiosity: the light alone, as if everything were white; albedo: the colour alone; "
     "emission: lamps that are seen, alone; bounce:K: light after K reflections between surfaces, alone; sum:K: lamps, "
     "and light after 0 to K reflections (files baked with --terms); direct, indirect: light of either sort (files of "
     "direct to indirect light)"},
    {"albedo", &R::albedo, "What is shown", I,
     "MATERIAL=R,G,B: repaint it, and what it reflects follows; may be given again"},
    {"at", &R::at, "What is shown", I,
     "Where indirect light is read: pixels, whatever the mesh; or the file's receivers, as an engine reads them, and "
     "where those have directions, for the normal that a normal map gives",
     0, 0, "pixels|receivers"},
    {"near-rays", &R::near_rays, "What is shown", I,
     "Rays of a pixel towards what a lamp lights within a few spacings of surfels, and as many all around: its first "
     "bounce is gathered there; 0: read off surfels, as all else",
     0, 64, nullptr, "at=pixels"},
    {"brdf", &R::brdf, "What is shown", C | Z | M | F | K,
     "Other materials than were baked, or those of blocks: diffuse (by base colour), materials (glTF's "
     "metallic-roughness), or one model for all, as `bake --brdf` takes it; for bakes that kept incident light, and "
     "blocks",
     0, 0, nullptr, nullptr, true, true},
    {"material", &R::material, "What is shown", K,
     "NAME=BRDF: another model for that material of the scene, as --brdf takes one for all; NAME=textured:BRDF: its "
     "diffuse colour times the base colour, with textures; may be given again"},
    {"insert", &R::insert, "What is shown", D | C | Z | M | I,
     "FILE@X,Y,Z[,SCALE]: put a small diffuse object there, lit by the scene's lattice; may be given again"},
    {"place", &R::place, "What is shown", D,
     "NAME=FIELD@X,Y,Z[,YAW,PITCH,ROLL[,SCALE]]: put the object of a file of `lambent field` there, the middle of its "
     "box, turned; it casts shadows on the scene and on others, and is lit by the scene's lattice; may be given again"},
    {"pose", &R::pose, "What is shown", D,
     "NAME=ANIMATION: that object of --place moves by a glTF animation of its own, by name or number, at the time of "
     "--time or --frames (files of lobes); may be given again",
     0, 0, nullptr, "place"},

    {"animation", &R::animation, "Motion", distant & ~(K | V),
     "Pose the scene by this glTF animation, by name or number"},
    {"time", &R::time, "Motion", every & ~K, "At this time, seconds, of --animation or --move"},
    {"frames", &R::frames, "Motion", every & ~K,
     "FROM:TO[:STEP]: at these times, seconds, as a strip of pictures; needs --animation, or --move"},
    {"frame-bounces", &R::frame_bounces, "Motion", I,
     "Bounces a frame, from the light of the frame before, so that what changes settles over the frames; 0: as many as "
     "it takes",
     0, 64, nullptr, "frames"},
    {"frame-leaves", &R::frame_leaves, "Motion", I,
     "Leaves that a lamp that moves lights anew a frame, those whose shadows may change most first; others keep their "
     "shadow, and settle over the frames; 0: all",
     0, 1 << 20, nullptr, "frames"},
    {"deform", &R::deform, "Motion", distant & ~(K | V),
     "bend:ANGLE[,along[,towards]] or twist:ANGLE[,along]: degrees from end to end, axes x, y or z"},

    {"method", &R::method, "Blocks", K,
     "By blocks, standard (every texel), or haar or haar:FRACTION (wavelets, kept coefficients)"},
    {"brdf-samples", &R::brdf_samples, "Blocks", K,
     "How many BRDF samples a block gets: bounded, by the error; paper, by its appendix A; full, 256", 0, 0,
     "bounded|paper|full", "method=blocks"},
    {"tolerance", &R::tolerance, "Blocks", K,
     "Error of BRDF x pi that bounded leaves; 0: 0.2 of Phong's lobes, 0.02 of others", 0, 10, nullptr,
     "brdf-samples=bounded"},
    {"indirect", &R::indirect, "Blocks", K, "sh adds light that has bounced, by a diffuse bake in harmonics", 0, 0,
     "none|sh"},

    {"terms", &R::terms, "Wavelets", W | V, "How many wavelets of the light are used, those that change most; 0: all",
     0, 1 << 20},

    {"transfer-texture", &R::transfer_texture, "Transfer textures", T,
     "Shade the scene by this texture of zonal lobes, from `lambent patch`; over a bake that kept incident light, in "
     "the light that arrives there",
     0, 0, nullptr, nullptr, true, true},
    {"tile", &R::tile, "Transfer textures", T,
     "U,V: its repetitions over the unit of texture coordinates; of grooves, across which they lie: 12,0 makes 12 "
     "along "
     "v"},
    {"groove-depth", &R::groove_depth, "Transfer textures", T,
     "Of grooves, in their widths; if not the deepest that the table has", 1e-6, 10},
    {"groove-width", &R::groove_width, "Transfer textures", T, "Of grooves, as a share of a repetition", 1e-3, 1},
    {"groove-map", &R::groove_map, "Transfer textures", T,
     "A picture over the texture coordinates, white where grooves have their full depth", 0, 0, nullptr, nullptr, true,
     true},
    {"wrinkle", &R::wrinkle, "Transfer textures", T,
     "strain[,LIMIT]: grooves are as deep as a pose presses the surface together, up to LIMIT of their widths, and lie "
     "across where it presses most, as many over the unit as --tile is long"},
};

// Pairs that leave one without effect, beyond what the table says; conditions as Option::needs.
struct Conflict {
  const char *option, *other, *why;
};
constexpr Conflict conflicts[] = {
    {"time", "frames", "and --frames both say when: give one"},
    {"deform", "animation", "and --animation both move the scene: give one"},
    {"insert", "animation", "draws the scene at rest: leave the animation out"},
    {"insert", "deform", "draws the scene at rest: leave --deform out"},
    {"place", "animation", "moves objects over a scene at rest: leave the animation out"},
    {"place", "deform", "moves objects over a scene at rest: leave --deform out"},
    {"place", "show=emission|bounce:|sum:", "is lit by all light at once: no --show of a part of it"},
    {"place", "insert", "and --insert both put objects in: give --place for all"},
    {"pose", "animation", "moves objects over a scene at rest: leave the animation out"},
    {"move", "animation", "moves objects over a scene at rest: leave the animation out"},
    {"insert", "show=emission|bounce:|sum:", "is lit by all light at once: no --show of a part of it"},
    {"groove-depth", "wrinkle", "is what --wrinkle finds: say at most how deep by strain,LIMIT"},
    {"tolerance", "method=standard|haar", "needs --method blocks"},
    {"at", "show=direct|albedo", "reads light that --show leaves out"},
    {"frame-bounces", "show=direct|albedo", "are of light that --show leaves out"},
    {"frame-leaves", "show=direct|albedo", "are of light that --show leaves out"},
    {"near-rays", "show=direct|albedo", "are of light that --show leaves out"},
    {"lamp", "show=albedo", "lights what --show albedo shows no light of"},
    {"sphere-lamp", "show=albedo|emission", "lights what --show leaves out"},
    {"window", "show=albedo|emission", "shapes light that --show leaves out"},
    {"light-order", "show=albedo|emission", "shapes light that --show leaves out"},
    {"brdf", "show=albedo|emission", "reflects light that --show leaves out"},
    {"move", "show=albedo|emission", "moves light that --show leaves out"},
};

GivenOptions said_in(const R& request) {
  GivenOptions said = request.given;
  const R untouched;
  for (const Option<R>& o : table)
    std::visit(
        [&](auto member) {
          if (request.*member != untouched.*member) said.insert(json_name(o.name));
        },
        o.member);
  return said;
}

}  // namespace

std::span<const Option<DrawRequest>> draw_options() { return table; }

bool is_given(const DrawRequest& request, const std::string& option) { return said_in(request).contains(option); }

DrawKind kind_of(const Field& surface) {
  if (std::holds_alternative<SightRows>(surface.rows)) return DrawKind::blocks;
  if (std::holds_alternative<PixelRows>(surface.rows)) return DrawKind::fixed_view;
  if (std::holds_alternative<ZonalTransfer>(surface.store)) return DrawKind::lobes;
  if (std::holds_alternative<HaarTransfer>(surface.store)) return DrawKind::wavelets;
  if (std::holds_alternative<IndirectTransfer>(surface.store)) return DrawKind::indirect;
  if (std::holds_alternative<FactoredTransfer>(surface.store)) return DrawKind::factors;
  if (std::holds_alternative<CpcaTransfer>(surface.store)) return DrawKind::clusters;
  if (outgoing_of(surface)) return DrawKind::matrix;
  const LightBasis light = light_of(surface.store);
  return light.order > 0 || !light.lobes.empty() ? DrawKind::diffuse : DrawKind::lamps;
}

Result<Show> parse_show(const std::string& text) {
  if (text == "product") return Show{};
  if (text == "radiosity") return Show{RenderOptions::Show::radiosity};
  if (text == "albedo") return Show{RenderOptions::Show::albedo};
  if (text == "emission") return Show{.part = Show::Part::emission};
  if (text == "direct") return Show{.part = Show::Part::direct};
  if (text == "indirect") return Show{.part = Show::Part::indirect};
  for (const auto& [start, part] : {std::pair("bounce:", Show::Part::bounce), std::pair("sum:", Show::Part::sum)})
    if (text.starts_with(start)) {
      Show show{.part = part};
      const char* digits = text.data() + std::string(start).size();
      const char* end = text.data() + text.size();
      if (const auto [stop, status] = std::from_chars(digits, end, show.term);
          status == std::errc() && stop == end && show.term >= 0)
        return show;
    }
  return Error{
      "--show",
      "must be product, radiosity, albedo, emission, bounce:K or sum:K with K from 0, direct or indirect, not \"" +
          text + "\"",
      true};
}

namespace {

Result<void> check_show(const DrawRequest& request, const Show& show, const Baked& baked) {
  const LightBasis light = light_of(baked.surface.store);
  const std::vector<Vec3> lamps = seen_emission(baked.scene, light, std::vector<Vec3>(light.groups.size(), Vec3(1.0f)));
  if (show.part == Show::Part::emission && std::all_of(lamps.begin(), lamps.end(), [](Vec3 e) { return e == Vec3(0); }))
    return Error{request.baked, "has no lamps of its own that --show emission could show"};
  if (show.part != Show::Part::bounce && show.part != Show::Part::sum) return {};
  if (baked.terms.empty())
    return Error{request.baked, "does not keep its reflections one by one: `lambent bake --terms` makes files that do"};
  if (size_t(show.term) >= baked.terms.size())
    return Error{
        "--show",
        "the file keeps terms 0 to " + std::to_string(baked.terms.size() - 1) + ", not " + std::to_string(show.term),
        true};
  return {};
}

// Lamps of the light that move; those of --place and of direct to indirect light are looked at where they are drawn.
Result<void> check_moves(const DrawRequest& request, DrawKind kind, const LightBasis& light) {
  if (request.move.empty() || kind == DrawKind::indirect || !request.place.empty()) return {};
  if (light.lobes.empty())
    return Error{
        "--move",
        "moves objects of --place, lamps of direct to indirect light, and lamps of a light that has some: bake "
        "--light sh:BANDS+lamps:COUNT@ENV",
        true};
  if (light.order == 0)
    return Error{"--move", "needs lamps beside harmonics; the file's lobes are spread evenly, and none is a lamp",
                 true};
  std::vector<bool> moved(light.lobes.size(), false);
  for (const std::string& text : request.move) {
    auto arc = parse_lamp_arc(text, moved.size());
    if (!arc) return arc.error();
    if (moved[arc->lamp])
      return Error{"--move", "says twice where lamp " + std::to_string(arc->lamp + 1) + " is", true};
    moved[arc->lamp] = true;
  }
  return {};
}

}  // namespace

Result<void> check_draw(const DrawRequest& request, DrawKind kind) {
  const GivenOptions said = said_in(request);
  if (auto ok = check_values(draw_options(), request, said); !ok) return ok;
  if (auto ok = check_given(draw_options(), request, said, int(kind), draw_kind_names); !ok) return ok;
  for (const Conflict& c : conflicts)
    if (said.contains(json_name(c.option)) && holds(draw_options(), request, c.other) &&
        said.contains(json_name(std::string(c.other).substr(0, std::string(c.other).find('=')))))
      return Error{std::string("--") + c.option, c.why, true};
  if (auto ok = check_display(request.exposure, request.tone); !ok) return ok;
  for (const char* option : {"exposure", "tone"})
    if (said.contains(option) && file_extension(request.output) == "exr")
      return Error{std::string("--") + option, "is for a PNG; an EXR keeps radiance as it is", true};
  auto show = parse_show(request.show);
  if (!show) return show.error();
  if (kind == DrawKind::texture && show->part != Show::Part::all)
    return Error{"--show", "of a transfer texture is product, radiosity or albedo", true};
  const bool two_sorts = show->part == Show::Part::direct || show->part == Show::Part::indirect;
  if (two_sorts && kind != DrawKind::indirect)
    return Error{"--show", "direct and indirect are of files of direct to indirect light: bake --transfer indirect",
                 true};
  if (kind == DrawKind::indirect && !two_sorts && show->part != Show::Part::all)
    return Error{"--show", "of direct to indirect light is product, radiosity, albedo, direct or indirect", true};
  const bool by_paths = kind == DrawKind::indirect || !request.place.empty() || !request.move.empty();
  if (said.contains("time") && request.animation.empty() && request.move.empty() && request.pose.empty())
    return Error{"--time", "needs --animation, --move or --pose", true};
  if (said.contains("frames") && (by_paths ? request.move.empty() && request.pose.empty() : request.animation.empty()))
    return Error{"--frames", by_paths ? "needs --move, or --pose" : "needs --animation, or --move", true};
  const bool from_afar = kind == DrawKind::texture || kind == DrawKind::blocks;
  if (from_afar && show->colour != RenderOptions::Show::albedo && request.env.empty() && request.sphere_lamp.empty())
    return Error{"--env", "is needed: an environment to light the scene by", true};
  return {};
}

Result<void> check_draw(const DrawRequest& request, const Baked& baked) {
  const DrawKind kind = kind_of(baked.surface);
  if (auto ok = check_draw(request, kind); !ok) return ok;
  if (kind == DrawKind::blocks) return {};
  auto show = parse_show(request.show);
  if (!show) return show.error();
  if (auto ok = check_show(request, *show, baked); !ok) return ok;
  const LightBasis light = light_of(baked.surface.store);
  const bool wavelets = std::holds_alternative<HaarTransfer>(baked.surface.store);
  if (!wavelets && is_given(request, "terms"))
    return Error{"--terms", "counts wavelets, and the file is baked for none: bake --light haar:SIZE", true};
  const bool lit = show->part != Show::Part::emission && show->colour != RenderOptions::Show::albedo;
  if (lit && (light.order > 0 || !light.lobes.empty() || wavelets) && request.env.empty() &&
      request.sphere_lamp.empty())
    return Error{"--env", "is needed: the file is baked for distant light", true};
  if (auto ok = check_moves(request, kind, light); !ok) return ok;
  const bool copies = !light.lobes.empty() && light.lobe_kind == LobeKind::band_limited;
  if (light.order == 0 && is_given(request, "window")) {
    if (!copies) return Error{"--window", "shapes harmonics, and the file is baked for none", true};
    if (request.window != "auto" && request.window != "none")
      return Error{"--window", "of steerable lobes is auto or none: others shape harmonics", true};
  }
  if (light.order == 0 && request.light_order > 0)
    return Error{"--light-order", "counts bands of harmonics, and the file is baked for none", true};
  const Outgoing* outgoing = outgoing_of(baked.surface);
  if (!request.brdf.empty() && (!outgoing || outgoing->kind != OutgoingKind::map))
    return Error{request.baked,
                 "--brdf needs a bake that kept incident light: lambent bake --transfer matrix --outgoing map"};
  if (request.insert.empty() && request.place.empty()) return {};
  const auto* indirect = std::get_if<IndirectTransfer>(&baked.surface.store);
  if (indirect && indirect->lattice) return {};
  if (!lattice_of(baked))
    return Error{request.baked, std::string("has no light in free space for ") +
                                    (request.insert.empty() ? "--place" : "--insert") + ": bake it with --lattice"};
  if (!vertices_of(baked) || std::holds_alternative<DirectionalRows>(baked.surface.rows))
    return Error{request.baked, "objects can only be " + std::string(request.insert.empty() ? "placed" : "inserted") +
                                    " into bakes at vertices"};
  if (!request.place.empty() && light.count() != size_t(sh_count(light.order)))
    return Error{request.baked, "has lobes or lamps beside harmonics, which objects of --place cannot shadow"};
  return {};
}

}  // namespace lambent
