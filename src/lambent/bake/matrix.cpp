// Follows: general-prt (transfer matrices, the recursion over bounces, the last reflection).
#include <lambent/bake/kernels.h>
#include <lambent/bake/last_reflection.h>
#include <lambent/bake/matrix_gather.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <atomic>
#include <chrono>
#include <map>
#include <variant>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct MatrixBaker : MatrixGather {
  Progress* progress;
  BakeReport& report;
  std::vector<ViewMap> responses{};

  // out[row][channel][width] = H x, x[J][channel][width].
  static void apply(std::span<const float> h, size_t rows, size_t J, size_t wc, const float* x, float* out) {
    std::fill(out, out + rows * wc, 0.0f);
    for (size_t r = 0; r < rows; ++r)
      for (size_t j = 0; j < J; ++j) {
        const float f = h[r * J + j];
        if (f == 0) continue;
        for (size_t i = 0; i < wc; ++i) out[r * wc + i] += f * x[j * wc + i];
      }
  }

  void make_responses() {
    ProgressStage stage(progress, "materials", materials.materials.size());
    responses.resize(materials.materials.size()), scatter.resize(responses.size());
    parallel_for(responses.size(), 1, [&](size_t begin, size_t end) {
      for (size_t m = begin; m < end; ++m) {
        responses[m] = make_response(materials.materials[m], basis, matrix.grid, matrix.response_samples);
        scatter[m] = factor_response(responses[m], matrix.scatter_rows, matrix.scatter_error);
        stage.advance();
      }
    });
    first_row.assign(1, 0);
    for (size_t r = 0; r < n(); ++r)
      first_row.push_back(first_row.back() + size_t(scatter[materials.of_receiver[r]].rows));
  }

  // T0 in every channel.
  void expand(const float* t, float* x) const {
    for (size_t j = 0; j < J(); ++j)
      for (size_t c = 0; c < channels(); ++c) std::copy_n(t + j * width(), width(), x + (j * channels() + c) * width());
  }

  // Sums of squares by block, added up in order.
  struct ErrorSums {
    std::vector<double> differences, totals;
    explicit ErrorSums(size_t blocks) : differences(blocks, 0.0), totals(blocks, 0.0) {}
    void add(size_t block, const float* half, const float* full, size_t count) {
      for (size_t i = 0; i < count; ++i)
        differences[block] += double(half[i] - full[i]) * (half[i] - full[i]),
            totals[block] += double(full[i]) * full[i];
    }
    double relative() const {
      double difference = 0, total = 0;
      for (size_t b = 0; b < differences.size(); ++b) difference += differences[b], total += totals[b];
      return total > 0 ? std::sqrt(difference / total) : 0;
    }
  };

  MatrixBake finish(const std::vector<uint8_t>& buried, const ErrorSums& errors, WritableTransfer&& out,
                    const LastReflection& last) const {
    report.error = has_halves() ? errors.relative() : -1;
    report.receivers = n(), report.bytes = out.transfer.bytes();
    for (uint8_t x : buried) report.buried += x;
    return {std::move(out.transfer), last.outgoing};
  }

  // Every receiver by itself: nothing is kept from one to the next.
  Result<MatrixBake> run_simulated() {
    make_responses();
    const auto start = Clock::now();
    const LastReflection last = make_last_reflection(responses, materials, matrix, basis, setup.channels);
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    std::vector<uint8_t> buried(n());
    ErrorSums errors((n() + gather_block - 1) / gather_block);
    auto receive = [&](MatrixScratch& s, size_t r) {
      MatrixHits hits;
      const bool inside = trace(s, r, &hits);
      AlignedVector<float> t0(J() * width()), x(J() * channels() * width());
      auto gather = [&](size_t limit) {
        direct(s, limit, t0.data());
        expand(t0.data(), x.data());
        simulated(s, r, hits.hits, limit, x.data());
      };
      AlignedVector<float> half;
      const bool checked = has_halves() && r % check_every == 0 && !inside;
      if (checked) gather(setup.sets.half), half = x;
      gather(rays());
      if (checked) errors.add(r / gather_block, half.data(), x.data(), x.size());
      store_rows(last, materials, out, r, x.data(), channels(), width());
      return inside;
    };
    {
      ProgressStage stage(progress, "paths", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        auto s = scratch.borrow();
        for (size_t r = begin; r < end && !stage.cancelled(); ++r) buried[r] = receive(*s, r);
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    auto s = scratch.borrow();
    for (const FillStep& step : make_fill_steps(scene, receivers.basis, buried)) {
      receivers.origins[step.receiver] = receivers.origins[step.sources[0]];
      (void)receive(*s, step.receiver);
    }
    report.rays = n() * rays();
    report.trace_seconds = seconds_since(start);
    report.working_memory = matrix_memory(n(), int(channels()), options, matrix);
    return finish(buried, errors, std::move(out), last);
  }

  Result<MatrixBake> run() {
    make_responses();
    const size_t wc = channels() * width(), blocks = (n() + gather_block - 1) / gather_block;
    const bool bounces = options.bounces > 0;
    auto start = Clock::now();
    // Bounces need the direct rows of all receivers at once; without them each is stored as it comes.
    const size_t held = bounces ? n() : 0;
    AlignedVector<float> T0(held * J() * width());
    std::vector<float> T0_half((held + check_every - 1) / check_every * J() * width());
    const LastReflection last = make_last_reflection(responses, materials, matrix, basis, setup.channels);
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    ErrorSums errors(blocks);
    std::vector<uint8_t> buried(n());
    std::vector<MatrixHits> kept(blocks);
    std::vector<uint8_t> is_kept(blocks, 0);
    const size_t fixed = matrix_memory(n(), int(channels()), options, matrix);
    const size_t budget = options.memory > fixed ? options.memory - fixed : 0;
    std::atomic<size_t> used{0};

    auto trace_receiver = [&](MatrixScratch& s, size_t r, MatrixHits* hits) {
      const bool moved = buried[r];
      buried[r] = trace(s, r, hits);
      const bool checked = r % check_every == 0;
      float* full = bounces ? T0.data() + r * J() * width() : s.full.data();
      float* half = !checked ? nullptr : bounces ? T0_half.data() + r / check_every * J() * width() : s.half.data();
      direct(s, rays(), full);
      if (half) direct(s, std::min(setup.sets.half, rays()), half);
      direct_sharp_lobes(s, r, full, half);
      if (hits) hits->ends.push_back(uint32_t(hits->hits.size()));
      if (bounces) return;
      store_rows(last, materials, out, r, full, channels(), width());
      if (checked && !buried[r] && !moved) errors.add(r / gather_block, half, full, J() * width());
    };
    // Which blocks are kept depends on the scheduling, the result does not: the others are traced again, alike.
    auto keep = [&](size_t block, MatrixHits&& hits) {
      const size_t bytes = hits.bytes();
      if (used.fetch_add(bytes) + bytes <= budget) kept[block] = std::move(hits), is_kept[block] = 1;
      else used.fetch_sub(bytes);
    };
    {
      ProgressStage stage(progress, "tracing", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        auto s = scratch.borrow();
        MatrixHits hits;
        for (size_t r = begin; r < end; ++r) trace_receiver(*s, r, bounces ? &hits : nullptr);
        if (bounces) keep(begin / gather_block, std::move(hits));
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    report.rays = n() * (rays() + size_t(lobes.rays) * lobes.sharp.size());
    move_buried(buried, trace_receiver, bounces, kept, is_kept, used);
    report.operator_bytes = used;
    report.operator_kept = bounces ? double(std::count(is_kept.begin(), is_kept.end(), uint8_t(1))) / double(blocks)
                                   : 1;
    report.trace_seconds = seconds_since(start);
    start = Clock::now();

    auto scatter_rows = [&](size_t r, const float* x, float* Y) {
      const FactoredResponse& f = scatter[materials.of_receiver[r]];
      apply(f.h, size_t(f.rows), J(), wc, x, Y + first_row[r] * wc);
    };

    AlignedVector<float> Y, next;
    if (bounces) Y.resize(first_row.back() * wc), next.resize(Y.size());
    parallel_for(held, gather_block, [&](size_t begin, size_t end) {
      AlignedVector<float> x(J() * wc);
      for (size_t r = begin; r < end; ++r) {
        expand(T0.data() + r * J() * width(), x.data());
        scatter_rows(r, x.data(), Y.data());
      }
    });

    for (int bounce = 1; bounce <= options.bounces; ++bounce) {
      const bool is_last = bounce == options.bounces;
      ProgressStage stage(progress, "bounce " + std::to_string(bounce), n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        auto s = scratch.borrow();
        const size_t b = begin / gather_block;
        MatrixHits again;
        if (!is_kept[b])
          for (size_t r = begin; r < end; ++r)
            (void)trace(*s, r, &again), again.ends.push_back(uint32_t(again.hits.size()));
        const MatrixHits& hits = is_kept[b] ? kept[b] : again;
        AlignedVector<float> x(J() * wc);
        for (size_t r = begin; r < end; ++r) {
          (void)aim(*s, r);
          const size_t first = r == begin ? 0 : hits.ends[r - begin - 1];
          const std::span<const MatrixHit> mine(hits.hits.data() + first, hits.ends[r - begin] - first);
          expand(T0.data() + r * J() * width(), x.data());
          scattered(*s, mine, rays(), Y.data(), x.data());
          if (!is_last) {
            scatter_rows(r, x.data(), next.data());
            continue;
          }
          store_rows(last, materials, out, r, x.data(), channels(), width());
          if (has_halves() && r % check_every == 0 && !buried[r]) {
            AlignedVector<float> half(J() * wc);
            expand(T0_half.data() + r / check_every * J() * width(), half.data());
            scattered(*s, mine, setup.sets.half, Y.data(), half.data());
            errors.add(b, half.data(), x.data(), half.size());
          }
        }
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
      report.rays += size_t(double(n()) * (1 - report.operator_kept) + 0.5) * rays();
      std::swap(Y, next);
    }
    report.bounce_seconds = seconds_since(start);
    report.working_memory = fixed + used;
    return finish(buried, errors, std::move(out), last);
  }

  // A buried receiver looks out from where its nearest clear neighbour along the mesh lies.
  template <class TraceReceiver>
  void move_buried(const std::vector<uint8_t>& was_buried, TraceReceiver& trace_receiver, bool bounces,
                   std::vector<MatrixHits>& kept, std::vector<uint8_t>& is_kept, std::atomic<size_t>& used) {
    const std::vector<uint8_t> buried = was_buried;
    const auto steps = make_fill_steps(scene, receivers.basis, buried);
    if (steps.empty()) return;
    for (const FillStep& step : steps) receivers.origins[step.receiver] = receivers.origins[step.sources[0]];
    auto s = scratch.borrow();
    if (!bounces) {
      for (const FillStep& step : steps) trace_receiver(*s, step.receiver, nullptr);
      return;
    }
    std::map<size_t, bool> touched;
    for (const FillStep& step : steps) touched[step.receiver / gather_block] = true;
    for (const auto& [block, yes] : touched) {
      const size_t begin = block * gather_block, end = std::min(n(), begin + gather_block);
      MatrixHits hits;
      for (size_t r = begin; r < end; ++r) trace_receiver(*s, r, &hits);
      if (is_kept[block]) used += hits.bytes(), used -= kept[block].bytes(), kept[block] = std::move(hits);
    }
  }
};

// Whether a BRDF of no base colour tints what it reflects: judged along mirrored and along unrelated directions.
bool tints(const Brdf& brdf) {
  for (uint32_t i = 0; i < 16; ++i) {
    const Vec3 wo = square_to_cosine_hemisphere(sobol_owen(i, 1));
    for (const Vec3& wi : {Vec3(-wo.x, -wo.y, wo.z), square_to_cosine_hemisphere(sobol_owen(i, 2))}) {
      const Vec3 f = evaluate(brdf, wi, wo);
      const float most = std::max({f.x, f.y, f.z}), least = std::min({f.x, f.y, f.z});
      if (most - least > 1e-5f * most) return true;
    }
  }
  return false;
}

Result<void> check_options(const BakeOptions& o, const MatrixOptions& m, const ReceiverMaterials& materials,
                           size_t receivers) {
  auto within = [](const char* name, int value, int least, int most) -> Result<void> {
    if (value >= least && value <= most) return {};
    return Error{name, "must lie between " + std::to_string(least) + " and " + std::to_string(most) + ", not " +
                           std::to_string(value)};
  };
  for (auto& ok :
       {check_light_basis(o, 1), within("samples", o.samples, 1, 1 << 20), within("bounces", o.bounces, 0, 64),
        within("incident-order", m.incident_order, 1, max_incident_order),
        within("outgoing-order", m.outgoing_order, 1, max_incident_order),
        within("order and incident-order together", o.order + m.incident_order, 2, max_sh_order + 1),
        within("svd rows", m.svd_rows, 1, sh_count(m.incident_order)), within("grid", m.grid, 8, 256)})
    if (!ok) return ok.error();
  // A path seldom meets a lamp by chance.
  if (m.simulate_paths && o.bounces > 0 && !o.lobes.empty())
    return Error{"lobes", "bounces by simulated paths are of harmonics alone"};
  if (m.outgoing == OutgoingKind::phong)
    for (const LinearMaterial& material : materials.materials)
      if (convolve_phong(material, make_cosine_basis(1), 0).empty())
        return Error{"outgoing", "phong convolves Phong's lobe and takes no other material"};
  LAMBENT_CHECK(materials.of_receiver.size() == receivers && materials.frames.size() == receivers &&
                !materials.materials.empty());
  return {};
}

}  // namespace

size_t matrix_memory(size_t receivers, int channels, const BakeOptions& o, const MatrixOptions& m) {
  const size_t width = pad_lanes(o.light().count()), J = size_t(sh_count(m.incident_order));
  const size_t table = 8 * pad_lanes(size_t(o.samples)) * 4 * size_t(sh_count(o.order + m.incident_order - 1) + 3);
  // Bounces hold direct rows and scattered ones; direct light alone is stored as it comes.
  const size_t held = o.bounces > 0 ? J * width * (check_every + 1) / check_every +
                                          2 * size_t(m.scatter_rows) * size_t(channels) * width
                                    : 0;
  return receivers * (4 * held + 2 * sizeof(Vec3) + sizeof(Mat3)) + table + lobe_set_bytes(o.samples, o.lobes.size());
}

Result<MatrixBake> bake_matrix(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                               const ReceiverMaterials& materials, const BakeOptions& options,
                               const MatrixOptions& matrix, BakeReport* report, Progress* progress) {
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  if (!std::holds_alternative<CornerReceivers>(receivers.basis))
    return Error{scene.path, "transfer matrices are baked at vertices"};
  if (auto ok = check_options(options, matrix, materials, receivers.count()); !ok) return ok.error();
  BakeReport unwanted;
  BakeReport& r = report ? *report : unwanted;
  r = {};
  GatherSetup setup = make_gather_setup(scene, tracer, receivers, options.order + matrix.incident_order - 1,
                                        options.samples, options.seed);
  for (const LinearMaterial& m : materials.materials)
    if (tints(m.black)) setup.channels = 3;
  if (options.bounces == 0) setup.channels = 1;  // direct light meets no coloured surface on its way
  const size_t needed = matrix_memory(receivers.count(), setup.channels, options, matrix);
  if (needed > options.memory)
    return Error{scene.path, "baking needs at least " + std::to_string(needed) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  MatrixBaker baker{{scene, receivers, materials, options, matrix, std::move(setup)}, progress, r};
  return matrix.simulate_paths && options.bounces > 0 ? baker.run_simulated() : baker.run();
}

}  // namespace lambent
