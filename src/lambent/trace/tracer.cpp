#include <lambent/core/random.h>
#include <lambent/scene/see_through.h>
#include <lambent/trace/embree_scene.h>
#include <lambent/trace/tracer.h>

#include <algorithm>
#include <bit>

namespace lambent {

struct Tracer::Impl {
  EmbreeScene embree;
  const Scene* source = nullptr;
  std::vector<uint8_t> passes;  // of each triangle; empty where all are solid
  bool colours = false;
  void read_materials(const Scene& read) {
    source = &read;
    const std::vector<uint8_t> materials = see_through_materials(read);
    if (materials.empty()) return;
    for (const Triangle& t : read.triangles) {
      const Material& m = read.materials[read.parts[t.part].material];
      passes.push_back(materials[read.parts[t.part].material]);
      if (!passes.back()) continue;
      const bool grey = m.base_color.x == m.base_color.y && m.base_color.y == m.base_color.z &&
                        m.base_color_texture < 0 && read.colors.empty();
      colours |= m.transmission > 0 && !grey;
    }
    if (std::none_of(passes.begin(), passes.end(), [](uint8_t p) { return p; })) passes = {};
  }
};

namespace {

// What a ray goes through, nearest first, and the solid surface at its end.
struct Layers {
  std::vector<Hit> through;
  Hit solid;
};

struct CollectContext {
  embree::Query query;  // first: embree.h
  const EmbreeScene* scene;
  const std::vector<uint8_t>* passes;
  Vec3 direction;  // in the world, as a ray's own may not be within a copy
  std::vector<Hit>* through;
};

// Notes surfaces that let light pass, and goes on behind them. May be called twice for one.
void collect(const RTCFilterFunctionNArguments* args) {
  const CollectContext& c = *reinterpret_cast<const CollectContext*>(args->context);
  for (unsigned i = 0; i < args->N; ++i) {
    const unsigned instance = RTCHitN_instID(args->hit, args->N, i, 0),
                   primitive = RTCHitN_primID(args->hit, args->N, i);
    if (args->valid[i] == 0 || !(*c.passes)[c.scene->triangle(instance, primitive)]) continue;
    args->valid[i] = 0;
    const Vec3 normal(RTCHitN_Ng_x(args->hit, args->N, i), RTCHitN_Ng_y(args->hit, args->N, i),
                      RTCHitN_Ng_z(args->hit, args->N, i));
    c.through->push_back(c.scene->hit(instance, primitive, RTCHitN_u(args->hit, args->N, i),
                                      RTCHitN_v(args->hit, args->N, i), normal, c.direction,
                                      RTCRayN_tfar(args->ray, args->N, i)));
  }
}

Hit intersect(const EmbreeScene& scene, embree::Query& query, Vec3 origin, Vec3 direction, float from, float to) {
  RTCRayHit r;
  r.ray.org_x = origin.x, r.ray.org_y = origin.y, r.ray.org_z = origin.z, r.ray.tnear = from;
  r.ray.dir_x = direction.x, r.ray.dir_y = direction.y, r.ray.dir_z = direction.z, r.ray.time = 0;
  r.ray.tfar = to, r.ray.mask = ~0u, r.ray.id = 0, r.ray.flags = 0;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID, r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree::intersect1(scene.top(), query, r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return scene.hit(r.hit.instID[0], r.hit.primID, r.hit.u, r.hit.v, {r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z}, direction,
                   r.ray.tfar);
}

// Surfaces that meet the ray within this share of its length are one sheet: the two sides of a pane modelled as two
// triangles, an edge that two triangles share.
constexpr float same_sheet = 1e-6f;

void sort_layers(Layers& layers) {
  std::vector<Hit>& t = layers.through;
  if (layers.solid.triangle != none) std::erase_if(t, [&](const Hit& h) { return h.distance > layers.solid.distance; });
  std::sort(t.begin(), t.end(), [](const Hit& a, const Hit& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.triangle < b.triangle;
  });
  t.erase(std::unique(t.begin(), t.end(),
                      [](const Hit& a, const Hit& b) { return b.distance - a.distance <= same_sheet * b.distance; }),
          t.end());
}

// All that a ray goes through up to `to`, in one traversal.
const Layers& find_layers(const EmbreeScene& scene, const std::vector<uint8_t>& passes, Vec3 origin, Vec3 direction,
                          float from = 0, float to = INFINITY) {
  thread_local Layers layers;
  layers.through.clear();
  CollectContext collecting;
  collecting.query.filter = collect, collecting.scene = &scene, collecting.passes = &passes;
  collecting.direction = direction, collecting.through = &layers.through;
  layers.solid = intersect(scene, collecting.query, origin, direction, from, to);
  sort_layers(layers);
  return layers;
}

// Whether light from behind a hit comes through it.
bool goes_on(const Scene& scene, const std::vector<uint8_t>& passes, const Hit& hit) {
  return hit.triangle != none && !passes.empty() && passes[hit.triangle] &&
         transmittance(scene, scene.triangles[hit.triangle], hit.u, hit.v) != Vec3(0);
}

// In [0, 1), of a ray and a surface on its way.
float draw(Vec3 origin, Vec3 direction, uint32_t triangle) {
  auto pair = [](float a, float b) { return uint64_t(std::bit_cast<uint32_t>(a)) << 32 | std::bit_cast<uint32_t>(b); };
  uint64_t key = hash64(pair(origin.x, origin.y), pair(origin.z, direction.x));
  key = hash64(key, pair(direction.y, direction.z));
  return to_unit_float(uint32_t(hash64(key, uint64_t(triangle)) >> 32));
}

// One of the layers, or none of them, drawn as closest_fan() says.
Hit draw_hit(const Scene& scene, const Layers& layers, Vec3 origin, Vec3 direction, Passage& passage) {
  Vec3 through(1), reached(1);  // exactly; and over the probability of having come so far
  bool drawn = false;
  Hit hit = layers.solid;
  for (const Hit& h : layers.through) {
    const Triangle& t = scene.triangles[h.triangle];
    const Vec3 pass = transmittance(scene, t, h.u, h.v);
    if (!drawn) {
      float on = largest(pass);
      if (on > 0.5f && largest(scene.materials[scene.parts[t.part].material].emissive) > 0) on = 0.5f;
      if (draw(origin, direction, h.triangle) < on) reached *= pass / on;
      else drawn = true, hit = h, reached *= coverage(scene, t, h.u, h.v) / (1 - on);
    }
    through *= pass;
    if (drawn && (layers.solid.triangle != none || through == Vec3(0))) break;
  }
  passage.hit = reached;
  const bool blocked = layers.solid.triangle != none;
  passage.sky = blocked ? Vec3(0) : through;
  return hit;
}

}  // namespace

Result<Tracer> Tracer::build(const Scene& scene, Progress* progress, Sharing sharing) {
  auto impl = std::make_shared<Impl>();
  impl->read_materials(scene);
  auto built = impl->embree.build(scene, !impl->passes.empty(), sharing, progress);
  if (!built) return built.error();
  Tracer tracer;
  tracer.impl_ = std::move(impl);
  return tracer;
}

size_t Tracer::bytes() const { return impl_->embree.bytes(); }
size_t Tracer::copies() const { return impl_->embree.copies(); }

bool Tracer::lets_pass() const { return !impl_->passes.empty(); }
bool Tracer::lets_pass(uint32_t triangle) const { return lets_pass() && impl_->passes[triangle]; }
bool Tracer::colours() const { return impl_->colours; }

// Occlusion: streams of 256 rays were the fastest of Embree's entry points for sorted directions; the COHERENT flag
// slows it.
void Tracer::visible_fan(Vec3 origin, const Directions& d, float* visible) const {
  constexpr size_t batch = 256;
  alignas(64) RTCRay rays[batch];
  if (lets_pass()) {
    std::array<std::vector<float>, 3> colour;
    for (auto& channel : colour) channel.resize(d.count);
    visible_fan(origin, d, {colour[0].data(), colour[1].data(), colour[2].data()});
    for (size_t i = 0; i < d.count; ++i) visible[i] = (colour[0][i] + colour[1][i] + colour[2][i]) / 3;
    return;
  }
  embree::Query query;
  for (size_t begin = 0; begin < d.count; begin += batch) {
    const size_t n = std::min(batch, d.count - begin);
    for (size_t i = 0; i < n; ++i) {
      RTCRay& r = rays[i];
      r.org_x = origin.x, r.org_y = origin.y, r.org_z = origin.z, r.tnear = 0;
      r.dir_x = d.x[begin + i], r.dir_y = d.y[begin + i], r.dir_z = d.z[begin + i], r.time = 0;
      r.tfar = INFINITY, r.mask = ~0u, r.id = 0, r.flags = 0;
    }
    embree::occluded_many(impl_->embree.top(), query, rays, n);
    for (size_t i = 0; i < n; ++i) visible[begin + i] = rays[i].tfar < 0 ? 0.0f : 1.0f;
  }
}

void Tracer::closest_fan(Vec3 origin, const Directions& d, Hit* hits) const {
  constexpr size_t batch = 16;
  RTCRayHit16 packet;
  alignas(64) int valid[batch];
  embree::Query query;
  for (size_t begin = 0; begin < d.count; begin += batch) {
    const size_t n = std::min(batch, d.count - begin);
    for (size_t i = 0; i < batch; ++i) {
      const size_t j = begin + std::min(i, n - 1);
      valid[i] = i < n ? -1 : 0;
      packet.ray.org_x[i] = origin.x, packet.ray.org_y[i] = origin.y, packet.ray.org_z[i] = origin.z;
      packet.ray.dir_x[i] = d.x[j], packet.ray.dir_y[i] = d.y[j], packet.ray.dir_z[i] = d.z[j];
      packet.ray.tnear[i] = 0, packet.ray.tfar[i] = INFINITY, packet.ray.time[i] = 0;
      packet.ray.mask[i] = ~0u, packet.ray.id[i] = 0, packet.ray.flags[i] = 0;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    embree::intersect16(valid, impl_->embree.top(), query, packet);
    for (size_t i = 0; i < n; ++i) {
      Hit& h = hits[begin + i];
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
        h = Hit{};
        continue;
      }
      const Vec3 normal(packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]),
          direction(packet.ray.dir_x[i], packet.ray.dir_y[i], packet.ray.dir_z[i]);
      h = impl_->embree.hit(packet.hit.instID[0][i], packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i], normal,
                            direction, packet.ray.tfar[i]);
    }
  }
}

