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
// Hits are looked up in tables larger than the caches: so many rays ahead.
constexpr size_t lookahead = 16;

bool is_grey(Vec3 c) { return c.x == c.y && c.y == c.z; }

// What one ray adds to the row of its receiver at one corner of the triangle that it met.
struct Record {
  uint32_t column;
  Vec3 weight;
};

// The records of a block as its rays meet them, row after row, and room to sort them in.
struct Records {
  std::vector<Record> list;
  std::vector<uint32_t> row_ends;
  std::vector<uint64_t> order, other;  // column, index
  std::vector<uint8_t> row_of;
  std::vector<float> weights;
  void clear() { list.clear(), row_ends.clear(); }
};

// Merges records of the same column and row. A stable radix sort on 11 bits of the column at a time keeps rows in order within a
// column, and with them the order of every sum.
SparseBlock by_columns(Records& in, int channels, float unit, size_t column_limit) {
  const size_t n = in.list.size();
  in.order.resize(n), in.other.resize(n), in.row_of.resize(n), in.weights.clear();
  for (size_t row = 0, i = 0; row < in.row_ends.size(); ++row)
    for (; i < in.row_ends[row]; ++i) in.order[i] = uint64_t(in.list[i].column) << 32 | i, in.row_of[i] = uint8_t(row);
  for (int shift = 32; shift < 64 && column_limit >> (shift - 32); shift += 11) {
    uint32_t start[2049] = {};
    for (uint64_t o : in.order) ++start[(o >> shift & 2047) + 1];
    for (int k = 0; k < 2048; ++k) start[k + 1] += start[k];
    for (uint64_t o : in.order) in.other[start[o >> shift & 2047]++] = o;
    std::swap(in.order, in.other);
  }
  SparseBlock out;
  out.row_count = in.row_ends.size();
  out.rows.reserve(n);
  uint32_t column = none;
  for (size_t i = 0; i < n;) {
    const uint32_t first = uint32_t(in.order[i]);
    const uint8_t row = in.row_of[first];
    const uint32_t here = uint32_t(in.order[i] >> 32);
    Vec3 weight = in.list[first].weight;
    for (++i; i < n && uint32_t(in.order[i] >> 32) == here && in.row_of[uint32_t(in.order[i])] == row; ++i)
      weight += in.list[uint32_t(in.order[i])].weight;
    if (here != column) {
      if (column != none) out.ends.push_back(uint32_t(out.rows.size()));
      out.columns.push_back(here), column = here;
    }
    out.rows.push_back(row);
    for (int c = 0; c < channels; ++c) in.weights.push_back(weight[c] * unit);
  }
  if (column != none) out.ends.push_back(uint32_t(out.rows.size()));
  out.weights.resize(in.weights.size());
  floats_to_halves(in.weights.data(), in.weights.size(), out.weights.data());
  return out;
}

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

struct GatherScratch {
  Fan fan;
  std::vector<Hit> hits;
  Records records, half_records;
  explicit GatherScratch(const DirectionSets& sets) : fan(sets), hits(size_t(sets.samples)) {}
};
void DeleteScratch::operator()(GatherScratch* scratch) const { delete scratch; }
ScratchPointer make_gather_scratch(const GatherSetup& setup) { return ScratchPointer(new GatherScratch(setup.sets)); }

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

void trace_gather(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, GatherBlock* block, const GatherSky* sky) {
  LAMBENT_CHECK(count <= gather_block);
  const DirectionSets& sets = setup.sets;
  const size_t coefficients = setup.coefficients(), rays = size_t(sets.samples), half = std::min(sets.half, rays);
  Fan& fan = scratch.fan;
  const std::vector<Hit>& hits = scratch.hits;
  Records& records = scratch.records;
  Records& half_records = scratch.half_records;
  records.clear(), half_records.clear();
  for (size_t i = 0; i < count; ++i) {
    const size_t r = first + i, begin = records.list.size();
    setup.tracer.closest_fan(setup.receivers.origins[r], fan.aim(setup.receivers.normals[r], setup.seed, r), scratch.hits.data());
    records.list.resize(begin + 3 * rays);
    Record* out = records.list.data() + begin;
    Record* out_at_half = nullptr;
    size_t backs = 0;
    for (size_t j = 0; j < rays; ++j) {
      if (j == half) out_at_half = out;
      if (j + lookahead < rays) setup.corners.prefetch(hits[j + lookahead].triangle, hits[j + lookahead].front);
      const Hit& h = hits[j];
      fan.visible[j] = h.triangle == none ? 1.0f : 0.0f;
      if (h.triangle == none) continue;
      const Corners* corner = setup.corners.find(h.triangle, h.front);
      if (!corner) {
        ++backs;
        continue;
      }
      const Vec3 rho = setup.part_varies[corner->part] ? albedo(setup.scene, setup.scene.triangles[h.triangle], h.u, h.v)
                                                       : setup.part_albedo[corner->part];
      *out++ = {corner->receiver[0], rho * (1 - h.u - h.v)};
      *out++ = {corner->receiver[1], rho * h.u};
      *out++ = {corner->receiver[2], rho * h.v};
    }
    if (!out_at_half) out_at_half = out;
    const size_t length = size_t(out - (records.list.data() + begin)), half_length = size_t(out_at_half - (records.list.data() + begin));
    records.list.resize(begin + length);
    records.row_ends.push_back(uint32_t(records.list.size()));
    if (block && r % check_every == 0) {
      const auto from = records.list.begin() + ptrdiff_t(begin);
      half_records.list.insert(half_records.list.end(), from, from + ptrdiff_t(half_length));
      half_records.row_ends.push_back(uint32_t(half_records.list.size()));
    }
    if (sky) {
      fan.project(sky->rows + i * coefficients, checked_row(sky->half_rows, first, r, coefficients));
      sky->buried[i] = 2 * backs > rays;
    }
  }
  if (block) {
    block->rows = by_columns(records, setup.channels, setup.weight_unit, setup.receivers.count());
    block->half_rows = by_columns(half_records, setup.channels, setup.weight_unit, setup.receivers.count());
  }
}

void trace_sky(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, const GatherSky& sky) {
  const DirectionSets& sets = setup.sets;
  const size_t coefficients = setup.coefficients(), rays = size_t(sets.samples);
  Fan& fan = scratch.fan;
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
      const auto& r = c.receiver;
      if (r[0] == none) continue;
      for (int k = 0; k < 3; ++k)
        for (int j = 1; j < 3; ++j)
          if (buried[r[k]] && r[k] != r[(k + j) % 3]) edges.push_back({r[k], r[(k + j) % 3]});
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
