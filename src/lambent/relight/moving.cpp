#include <lambent/relight/moving.h>

#include <lambent/relight/moving_kernels.h>

#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <atomic>
#include <cmath>

namespace lambent {
namespace {

constexpr float whole_sphere = 3.5449077f;  // of the constant 1: sqrt(4 pi)

float share_of_sphere(float radius, float distance) {
  return distance > radius ? 0.25f * (radius / distance) * (radius / distance) : 1.0f;
}

// What a tile of receivers does with one object after another.
struct TileWork {
  AlignedVector<float> product, next;
  std::vector<AlignedVector<float>> factors;  // of the objects that hide something, nearest first
  std::vector<int> orders;
  AlignedVector<float> rows;
  TileMix mix;
  alignas(64) float open[sh_tile];
  std::vector<std::pair<float, const PlacedObject*>> near;
};

// Objects near a tile, nearest first.
void find_near(const MovingReceivers::Tile& tile, std::span<const PlacedObject* const> objects, float least,
               TileWork& work) {
  work.near.clear();
  for (const PlacedObject* object : objects) {
    const float distance = length(object->place.position - tile.center);
    if (share_of_sphere(object->radius(), distance - tile.radius) >= least) work.near.emplace_back(distance, object);
  }
  std::stable_sort(work.near.begin(), work.near.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
}

// What an object lets pass to each receiver of a tile. False where it hides nothing from any.
bool factor_of(const PlacedObject& object, const MovingReceivers& r, size_t first, size_t count, float least,
               AlignedVector<float>& factor, TileWork& work, size_t& pairs) {
  const size_t n = size_t(sh_count(object.light->order)), stride = object.stride();
  const float radius = object.radius(), reach = 0.25f * radius * radius / least;
  uint8_t wanted[sh_tile];
  size_t met = 0;
  for (size_t i = 0; i < sh_tile; ++i) {
    const size_t at = first + std::min(i, count - 1);
    const Vec3 from = r.positions[at] - object.place.position;
    wanted[i] = i < count && dot(r.normals[at], from) < radius && dot(from, from) < reach;
    met += wanted[i];
  }
  if (met == 0) return false;
  pairs += met;
  factor.resize(n * sh_tile);
  rows_of_tile(object.light->shells, object.light->log_radii, object.place, object.values, stride,
               std::span(r.positions).subspan(first, count), wanted, work.mix, work.rows);
  factor_of_tile(work.rows.data(), stride, n, whole_sphere, factor.data());
  return true;
}

// Those of all objects near a tile; how many.
size_t factors_of(const MovingReceivers& r, size_t first, size_t count, const MovingOptions& o, TileWork& work,
                  size_t& pairs) {
  std::fill_n(work.open, sh_tile, 1.0f);
  work.orders.clear();
  for (const auto& near : work.near) {
    const size_t at = work.orders.size();
    if (work.factors.size() <= at) work.factors.emplace_back();
    if (!factor_of(*near.second, r, first, count, o.least_share, work.factors[at], work, pairs)) continue;
    work.orders.push_back(near.second->light->order);
    if (o.bounced)
      open_of_tile(r.lobes.data() + first * 9, work.factors[at].data(),
                   size_t(std::min(9, sh_count(work.orders.back()))), work.open);
  }
  return work.orders.size();
}

// T . light of each receiver of a tile, [r, g, b][receiver].
void light_of_tile(const float* rows, const MovingLight& light, size_t coefficients, size_t first, size_t count,
                   float* out) {
  if (!light.each) return dot_sh_tile(rows, light.light.first(coefficients), out);
  for (size_t i = 0; i < count; ++i) {
    Vec3 sum(0.0f);
    for (size_t k = 0; k < coefficients; ++k)
      sum += rows[k * sh_tile + i] * light.light[(first + i) * coefficients + k];
    for (int c = 0; c < 3; ++c) out[size_t(c) * sh_tile + i] = sum[c];
  }
}

}  // namespace

void rows_of_tile(const Shells& shells, const std::vector<float>& log_radii, const RigidPlace& place,
                  std::span<const float> values, size_t stride, std::span<const Vec3> positions, const uint8_t* wanted,
                  TileMix& mix, AlignedVector<float>& rows) {
  const Mat3 back = transpose(place.rotation) * (1 / place.scale);
  alignas(64) float x[sh_tile], y[sh_tile], z[sh_tile];
  for (size_t i = 0; i < sh_tile; ++i) {
    const Vec3 own = back * (positions[std::min(i, positions.size() - 1)] - place.position);
    x[i] = own.x, y[i] = own.y, z[i] = own.z;
  }
  mix_tile(shells, log_radii.data(), x, y, z, mix);
  rows.assign(sh_tile * stride, 0.0f);
  hidden_of_tile(mix, wanted, size_t(shells.side), values.data(), stride, rows.data());
}

HiddenLight hidden_light(const Field& field, int order) {
  const Transfer& t = std::get<Transfer>(field.store);
  LAMBENT_CHECK(std::holds_alternative<HiddenRows>(field.rows) && t.channels == 1);
  HiddenLight out{std::get<ShellPlacement>(field.where).shells, {}, std::min(order, t.light.order), {}};
  for (float r : out.shells.radii) out.log_radii.push_back(std::log2(r));
  const size_t n = size_t(sh_count(out.order));
  out.values.resize(t.receivers * n);
  parallel_for(t.receivers, 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p)
      std::copy_n(load_receiver(t, p).begin(), n, out.values.begin() + ptrdiff_t(p * n));
  });
  return out;
}

