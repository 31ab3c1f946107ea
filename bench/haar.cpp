// Diffuse transfer in Haar wavelets by columns: error by terms of the light beside as many harmonics, and the rate at
// which columns are read.
#include "bench.h"

#include <lambent/basis/sh.h>
#include <lambent/bake/visibility.h>
#include <lambent/compress/haar_fit.h>
#include <lambent/core/parallel.h>
#include <lambent/light/sky.h>
#include <lambent/receivers/receivers.h>
#include <lambent/relight/relight_haar.h>
#include <lambent/scene/procedural.h>

#include <cmath>
#include <ctime>
#include <numeric>

namespace lambent::bench {
namespace {

constexpr int haar_size = 32;

double relative_rms(const std::vector<Vec3>& ours, const std::vector<Vec3>& truth) {
  double error = 0, all = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const Vec3 d = ours[i] - truth[i];
    error += double(dot(d, d)), all += double(dot(truth[i], truth[i]));
  }
  return std::sqrt(error / all);
}

// What the receivers see times the cosine, over texels and in harmonics.
struct SeenCosines {
  Cube cube = make_cube(haar_size);
  std::vector<std::vector<float>> texels;     // [receiver][texel]
  std::vector<std::vector<float>> harmonics;  // [receiver][16^2]
  std::vector<float> table;                   // [texel][16^2]
  SeenCosines(const Visibility& v, std::span<const Vec3> normals) {
    table.resize(cube.count() * 256);
    for (size_t t = 0; t < cube.count(); ++t)
      evaluate_sh(16, normalize(cube.texels.at(t)), std::span(table).subspan(t * 256, 256));
    texels.resize(v.receivers), harmonics.resize(v.receivers);
    parallel_for(v.receivers, 16, [&](size_t begin, size_t end) {
      std::vector<uint8_t> levels(cube.count());
      for (size_t r = begin; r < end; ++r) {
        decode_visibility(v, r, levels);
        texels[r].assign(cube.count(), 0.0f), harmonics[r].assign(256, 0.0f);
        for (int face = 0; face < 6; ++face)
          for (int row = 0; row < haar_size; ++row)
            for (int column = 0; column < haar_size; ++column) {
              const size_t t = cube_texel(haar_size, face, column, row);
              if (!levels[t]) continue;
              const float value = std::max(0.0f, dot(normals[r], cube.texels.at(t))) / pi;
              const float share = value * float(cube_solid_angle(haar_size, column, row));
              texels[r][t] = value;
              for (size_t k = 0; k < 256; ++k) harmonics[r][k] += share * table[t * 256 + k];
            }
      }
    });
  }
};

void report_errors(const std::string& name, const SeenCosines& seen, const HaarTransfer& t,
                   std::span<const float> norms, const CubeLight& light) {
  std::vector<Vec3> truth, sh(256, Vec3(0.0f));
  for (const auto& row : seen.texels) {
    Vec3 sum(0.0f);
    for (size_t k = 0; k < row.size(); ++k) sum += row[k] * light.energy[k];
    truth.push_back(sum);
  }
  for (size_t k = 0; k < seen.cube.count(); ++k)
    for (size_t j = 0; j < 256; ++j) sh[j] += seen.table[k * 256 + j] * light.energy[k];
  for (const int order : {4, 6, 8, 10, 14, 16}) {
    const size_t terms = size_t(sh_count(order));
    std::vector<Vec3> by_sh, by_haar;
    for (const auto& row : seen.harmonics) {
      Vec3 sum(0.0f);
      for (size_t k = 0; k < terms; ++k) sum += row[k] * sh[k];
      by_sh.push_back(sum);
    }
    Relit relit;
    relight(t, haar_terms(t, norms, light, terms), relit);
    for (size_t r = 0; r < truth.size(); ++r) by_haar.push_back(relit.at(r));
    report("haar, " + name + ", " + std::to_string(terms) + " terms", 100 * relative_rms(by_haar, truth),
           100 * relative_rms(by_sh, truth), "% RMS", "harmonics of as many terms");
  }
}

// Least processor time: the machine may be shared.
template <class F>
double least_processor_seconds(int runs, F&& f) {
  double least = 1e300;
  for (int i = 0; i < runs; ++i) {
    const std::clock_t start = std::clock();
    f();
    least = std::min(least, double(std::clock() - start) / CLOCKS_PER_SEC);
  }
  return least;
}

// Bytes of the woken columns a second, beside the sum of as many bytes; one thread.
void report_rate(const std::vector<std::vector<HaarEntry>>& rows, const CubeLight& light) {
  std::vector<std::vector<HaarEntry>> many;
  while (many.size() < 100000) many.push_back(rows[many.size() % rows.size()]);
  const HaarTransfer t = make_haar_transfer(haar_size, many);
  const HaarTerms terms = haar_terms(t, haar_column_norms(t), light, 200);
  Relit relit;
  HaarReading reading;
  relight(t, terms, relit, &reading);
  const ThreadLimit one(1);
  const double seconds = least_processor_seconds(9, [&] { relight(t, terms, relit); });
  std::vector<uint64_t> stream(size_t{32} << 20, 1);
  uint64_t sum = 0;
  const double read =
      least_processor_seconds(5, [&] { sum += std::accumulate(stream.begin(), stream.end(), uint64_t{0}); });
  report("haar, read", double(reading.bytes) / seconds / 1e9, 0.5 * double(stream.size() * 8) / read / 1e9, "GB/s",
         "half of the rate at which memory is read",
         {{"bytes", reading.bytes}, {"all_bytes", t.bytes()}, {"seconds", seconds}, {"kept", sum != 0}});
}

}  // namespace

