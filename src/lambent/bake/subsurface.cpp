// Follows: local-deformable-prt, section 6, by analogue random walks run backwards: from the receiver into the medium
// and out to the light. Radiance over the square of the index is what keeps along a path through boundaries, so that no
// other factor stands at them than what is let through, and a walk that is chosen by it carries weight 1.
#include <lambent/bake/gather.h>
#include <lambent/bake/solve.h>
#include <lambent/bake/walk.h>
#include <lambent/core/check.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <atomic>

namespace lambent {
namespace {

constexpr size_t walk_grain = 4;  // receivers: walks are long

struct HitEntry {
  uint32_t receiver;
  Vec3 weight;
};

// What `count` receivers' walks bring.
struct WalkSums {
  std::vector<HitEntry> entries;
  std::vector<uint32_t> ends;
  size_t walks = 0, lost = 0, events = 0;
  double difference = 0, total = 0;
};

void merge(std::vector<HitEntry>& entries, size_t from) {
  std::stable_sort(entries.begin() + ptrdiff_t(from), entries.end(),
                   [](const HitEntry& a, const HitEntry& b) { return a.receiver < b.receiver; });
  size_t end = from;
  for (size_t i = from; i < entries.size(); ++i)
    if (end > from && entries[end - 1].receiver == entries[i].receiver) entries[end - 1].weight += entries[i].weight;
    else entries[end++] = entries[i];
  entries.resize(end);
}

// Rows of walks: what leaves where a walk comes out and meets a surface again is that receiver's own transfer.
struct WalkRows final : LinearOperator {
  const Scene& scene;
  const Receivers& receivers;
  const BakeOptions& options;
  const SubsurfaceOptions& subsurface;
  size_t C, channels, fixed;  // fixed: bytes beside the rows
  std::vector<Walker> walkers;
  Progress* progress;

  std::vector<float> T0 = std::vector<float>(rows() * width());  // [receiver][channel][coefficient]
  std::vector<uint8_t> buried = std::vector<uint8_t>(rows());
  std::vector<WalkSums> sums = std::vector<WalkSums>((rows() + walk_grain - 1) / walk_grain);
  std::atomic<size_t> entry_count{0};
  std::vector<FillStep> fill_steps{};

  WalkRows(const Scene& s, const Receivers& r, const BakeOptions& o, const SubsurfaceOptions& sub, size_t C_,
           size_t channels_, size_t fixed_, std::vector<Walker> w, Progress* p)
      : scene(s),
        receivers(r),
        options(o),
        subsurface(sub),
        C(C_),
        channels(channels_),
        fixed(fixed_),
        walkers(std::move(w)),
        progress(p) {}

  size_t width() const { return C * channels; }
  size_t samples() const { return size_t(options.samples); }
  size_t half() const { return samples() / 2; }
  size_t bytes() const { return fixed + entry_count * sizeof(HitEntry); }

  size_t rows() const override { return receivers.count(); }
  size_t piece() const override { return walk_grain; }
  bool is_filled(size_t row) const override { return buried[row]; }
  void fill(float* x, size_t w) const override { fill_buried(fill_steps, x, w, w); }
  void add_rows(size_t first, size_t count, const float* x, size_t w, float* y, float*) const override {
    const WalkSums& sum = sums[first / walk_grain];
    for (size_t i = 0; i < count; ++i)
      for (size_t e = i == 0 ? 0 : sum.ends[i - 1]; e < sum.ends[i]; ++e)
        for (size_t c = 0; c < channels; ++c) {
          const float* from = x + size_t(sum.entries[e].receiver) * w + c * C;
          for (size_t k = 0; k < C; ++k) y[i * w + c * C + k] += sum.entries[e].weight[int(c)] * from[k];
        }
  }

  // One walk of colour m from under a receiver along its ray: direct light into row, a surface met into the entries.
  struct Start {
    Vec3 position, into;
    float through;  // share that the boundary lets out along the ray
    uint64_t key;
    uint32_t ray;
  };
  void walk(const Start& start, size_t m, float* row, std::vector<float>& y, WalkSums& sum) const {
    Random random(start.key, start.ray);  // alike for all colours, so that their noise is
    const WalkEnd end = walkers[m].walk(start.position, start.into, random, sum.events);
    ++sum.walks, sum.lost += end.how == WalkEnd::lost;
    if (end.how != WalkEnd::left) return;
    Passage passage;
    const Hit hit = walkers[m].tracer.closest(end.position, end.direction, passage);
    const size_t from = walkers.size() == 3 ? m : 0, to = walkers.size() == 3 ? m + 1 : channels;
    if (hit.triangle == none) {
      evaluate_sh(options.order, end.direction, y);
      for (size_t c = from; c < to; ++c)
        for (size_t k = 0; k < C; ++k) row[c * C + k] += start.through * passage.hit[int(c)] * y[k];
    } else if (options.bounces > 0) {
      Vec3 weight(0);
      for (size_t c = from; c < to; ++c) weight[int(c)] = start.through / float(samples());
      weight *= albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v) * passage.hit;
      std::visit(
          [&](const auto& basis) {
            if (const auto* at = basis.find(hit.triangle, hit.front))
              basis.spread(*at, hit.u, hit.v, [&](uint32_t q, float share) {
                sum.entries.push_back({q, share * weight});
              });
          },
          receivers.basis);
    }
  }