PlacedObject place_object(const HiddenLight& light, const RigidPlace& place) {
  PlacedObject out{&light, place, {}};
  const size_t n = size_t(sh_count(light.order)), stride = out.stride();
  out.values.resize(light.shells.count() * stride, 0.0f);
  parallel_for(light.shells.count(), 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p)
      rotate_sh_zyz(place.rotation, std::span<const float>(light.values).subspan(p * n, n),
                    std::span<float>(out.values).subspan(p * stride, n));
  });
  return out;
}

void hidden_from(const PlacedObject& object, Vec3 point, std::span<float> out) {
  const Vec3 from = transpose(object.place.rotation) * (point - object.place.position) / object.place.scale;
  const ShellMix mix = mix_shells(object.light->shells, object.light->log_radii, from);
  const size_t n = out.size();
  const float* values = object.values.data();
  std::fill(out.begin(), out.end(), 0.0f);
  for (size_t m = 0; m < mix.points.size(); ++m) {
    const float weight = mix.weights[m] * mix.fade;
    const float* v = values + size_t(mix.points[m]) * object.stride();
    for (size_t k = 0; k < n; ++k) out[k] += weight * v[k];
  }
}

MovingReceivers moving_receivers(const Transfer& t, std::span<const Vec3> positions, std::span<const Vec3> normals,
                                 Vec3 center, const RigidPlace& place) {
  LAMBENT_CHECK(t.rows == 1 && t.columns() == size_t(sh_count(t.light.order)));
  LAMBENT_CHECK(positions.size() == t.receivers && normals.size() == t.receivers);
  MovingReceivers out{t.receivers, t.light.order, t.channels, {}, {}, {}, {}, {}};
  const size_t n = t.columns(), tiles = (t.receivers + sh_tile - 1) / sh_tile, channels = size_t(t.channels);
  out.positions.resize(t.receivers), out.normals.resize(t.receivers), out.tiles.resize(tiles);
  out.transfer.resize(tiles * channels * n * sh_tile), out.lobes.resize(tiles * 9 * sh_tile);
  const bool turned = !(place.rotation == Mat3(1.0f));
  parallel_for(tiles, 1, [&](size_t begin, size_t end) {
    for (size_t tile = begin; tile < end; ++tile) {
      const size_t first = tile * sh_tile, last = std::min(first + sh_tile, t.receivers);
      Bounds box;
      for (size_t r = first; r < last; ++r) {
        out.positions[r] = place.position + place.scale * (place.rotation * (positions[r] - center));
        out.normals[r] = place.rotation * normals[r];
        box.extend(out.positions[r]);
        float y[9];
        evaluate_sh(3, out.normals[r], y);
        for (size_t k = 0; k < 9; ++k)
          out.lobes[tile * 9 * sh_tile + k * sh_tile + r - first] =
              float(clamped_cosine(sh_band(int(k))) / std::numbers::pi) * y[k];
        std::vector<float> rows = load_receiver(t, r);
        for (size_t c = 0; c < channels; ++c) {
          const std::span<float> row = std::span(rows).subspan(c * n, n);
          if (turned) rotate_sh_zyz(place.rotation, std::span<const float>(row), row);
          for (size_t k = 0; k < n; ++k) out.transfer[((tile * channels + c) * n + k) * sh_tile + r - first] = row[k];
        }
      }
      out.tiles[tile] = {0.5f * (box.min + box.max), 0.5f * length(box.max - box.min)};
    }
  });
  return out;
}

