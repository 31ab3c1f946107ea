#include <lambent/pipeline/bake_request.h>

#include <lambent/baked/fields.h>
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh.h>

#include <filesystem>

namespace lambent {

namespace {

using R = BakeRequest;

constexpr KindMask bit(BakeKind kind) { return KindMask(1) << int(kind); }
constexpr KindMask D = bit(BakeKind::diffuse), M = bit(BakeKind::matrix), F = bit(BakeKind::factors),
                   Z = bit(BakeKind::zonal), G = bit(BakeKind::glossy_zonal), S = bit(BakeKind::membrane),
                   L = bit(BakeKind::lightmap), K = bit(BakeKind::blocks), I = bit(BakeKind::indirect),
                   W = bit(BakeKind::wavelets);
constexpr KindMask every = D | M | F | Z | G | S | L | K | I | W, traced = D | M | F | Z | G | L, glossy = M | F | G;

const Option<R> table[] = {
    {"scene", &R::scene, "Files", every, "Scene: .gltf, .glb, .obj or .ply", 0, 0, nullptr, nullptr, true, true},
    {"output", &R::output, "Files", every,
     "Baked file to write: .glb, of up to 4 GiB, or .gltf with its data beside it, of any size", 0, 0, nullptr, nullptr,
     false},
    {"bin-limit", &R::bin_limit, "Files", every, "Bytes of each .bin of a .gltf, at most; e.g. 256MB, 2GiB (1GiB)",
     65536, 1e18, nullptr, nullptr, false},
    {"checkpoint", &R::checkpoint, "Files", traced | K | I | W,
     "Folder to keep the work in as it comes, from which the same command goes on after an interrupt or a crash; off: "
     "nowhere (OUTPUT.checkpoint, of work of over a minute)",
     0, 0, nullptr, nullptr, false},
    {"scratch", &R::scratch, "Files", D | L,
     "Folder for rows of the operator that --memory has no room for (the output's); off: they are traced again at each "
     "bounce",
     0, 0, nullptr, nullptr, false},
    {"depfile", &R::depfile, "Files", every, "Rule of make to write: the outputs, and all files that were read", 0, 0,
     nullptr, nullptr, false},
    {"transfer", &R::transfer, "What is baked", every,
     "diffuse: a vector a receiver for distant light; matrix: incident light in every direction, for glossy materials; "
     "zonal: lobes, for what moves, glossy too with --brdf or --outgoing; lightmap: the light of the scene's own "
     "lamps; "
     "blocks: visibility for sharp shadows and highlights, with materials chosen when it is drawn; indirect: how "
     "direct "
     "light becomes indirect light, for lamps that move and walls that are repainted",
     0, 0, "diffuse|matrix|zonal|lightmap|blocks|indirect"},
    {"order", &R::order, "What is baked", every & ~(K | I | W),
     "Bands of the light's spherical harmonics; 6 if nothing is said, of lightmaps none", 1, max_sh_order},
    {"light", &R::light, "What is baked", D | M | F | W,
     "What light is made of, in place of --order: sh:BANDS, sh:BANDS+lamps:COUNT@ENV, directional:COUNT, "
     "compact:COUNT (lobes of finite reach), steerable:BANDS (turned copies of one lobe), or "
     "haar:SIZE[,error=ERROR|,keep=FRACTION] (wavelets on a cube of so many texels a side, as few as leave that error "
     "of a receiver's transfer, 0.02, or that share of all)",
     0, 0, nullptr, nullptr, true, true},
    {"precision", &R::precision, "What is baked", every & ~(K | I | W), "Of the stored transfer", 0, 0, "half|single"},
    {"receivers", &R::receivers, "What is baked", every,
     "Where light is received, the basis of what is baked: vertices (hats), texels of an atlas (tents), patches "
     "(triangles, boxes), or meshless, kernels about --surfels, looked up at vertices; texels for lightmaps, else "
     "vertices",
     0, 0, "vertices|texels|patches|meshless"},
    {"projection", &R::projection, "What is baked", D | L,
     "What receivers hold: the light where they are (collocation), or coefficients that come nearest to it over all "
     "surfaces (least-squares), by rays from all over their areas",
     0, 0, "collocation|least-squares"},
    {"texels-per-unit", &R::texels_per_unit, "What is baked", D | L | W | I,
     "Texels along one scene unit; the atlas is as large as that needs", 1e-12, 1e12, nullptr, "receivers=texels"},
    {"atlas", &R::atlas, "What is baked", D | L | W | I,
     "WIDTHxHEIGHT of the atlas; texels are as small as that allows (if nothing is said, as light asks for in a "
     "lightmap "
     "baked to an error, else 1024x1024)",
     0, 0, nullptr, "receivers=texels"},

    {"quality", &R::quality, "How well", D | L,
     "An error to bake to, and how fine a mesh or a lightmap may become: 10 %, 2.5 % or 1 % of the transfer's RMS (of "
     "lightmaps 2 %)",
     0, 0, "preview|good|final"},
    {"error", &R::error, "How well", D | L,
     "Bake to this relative RMS error, e.g. 2%, measured on rays and places of their own; says what it reached"},
    {"time", &R::time, "How well", D | L,
     "Seconds (or 90s, 2min, 1h) after which no more rays are asked for, whatever the error; the result then depends "
     "on the machine",
     0, 1e6},
    {"adapt", &R::adapt, "How well", D,
     "Receivers where light changes: split edges, and, in a bake to an error, trace no receivers that others can stand "
     "for; auto splits scenes without bones, where neither --samples nor --max-edge is given",
     0, 0, "auto|on|off", "receivers=vertices"},
    {"denoise", &R::denoise, "How well", D | Z | F | L, "Take away noise that neighbours on a surface do not share", 0,
     0, "on|off"},
    {"samples", &R::samples, "How well", traced | I | W,
     "Rays a receiver; without, diffuse transfer and lightmaps of lamps are baked to an error, other kinds with 1024",
     1, 1 << 20},
    {"bounces", &R::bounces, "How well", D | M | Z | G | L | W,
     "Reflections between surfaces, 0 to 64 (3; of wavelets 0); lightmaps also converge:EPS, as many as leave that "
     "residual"},
    {"shadows", &R::shadows, "How well", D | Z, "off: open light everywhere, no shadows and no bounces", 0, 0,
     "on|off"},
    {"terms", &R::terms, "How well", D | M | L,
     "Keep direct light and each bounce one by one too, for `render --show`"},
    {"memory", &R::memory, "How well", traced | K | W,
     "Working memory beyond scene and result, bytes; e.g. 500MB, 2GiB (4GiB); less means rays traced again", 0, 0,
     nullptr, nullptr, false},
    {"seed", &R::seed, "How well", traced | I | W, "Of the ray directions"},

    {"ground", &R::ground, "Scene", every, "Add a tessellated floor under the scene"},
    {"max-edge", &R::max_edge, "Scene", every, "Split edges longer than this many scene units", 1e-12, 1e12},
    {"emit", &R::emit, "Scene", every & ~I, "MATERIAL=R,G,B: make a material a lamp of this radiance"},
    {"light-units", &R::light_units, "Scene", L,
     "What lamps are stated in, beside emission: lumen as glTF has it, candela and lux; watt divides them by 683, "
     "Blender's lumens a watt; raw divides points and spots by 4 pi, watts all around; auto asks the file's generator",
     0, 0, "auto|lumen|watt|raw"},
    {"lamp", &R::lamp, "Scene", L,
     "NAME=SCALE, or NAME=R,G,B: lamps of this name, or a material that glows, times so much; may be given again"},
    {"max-albedo", &R::max_albedo, "Scene", every, "Darken base colours to at most this, channel by channel", 0, 1},
    {"rooms", &R::rooms, "Scene", D,
     "Bake room by room, each with its own geometry, and join them through the light in their openings: auto finds "
     "where to part the scene, a JSON file names the rooms' boxes or nodes",
     0, 0, nullptr, nullptr, true, true},
    {"rooms-error", &R::rooms_error, "Scene", D, "Relative residual of the joined rooms at which it ends", 1e-6, 0.5,
     nullptr, "rooms"},
    {"exclude", &R::exclude, "Scene", every,
     "Leave a part out, by its name or its material's, or with unlit all of unlit materials: sky domes, backdrops; may "
     "be given again"},

    {"brdf", &R::brdf, "Glossy transfer (--transfer matrix, and zonal)", glossy,
     "How surfaces reflect: diffuse (by base colour), materials (glTF's metallic-roughness), or one model for all, as "
     "`render --brdf` takes it",
     0, 0, nullptr, nullptr, true, true},
    {"outgoing", &R::outgoing, "Glossy transfer (--transfer matrix, and zonal)", M | G,
     "Rows for the last reflection: map, phong, svd:ROWS, sh:BANDS, hemisphere:BANDS, hsh:BANDS, "
     "directional:COUNT"},
    {"incident-order", &R::incident_order, "Glossy transfer (--transfer matrix, and zonal)", glossy,
     "Bands of incident light", 1, max_incident_order},
    {"view-map", &R::view_map, "Glossy transfer (--transfer matrix, and zonal)", glossy,
     "Nodes a side of the maps that the last reflection is looked up in by view", 8, 256, nullptr, "outgoing=map|svd"},
    {"simulate", &R::simulate, "Glossy transfer (--transfer matrix, and zonal)", M | G,
     "Bounces by the recursion over receivers, or by paths (caustics, coarse meshes; noisier)", 0, 0,
     "recursion|paths"},
    {"factors", &R::factors, "Glossy transfer (--transfer matrix, and zonal)", F,
     "With --transfer matrix: keep visibility, light and BRDF as factors; direct light alone, a tenth of the size"},

    {"lobes", &R::lobes, "Lobes (--transfer zonal), media, sheets", Z | G, "Lobes a receiver; of glossy lobes, a row",
     1, max_stored_lobes},
    {"subsurface", &R::subsurface, "Lobes (--transfer zonal), media, sheets", D | Z,
     "Light through a medium: sigma_s=S,sigma_a=A[,g=G][,eta=E] per unit, S and A one number or R,G,B; or NAME[:MM], a "
     "measured one (marble, skin, wholemilk, ...) where a unit is MM millimetres (1000)"},
    {"membrane", &R::membrane, "Lobes (--transfer zonal), media, sheets", S,
     "No simulation: thin sheets that let this share of the light through, 0 to 1, or a picture of it", 0, 0, nullptr,
     nullptr, true, true},

    {"direct", &R::direct, "Lightmaps (--transfer lightmap)", L,
     "separate writes direct light to a picture of its own as well, and leaves it out of the others", 0, 0,
     "included|separate"},
    {"directional", &R::directional, "Lightmaps (--transfer lightmap)", L | I,
     "For normal maps: sh:2 or sh:3 (harmonics of irradiance), hl2 (Half-Life 2's three directions; of lightmaps), "
     "vector",
     0, 0, "none|sh:2|sh:3|hl2|vector"},
    {"solver", &R::solver, "Lightmaps (--transfer lightmap)", L, "With --bounces converge:EPS", 0, 0,
     "jacobi|gauss-seidel|southwell|gmres", "bounces=converge:"},
    {"gather", &R::gather, "Lightmaps (--transfer lightmap)", L,
     "Bounces by cosine-distributed rays, or through a hemicube's pixels, 3 n^2 as near to --samples as can be", 0, 0,
     "rays|hemicube"},
    {"sky", &R::sky, "Lightmaps (--transfer lightmap)", L,
     "An environment (as --env of render) as one more lamp, named sky", 0, 0, nullptr, nullptr, true, true},
    {"light-groups", &R::light_groups, "Lightmaps (--transfer lightmap)", L,
     "A column for each material that glows, each lamp by name, and the sky"},
    {"lamp-samples", &R::lamp_samples, "Lightmaps (--transfer lightmap)", L,
     "Samples a receiver towards each group's lamps", 1, 1 << 16},

    {"cube", &R::cube, "Blocks (--transfer blocks)", K, "Texels a side of a cubemap's face: 16, 32, 64, 128 or 256", 16,
     256},
    {"visibility", &R::visibility, "Blocks (--transfer blocks)", K | W,
     "binary, or bits:N, shares of texels in 2^N levels, for harsh light; of wavelets bits:4, of blocks binary"},

    {"surfels", &R::surfels, "Direct to indirect light (--transfer indirect)", D | I,
     "Points on surfaces that direct light is taken at, about, and that gather, or a quarter of them (--gatherers); of "
     "--receivers meshless, those that receive; 0: 16,384 to 65,536, by how far surfaces see",
     0, 1 << 20},

    {"gatherers", &R::gatherers, "Direct to indirect light (--transfer indirect)", I,
     "Which of them gather: a quarter, evenly apart, or all, for light that changes over a few of their distances, "
     "with several times the bytes and the time",
     0, 0, "quarter|all"},

    {"compress", &R::compress, "Smaller and special", D | M,
     "cpca:CLUSTERS,RANK: store clusters, and a few weights a receiver"},
    {"fix-light", &R::fix_light, "Smaller and special", D | M,
     "Bake this environment in, so that only its brightness is left: a surface light field", 0, 0, nullptr, nullptr,
     true, true},
    {"fix-view", &R::fix_view, "Smaller and special", D | M | W,
     "EYE,TARGET,FOV or auto: bake this camera in, one row a pixel: image relighting"},
    {"size", &R::size, "Smaller and special", D | M | W, "Of --fix-view: WIDTHxHEIGHT in pixels", 0, 0, nullptr,
     "fix-view"},
    {"spp", &R::spp, "Smaller and special", D | M | W, "Of --fix-view: rays a pixel", 1, 4096, nullptr, "fix-view"},

    {"lattice", &R::lattice, "Light in free space (diffuse, matrix, indirect)", D | M | I,
     "NX,NY,NZ: also bake light in free space at so many points, for `render --insert`"},
    {"lattice-box", &R::lattice_box, "Light in free space (diffuse, matrix, indirect)", D | M | I,
     "X0,Y0,Z0,X1,Y1,Z1: where, if not throughout the scene's box", 0, 0, nullptr, "lattice"},
    {"lattice-order", &R::lattice_order, "Light in free space (diffuse, matrix, indirect)", D | M | I,
     "Bands of the light that arrives there", 1, max_sh_order, nullptr, "lattice"},
};

// Pairs that contradict one another, beyond what the table says.
struct Conflict {
  const char *option, *other, *why;  // conditions as Option::needs
};
constexpr Conflict conflicts[] = {
    {"order", "light", "and --light both say how many bands there are: give one"},
    {"compress", "fix-view", "makes clusters of receivers on surfaces, and --fix-view has pixels: give one"},
    {"lattice", "fix-view", "would light what a fixed view leaves no room for: give one"},
    {"lattice", "fix-light", "is lit by any distant light, and --fix-light leaves one: give one"},
    {"lattice", "shadows=off", "is always baked with shadows"},
    {"lattice", "subsurface", "does not know media: --subsurface is for surfaces alone"},
    {"lattice", "light=directional|compact|steerable", "is lit by harmonics alone: leave --light out, or say sh:BANDS"},
    {"subsurface", "shadows=off", "is always baked with shadows"},
    {"subsurface", "light=directional|compact|steerable", "is of harmonics alone"},
    {"directional", "direct=separate", "leaves no direct light apart: --direct separate goes with --directional none"},
    {"directional", "order", "holds lamps alone: leave --order out"},
    {"terms", "compress", "are kept of plain transfer: leave --compress out"},
    {"terms", "fix-view", "are kept on surfaces: leave --fix-view out"},
    {"terms", "fix-light", "are kept for any light: leave --fix-light out"},
    {"terms", "simulate=paths", "are not known of simulated paths, which are followed whole"},
    {"terms", "shadows=off", "are direct light alone without shadows"},
    {"terms", "bounces=converge:", "are counted: give --bounces a number"},
    {"terms", "direct=separate", "have direct light apart already"},
    {"terms", "directional=sh|hl2|vector", "are not kept of directional lightmaps"},
    {"atlas", "texels-per-unit", "excludes --texels-per-unit"},
    {"error", "samples", "says how many rays: leave --samples out"},
    {"time", "samples", "ends what --error asks for: leave --samples out"},
    {"error", "gather=hemicube", "is not measured of hemicubes: leave --gather out"},
    {"error", "directional=sh|hl2|vector", "is not measured of directional lightmaps: leave --directional out"},
    {"error", "subsurface", "is not measured of media: leave --subsurface out"},
    {"error", "shadows=off", "is none without shadows"},
    {"time", "subsurface", "is not heeded by media: leave --subsurface out"},
    {"time", "shadows=off", "is next to none without shadows"},
    {"denoise", "subsurface", "does not go with media"},
    {"denoise", "shadows=off", "has no noise to take away without shadows"},
    {"quality", "subsurface", "is not measured of media: leave --subsurface out"},
    {"quality", "shadows=off", "is the same for all without shadows"},
    {"adapt", "shadows=off", "looks for shadows"},
    {"rooms", "bounces", "ends by --rooms-error and not by a number of bounces: leave --bounces out"},
    {"rooms", "light", "joins light of harmonics alone: leave --light out"},
    {"rooms", "shadows=off", "has nothing to join without shadows"},
    {"rooms", "subsurface", "does not know media: leave --subsurface out"},
    {"rooms", "terms", "has no terms of its own: leave --terms out"},
    {"rooms", "lattice", "does not light free space: leave --lattice out"},
    {"rooms", "fix-view", "has no picture of the whole: leave --fix-view out"},
    {"rooms", "error", "is not measured on places of its own: leave --error out, and say --samples"},
    {"rooms", "quality", "keeps the mesh, and is baked with --samples: leave --quality out"},
    {"rooms", "time", "is baked with --samples: leave --time out"},
    {"rooms", "adapt=on|auto", "keeps the mesh as it is: leave --adapt out"},
    {"rooms", "denoise=on", "is not denoised: leave --denoise out"},
    {"subsurface", "receivers=meshless", "does not know surfels: leave --receivers out"},
    {"shadows=off", "receivers=meshless", "off leaves nothing to gather at surfels: leave --receivers out"},
    {"adapt", "receivers=meshless", "splits what receives, and surfels know no mesh: leave --adapt out"},
    {"projection=least-squares", "receivers=meshless",
     "is of vertices, texels and patches: kernels are fitted to surfels"},
    {"error", "projection=least-squares", "is not baked to by least squares: leave --error out, and say --samples"},
    {"quality", "projection=least-squares", "is not baked to by least squares: leave it out, and say --samples"},
    {"time", "projection=least-squares", "ends what --error asks for, which least squares do not: leave it out"},
    {"adapt", "projection=least-squares", "is of light at points: leave --adapt out, or --projection"},
    {"denoise", "projection=least-squares", "takes receivers for points: leave --denoise out, or --projection"},
    {"rooms", "projection=least-squares", "joins light at points: leave --projection out"},
    {"subsurface", "projection=least-squares", "does not know least squares: leave --projection out"},
    {"shadows=off", "projection=least-squares", "off traces no rays that least squares would spread: leave one out"},
    {"light", "projection=least-squares", "would gather lobes at points: say --order in place of it"},
    {"directional", "projection=least-squares", "gathers directions at points: leave --projection out"},
    {"gather", "projection=least-squares", "looks from one point: leave --projection out"},
    {"projection=least-squares", "solver=gauss-seidel|southwell",
     "are solved for all rows at once: --solver jacobi or gmres"},
};

// Given options that conflict; a default conflicts with nothing.
Result<void> check_conflicts(const BakeRequest& r) {
  auto said = [&](const std::string& condition) {
    const std::string name = condition.substr(0, condition.find('='));
    return r.given.contains(json_name(name)) && holds(bake_options(), r, condition);
  };
  for (const Conflict& c : conflicts) {
    if (std::string(c.option) == "directional" && r.directional == "none") continue;
    const std::string option = c.option;
    if (said(option) && said(c.other)) return Error{"--" + option.substr(0, option.find('=')), c.why, true};
  }
  return {};
}

bool is_least_squares(const BakeRequest& r) { return r.projection == "least-squares"; }

// So many rays on the mesh as it is; of lightmaps, what is not baked to an error.
bool is_plain_lightmap(const BakeRequest& r) {
  return r.samples > 0 || r.order > 0 || r.directional != "none" || r.gather != "rays" || is_least_squares(r);
}
bool has_no_quality(const BakeRequest& r) {
  return r.transfer == "lightmap" ? is_plain_lightmap(r) : r.samples > 0 && r.adapt != "on";
}

Result<void> check_kind(const BakeRequest& r, BakeKind kind) {
  if (r.given.contains("bin_limit") && file_extension(r.output) != "gltf")
    return Error{"--bin-limit", "is of the files beside a .gltf: leave it out, or write one", true};
  if (kind != BakeKind::diffuse && kind != BakeKind::lightmap && kind != BakeKind::wavelets &&
      kind != BakeKind::indirect && r.receivers != "vertices")
    return Error{"--receivers", std::string(bake_kind_names[int(kind)]) + " are received at vertices", true};
  if (kind != BakeKind::diffuse && r.receivers == "meshless")
    return Error{"--receivers",
                 kind == BakeKind::indirect
                     ? "direct to indirect light is over surfels whatever reads it: vertices, texels or patches"
                     : "meshless is of diffuse transfer",
                 true};
  if (kind == BakeKind::diffuse && r.given.contains("surfels") && r.receivers != "meshless")
    return Error{"--surfels", "needs --receivers meshless, or --transfer indirect", true};
  if (kind == BakeKind::indirect && r.directional == "hl2")
    return Error{"--directional", "of direct to indirect light is sh:2, sh:3 or vector", true};
  if (!r.lattice.empty() && r.receivers != "vertices" && kind != BakeKind::indirect)
    return Error{"--receivers", "--lattice needs a bake at vertices", true};
  if (r.shadows == "off" && r.given.contains("bounces") && r.bounces != "0")
    return Error{"--shadows", "off has no bounces: leave --bounces out, or set it to 0", true};
  if (!r.rooms.empty() && r.receivers != "vertices")
    return Error{"--rooms", "joins receivers at vertices: leave --receivers out", true};
  if (kind == BakeKind::wavelets && (!r.given.contains("bounces") || r.bounces == "0"))
    for (const char* name : {"samples", "seed"})
      if (r.given.contains(name))
        return Error{std::string("--") + name, "is of the rays that bounce: give --bounces, or leave it out", true};
  if (kind != BakeKind::lightmap && r.bounces.starts_with("converge:"))
    return Error{"--bounces", "converge:EPS is for lightmaps", true};
  if (kind == BakeKind::lightmap && is_plain_lightmap(r))
    for (const char* name : {"quality", "error", "time", "denoise"})
      if (r.given.contains(name))
        return Error{
            std::string("--") + name,
            "is for lightmaps of lamps that are baked to an error: leave --samples, --order, --directional and "
            "--gather out",
            true};
  if (r.given.contains("quality") && has_no_quality(r))
    return Error{"--quality", "with --samples says how fine --adapt on may make the mesh: add that, or leave one out",
                 true};
  if (kind == BakeKind::blocks && (r.cube & (r.cube - 1)) != 0)
    return Error{"--cube", "must be 16, 32, 64, 128 or 256, not " + std::to_string(r.cube), true};
  return {};
}

}  // namespace

std::span<const Option<BakeRequest>> bake_options() { return table; }

BakeKind kind_of(const BakeRequest& r) {
  if (r.transfer == "matrix") return r.factors ? BakeKind::factors : BakeKind::matrix;
  if (r.transfer == "zonal")
    return r.given.contains("brdf") || r.given.contains("outgoing") ? BakeKind::glossy_zonal : BakeKind::zonal;
  if (r.transfer == "lightmap") return BakeKind::lightmap;
  if (r.transfer == "blocks") return BakeKind::blocks;
  if (r.transfer == "indirect") return BakeKind::indirect;
  if (r.light.starts_with("haar:")) return BakeKind::wavelets;
  return r.membrane.empty() ? BakeKind::diffuse : BakeKind::membrane;
}

std::string to_text(const BakeRequest& request) {
  return to_json(request).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}
Result<BakeRequest> bake_request(const std::string& json) {
  const nlohmann::json object = nlohmann::json::parse(json, nullptr, false);
  if (object.is_discarded()) return Error{"", "the request is not JSON", true};
  return bake_request_from_json(object);
}

Result<BakeRequest> resolved(BakeRequest r) {
  const BakeRequest untouched;
  for (const Option<BakeRequest>& o : bake_options())
    std::visit(
        [&](auto member) {
          if (r.*member != untouched.*member) r.given.insert(json_name(o.name));
        },
        o.member);
  if (auto ok = check_values(bake_options(), r, r.given); !ok) return ok.error();
  const BakeKind kind = kind_of(r);
  if (r.receivers.empty()) r.receivers = kind == BakeKind::lightmap ? "texels" : "vertices";
  if (kind == BakeKind::lightmap && r.given.contains("light"))
    return Error{"--light",
                 "does not go with lightmaps, which hold the scene's own lamps: --receivers texels, without --transfer "
                 "lightmap, keeps such light over an atlas",
                 true};
  if (auto ok = check_given(bake_options(), r, r.given, int(kind), bake_kind_names); !ok) return ok.error();
  if (auto ok = check_conflicts(r); !ok) return ok.error();
  if (auto ok = check_kind(r, kind); !ok) return ok.error();
  if (kind == BakeKind::wavelets && !r.given.contains("visibility")) r.visibility = "bits:4";
  if (kind == BakeKind::factors || r.shadows == "off") r.bounces = "0";
  if (kind == BakeKind::wavelets && !r.given.contains("bounces")) r.bounces = "0";
  if (r.order == 0 && r.light.empty() && kind != BakeKind::lightmap && kind != BakeKind::blocks &&
      kind != BakeKind::indirect)
    r.order = 6;
  const bool to_error = kind == BakeKind::lightmap ? !is_plain_lightmap(r)
                                                   : kind == BakeKind::diffuse && r.subsurface.empty() &&
                                                         r.shadows == "on" && r.rooms.empty() && !is_least_squares(r);
  if (!to_error && r.samples == 0) r.samples = 1024;
  if (r.receivers == "texels" && r.atlas.empty() && !(r.texels_per_unit > 0) &&
      !(kind == BakeKind::lightmap && r.samples == 0))
    r.atlas = "1024x1024";
  if (r.shadows == "on") r.given.erase("shadows");
  return r;
}

nlohmann::json to_json(const BakeRequest& request) {
  const BakeKind kind = kind_of(request);
  nlohmann::json out = request_json(bake_options(), request, int(kind));
  if (request.shadows == "off") out.erase("bounces");
  if (kind == BakeKind::wavelets && request.bounces == "0")
    for (const char* without : {"bounces", "samples", "seed"}) out.erase(without);
  if (has_no_quality(request)) out.erase("quality");
  if (is_least_squares(request))
    for (const char* without : {"denoise", "adapt", "quality", "error", "time"}) out.erase(without);
  if (request.receivers != "meshless" && kind == BakeKind::diffuse) out.erase("surfels");
  if (!request.rooms.empty())
    for (const char* without : {"bounces", "denoise", "adapt", "quality", "error", "time"}) out.erase(without);
  if (kind == BakeKind::lightmap && is_plain_lightmap(request))
    for (const char* name : {"error", "time", "denoise"}) out.erase(name);
  return out;
}

Result<BakeRequest> bake_request_from_json(const nlohmann::json& object) {
  BakeRequest request;
  if (auto ok = read_request(bake_options(), object, request, request.given); !ok) return ok.error();
  return request;
}

Result<BakeRequest> load_bake_request(const std::string& path) {
  BakeRequest request;
  if (auto ok = load_request(bake_options(), path, request, request.given); !ok) return ok.error();
  return request;
}

namespace {

// A file named in a provenance: where we are, or beside the baked file.
std::string found(const std::string& value, const std::filesystem::path& folder) {
  const size_t prefix = value.find_last_of("@:");
  const std::string start = prefix == std::string::npos ? "" : value.substr(0, prefix + 1),
                    name = value.substr(start.size());
  std::error_code status;
  if (name.empty() || std::filesystem::exists(name, status) || !std::filesystem::exists(folder / name, status))
    return value;
  return start + (folder / name).string();
}

}  // namespace

Result<BakeRequest> request_of_baked_file(const std::string& path, const std::string& scene) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  auto fields = read_fields(*file, path);
  if (!fields) return fields.error();
  const auto provenance = nlohmann::json::parse(fields->provenance, nullptr, false);
  const auto object = provenance.is_object() ? provenance.find("request") : provenance.end();
  if (!provenance.is_object() || object == provenance.end())
    return Error{path, "does not say by which request it was baked: it is of an older version or was made otherwise"};
  auto request = bake_request_from_json(*object);
  if (!request) return Error{path, "its request: \"" + request.error().where + "\" " + request.error().message};
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  for (const Option<BakeRequest>& o : bake_options())
    if (const auto* member = std::get_if<std::string BakeRequest::*>(&o.member); member && o.is_path)
      (*request).*(*member) = found((*request).*(*member), folder);
  if (!scene.empty()) request->scene = scene;
  auto input = read_file(request->scene);
  if (!input) return input.error();
  const auto hash = provenance.contains("input") && provenance["input"].is_object()
                      ? provenance["input"].value("xxh3_128", nlohmann::json())
                      : nlohmann::json();
  if (hash.is_string() && hash != content_hash(*input))
    return Error{request->scene, "is not the scene that " + path + " was baked of"};
  return request;
}

}  // namespace lambent
