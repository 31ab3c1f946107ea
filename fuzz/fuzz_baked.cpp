// The baked-file reader on hostile bytes: whatever it accepts must be safe to project light onto and to relight.
#include <lambent/baked/baked_file.h>
#include <lambent/relight/factors.h>
#include <lambent/relight/lattice.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relight.h>
#include <lambent/relight/zonal.h>
#include <lambent/render/render.h>

#include <sys/mman.h>
#include <unistd.h>

#include <string>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // The reader maps files: hand it one in memory.
  static const int memory = ::memfd_create("baked", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(memory);
  if (::ftruncate(memory, 0) != 0 || ::pwrite(memory, data, size, 0) != ssize_t(size)) return 0;
  auto file = lambent::MappedFile::open(path);
  if (!file) return 0;
  auto baked = lambent::load_baked(*file, "fuzz.glb");
  if (!baked) return 0;
  if (baked->visibility) {
    const lambent::Visibility& v = *baked->visibility;
    std::vector<uint8_t> levels(lambent::cube_texels(v.size));
    for (size_t r = 0; r < std::min<size_t>(v.receivers, 64); ++r) lambent::decode_visibility(v, r, levels);
    return 0;
  }
  std::vector<lambent::Vec3> light(lambent::light_of(*baked).count(), lambent::Vec3(0.5f));
  if (light.size() <= 24) {  // the dual functions of many take long
    const auto env =
        lambent::make_environment("fuzz", 64, 32, [](lambent::Vec3 d) { return lambent::Vec3(1, 1 + d.x, 1 + d.y); });
    light = lambent::project_light(env, lambent::light_of(*baked)).light;
  }
  lambent::Relit relit;
  if (baked->zonal) {
    const std::vector<lambent::Vec3> harmonics(size_t(lambent::sh_count(baked->zonal->order)), lambent::Vec3(0.5f));
    lambent::ZonalLight table;
    lambent::specialise_light(*baked->zonal, harmonics, table);
    lambent::relight_zonal(*baked->zonal, nullptr, table, relit);
  } else if (baked->factors) {
    lambent::relight_factors(baked->transfer, *baked->outgoing, light, relit);
  } else if (baked->cpca) {
    lambent::relight(*baked->cpca, light, relit);
  } else {
    lambent::relight(baked->transfer, light, relit);
  }
  float sum = 0;
  if (const auto& v = baked->view)
    sum += lambent::pixels_image(relit, v->coverage, v->camera, v->width, v->height, nullptr).rgb[0].x;
  for (const auto* map : {&baked->front, &baked->back})
    for (uint32_t r : *map)
      if (r != lambent::none) {
        sum += relit.at(r).x;
        if (!baked->outgoing) continue;
        std::vector<lambent::ViewWeights> weights(size_t(relit.rows));
        lambent::evaluate_outgoing(*baked->outgoing, r, lambent::Vec3(0.6f, 0, 0.8f), weights);
        sum += lambent::reflect_rows(weights, lambent::Vec3(1), [&](size_t row) { return relit.at(r, int(row)); }).x;
      }
  std::visit(
      [&](const auto& basis) {
        for (uint32_t t = 0; t < baked->scene.triangles.size(); ++t)
          for (bool front : {true, false})
            if (const auto* at = basis.find(t, front))
              basis.spread(*at, 0.3f, 0.6f, [&](uint32_t receiver, float weight) {
                for (int row = 0; row < relit.rows; ++row) sum += weight * relit.at(receiver, row).x;
              });
      },
      baked->basis);
  if (baked->lattice) {
    const lambent::Lattice& l = baked->lattice->lattice;
    lambent::relight(baked->lattice->transfer, light, relit);
    std::vector<lambent::Vec3> incident(size_t(relit.rows));
    for (float t : {-0.5f, 0.0f, 0.3f, 1.0f, 1.5f}) {
      lambent::interpolate_lattice(l, relit, l.min + t * (l.max - l.min), incident);
      sum += incident[0].x;
    }
  }
  volatile float used = sum;
  (void)used;
  return 0;
}