void light_receivers(const MovingReceivers& r, int light_order, const MovingLight& light) {
  const size_t n = size_t(sh_count(r.order)), lit = size_t(sh_count(light_order)), channels = size_t(r.channels);
  light.values->rows = 1;
  light.values->values.assign((r.count + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  parallel_for(r.tiles.size(), 1, [&](size_t begin, size_t end) {
    alignas(64) float lights[3 * sh_tile];
    for (size_t tile = begin; tile < end; ++tile) {
      const size_t first = tile * sh_tile, count = std::min(sh_tile, r.count - first);
      for (size_t c = 0; c < channels; ++c) {
        light_of_tile(r.transfer.data() + (tile * channels + c) * n * sh_tile, light, lit, first, count, lights);
        for (size_t i = 0; i < count; ++i) {
          Vec3 value = light.values->at(first + i);
          for (int k = 0; k < 3; ++k)
            if (channels == 1 || k == int(c)) value[k] = lights[size_t(k) * sh_tile + i];
          light.values->set(first + i, 0, value);
        }
      }
    }
  });
}

MovingCount MovingShader::shade(const MovingReceivers& r, std::span<const PlacedObject* const> objects,
                                const MovingOptions& options, std::span<const MovingLight> lights) {
  const size_t n = size_t(sh_count(r.order)), lit = size_t(sh_count(options.light_order));
  LAMBENT_CHECK(options.light_order >= 1 && options.light_order <= r.order);
  for (const PlacedObject* object : objects)  // before any thread asks
    products_.make(r.order, object->light->order, r.order),
        products_.make(r.order, object->light->order, options.light_order);
  std::atomic<size_t> pairs{0}, worked{0};
  parallel_for(r.tiles.size(), 1, [&](size_t begin, size_t end) {
    thread_local TileWork work;
    work.product.resize(n * sh_tile), work.next.resize(n * sh_tile);
    alignas(64) float before[3 * sh_tile], after[3 * sh_tile];
    for (size_t tile = begin; tile < end; ++tile) {
      find_near(r.tiles[tile], objects, options.least_share, work);
      if (work.near.empty()) continue;
      const size_t first = tile * sh_tile, count = std::min(sh_tile, r.count - first);
      size_t met = 0;
      const size_t factors = factors_of(r, first, count, options, work, met);
      pairs += met;
      if (factors == 0) continue;
      ++worked;
      for (size_t c = 0; c < size_t(r.channels); ++c) {
        const float* rows = r.transfer.data() + (tile * size_t(r.channels) + c) * n * sh_tile;
        const float* a = rows;
        for (size_t f = 0; f < factors; ++f) {
          const int bands = f + 1 == factors ? options.light_order : r.order;
          multiply_sh_tile(products_.at(r.order, work.orders[f], bands), a, work.factors[f].data(), work.next.data());
          std::swap(work.product, work.next), a = work.product.data();
        }
        for (const MovingLight& light : lights) {
          if (options.bounced) light_of_tile(rows, light, lit, first, count, before);
          light_of_tile(a, light, lit, first, count, after);
          for (size_t k = 0; k < 3; ++k) {
            if (r.channels == 3 && k != c) continue;
            for (size_t i = 0; i < count; i += transfer_block) {
              float* value = light.values->values.data() + ((first + i) / transfer_block * 3 + k) * transfer_block;
              const size_t at = k * sh_tile + i, end = std::min(transfer_block, count - i);
              for (size_t j = 0; j < end; ++j)
                value[j] = after[at + j] + (options.bounced ? (value[j] - before[at + j]) * work.open[i + j] : 0.0f);
            }
          }
        }
      }
    }
  });
  return {pairs, worked};
}

}  // namespace lambent
