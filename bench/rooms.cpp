// Rooms that are joined, sweep by sweep, against the same scene baked whole with the same rays: residuals, and what is
// left of the difference after so many sweeps. The whole, by two seeds, says what the rays alone are off. A made
// building of twelve rooms and a hall; LAMBENT_ROOMS_SCENE: a file instead. LAMBENT_ROOMS_RAYS (256) a receiver.
// LAMBENT_ROOMS_LOSS (0.01): what light fields may lose, "inf": they are everywhere, 0: nowhere. LAMBENT_ROOMS_CELLS
// (32 16): of a field's place and direction.
#include "bench.h"

#include <lambent/bake/rooms.h>
#include <lambent/scene/load.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

namespace lambent::bench {
namespace {

double difference_of(const Transfer& a, const Transfer& b) {
  double squares = 0, all = 0;
  for (size_t r = 0; r < a.receivers; ++r) {
    const std::vector<float> x = load_receiver(a, r), y = load_receiver(b, r);
    for (size_t k = 0; k < x.size(); ++k)
      squares += std::pow(double(x[k]) - double(y[k]), 2), all += double(y[k]) * double(y[k]);
  }
  return std::sqrt(squares / all);
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
  for (const Transfer& t : told.sweeps) differences.push_back(difference_of(t, *whole));
  report("rooms_joined", differences.back(), difference_of(*again, *whole), "relative RMS over receivers",
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
          {"residuals", told.residuals},
          {"differences", differences}});
}

}  // namespace lambent::bench
