// The baked-file reader on hostile bytes: whatever it accepts must be safe to project light onto, to relight and to
// shade.
#include <lambent/baked/baked_file.h>
#include <lambent/relight/lattice.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relighter.h>
#include <lambent/render/render.h>

#include <sys/mman.h>
#include <unistd.h>

#include <string>

namespace lambent {
namespace {

std::vector<Vec3> light_for(const LightBasis& basis) {
  if (basis.count() > 24) return std::vector<Vec3>(basis.count(), Vec3(0.5f));  // the dual functions of many take long
  return project_light(make_environment("fuzz", 64, 32, [](Vec3 d) { return Vec3(1, 1 + d.x, 1 + d.y); }), basis).light;
}

// Grey surfaces, for visibility in blocks.
ProductReceivers some_receivers(const Visibility& v) {
  ProductReceivers out;
  out.positions.assign(v.receivers, Vec3(0.0f)), out.frames.assign(v.receivers, frame_about(Vec3(0, 1, 0)));
  out.materials = {make_product_material(Lambert{Vec3(0.5f)}, make_cube(v.size), {})};
  out.material_of.assign(v.receivers, 0);
  return out;
}

// T . light at every receiver, or none where the field is refused.
Relit relit(const Field& field) {
  RelighterOptions options;
  const auto* visibility = std::get_if<Visibility>(&field.store);
  if (visibility) {
    if (visibility->receivers > 64 || visibility->size > 32) return {};  // these take long
    options.receivers = some_receivers(*visibility);
  }
  auto relighter = Relighter::make(field, std::move(options));
  if (!relighter) return {};
  const auto* indirect = std::get_if<IndirectTransfer>(&field.store);
  const int cube = cube_of(field.store);
  if (cube > 64) return {};
  const bool lit = bool(indirect ? relighter->set_light(std::vector<Vec3>(indirect->surfels.count(), Vec3(1)))
                        : cube   ? relighter->set_light(cube_light(
                                       make_environment("fuzz", 16, 8, [](Vec3 d) { return Vec3(1 + d.y); }), cube))
                                 : relighter->set_light(light_for(relighter->light())));
  Relit out;
  if (!lit || !relighter->relight({.eye = Vec3(0, 1, 0)}, out)) return {};
  return out;
}

float shade_receiver(const Field& field, const Relit& relit, uint32_t r) {
  const Outgoing* outgoing = outgoing_of(field);
  if (!outgoing) return relit.at(r).x;
  std::vector<ViewWeights> weights(size_t(relit.rows));
  evaluate_outgoing(*outgoing, r, Vec3(0.6f, 0, 0.8f), weights);
  return reflect_rows(weights, Vec3(1), [&](size_t row) { return relit.at(r, int(row)); }).x;
}

float shade_scene(const Baked& baked, const Relit& relit) {
  float sum = 0;
  std::visit(
      [&](const auto& basis) {
        for (uint32_t t = 0; t < baked.scene.triangles.size(); ++t)
          for (bool front : {true, false})
            if (const auto* at = basis.find(t, front))
              basis.spread(*at, 0.3f, 0.6f, [&](uint32_t receiver, float weight) {
                for (int row = 0; row < relit.rows; ++row) sum += weight * relit.at(receiver, row).x;
              });
      },
      baked.basis);
  return sum;
}

float use(const Baked& baked) {
  float sum = 0;
  if (const auto* v = std::get_if<Visibility>(&baked.surface.store)) {
    std::vector<uint8_t> levels(cube_texels(v->size));
    for (size_t r = 0; r < std::min<size_t>(v->receivers, 64); ++r)
      decode_visibility(*v, r, levels), sum += float(levels[0]);
  }
  if (const Relit lit = relit(baked.surface); !lit.values.empty()) {
    if (const auto* v = std::get_if<FixedView>(&baked.surface.where))
      sum += pixels_image(lit, v->coverage, v->camera, v->width, v->height, nullptr).rgb[0].x;
    if (const VertexPlacement* at = vertices_of(baked))
      for (const auto* side : {&at->front, &at->back})
        for (uint32_t r : *side)
          if (r != no_receiver) sum += shade_receiver(baked.surface, lit, r);
    sum += shade_scene(baked, lit);
  }
  for (const Transfer& term : baked.terms)
    if (const Relit lit = relit({baked.surface.where, term, baked.surface.rows}); !lit.values.empty())
      sum += lit.at(0).x;
  for (const Field& field : baked.more) {
    const Relit lit = relit(field);
    const auto* at = std::get_if<LatticePlacement>(&field.where);
    if (lit.values.empty() || !at) continue;
    std::vector<Vec3> incident(size_t(lit.rows));
    for (float t : {-0.5f, 0.0f, 0.3f, 1.0f, 1.5f}) {
      interpolate_lattice(at->lattice, lit, at->lattice.min + t * (at->lattice.max - at->lattice.min), incident);
      sum += incident[0].x;
    }
  }
  return sum;
}

}  // namespace
}  // namespace lambent

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // The reader maps files: hand it one in memory.
  static const int memory = ::memfd_create("baked", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(memory);
  if (::ftruncate(memory, 0) != 0 || ::pwrite(memory, data, size, 0) != ssize_t(size)) return 0;
  auto file = lambent::MappedFile::open(path);
  if (!file) return 0;
  auto baked = lambent::load_baked(*file, "fuzz.glb");
  if (!baked) return 0;
  volatile float used = lambent::use(*baked);
  (void)used;
  return 0;
}
