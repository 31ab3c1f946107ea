#include <lambent/pipeline/moving_light.h>

#include <lambent/basis/sh.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/lattice.h>
#include <lambent/scene/lights.h>

#include <algorithm>

namespace lambent {
namespace {

// Rays of a receiver that bounces of lamps' light are gathered by, and of an object's middle.
constexpr int bounce_samples = 256, middle_samples = 512;
// Of an object that reflects: as for what it hides (MovingOptions::least_share).
constexpr float least_share = 2.5e-4f;

// How far from its middle an object's reflection is looked at.
float reach_of(const Mover& m) { return 0.5f * m.placed.radius() / std::sqrt(least_share); }

std::vector<const PlacedObject*> others_of(const std::vector<Mover>& movers, const Mover* self) {
  std::vector<const PlacedObject*> out;
  for (const Mover& m : movers)
    if (&m != self) out.push_back(&m.placed);
  return out;
}

Relit black(size_t receivers) {
  Relit out;
  out.rows = 1, out.values.assign((receivers + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  return out;
}

void add_to(Relit& sum, const Relit& more) {
  std::transform(sum.values.begin(), sum.values.end(), more.values.begin(), sum.values.begin(), std::plus());
}

}  // namespace

Result<void> add_bounces(MovingScene& s, const Baked& baked, const Job& job) {
  const VertexPlacement& at = *vertices_of(baked);
  SceneBounces b{make_vertex_receivers(baked.scene), nullptr, nullptr};
  if (b.receivers.front != at.front || b.receivers.back != at.back) {
    job.warn("the light of lamps that move does not bounce: the file's receivers are not those of its scene");
    return {};
  }
  s.bounces = std::move(b);
  SceneBounces& kept = *s.bounces;
  kept.setup =
      std::make_unique<GatherSetup>(make_gather_setup(baked.scene, *s.tracer, kept.receivers, 1, bounce_samples, 1));
  auto op = GatherOperator::trace(*kept.setup, nullptr, nullptr, true, size_t{2} << 30, job.progress);
  if (!op) return op.error();
  kept.op = std::make_unique<GatherOperator>(std::move(*op));
  return {};
}

std::vector<SeenLamp> LightAmongMovers::seen_from(const MovingReceivers& receivers, const Mover* self, bool reflections,
                                                  std::vector<std::vector<float>>& open) const {
  std::vector<SeenLamp> seen;
  for (const Mover& m : movers_) {
    if (&m == self || (reflections ? !m.model->reflecting : !m.model->shining)) continue;
    open.push_back(lamp_in_sight(*s_.tracer, s_.diagonal, receivers,
                                 reflections ? m.model->reflecting_points : m.model->shining_points,
                                 m.model->hidden.shells.center, m.placed.place, reflections ? reach_of(m) : INFINITY));
    seen.push_back({reflections ? &m.reflection : &m.lamp, &m.placed});
  }
  for (size_t i = 0; i < seen.size(); ++i) seen[i].open = open[i];
  return seen;
}

// To the scene's receivers where `self` is null.
void LightAmongMovers::add(const MovingReceivers& receivers, const Mover* self, bool reflections, Relit& values) {
  std::vector<std::vector<float>> open;
  const std::vector<SeenLamp> seen = seen_from(receivers, self, reflections, open);
  if (seen.empty()) return;
  lamps_.add(receivers, seen, others_of(movers_, self), self ? LampResponse::transfer : LampResponse::cosine, values);
}

// Of lamps' light that has met the scene: what objects leave open of it at each receiver, as of all light that has
// bounced.
void LightAmongMovers::bounce_lamps(const Relit& direct, Relit& values) {
  lit_ = direct;
  if (lamp_bounces_ == 0 || !s_.bounces) return;
  const size_t n = s_.receivers.count, width = pad_lanes(3);
  AlignedVector<float> x(n * width), y(n * width);
  Relit bounced = black(n);
  for (int k = 0; k < lamp_bounces_; ++k) {
    for (size_t r = 0; r < n; ++r)
      for (int c = 0; c < 3; ++c) x[r * width + size_t(c)] = direct.at(r)[c] + bounced.at(r)[c];
    s_.bounces->op->apply(x.data(), width, y.data());
    for (size_t r = 0; r < n; ++r) bounced.set(r, 0, Vec3(y[r * width], y[r * width + 1], y[r * width + 2]));
    const std::vector<Vec3> dark(size_t(sh_count(s_.light_order)), Vec3(0.0f));
    const MovingLight light{dark, false, &bounced};
    sky_.shade(s_.receivers, others_of(movers_, nullptr), {.light_order = s_.light_order, .bounced = true},
               {&light, 1});
  }
  add_to(lit_, bounced), add_to(values, bounced);
}

// Harmonics of the lamps' light that the scene sends to a place.
std::vector<Vec3> LightAmongMovers::scene_light(Vec3 from, int order) const {
  const size_t n = size_t(sh_count(order));
  std::vector<Vec3> out(n, Vec3(0.0f));
  if (lit_.values.empty()) return out;
  const Scene& scene = baked_.scene;
  const auto& corners = std::get<CornerReceivers>(baked_.basis);
  std::vector<float> y(n);
  for (int i = 0; i < middle_samples; ++i) {
    const Vec3 d = square_to_sphere(sobol_owen(uint32_t(i), 1));
    const Hit hit = s_.tracer->closest(from, d);
    const Corners* at = hit.triangle == none ? nullptr : corners.find(hit.triangle, hit.front);
    if (!at) continue;
    Vec3 sum(0.0f);
    corners.spread(*at, hit.u, hit.v, [&](uint32_t r, float weight) { sum += weight * lit_.at(r); });
    sum = sum * albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v);
    evaluate_sh(order, d, y);
    for (size_t k = 0; k < n; ++k) out[k] += (4 * pi / float(middle_samples) * y[k]) * sum;
  }
  return out;
}

// Harmonics of all light that arrives at an object's middle, as if the object were not there.
std::vector<Vec3> LightAmongMovers::arriving_at(const Mover& m) const {
  const int order = std::max(s_.space.order, m.model->reflecting->incident_order);
  const std::vector<const PlacedObject*> others = others_of(movers_, &m);
  const Vec3 middle = m.placed.place.position;
  std::vector<Vec3> out(size_t(sh_count(order)), Vec3(0.0f));
  interpolate_lattice(s_.space.lattice, s_.space.all, middle, out);
  if (!lit_.values.empty()) {
    const std::vector<Vec3> bounced = scene_light(middle, order);
    for (size_t k = 0; k < out.size(); ++k) out[k] += bounced[k];
  }
  pass_objects(out, middle, others);
  for (const Mover& lamp : movers_) {
    if (!lamp.model->shining || &lamp == &m) continue;
    std::vector<Vec3> light(size_t(sh_count(std::min(order, lamp.model->shining->order))));
    arriving_from(lamp.lamp, middle, light);
    const Vec3 to = lamp.placed.place.position - middle;
    const float distance = length(to);
    if (!(distance > 0)) continue;
    const Vec3 passed = s_.tracer->transmittance(middle, to / distance, distance);
    std::vector<const PlacedObject*> between = others;
    std::erase(between, &lamp.placed);
    pass_objects(light, middle, between, distance);
    for (size_t k = 0; k < light.size(); ++k) out[k] += passed * light[k];
  }
  return out;
}

void LightAmongMovers::light_scene(Relit& values) {
  if (std::any_of(movers_.begin(), movers_.end(), [](const Mover& m) { return m.model->shining.has_value(); })) {
    Relit direct = black(s_.receivers.count);
    add(s_.receivers, nullptr, false, direct);
    add_to(values, direct);
    bounce_lamps(direct, values);
  }
  for (Mover& m : movers_) {
    if (!m.model->reflecting) continue;
    m.reflected = reflected_light(*m.model->reflecting, arriving_at(m), m.placed.place.rotation);
    m.reflection = place_lamp(m.reflected, m.placed.place);
  }
  add(s_.receivers, nullptr, true, values);
}

std::vector<Vec3> LightAmongMovers::arriving_at_each(const Mover& m, const Relit& space, int order) const {
  const MovingReceivers& r = m.receivers;
  const size_t n = size_t(sh_count(order));
  const std::vector<const PlacedObject*> others = others_of(movers_, &m);
  std::vector<Vec3> out(r.count * n);
  parallel_for(r.count, sh_tile, [&](size_t begin, size_t end) {
    std::vector<Vec3> here(std::max(n, size_t(space.rows)));
    for (size_t i = begin; i < end; ++i) {
      std::fill(here.begin(), here.end(), Vec3(0.0f));
      interpolate_lattice(s_.space.lattice, space, r.positions[i], here);
      pass_objects(std::span(here).first(n), r.positions[i], others);
      std::copy_n(here.begin(), n, out.begin() + ptrdiff_t(i * n));
    }
  });
  return out;
}

bool LightAmongMovers::sends_to(const Mover& m) const {
  return std::any_of(movers_.begin(), movers_.end(),
                     [&](const Mover& o) { return &o != &m && (o.model->shining || o.model->reflecting); });
}

std::vector<Vec3> LightAmongMovers::sent_to_each(const Mover& m, int order) const {
  const MovingReceivers& r = m.receivers;
  const size_t n = size_t(sh_count(order));
  const std::vector<const PlacedObject*> others = others_of(movers_, &m);
  std::vector<std::vector<float>> open_lamps, open_objects;
  std::vector<SeenLamp> seen = seen_from(r, &m, false, open_lamps);
  for (const SeenLamp& lamp : seen_from(r, &m, true, open_objects)) seen.push_back(lamp);
  std::vector<Vec3> bounced = scene_light(m.placed.place.position, order);
  pass_objects(bounced, m.placed.place.position, others);
  std::vector<Vec3> out(r.count * n);
  parallel_for(r.count, sh_tile, [&](size_t begin, size_t end) {
    std::vector<const PlacedObject*> between;
    for (size_t i = begin; i < end; ++i) {
      const std::span<Vec3> here = std::span(out).subspan(i * n, n);
      std::copy(bounced.begin(), bounced.end(), here.begin());
      for (const SeenLamp& lamp : seen) {
        if (!(lamp.open[i] > 0)) continue;
        std::vector<Vec3> light(size_t(sh_count(std::min(order, lamp.lamp->light->order))));
        arriving_from(*lamp.lamp, r.positions[i], light);
        between = others;
        std::erase(between, lamp.itself);
        pass_objects(light, r.positions[i], between, length(lamp.lamp->place.position - r.positions[i]));
        for (size_t k = 0; k < light.size(); ++k) here[k] += lamp.open[i] * light[k];
      }
    }
  });
  return out;
}

void LightAmongMovers::light_object(const Mover& m, Relit& values) {
  add(m.receivers, &m, false, values);
  add(m.receivers, &m, true, values);
  if (lit_.values.empty()) return;
  // The same all over the object.
  const int order = std::min(m.receivers.order, 4);
  std::vector<Vec3> light = scene_light(m.placed.place.position, order);
  pass_objects(light, m.placed.place.position, others_of(movers_, &m));
  Relit bounced;
  light_receivers(m.receivers, order, {light, false, &bounced});
  for (float& v : bounced.values) v = std::max(v, 0.0f);
  add_to(values, bounced);
}

}  // namespace lambent
