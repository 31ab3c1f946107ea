#include <lambent/relight/shining.h>

#include <lambent/relight/moving_kernels.h>

#include <lambent/basis/sh.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

namespace lambent {
namespace {

// Of the constant 1.
constexpr float lit_sphere = 3.5449077f;

struct LampWork {
  TileMix mix;
  AlignedVector<float> rows, factor, next;
  AlignedVector<float> light;  // [r, g, b][coefficient][receiver]
  AlignedVector<float> table;  // the cosine of each receiver, over pi: [coefficient][receiver]
  std::vector<std::pair<float, const PlacedObject*>> between;
};

// The receivers of a tile that a lamp can reach; how many.
size_t reached(const MovingReceivers& r, const SeenLamp& lamp, size_t first, size_t count, uint8_t* wanted) {
  size_t met = 0;
  for (size_t i = 0; i < sh_tile; ++i) {
    const size_t at = first + std::min(i, count - 1);
    const Vec3 from = r.positions[at] - lamp.lamp->place.position;
    wanted[i] = i < count && dot(r.normals[at], from) < lamp.lamp->radius() && (lamp.open.empty() || lamp.open[at] > 0);
    met += wanted[i];
  }
  return met;
}

// Objects that may be nearer to some receiver of the tile than the lamp is and hide some of it, nearest first.
void find_between(const MovingReceivers::Tile& tile, const SeenLamp& lamp, std::span<const PlacedObject* const> objects,
                  LampWork& work) {
  work.between.clear();
  const float far = length(lamp.lamp->place.position - tile.center) + tile.radius;
  for (const PlacedObject* object : objects) {
    const float distance = length(object->place.position - tile.center);
    if (object != lamp.itself && distance - tile.radius < far) work.between.emplace_back(distance, object);
  }
  std::stable_sort(work.between.begin(), work.between.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
}

// What an object lets pass of a lamp's light, by receiver; false where it is in nobody's way.
bool lets_by(const PlacedObject& object, const MovingReceivers& r, const SeenLamp& lamp, size_t first, size_t count,
             const uint8_t* wanted, LampWork& work) {
  uint8_t nearer[sh_tile];
  size_t met = 0;
  const float radius = object.radius();
  for (size_t i = 0; i < sh_tile; ++i) {
    const size_t at = first + std::min(i, count - 1);
    const Vec3 from = r.positions[at] - object.place.position, to_lamp = r.positions[at] - lamp.lamp->place.position;
    nearer[i] = wanted[i] && dot(r.normals[at], from) < radius && dot(from, from) < dot(to_lamp, to_lamp);
    met += nearer[i];
  }
  if (met == 0) return false;
  const size_t n = size_t(sh_count(object.light->order));
  work.factor.resize(n * sh_tile);
  rows_of_tile(object.light->shells, object.light->log_radii, object.place, object.values, object.stride(),
               std::span(r.positions).subspan(first, count), nearer, work.mix, work.rows);
  factor_of_tile(work.rows.data(), object.stride(), n, lit_sphere, work.factor.data());
  return true;
}

// What arrives of a lamp at a tile without anything in the way.
void light_tile(const MovingReceivers& r, const SeenLamp& lamp, size_t first, size_t count, const uint8_t* wanted,
                LampWork& work) {
  const ShiningLight& light = *lamp.lamp->light;
  const size_t stride = lamp.lamp->stride(), values = 3 * size_t(sh_count(light.order));
  rows_of_tile(light.shells, light.log_radii, lamp.lamp->place, lamp.lamp->values, stride,
               std::span(r.positions).subspan(first, count), wanted, work.mix, work.rows);
  work.light.resize(values * sh_tile);
  for (size_t i = 0; i < sh_tile; ++i)
    for (size_t k = 0; k < values; ++k) work.light[k * sh_tile + i] = work.rows[i * stride + k];
}

// The clamped cosine about each normal, over pi.
void cosines_of_tile(const MovingReceivers& r, int order, size_t first, size_t count, LampWork& work) {
  alignas(64) float x[sh_tile], y[sh_tile], z[sh_tile];
  for (size_t i = 0; i < sh_tile; ++i) {
    const Vec3 n = r.normals[first + std::min(i, count - 1)];
    x[i] = n.x, y[i] = n.y, z[i] = n.z;
  }
  work.table.resize(size_t(sh_count(order)) * sh_tile);
  evaluate_sh(order, x, y, z, sh_tile, work.table);
  for (int k = 0; k < sh_count(order); ++k)
    for (size_t i = 0; i < sh_tile; ++i)
      work.table[size_t(k) * sh_tile + i] *= float(clamped_cosine(sh_band(k)) / std::numbers::pi);
}

// Adds what of the tile's light leaves its receivers, which is never negative.
void reflect_tile(const SeenLamp& lamp, int order, const float* const* response, size_t coefficients, size_t first,
                  size_t count, const LampWork& work, Relit& values) {
  const size_t n = size_t(sh_count(order));
  for (size_t c = 0; c < 3; ++c) {
    float sum[sh_tile] = {};
    for (size_t k = 0; k < std::min(n, coefficients); ++k)
      for (size_t i = 0; i < sh_tile; ++i)
        sum[i] += work.light[(c * n + k) * sh_tile + i] * response[c][k * sh_tile + i];
    for (size_t i = 0; i < count; ++i) {
      Vec3 v = values.at(first + i);
      v[int(c)] += std::max(sum[i], 0.0f) * (lamp.open.empty() ? 1.0f : lamp.open[first + i]);
      values.set(first + i, 0, v);
    }
  }
}

}  // namespace

ShiningLight shining_light(const Field& field, int order) {
  const Transfer& t = std::get<Transfer>(field.store);
  LAMBENT_CHECK(std::holds_alternative<IncidentRows>(field.rows) && t.channels == 3 && t.columns() == 1);
  ShiningLight out{
      std::get<ShellPlacement>(field.where).shells, {}, std::min(order, std::get<IncidentRows>(field.rows).order), {}};
  for (float r : out.shells.radii) out.log_radii.push_back(std::log2(r));
  const size_t n = size_t(sh_count(out.order));
  out.values.resize(t.receivers * 3 * n);
  parallel_for(t.receivers, 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const std::vector<float> rows = load_receiver(t, p);  // [coefficient][channel]
      for (size_t c = 0; c < 3; ++c)
        for (size_t k = 0; k < n; ++k) out.values[(p * 3 + c) * n + k] = rows[3 * k + c];
    }
  });
  return out;
}