  // All walks of a receiver, from `start_at` under it. Half of the samples' row is left in half_row.
  void walk_all(size_t r, Vec3 start_at, const Mat3& frame, uint64_t key, std::vector<float>& half_row,
                std::vector<float>& y, WalkSums& sum) {
    const float eta = subsurface.medium.eta;
    const Vec3 up = receivers.normals[r];
    float* row = T0.data() + r * width();
    const size_t first_entry = sum.entries.size();
    for (size_t i = 0; i < samples(); ++i) {
      if (i % 256 == 0 && is_cancelled(progress)) return;
      if (i == half()) half_row.assign(row, row + width());
      const Vec3 local = square_to_cosine_hemisphere(sobol_owen(uint32_t(i), uint32_t(key >> 32))), out = frame * local;
      const float through = eta > 1 ? 1 - float(fresnel_reflectance(local.z, eta)) : 1.0f;
      const Vec3 into = eta > 1 ? refract(-out, -up, 1 / eta) : -out;
      for (size_t m = 0; m < walkers.size(); ++m) walk({start_at, into, through, key, uint32_t(i)}, m, row, y, sum);
    }
    merge(sum.entries, first_entry);
    for (size_t j = 0; j < width(); ++j) row[j] /= float(samples());
    if (half() == 0 || r % check_every) return;
    for (size_t j = 0; j < width(); ++j) {
      const double d = half_row[j] / float(half()) - row[j];
      sum.difference += d * d, sum.total += double(row[j]) * row[j];
    }
  }

  void trace(size_t r, std::vector<float>& half_row, std::vector<float>& y, WalkSums& sum) {
    const Tracer& tracer = walkers[0].tracer;
    const Vec3 origin = receivers.origins[r], up = receivers.normals[r];
    const Mat3 frame = frame_about(up);
    const uint64_t key = hash64(options.seed, r);
    buried[r] = is_buried(tracer, receivers, r);
    // The surface that the receiver lies on; one that lies on a back has no medium behind it, and stays dark.
    // A ray straight down a vertex may slip between its triangles, hence others beside it.
    Hit below = tracer.closest(origin, -up);
    for (int side = 0; side < 8 && (below.triangle == none || !below.front); ++side)
      below = tracer.closest(origin,
                             normalize(frame * Vec3(0.05f * std::cos(float(side)), 0.05f * std::sin(float(side)), -1)));
    const size_t before = sum.entries.size();
    if (!buried[r] && below.triangle != none && below.front)
      walk_all(r, walkers[0].beside(below, walkers[0].normal(below), -1), frame, key, half_row, y, sum);
    sum.ends.push_back(uint32_t(sum.entries.size()));
    entry_count += sum.entries.size() - before;
  }

  // Of walks that were kept: whether they are such as these receivers have.
  bool is_sound(const WalkSums& sum, size_t count) const {
    return sum.ends.size() == count && std::is_sorted(sum.ends.begin(), sum.ends.end()) &&
           sum.ends.back() == sum.entries.size() &&
           std::all_of(sum.entries.begin(), sum.entries.end(), [&](const HitEntry& e) { return e.receiver < rows(); });
  }

  bool load(const KeptPieces& pieces, size_t begin, size_t end) {
    WalkSums& sum = sums[begin / walk_grain];
    const std::span<float> row(T0.data() + begin * width(), (end - begin) * width());
    if (!pieces.load(begin / walk_grain, row, std::span(buried).subspan(begin, end - begin), sum.entries, sum.ends,
                     sum.walks, sum.lost, sum.events, sum.difference, sum.total))
      return false;
    if (!is_sound(sum, end - begin)) {
      pieces.refuse(), sum = {};
      std::fill(row.begin(), row.end(), 0.0f);
      return false;
    }
    entry_count += sum.entries.size();
    return true;
  }
  void save(const KeptPieces& pieces, size_t begin, size_t end) {
    WalkSums& sum = sums[begin / walk_grain];
    pieces.save(begin / walk_grain, std::span(T0).subspan(begin * width(), (end - begin) * width()),
                std::span(buried).subspan(begin, end - begin), sum.entries, sum.ends, sum.walks, sum.lost, sum.events,
                sum.difference, sum.total);
  }

