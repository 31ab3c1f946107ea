// Follows: general-prt (transfer by the Neumann recursion, interpolated between receivers), radiosity (the same operator).
#include <lambent/bake/gather.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>

#include <algorithm>
#include <cstring>

namespace lambent {
namespace {

// A handful of sets keeps the tables in cache; the spin makes every receiver's directions its own.
constexpr int set_count = 8;
// Rays of the second look at dark receivers, when only occlusion was traced.
constexpr size_t burial_rays = 64;

bool is_grey(Vec3 c) { return c.x == c.y && c.y == c.z; }

// Entries of a block as its rays meet them, row after row.
struct UnsortedEntries {
  size_t row_count = 0;
  std::vector<uint32_t> columns;
  std::vector<uint8_t> rows;
  std::vector<uint16_t> weights;
};

// Sorted by column, rows in order within each: a stable radix sort on 11 bits at a time.
SparseBlock by_columns(const UnsortedEntries& in, int channels, size_t column_limit) {
  const size_t n = in.columns.size();
  std::vector<uint32_t> order(n), other(n);
  for (size_t i = 0; i < n; ++i) order[i] = uint32_t(i);
  for (int shift = 0; shift < 32 && column_limit >> shift; shift += 11) {
    uint32_t start[2049] = {};
    for (uint32_t c : in.columns) ++start[(c >> shift & 2047) + 1];
    for (int k = 0; k < 2048; ++k) start[k + 1] += start[k];
    for (uint32_t i : order) other[start[in.columns[i] >> shift & 2047]++] = i;
    std::swap(order, other);
  }
  SparseBlock out;
  out.row_count = in.row_count;
  out.rows.resize(n), out.weights.resize(n * size_t(channels));
  for (size_t i = 0; i < n; ++i) {
    const size_t from = order[i];
    if (out.columns.empty() || out.columns.back() != in.columns[from]) {
      if (!out.columns.empty()) out.ends.push_back(uint32_t(i));
      out.columns.push_back(in.columns[from]);
    }
    out.rows[i] = in.rows[from];
    for (size_t c = 0; c < size_t(channels); ++c) out.weights[i * size_t(channels) + c] = in.weights[from * size_t(channels) + c];
  }
  if (!out.columns.empty()) out.ends.push_back(uint32_t(n));
  return out;
}

// Sums weights by receiver. Open addressing; the entries come out in the order in which they were first met.
class RowAccumulator {
 public:
  explicit RowAccumulator(size_t rays) {
    size_t capacity = 16;
    while (capacity < 6 * rays) capacity *= 2;
    slots_.assign(capacity, {none, Vec3(0)});
    touched_.reserve(3 * rays);
  }
  void add(uint32_t receiver, Vec3 weight) {
    size_t i = size_t(receiver * 0x9e3779b1u) & (slots_.size() - 1);
    while (slots_[i].receiver != receiver) {
      if (slots_[i].receiver == none) {
        slots_[i].receiver = receiver;
        touched_.push_back(uint32_t(i));
        break;
      }
      i = (i + 1) & (slots_.size() - 1);
    }
    slots_[i].weight += weight;
  }
  void append_to(UnsortedEntries& entries, int channels, float unit) const {
    for (uint32_t i : touched_) {
      entries.columns.push_back(slots_[i].receiver);
      entries.rows.push_back(uint8_t(entries.row_count));
      for (int c = 0; c < channels; ++c) entries.weights.push_back(float_to_half(slots_[i].weight[c] * unit));
    }
    ++entries.row_count;
  }
  void clear() {
    for (uint32_t i : touched_) slots_[i] = {none, Vec3(0)};
    touched_.clear();
  }

 private:
  struct Slot {
    uint32_t receiver;
    Vec3 weight;
  };
  std::vector<Slot> slots_;
  std::vector<uint32_t> touched_;
};

// One receiver's directions in world space, and the sky row of a visibility.
struct Fan {
  const DirectionSets& sets;
  ShZyzRotator rotator;
  AlignedVector<float> x, y, z, visible;
  std::vector<float> half, rest;
  DirectionChoice choice{};

  explicit Fan(const DirectionSets& s)
      : sets(s), rotator(s.order), x(s.stride), y(s.stride), z(s.stride), visible(s.stride), half(size_t(sh_count(s.order))),
        rest(half.size()) {}