PlacedLamp place_lamp(const ShiningLight& light, const RigidPlace& place) {
  PlacedLamp out{&light, place, {}};
  const size_t n = size_t(sh_count(light.order)), stride = out.stride();
  out.values.resize(light.shells.count() * stride, 0.0f);
  parallel_for(light.shells.count(), 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p)
      for (size_t c = 0; c < 3; ++c)
        rotate_sh_zyz(place.rotation, std::span<const float>(light.values).subspan((p * 3 + c) * n, n),
                      std::span<float>(out.values).subspan(p * stride + c * n, n));
  });
  return out;
}

void arriving_from(const PlacedLamp& lamp, Vec3 point, std::span<Vec3> out) {
  const Vec3 from = transpose(lamp.place.rotation) * (point - lamp.place.position) / lamp.place.scale;
  const ShellMix mix = mix_shells(lamp.light->shells, lamp.light->log_radii, from);
  const size_t n = size_t(sh_count(lamp.light->order));
  LAMBENT_CHECK(out.size() <= n);
  std::fill(out.begin(), out.end(), Vec3(0.0f));
  for (size_t m = 0; m < mix.points.size(); ++m) {
    const float weight = mix.weights[m] * mix.fade;
    const float* v = lamp.values.data() + size_t(mix.points[m]) * lamp.stride();
    for (size_t k = 0; k < out.size(); ++k) out[k] += weight * Vec3(v[k], v[n + k], v[2 * n + k]);
  }
}

MovingCount LampShader::add(const MovingReceivers& r, std::span<const SeenLamp> lamps,
                            std::span<const PlacedObject* const> objects, LampResponse response, Relit& values) {
  for (const SeenLamp& lamp : lamps)  // before any thread asks
    for (const PlacedObject* object : objects)
      products_.make(lamp.lamp->light->order, object->light->order, lamp.lamp->light->order);
  std::atomic<size_t> pairs{0}, worked{0};
  parallel_for(r.tiles.size(), 1, [&](size_t begin, size_t end) {
    thread_local LampWork work;
    uint8_t wanted[sh_tile];
    for (size_t tile = begin; tile < end; ++tile) {
      const size_t first = tile * sh_tile, count = std::min(sh_tile, r.count - first);
      for (const SeenLamp& lamp : lamps) {
        const size_t met = reached(r, lamp, first, count, wanted);
        if (met == 0) continue;
        pairs += met, ++worked;
        const int order = lamp.lamp->light->order;
        const size_t n = size_t(sh_count(order)), own = size_t(sh_count(r.order));
        light_tile(r, lamp, first, count, wanted, work);
        find_between(r.tiles[tile], lamp, objects, work);
        for (const auto& near : work.between) {
          if (!lets_by(*near.second, r, lamp, first, count, wanted, work)) continue;
          work.next.resize(work.light.size());
          const ShTileProduct& product = products_.at(order, near.second->light->order, order);
          for (size_t c = 0; c < 3; ++c)
            multiply_sh_tile(product, work.light.data() + c * n * sh_tile, work.factor.data(),
                             work.next.data() + c * n * sh_tile);
          std::swap(work.light, work.next);
        }
        const float* of[3];
        if (response == LampResponse::cosine) cosines_of_tile(r, order, first, count, work);
        for (size_t c = 0; c < 3; ++c)
          of[c] = response == LampResponse::cosine
                    ? work.table.data()
                    : r.transfer.data() + (tile * size_t(r.channels) + (r.channels == 3 ? c : 0)) * own * sh_tile;
        reflect_tile(lamp, order, of, response == LampResponse::cosine ? n : own, first, count, work, values);
      }
    }
  });
  return {pairs, worked};
}

}  // namespace lambent