Hit Tracer::closest(Vec3 origin, Vec3 direction, float from, float to) const {
  embree::Query query;
  return intersect(impl_->embree, query, origin, direction, from, to);
}

Hit Tracer::closest(Vec3 origin, Vec3 direction, Passage& passage) const {
  const Hit first = closest(origin, direction);
  passage = {Vec3(first.triangle == none ? 1.0f : 0.0f), Vec3(1)};
  if (!goes_on(*impl_->source, impl_->passes, first)) return first;
  return draw_hit(*impl_->source, find_layers(impl_->embree, impl_->passes, origin, direction), origin, direction,
                  passage);
}

void Tracer::closest_fan(Vec3 origin, const Directions& d, Hit* hits, Passage* passages) const {
  closest_fan(origin, d, hits);
  for (size_t i = 0; i < d.count; ++i) {
    passages[i] = {Vec3(hits[i].triangle == none ? 1.0f : 0.0f), Vec3(1)};
    if (!goes_on(*impl_->source, impl_->passes, hits[i])) continue;
    const Vec3 direction(d.x[i], d.y[i], d.z[i]);
    hits[i] = draw_hit(*impl_->source, find_layers(impl_->embree, impl_->passes, origin, direction), origin, direction,
                       passages[i]);
  }
}

void Tracer::visible_fan(Vec3 origin, const Directions& d, const std::array<float*, 3>& visible) const {
  constexpr size_t batch = 256;
  Hit hits[batch];
  Passage passages[batch];
  for (size_t begin = 0; begin < d.count; begin += batch) {
    const size_t n = std::min(batch, d.count - begin);
    closest_fan(origin, {d.x + begin, d.y + begin, d.z + begin, n}, hits, passages);
    for (size_t i = 0; i < n; ++i)
      for (size_t c = 0; c < 3; ++c) visible[c][begin + i] = passages[i].sky[int(c)];
  }
}

void Tracer::layers(Vec3 origin, Vec3 direction, float from, std::vector<Hit>& out) const {
  const Layers& met = find_layers(impl_->embree, impl_->passes, origin, direction, from);
  out = met.through;
  if (met.solid.triangle != none) out.push_back(met.solid);
}

Vec3 Tracer::transmittance(Vec3 origin, Vec3 direction, float distance) const {
  if (!lets_pass()) return Vec3(closest(origin, direction, 0, distance).triangle == none ? 1.0f : 0.0f);
  const Layers& met = find_layers(impl_->embree, impl_->passes, origin, direction, 0, distance);
  if (met.solid.triangle != none) return Vec3(0);
  Vec3 product(1);
  for (const Hit& h : met.through)
    product *= lambent::transmittance(*impl_->source, impl_->source->triangles[h.triangle], h.u, h.v);
  return product;
}

}  // namespace lambent