void bench_haar() {
  Scene scene;
  add_quad(scene, add_material(scene, "floor", Vec3(0.5f)), "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 40,
           40);
  const uint32_t things = add_material(scene, "things", Vec3(0.5f));
  add_sphere(scene, things, "ball", Vec3(0.3f, 0.6f, 0.2f), 0.5f, 3);
  add_box(scene, things, "box", Vec3(-1.2f, 0, -0.6f), Vec3(-0.6f, 1.2f, 0.2f), 6);
  auto tracer = Tracer::build(scene);
  if (!tracer) return;
  const Receivers receivers = make_vertex_receivers(scene);
  auto visibility = bake_visibility(*tracer, receivers, {.size = haar_size, .bits = 4});
  if (!visibility) return;
  HaarFitReport fit;
  auto t = fit_haar(*visibility, receivers.normals, {.error = 0.02}, &fit);
  if (!t) return;
  report("haar, bytes a receiver", double(t->bytes()) / double(t->receivers), 2.0 * 256, "bytes",
         "harmonics of order 16 in half floats", {{"wavelets", fit.entries}, {"error", fit.error}});
  const std::vector<float> norms = haar_column_norms(*t);
  const SeenCosines seen(*visibility, receivers.normals);
  const auto sun = make_sky(*parse_sky("elevation=30,azimuth=50,turbidity=2"));
  if (!sun) return;
  report_errors("a sun", seen, *t, norms, cube_light(*sun, haar_size));
  for (const char* name : {"chinese_garden_512", "studio_small_03_512", "dikhololo_night_512"})
    if (auto env = data_environment(name)) report_errors(name, seen, *t, norms, cube_light(*env, haar_size));
  std::vector<std::vector<HaarEntry>> rows(visibility->receivers);
  for (size_t r = 0; r < rows.size(); ++r) {
    const std::vector<float> row = load_receiver(*t, r);
    for (uint32_t c = 0; c < row.size(); ++c)
      if (row[c] != 0) rows[r].push_back({c, row[c]});
  }
  report_rate(rows, cube_light(*sun, haar_size));
}

}  // namespace lambent::bench
