#include <lambent/pipeline/field_request.h>

#include <lambent/bake/shells.h>
#include <lambent/pipeline/movers.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

namespace lambent {
namespace {

using R = FieldRequest;
constexpr KindMask raw = 1, baked = 2;

const Option<R> table[] = {
    {"object", &R::object, "Files", raw | baked, "The object: .gltf, .glb, .obj or .ply; or a baked file of it", 0, 0,
     nullptr, nullptr, true, true},
    {"output", &R::output, "Files", raw | baked, "Field to write (.glb): the object's bake and what it does around it",
     0, 0, nullptr, nullptr, false},
    {"order", &R::order, "Field", raw | baked,
     "Bands of what the object hides; of an object that is not baked yet, of its own transfer too", 1, 8},
    {"shells", &R::shells, "Field", raw | baked, "Spheres about the object on which its effect is known", 2,
     max_shells},
    {"side", &R::side, "Field", raw | baked, "Points of a shell: this number squared", 2, max_shell_side},
    {"inner", &R::inner, "Field", raw | baked, "Radius of the first shell, in radii of the object", 0.01, 0.95},
    {"outer", &R::outer, "Field", raw | baked,
     "Radius of the last shell, in radii of the object; beyond, what is hidden shrinks by the square of the distance",
     1.1, 1000},
    {"samples", &R::samples, "Rays", raw | baked, "Rays a point", 1, 1 << 20},
    {"seed", &R::seed, "Rays", raw | baked, "Of the ray directions"},
    {"bounces", &R::bounces, "Rays", raw, "Reflections within the object, as `lambent bake` takes them"},
    {"radiance", &R::radiance, "Field", raw | baked,
     "Also how its emissive materials shine: a lamp that moves, and lights the scene and other objects"},
    {"transfer", &R::transfer, "Field", raw | baked,
     "Also how it reflects what arrives at it: light on the scene and other objects, in its colours"},
};

Result<Baked> bake_object(const R& request, const Job& job) {
  if (is_baked(request.object)) {
    auto object = load_baked(request.object);
    if (!object) return object;
    if (auto ok = check_mover(*object, request.object); !ok) return ok.error();
    if (request.transfer && (!std::holds_alternative<Transfer>(object->surface.store) || outgoing_of(object->surface)))
      return Error{"--transfer", "is how diffuse objects reflect, and this one is glossy, or of lobes", true};
    std::erase_if(object->more, [](const Field& f) { return std::holds_alternative<ShellPlacement>(f.where); });
    return object;
  }
  BakeRequest bake_it;
  bake_it.scene = request.object, bake_it.order = request.order, bake_it.bounces = request.bounces;
  bake_it.samples = request.samples, bake_it.seed = request.seed;
  bake_it.given = {"scene", "order", "bounces", "samples", "seed"};
  return bake(bake_it, job);
}

}  // namespace

std::span<const Option<FieldRequest>> field_options() { return table; }

Result<Summary> field_to_file(const FieldRequest& request, const Job& job) {
  if (auto ok = check_output(request.output, {"glb"}); !ok) return ok.error();
  if (auto ok = check_values(field_options(), request, request.given); !ok) return ok.error();
  if (auto ok =
          check_given(field_options(), request, request.given, is_baked(request.object) ? 1 : 0, field_kind_names);
      !ok)
    return ok.error();
  auto object = bake_object(request, job);
  if (!object) return object.error();
  const ShellOptions options{request.order, request.shells,  request.side, request.inner,
                             request.outer, request.samples, request.seed};
  auto shells = make_shells(object->scene, options);
  if (!shells) return shells.error();
  auto tracer = Tracer::build(object->scene, job.progress);
  if (!tracer) return tracer.error();
  ShellReport report;
  auto hidden = bake_hidden(*tracer, *shells, options, &report, job.progress);
  if (!hidden) return hidden.error();
  object->more.push_back(std::move(*hidden));
  if (request.radiance) {
    auto shining = bake_shining(object->scene, *tracer, *shells, options, job.progress);
    if (!shining) return shining.error();
    object->more.push_back(std::move(*shining));
  }
  if (request.transfer) {
    auto reflecting = bake_reflecting(object->scene, *tracer, std::get<CornerReceivers>(object->basis),
                                      std::get<Transfer>(object->surface.store), *shells, options, job.progress);
    if (!reflecting) return reflecting.error();
    report.bytes += bytes_of(reflecting->store);
    object->more.push_back(std::move(*reflecting));
  }
  auto provenance = nlohmann::json::parse(object->provenance, nullptr, false);
  if (provenance.is_object()) {
    provenance["field"] = request_json(field_options(), request, is_baked(request.object) ? 1 : 0);
    object->provenance = provenance.dump();
  }
  if (auto ok = save_baked(request.output, *object); !ok) return ok.error();
  Summary summary;
  summary.json = {{"output", request.output},     {"points", report.points},
                  {"order", request.order},       {"radius", shells->radius},
                  {"rays", report.rays},          {"bytes", report.bytes},
                  {"seconds", report.seconds},    {"receivers", receivers_of(object->surface.store)},
                  {"radiance", request.radiance}, {"transfer", request.transfer},
                  {"radii", shells->radii}};
  summary.lines.emplace_back("field",
                             fmt::format("{} shells of {} points, order {}, {}; {} rays in {}", request.shells,
                                         request.side * request.side, request.order, human_bytes(double(report.bytes)),
                                         human_count(report.rays), human_seconds(report.seconds)));
  summary.lines.emplace_back("object", fmt::format("{} receivers, radius {:.3g}",
                                                   human_count(receivers_of(object->surface.store)), shells->radius));
  return summary;
}

}  // namespace lambent