  Directions aim(Vec3 normal, uint32_t seed, size_t receiver) {
    choice = choose_directions(sets, normal, seed, receiver);
    const size_t base = size_t(choice.set) * sets.stride;
    rotate_directions(choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride, x.data(),
                      y.data(), z.data());
    return {x.data(), y.data(), z.data(), size_t(sets.samples)};
  }

  // T0: the mean of V y over cosine-distributed directions, which is the integral of V y cos / pi.
  void project(float* row, float* half_row) {
    const size_t coefficients = half.size();
    const float* table = sets.table.data() + size_t(choice.set) * coefficients * sets.stride;
    weighted_rows(table, coefficients, sets.stride, visible.data(), sets.half >= size_t(sets.samples) ? sets.stride : sets.half,
                  half.data());
    std::fill(rest.begin(), rest.end(), 0.0f);
    if (sets.half < size_t(sets.samples))
      weighted_rows(table + sets.half, coefficients, sets.stride, visible.data() + sets.half, sets.stride - sets.half, rest.data());
    for (size_t k = 0; k < coefficients; ++k) row[k] = (half[k] + rest[k]) / float(sets.samples);
    rotator.rotate(choice.a, choice.b, choice.c, {row, coefficients});
    if (!half_row) return;
    const float rays = float(std::min(sets.half, size_t(sets.samples)));
    for (size_t k = 0; k < coefficients; ++k) half_row[k] = half[k] / rays;
    rotator.rotate(choice.a, choice.b, choice.c, {half_row, coefficients});
  }
};

// Index of a checked receiver among those of the block that begins at `first`.
float* checked_row(float* rows, size_t first, size_t receiver, size_t coefficients) {
  if (!rows || receiver % check_every) return nullptr;
  return rows + (receiver / check_every - (first + check_every - 1) / check_every) * coefficients;
}

}  // namespace

GatherSetup make_gather_setup(const Scene& scene, const Tracer& tracer, const Receivers& receivers, int order, int samples, uint32_t seed) {
  GatherSetup setup{scene, tracer, receivers, corner_receivers(scene, receivers.front, receivers.back),
                    make_direction_sets(order, samples, set_count, seed), seed, 1, 1.0f, {}, {}};
  // Weights are sums over rays: halves hold 65504.
  setup.weight_unit = std::min(1.0f, 16384.0f / float(samples));
  bool coloured = false;
  for (const Part& part : scene.parts) {
    const Material& m = scene.materials[part.material];
    setup.part_albedo.push_back(m.base_color);
    setup.part_varies.push_back(m.base_color_texture >= 0 || !scene.colors.empty());
    coloured |= setup.part_varies.back() || !is_grey(m.base_color);
  }
  setup.channels = coloured ? 3 : 1;
  return setup;
}

void trace_gather(const GatherSetup& setup, size_t first, size_t count, GatherBlock* block, const GatherSky* sky) {
  LAMBENT_CHECK(count <= gather_block);
  const DirectionSets& sets = setup.sets;
  const size_t coefficients = setup.coefficients(), rays = size_t(sets.samples);
  Fan fan(sets);
  RowAccumulator row(rays);
  std::vector<Hit> hits(rays);
  UnsortedEntries entries, half_entries;
  for (size_t i = 0; i < count; ++i) {
    const size_t r = first + i;
    const bool checked = r % check_every == 0;
    setup.tracer.closest_fan(setup.receivers.origins[r], fan.aim(setup.receivers.normals[r], setup.seed, r), hits.data());
    size_t backs = 0;
    for (size_t j = 0; j < rays; ++j) {
      const Hit& h = hits[j];
      fan.visible[j] = h.triangle == none ? 1.0f : 0.0f;
      if (block && checked && j == sets.half) row.append_to(half_entries, setup.channels, setup.weight_unit);
      if (h.triangle == none) continue;
      const auto* corner = setup.corners.find(h.triangle, h.front);
      if (!corner) {
        ++backs;
        continue;
      }
      if (!block) continue;
      const Triangle& t = setup.scene.triangles[h.triangle];
      const Vec3 rho = setup.part_varies[t.part] ? albedo(setup.scene, t, h.u, h.v) : setup.part_albedo[t.part];
      row.add((*corner)[0], rho * (1 - h.u - h.v));
      row.add((*corner)[1], rho * h.u);
      row.add((*corner)[2], rho * h.v);
    }
    if (block) {
      if (checked && sets.half >= rays) row.append_to(half_entries, setup.channels, setup.weight_unit);
      row.append_to(entries, setup.channels, setup.weight_unit);
      row.clear();
    }
    if (sky) {
      fan.project(sky->rows + i * coefficients, checked_row(sky->half_rows, first, r, coefficients));
      sky->buried[i] = 2 * backs > rays;
    }
  }
  if (block) {
    block->rows = by_columns(entries, setup.channels, setup.receivers.count());
    block->half_rows = by_columns(half_entries, setup.channels, setup.receivers.count());
  }
}

void trace_sky(const GatherSetup& setup, size_t first, size_t count, const GatherSky& sky) {
  const DirectionSets& sets = setup.sets;
  const size_t coefficients = setup.coefficients(), rays = size_t(sets.samples);
  Fan fan(sets);
  float fx[burial_rays], fy[burial_rays], fz[burial_rays];
  Hit hits[burial_rays];
  for (size_t i = 0; i < count; ++i) {
    const size_t r = first + i;
    const Vec3 origin = setup.receivers.origins[r];
    setup.tracer.visible_fan(origin, fan.aim(setup.receivers.normals[r], setup.seed, r), fan.visible.data());
    fan.project(sky.rows + i * coefficients, checked_row(sky.half_rows, first, r, coefficients));
    size_t seen = 0;
    for (size_t j = 0; j < rays; ++j) seen += fan.visible[j] > 0;
    sky.buried[i] = 0;
    if (2 * seen >= rays) continue;
    const size_t n = std::min(burial_rays, rays);
    for (size_t k = 0; k < n; ++k) {
      const size_t j = k * rays / n;
      fx[k] = fan.x[j], fy[k] = fan.y[j], fz[k] = fan.z[j];
    }
    setup.tracer.closest_fan(origin, {fx, fy, fz, n}, hits);
    size_t backs = 0;
    for (size_t k = 0; k < n; ++k) backs += hits[k].triangle != none && !setup.corners.find(hits[k].triangle, hits[k].front);
    sky.buried[i] = 2 * backs > n;
  }
}

void multiply_rows(const SparseBlock& block, int channels, const float* x, size_t width, float scale, float* y) {
  const size_t values = block.row_count * width;
  std::fill(y, y + values, 0.0f);
  multiply_entries({block.columns.data(), block.ends.data(), block.columns.size(), block.rows.data(), block.weights.data()}, channels, x,
                   width, y);
  for (size_t i = 0; i < values; ++i) y[i] *= scale;
}

std::vector<FillStep> make_fill_steps(const CornerReceivers& corners, const std::vector<uint8_t>& buried) {
  std::vector<std::pair<uint32_t, uint32_t>> edges;  // (buried receiver, neighbour)
  for (const auto* side : {&corners.front, &corners.back})
    for (const auto& c : *side) {
      if (c[0] == none) continue;
      for (int k = 0; k < 3; ++k)
        for (int j = 1; j < 3; ++j)
          if (buried[c[k]] && c[k] != c[(k + j) % 3]) edges.push_back({c[k], c[(k + j) % 3]});
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());

  std::vector<FillStep> steps;
  std::vector<uint8_t> waiting = buried;
  for (bool grew = true; grew;) {  // layer by layer from the receivers that are clear
    grew = false;
    const size_t layer = steps.size();
    for (size_t begin = 0; begin < edges.size();) {
      size_t end = begin;
      const uint32_t r = edges[begin].first;
      FillStep step{r, {}};
      for (; end < edges.size() && edges[end].first == r; ++end)
        if (!waiting[edges[end].second]) step.sources.push_back(edges[end].second);
      if (waiting[r] && !step.sources.empty()) steps.push_back(std::move(step)), grew = true;
      begin = end;
    }
    for (size_t i = layer; i < steps.size(); ++i) waiting[steps[i].receiver] = 0;
  }
  return steps;
}

void fill_buried(const std::vector<FillStep>& steps, float* values, size_t stride, size_t width) {
  for (const FillStep& step : steps) {
    float* out = values + size_t(step.receiver) * stride;
    std::fill(out, out + width, 0.0f);
    for (uint32_t s : step.sources)
      for (size_t j = 0; j < width; ++j) out[j] += values[size_t(s) * stride + j] / float(step.sources.size());
  }
}

}  // namespace lambent
