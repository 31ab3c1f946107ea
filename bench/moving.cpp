// Objects that move over a baked scene: nanoseconds a receiver and object beyond the relight, all receivers near them,
// for what they hide and for what they reflect.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/shells.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/reflecting.h>
#include <lambent/scene/procedural.h>

namespace lambent::bench {
namespace {

// A ball whose light is that of a lamp, made anew each frame.
void bench_reflections(const MovingReceivers& receivers, const Scene& ball, const Tracer& tracer, const Shells& shells,
                       const ShellOptions& options) {
  const Receivers at = make_vertex_receivers(ball);
  auto own = bake(ball, tracer, at, {.order = 3, .samples = 64, .bounces = 0});
  if (!own) return;
  auto field = bake_reflecting(ball, tracer, std::get<CornerReceivers>(at.basis), *own, shells, options);
  if (!field) return;
  const ReflectingLight reflecting = reflecting_light(*field);
  const std::vector<Vec3> arriving(size_t(sh_count(reflecting.incident_order)), Vec3(0.1f));
  const RigidPlace place{Vec3(0, 0.1f, 0), rotation_from_yaw_pitch_roll({10, 0, 0}), 1};
  ShiningLight light;
  PlacedLamp lamp;
  const double made = least_thread_seconds(5, [&] {
    light = reflected_light(reflecting, arriving, place.rotation);
    lamp = place_lamp(light, place);
  });
  LampShader shader;
  Relit relit;
  relit.values.assign((receivers.count + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  const SeenLamp seen[] = {{&lamp, nullptr}};
  MovingCount done;
  const double seconds =
      least_thread_seconds(5, [&] { done = shader.add(receivers, seen, {}, LampResponse::cosine, relit); });
  report("moving, 1 object that reflects", 1e9 * seconds / double(done.pairs), 12, "ns",
         "the aim of what an object hides, a receiver and object",
         {{"pairs", done.pairs}, {"made_anew_ms", 1e3 * made}});
}

}  // namespace

void bench_moving() {
  const ThreadLimit one(1);
  constexpr int order = 4, side = 316;
  constexpr double aim = 12;  // ns
  std::vector<Vec3> places, normals;
  for (int i = 0; i < side * side; ++i) {
    places.emplace_back(float(i % side) / side * 6 - 3, -1.0f, float(i / side) / side * 6 - 3);
    normals.emplace_back(0.0f, 1.0f, 0.0f);
  }
  const WritableTransfer t = make_transfer({.order = order}, 1, 1, places.size(), Precision::half);
  std::vector<float> row(size_t(sh_count(order)), 0.1f);
  for (size_t r = 0; r < places.size(); ++r) store_receiver(t, r, row);
  const MovingReceivers plain = moving_receivers(t.transfer, places, normals);
  MovingReceivers receivers = plain;
  arrange_rows(receivers);
  const Scene ball = make_sphere(1, 2, Vec3(0.5f));
  auto tracer = Tracer::build(ball);
  const ShellOptions options{.order = order, .samples = 32};
  auto shells = make_shells(ball, options);
  if (!tracer || !shells) return;
  auto field = bake_hidden(*tracer, *shells, options);
  if (!field) return;
  const HiddenLight hidden = hidden_light(*field, order);
  const std::vector<Vec3> light(size_t(sh_count(order)), Vec3(0.1f));
  Relit relit;
  relight(t.transfer, light, relit);
  const double alone = least_thread_seconds(9, [&] { relight(t.transfer, light, relit); });
  for (int count : {1, 2, 10}) {
    std::vector<PlacedObject> placed;
    std::vector<const PlacedObject*> objects;
    for (int i = 0; i < count; ++i)
      placed.push_back(place_object(hidden, {Vec3(0.2f * float(i), 0.1f, 0.1f * float(i)),
                                             rotation_from_yaw_pitch_roll({10.0f * float(i), 0, 0}), 1}));
    for (const PlacedObject& p : placed) objects.push_back(&p);
    MovingShader shader;
    MovingCount done;
    const MovingLight lights[] = {{light, false, &relit}};
    const double seconds =
        least_thread_seconds(9, [&] { done = shader.shade(receivers, objects, {.light_order = order}, lights); });
    const double by_products =
        least_thread_seconds(9, [&] { shader.shade(plain, objects, {.light_order = order}, lights); });
    report("moving, " + std::to_string(count) + " objects", 1e9 * seconds / double(done.pairs), aim, "ns",
           "the aim, a receiver and object beyond the relight",
           {{"pairs", done.pairs},
            {"by_products_alone_ns", 1e9 * by_products / double(done.pairs)},
            {"relight_ns", 1e9 * alone / double(places.size())}});
  }
  bench_reflections(receivers, ball, *tracer, *shells, options);
}

}  // namespace lambent::bench
