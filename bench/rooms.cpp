// Rooms that are joined, sweep by sweep, against the same scene baked whole with the same rays: residuals, and what is
// left of the difference after so many sweeps. The whole, by two seeds, says what the rays alone are off; with its
// triangles in another order, where its surfaces coincide. A made building of twelve rooms and a hall;
// LAMBENT_ROOMS_SCENE: a file instead. LAMBENT_ROOMS_RAYS (256) a receiver. LAMBENT_ROOMS_LOSS (0.01): what fields
// may lose, "inf": they are everywhere, 0: nowhere. LAMBENT_ROOMS_CELLS (32 16): of a field's place and direction.
#include "bench.h"

#include <lambent/bake/rooms.h>
#include <lambent/scene/load.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <sstream>

namespace lambent::bench {
namespace {

double square_of(const std::vector<float>& x, const std::vector<float>& y) {
  double sum = 0;
  for (size_t k = 0; k < x.size(); ++k) sum += std::pow(double(x[k]) - double(y[k]), 2);
  return sum;
}

// Relative RMS over the receivers that are sure.
double difference_of(const Transfer& a, const Transfer& b, const std::vector<uint8_t>& sure) {
  double squares = 0, all = 0;
  for (size_t r = 0; r < a.receivers; ++r) {
    const std::vector<float> x = load_receiver(a, r), y = load_receiver(b, r);
    if (sure[r]) squares += square_of(x, y);
    all += square_of(y, std::vector<float>(y.size(), 0.0f));
  }
  return std::sqrt(squares / all);
}

// Receivers that have the same, to a tenth of the mean, where the triangles are in another order: not so between
// surfaces that coincide, of which a ray meets one or the other.
std::vector<uint8_t> sure_receivers(const Scene& scene, const Receivers& receivers, const BakeOptions& options,
                                    const Transfer& whole, double& difference) {
  std::vector<uint8_t> sure(receivers.count(), 1);
  Scene other = scene;
  for (const Part& part : other.parts) {
    const auto first = other.triangles.begin() + ptrdiff_t(part.first_triangle);
    std::reverse(first, first + ptrdiff_t(part.triangle_count));
  }
  auto tracer = Tracer::build(other);
  const Receivers theirs = make_vertex_receivers(other);
  auto again = tracer ? bake(other, *tracer, theirs, options) : tracer.error();
  if (!again || theirs.count() != receivers.count()) return sure;
  difference = difference_of(*again, whole, sure);
  double all = 0;
  for (size_t r = 0; r < sure.size(); ++r) {
    const std::vector<float> x = load_receiver(whole, r);
    all += square_of(x, std::vector<float>(x.size(), 0.0f)) / double(sure.size());
  }
  for (size_t r = 0; r < sure.size(); ++r)
    sure[r] = square_of(load_receiver(*again, r), load_receiver(whole, r)) < 0.01 * all;
  return sure;
}

}  // namespace

void bench_rooms() {
  const char *file = std::getenv("LAMBENT_ROOMS_SCENE"), *rays = std::getenv("LAMBENT_ROOMS_RAYS");
  auto loaded = file ? load_scene(file) : Result<Scene>(make_building(6, 0.8f));
  if (!loaded) return fmt::print(stderr, "skipped: {}\n", loaded.error().text());
  Scene& scene = *loaded;
  for (Material& m : scene.materials) m.base_color = min(m.base_color, Vec3(0.8f));
  auto tracer = Tracer::build(scene);
  if (!tracer) return fmt::print(stderr, "skipped: {}\n", tracer.error().text());
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options{
      .order = 3, .samples = rays ? std::atoi(rays) : 256, .bounces = 40, .precision = Precision::single};
  options.denoise = options.certify = false;
  BakeOptions other = options;
  other.seed = 7;
  auto whole = bake(scene, *tracer, receivers, options), again = bake(scene, *tracer, receivers, other);
  if (!whole || !again) return fmt::print(stderr, "skipped: {}\n", (whole ? again : whole).error().text());
  const std::vector<Room> rooms = find_rooms(scene, 64);
  RoomsOptions how{.residual = 1e-3};
  if (const char* loss = std::getenv("LAMBENT_ROOMS_LOSS")) how.loss = std::strtod(loss, nullptr);
  if (const char* cells = std::getenv("LAMBENT_ROOMS_CELLS")) std::istringstream(cells) >> how.places >> how.directions;
  RoomsReport told;
  how.keep_sweeps = true;
  auto joined = bake_rooms(scene, receivers, rooms, options, how, nullptr, &told);
  if (!joined) return fmt::print(stderr, "skipped: {}\n", joined.error().text());
  std::vector<double> differences;
  const std::vector<uint8_t> every(receivers.count(), 1);
  for (const Transfer& t : told.sweeps) differences.push_back(difference_of(t, *whole, every));
  double reordered = 0;
  const std::vector<uint8_t> sure = sure_receivers(scene, receivers, options, *whole, reordered);
  report("rooms_joined", differences.back(), difference_of(*again, *whole, every), "relative RMS over receivers",
         "two seeds of the whole",
         {{"receivers", receivers.count()},
          {"largest", told.largest},
          {"rooms", told.rooms},
          {"openings", told.openings},
          {"nodes", told.nodes},
          {"lost", told.lost},
          {"handed", told.handed},
          {"handed_rays", told.handed_rays},
          {"loss", told.loss},
          {"loss_of_all", told.loss_of_all},
          {"reordered", reordered},
          {"sure", std::accumulate(sure.begin(), sure.end(), size_t{0})},
          {"difference_of_sure", difference_of(told.sweeps.back(), *whole, sure)},
          {"limit_of_sure", difference_of(*again, *whole, sure)},
          {"residuals", told.residuals},
          {"differences", differences}});
}

}  // namespace lambent::bench