  // Errors: cancelled; memory.
  Result<void> trace_all() {
    ProgressStage stage(progress, "walking", rows());
    const KeptPieces pieces(progress, "walking", sums.size());
    parallel_for(rows(), walk_grain, [&](size_t begin, size_t end) {
      std::vector<float> y(C), half_row(width());
      if (!load(pieces, begin, end)) {
        for (size_t r = begin; r < end; ++r) {
          if (stage.cancelled() || bytes() > options.memory) return;
          trace(r, half_row, y, sums[begin / walk_grain]);
        }
        save(pieces, begin, end);
      }
      stage.advance(end - begin);
    });
    if (stage.cancelled()) return Error{"", "cancelled"};
    if (bytes() > options.memory) return too_small(bytes());
    fill_steps = make_fill_steps(scene, receivers.basis, buried);
    fill(T0.data(), width());
    return {};
  }

  static Error too_small(size_t needed) {
    return {"memory", "is too small: this takes " + std::to_string(needed >> 20) + " MiB or more"};
  }

  void add_to(BakeReport& report, SubsurfaceReport& walks) const {
    double difference = 0, total = 0, lost = 0, events = 0, count = 0;
    for (const WalkSums& s : sums)
      difference += s.difference, total += s.total, lost += double(s.lost), events += double(s.events),
          count += double(s.walks);
    walks.lost = count > 0 ? lost / count : 0, walks.events = count > 0 ? events / count : 0;
    for (uint8_t b : buried) report.buried += b;
    report.receivers = rows(), report.rays = size_t(events);
    report.error = half() > 0 && total > 0 ? std::sqrt(difference / total) : -1;
    report.operator_bytes = entry_count * sizeof(HitEntry), report.working_memory = bytes();
  }
};

Result<void> check_options(const BakeOptions& o, const Medium& medium) {
  if (auto ok = check_light_basis(o, 1); !ok) return ok.error();
  if (!o.lobes.empty()) return Error{"light", "lobes do not go with a medium: its light is of harmonics alone"};
  if (auto ok = check_medium(medium); !ok) return ok.error();
  if (o.samples < 1 || o.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(o.samples)};
  if (o.bounces < 0 || o.bounces > 64)
    return Error{"bounces", "must lie between 0 and 64, not " + std::to_string(o.bounces)};
  return {};
}

}  // namespace

Result<Transfer> bake_subsurface(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                 const BakeOptions& options, const SubsurfaceOptions& subsurface,
                                 BakeReport* report_out, SubsurfaceReport* walks_out, Progress* progress) {
  if (auto ok = check_options(options, subsurface.medium); !ok) return ok.error();
  auto start = Clock::now();
  const GatherSetup setup =
      make_gather_setup(scene, tracer, receivers, 1, 16, options.seed);  // for what it knows of albedos
  std::vector<Walker> walkers = make_walkers(scene, tracer, subsurface);
  const size_t channels =
      walkers.size() == 3 || (options.bounces > 0 && setup.channels == 3) || setup.sky_channels == 3 ? 3 : 1;
  const size_t n = receivers.count(), C = size_t(sh_count(options.order)), width = C * channels;
  const size_t fixed = 3 * n * width * sizeof(float);
  if (fixed > options.memory) return WalkRows::too_small(fixed);

  WalkRows rows(scene, receivers, options, subsurface, C, channels, fixed, std::move(walkers), progress);
  if (auto ok = rows.trace_all(); !ok) return ok.error();
  BakeReport report;
  SubsurfaceReport walks;
  rows.add_to(report, walks);
  report.trace_seconds = seconds_since(start);
  start = Clock::now();

  auto x = bounce(rows, source_of(rows.T0.data(), width), width, options.bounces, progress);
  if (!x) return x.error();
  auto stored = [&](const AlignedVector<float>& values) {
    WritableTransfer out = make_transfer(options.light(), 1, int(channels), n, options.precision);
    parallel_for(n, transfer_block, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r) store_receiver(out, r, {values.data() + r * width, width});
    });
    return std::move(out.transfer);
  };
  Transfer out = stored(x->x);
  x->x = {};
  if (options.keep_terms) {
    auto ok = bounce_terms(rows, source_of(rows.T0.data(), width), width, options.bounces, progress,
                           [&](int, const auto& term) { return report.terms.push_back(stored(term)), Result<void>(); });
    if (!ok) return ok.error();
  }
  report.bounce_seconds = seconds_since(start), report.bytes = out.bytes();
  if (report_out) *report_out = report;
  if (walks_out) *walks_out = walks;
  return out;
}

}  // namespace lambent
