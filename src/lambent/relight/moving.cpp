#include <lambent/relight/moving.h>

#include <lambent/relight/hidden_table.h>
#include <lambent/relight/moving_kernels.h>

#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace lambent {
namespace {

constexpr float whole_sphere = 3.5449077f;  // of the constant 1: sqrt(4 pi)

float share_of_sphere(float radius, float distance) {
  return distance > radius ? 0.25f * (radius / distance) * (radius / distance) : 1.0f;
}

// An object that hides something from a tile's receivers: those that `wanted` has.
struct Met {
  size_t object = 0;
  float distance = 0;
  uint64_t wanted = 0;
};

// What a tile of receivers does with one object after another.
struct TileWork {
  AlignedVector<float> product, next;
  std::vector<AlignedVector<float>> factors;
  AlignedVector<float> rows, light, by_receiver;
  TileMix mix;
  TableMix table_mix;
  alignas(64) float open[sh_tile], shut[sh_tile], before[3 * sh_tile], after[3 * sh_tile], sums[4 * sh_tile];
  std::vector<Met> met;  // nearest first
};

// Objects that hide something of a tile, nearest first; pairs of a receiver and an object.
size_t find_near(const MovingReceivers& r, size_t tile, std::span<const PlacedObject* const> objects, float least,
                 TileWork& work) {
  const size_t count = std::min(sh_tile, r.count - tile * sh_tile);
  const MovingReceivers::Tile& of = r.tiles[tile];
  size_t pairs = 0;
  work.met.clear();
  for (size_t k = 0; k < objects.size(); ++k) {
    const PlacedObject& object = *objects[k];
    const float distance = length(object.place.position - of.center), radius = object.radius();
    if (share_of_sphere(radius, distance - of.radius) < least) continue;
    const uint64_t wanted = near_of_tile(r.lanes.data() + tile * 6 * sh_tile, count, object.place.position, radius,
                                         0.25f * radius * radius / least);
    if (wanted != 0) work.met.push_back({k, distance, wanted});
    pairs += size_t(std::popcount(wanted));
  }
  std::stable_sort(work.met.begin(), work.met.end(),
                   [](const Met& a, const Met& b) { return a.distance < b.distance; });
  return pairs;
}

// What an object lets pass to each receiver of a tile.
void factor_of(const PlacedObject& object, const MovingReceivers& r, size_t first, size_t count, uint64_t asked,
               AlignedVector<float>& factor, TileWork& work) {
  const size_t n = size_t(sh_count(object.light->order)), stride = object.stride();
  uint8_t wanted[sh_tile];
  for (size_t i = 0; i < sh_tile; ++i) wanted[i] = asked >> i & 1;
  factor.resize(n * sh_tile);
  rows_of_tile(object.light->shells, object.light->log_radii, object.place, object.values, stride,
               std::span(r.positions).subspan(first, count), wanted, work.mix, work.rows);
  factor_of_tile(work.rows.data(), stride, n, whole_sphere, factor.data());
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
  MovingReceivers out{t.receivers, t.light.order, t.channels, {}, {}, {}, {}, {}, {}, {}, {}};
  const size_t n = t.columns(), tiles = (t.receivers + sh_tile - 1) / sh_tile, channels = size_t(t.channels);
  out.positions.resize(t.receivers), out.normals.resize(t.receivers), out.tiles.resize(tiles);
  out.transfer.resize(tiles * channels * n * sh_tile), out.lobes.resize(tiles * 9 * sh_tile);
  out.lanes.resize(tiles * 6 * sh_tile);
  const bool turned = !(place.rotation == Mat3(1.0f));
  parallel_for(tiles, 1, [&](size_t begin, size_t end) {
    for (size_t tile = begin; tile < end; ++tile) {
      const size_t first = tile * sh_tile, last = std::min(first + sh_tile, t.receivers);
      Bounds box;
      for (size_t r = first; r < last; ++r) {
        out.positions[r] = place.position + place.scale * (place.rotation * (positions[r] - center));
        out.normals[r] = place.rotation * normals[r];
        box.extend(out.positions[r]);
        for (int k = 0; k < 3; ++k) {
          out.lanes[(tile * 6 + size_t(k)) * sh_tile + r - first] = out.positions[r][k];
          out.lanes[(tile * 6 + 3 + size_t(k)) * sh_tile + r - first] = out.normals[r][k];
        }
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

void arrange_rows(MovingReceivers& r) {
  const size_t n = size_t(sh_count(r.order)), stride = (n + 15) / 16 * 16, channels = size_t(r.channels);
  r.rows.assign(r.tiles.size() * sh_tile * channels * stride, uint16_t{0});
  r.lobe_rows.assign(r.tiles.size() * sh_tile * 16, uint16_t{0});
  parallel_for(r.tiles.size(), 1, [&](size_t begin, size_t end) {
    for (size_t at = begin * sh_tile; at < end * sh_tile; ++at) {
      const size_t tile = at / sh_tile, i = at % sh_tile;
      for (size_t c = 0; c < channels; ++c)
        for (size_t k = 0; k < n; ++k)
          r.rows[(at * channels + c) * stride + k] =
              float_to_half(r.transfer[((tile * channels + c) * n + k) * sh_tile + i]);
      for (size_t k = 0; k < 9; ++k) r.lobe_rows[at * 16 + k] = float_to_half(r.lobes[(tile * 9 + k) * sh_tile + i]);
    }
  });
}

MovingShader::MovingShader() = default;
MovingShader::MovingShader(MovingShader&&) noexcept = default;
MovingShader& MovingShader::operator=(MovingShader&&) noexcept = default;
MovingShader::~MovingShader() = default;

// Tables where there are receivers enough that products for them would take more multiply-adds.
void MovingShader::make_tables(const MovingReceivers& r, std::span<const PlacedObject* const> objects,
                               const MovingOptions& options, std::span<const MovingLight> lights) {
  constexpr size_t most_bytes = size_t{128} << 20;
  tables_.resize(objects.size());
  for (size_t k = 0; k < objects.size(); ++k) {
    const PlacedObject& object = *objects[k];
    const std::vector<float>& radii = object.light->shells.radii;
    HiddenTable& table = tables_[k];
    table.shells = 0;
    if (r.rows.empty() || std::any_of(lights.begin(), lights.end(), [](const MovingLight& l) { return l.each; }))
      continue;
    size_t tiles = 0;
    float from = INFINITY, to = 0;
    for (const MovingReceivers::Tile& tile : r.tiles) {
      const float distance = length(object.place.position - tile.center);
      if (share_of_sphere(object.radius(), distance - tile.radius) < options.least_share) continue;
      ++tiles, from = std::min(from, distance - tile.radius), to = std::max(to, distance + tile.radius);
    }
    if (tiles == 0) continue;
    to = std::min(to, 0.5f * object.radius() / std::sqrt(options.least_share));
    const auto below = [&](float distance) {  // shells no larger
      return int(std::upper_bound(radii.begin(), radii.end(), distance / object.place.scale) - radii.begin());
    };
    const int first = std::max(below(from) - 1, 0), last = std::min(below(to), int(radii.size()) - 1);
    const ShTileProduct& product = products_.at(r.order, object.light->order, options.light_order);
    const size_t side = size_t(object.light->shells.side), points = size_t(last - first + 1) * side * side;
    const size_t groups = 3 * lights.size() + options.bounced, n = size_t(sh_count(r.order));
    const size_t by_table = points * groups * n * size_t(sh_count(object.light->order)),
                 by_products = tiles * sh_tile * size_t(r.channels) * (product.value.size() + product.rows.size());
    if (by_table > by_products || points * groups * (n + 15) * 8 > most_bytes) continue;
    make_hidden_table(object, product, lights, options.bounced, first, last - first + 1, table);
  }
}

namespace {

// One tile: its transfer times what all objects let pass that it meets, the last of them by its table if it has one.
class TileShade {
 public:
  TileShade(const MovingReceivers& r, std::span<const PlacedObject* const> objects, const MovingOptions& options,
            std::span<const MovingLight> lights, const ShTileProducts& products, const std::vector<HiddenTable>& tables,
            TileWork& work)
      : r_(r), objects_(objects), o_(options), lights_(lights), products_(products), tables_(tables), work_(work) {}

  void shade(size_t tile) {
    const size_t first = tile * sh_tile, count = std::min(sh_tile, r_.count - first), met = work_.met.size();
    const HiddenTable* table = tables_[work_.met.back().object].shells > 0 ? &tables_[work_.met.back().object]
                                                                           : nullptr;
    const size_t factors = met - (table ? 1 : 0);
    std::fill_n(work_.open, sh_tile, 1.0f);
    if (work_.factors.size() < factors) work_.factors.resize(factors);
    for (size_t f = 0; f < factors; ++f) {
      const PlacedObject& object = *objects_[work_.met[f].object];
      factor_of(object, r_, first, count, work_.met[f].wanted, work_.factors[f], work_);
      if (o_.bounced)
        open_of_tile(r_.lobes.data() + first * 9, work_.factors[f].data(),
                     size_t(std::min(9, sh_count(object.light->order))), work_.open);
    }
    if (table) begin_table(*table, tile, factors == 0);
    if (table && factors == 0) return by_table_alone(*table, tile, count);
    const size_t n = size_t(sh_count(r_.order));
    for (size_t c = 0; c < size_t(r_.channels); ++c) {
      const float* rows = r_.transfer.data() + (tile * size_t(r_.channels) + c) * n * sh_tile;
      const float* a = rows;
      for (size_t f = 0; f < factors; ++f) {
        const int bands = f + 1 == met ? o_.light_order : r_.order;
        multiply_sh_tile(products_.at(r_.order, objects_[work_.met[f].object]->light->order, bands), a,
                         work_.factors[f].data(), work_.next.data());
        std::swap(work_.product, work_.next), a = work_.product.data();
      }
      if (table) rows_from_tile(a, n, table->stride, work_.by_receiver.data());
      for (size_t l = 0; l < lights_.size(); ++l) {
        if (o_.bounced) light_of_tile(rows, lights_[l], lit(), first, count, work_.before);
        if (table) dot_rest(*table, l);
        else light_of_tile(a, lights_[l], lit(), first, count, work_.after);
        store(lights_[l], c, first, count);
      }
    }
  }

 private:
  size_t lit() const { return size_t(sh_count(o_.light_order)); }

  // What of the light beside the objects' the last one leaves open, where light that has bounced is dimmed by it.
  void begin_table(const HiddenTable& table, size_t tile, bool alone) {
    const Met& last = work_.met.back();
    mix_table(*objects_[last.object], table, r_.lanes.data() + tile * 6 * sh_tile, last.wanted, work_.table_mix);
    if (o_.bounced) {
      std::fill_n(work_.shut, sh_tile, 0.0f);
      dot_table_open(table, work_.table_mix, last.wanted, r_.lobe_rows.data() + tile * sh_tile * 16, work_.shut);
      for (size_t i = 0; i < sh_tile; ++i) work_.open[i] *= std::clamp(1 - work_.shut[i], 0.0f, 1.0f);
    }
    if (alone) return;
    std::fill_n(work_.shut, sh_tile, 1.0f);
    work_.by_receiver.resize(sh_tile * table.stride);
  }

  // [r, g, b][coefficient, padded]
  const float* padded_light(const HiddenTable& table, const MovingLight& light) {
    work_.light.assign(3 * table.stride, 0.0f);
    for (size_t k = 0; k < lit(); ++k)
      for (size_t c = 0; c < 3; ++c) work_.light[c * table.stride + k] = light.light[k][int(c)];
    return work_.light.data();
  }

  // No product: what there was, less what is hidden of it; and light that has bounced, dimmed.
  void by_table_alone(const HiddenTable& table, size_t tile, size_t count) {
    const size_t channels = size_t(r_.channels), first = tile * sh_tile;
    if (o_.bounced)
      for (size_t i = 0; i < sh_tile; ++i) work_.shut[i] = 1 - work_.open[i];
    const uint64_t wanted = work_.met.back().wanted;
    for (size_t l = 0; l < lights_.size(); ++l) {
      if (wanted != ~uint64_t{0}) std::fill_n(work_.sums, 4 * sh_tile, 0.0f);
      dot_table(table, 3 * l, work_.table_mix, wanted,
                {r_.rows.data() + first * channels * table.stride, nullptr, channels * table.stride,
                 channels == 3 ? table.stride : 0},
                {o_.bounced ? padded_light(table, lights_[l]) : nullptr, work_.shut}, work_.sums);
      add_sums(work_.sums, work_.open, count, lights_[l].values->values.data() + first * 3);
    }
  }

  // What of a product, by receiver, the last object leaves.
  void dot_rest(const HiddenTable& table, size_t l) {
    dot_table(table, 3 * l, work_.table_mix, ~uint64_t{0}, {nullptr, work_.by_receiver.data(), table.stride, 0},
              {padded_light(table, lights_[l]), work_.shut}, work_.sums);
    for (size_t i = 0; i < sh_tile; ++i)
      for (size_t c = 0; c < 3; ++c) work_.after[c * sh_tile + i] = work_.sums[4 * i + c];
  }

  void store(const MovingLight& light, size_t channel, size_t first, size_t count) const {
    for (size_t k = 0; k < 3; ++k) {
      if (r_.channels == 3 && k != channel) continue;
      for (size_t i = 0; i < count; i += transfer_block) {
        float* value = light.values->values.data() + ((first + i) / transfer_block * 3 + k) * transfer_block;
        const size_t at = k * sh_tile + i, end = std::min(transfer_block, count - i);
        for (size_t j = 0; j < end; ++j)
          value[j] = work_.after[at + j] + (o_.bounced ? (value[j] - work_.before[at + j]) * work_.open[i + j] : 0.0f);
      }
    }
  }

  const MovingReceivers& r_;
  std::span<const PlacedObject* const> objects_;
  const MovingOptions& o_;
  std::span<const MovingLight> lights_;
  const ShTileProducts& products_;
  const std::vector<HiddenTable>& tables_;
  TileWork& work_;
};

}  // namespace

MovingCount MovingShader::shade(const MovingReceivers& r, std::span<const PlacedObject* const> objects,
                                const MovingOptions& options, std::span<const MovingLight> lights) {
  const size_t n = size_t(sh_count(r.order));
  LAMBENT_CHECK(options.light_order >= 1 && options.light_order <= r.order);
  for (const PlacedObject* object : objects)  // before any thread asks
    products_.make(r.order, object->light->order, r.order),
        products_.make(r.order, object->light->order, options.light_order);
  make_tables(r, objects, options, lights);
  std::atomic<size_t> pairs{0}, worked{0};
  parallel_for(r.tiles.size(), 1, [&](size_t begin, size_t end) {
    thread_local TileWork work;
    work.product.resize(n * sh_tile), work.next.resize(n * sh_tile);
    TileShade shade(r, objects, options, lights, products_, tables_, work);
    for (size_t tile = begin; tile < end; ++tile) {
      const size_t met = find_near(r, tile, objects, options.least_share, work);
      if (met == 0) continue;
      shade.shade(tile);
      pairs += met, ++worked;
    }
  });
  const auto tables = std::count_if(tables_.begin(), tables_.end(), [](const HiddenTable& t) { return t.shells > 0; });
  return {pairs, worked, size_t(tables)};
}

}  // namespace lambent
