// Follows: general-prt (transfer matrices, the recursion over bounces, the last reflection).
#include <lambent/bake/columns.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/last_reflection.h>
#include <lambent/bake/matrix_rows.h>
#include <lambent/bake/solve.h>
#include <lambent/core/check.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <variant>

namespace lambent {
namespace {

struct MatrixBaker : MatrixGather {
  Progress* progress;
  BakeReport& report;

  // How materials answer light, and the rows with which they scatter. Errors: cancelled.
  Result<LastReflection> prepare() {
    auto responses = make_responses(materials.materials, basis, matrix.grid, matrix.response_samples, progress);
    if (!responses) return responses.error();
    scatter.resize(responses->size());
    if (options.bounces > 0 && !matrix.simulate_paths) {
      ProgressStage stage(progress, "scattering", responses->size());
      parallel_for(responses->size(), 1, [&](size_t m, size_t) {
        if (stage.cancelled()) return;
        scatter[m] = factor_response((*responses)[m], matrix.scatter_rows, matrix.scatter_error);
        stage.advance();
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    first_row.assign(1, 0);
    for (size_t r = 0; r < n(); ++r)
      first_row.push_back(first_row.back() + size_t(scatter[materials.of_receiver[r]].rows));
    return make_last_reflection(*responses, materials, matrix, basis, setup.channels, progress);
  }

  MatrixBake finish(const std::vector<uint8_t>& buried, double error, WritableTransfer&& out,
                    const LastReflection& last) const {
    report.error = has_halves() ? error : -1;
    report.receivers = n(), report.bytes = out.transfer.bytes();
    for (uint8_t x : buried) report.buried += x;
    return {std::move(out.transfer), last.outgoing};
  }

  // Every receiver by itself, nothing kept from one to the next: direct light, and simulated paths.
  Result<MatrixBake> run_apart(const LastReflection& last) {
    const auto start = Clock::now();
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    const bool paths = options.bounces > 0;
    std::vector<uint8_t> buried(n());
    ErrorSums errors(n());
    auto receive = [&](MatrixScratch& s, size_t r) {
      MatrixHits hits;
      const bool moved = buried[r];
      buried[r] = trace(s, r, paths ? &hits : nullptr);
      AlignedVector<float> x(J() * wc()), half(x.size());
      const bool checked = r % check_every == 0;
      direct_light(s, r, s.full.data(), checked ? s.half.data() : nullptr);
      auto gather = [&](const AlignedVector<float>& t0, size_t limit, AlignedVector<float>& sum) {
        expand(t0.data(), sum.data());
        if (paths) simulated(s, r, hits.hits, limit, sum.data());
      };
      gather(s.full, rays(), x);
      store_rows(last, materials, out, r, x.data(), channels(), width());
      if (!checked || !has_halves() || buried[r] || moved) return;
      gather(s.half, setup.sets.half, half);
      errors.add(r, half.data(), x.data(), x.size());
    };
    const Shares shares(n(), gather_block);
    {
      ProgressStage stage(progress, paths ? "paths" : "tracing", shares.own());
      const KeptPieces pieces(progress, "tracing", n() / gather_block);
      shares.for_own([&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        const std::span<uint8_t> rows = stored_bytes(out, begin, end - begin),
                                 inside(buried.data() + begin, end - begin);
        if (!pieces.load(begin / gather_block, rows, inside, errors.of_block(begin))) {
          auto s = scratch.borrow();
          for (size_t r = begin; r < end && !stage.cancelled(); ++r) receive(*s, r);
          pieces.save(begin / gather_block, rows, inside, errors.of_block(begin));
        }
        stage.advance(end - begin);
      });
      if (!none_cancelled(progress)) return Error{"", "cancelled"};
    }
    shares.gather(buried.data()), errors.gather(shares), gather_stored(shares, out);
    const std::vector<FillStep> steps = make_fill_steps(scene, receivers.basis, buried);
    for (const FillStep& step : steps) receivers.origins[step.receiver] = receivers.origins[step.sources[0]];
    if (!steps.empty()) {
      ProgressStage stage(progress, "moving buried", steps.size());
      parallel_for(steps.size(), 1, [&](size_t i, size_t) {
        if (stage.cancelled()) return;
        receive(*scratch.borrow(), steps[i].receiver);
        stage.advance();
      });
      if (!none_cancelled(progress)) return Error{"", "cancelled"};
    }
    report.rays = n() * (rays() + size_t(lobes.rays) * lobes.sharp.size());
    report.trace_seconds = seconds_since(start);
    report.working_memory = matrix_memory(n(), int(channels()), options, matrix);
    MatrixBake baked = finish(buried, errors.relative(), std::move(out), last);
    if (options.keep_terms) report.terms = {baked.transfer};
    return baked;
  }

  // One by one, as many columns and rows as the bake has.
  Result<void> keep_terms(const MatrixRows& G, const Source& source, const LastReflection& last) {
    std::vector<WritableTransfer> terms;
    for (int k = 0; k <= options.bounces; ++k)
      terms.push_back(make_transfer(options.light(), last.rows, last.channels, n(), options.precision));
    auto ok = bounce_terms(
        G, source, J() * wc(), options.bounces, progress, [](int, const auto&) { return Result<void>(); },
        [&](int k) -> TakeRows {
          return [&, k](size_t first, size_t count, const float* x) {
            for (size_t i = 0; i < count; ++i)
              store_rows(last, materials, terms[size_t(k)], first + i, x + i * J() * wc(), channels(), width());
          };
        });
    if (!ok) return ok;
    for (WritableTransfer& term : terms) {
      gather_stored(G.shares(), term);
      report.terms.push_back(std::move(term.transfer));
    }
    return {};
  }

  Result<MatrixBake> run_bounced(const LastReflection& last) {
    auto start = Clock::now();
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    const size_t fixed = matrix_memory(n(), int(channels()), options, matrix);
    MatrixRows G(*this, options.memory > fixed ? options.memory - fixed : 0);
    if (auto ok = G.trace(progress); !ok) return ok.error();
    report.operator_bytes = G.bytes(), report.operator_kept = G.kept();
    report.trace_seconds = seconds_since(start);
    start = Clock::now();
    Source source{[&](size_t r, float* x) { expand(G.T0(r), x); }};
    if (has_halves()) source.set_half = [&](size_t r, float* x) { expand(G.T0_half(r), x); };
    auto solution = bounce(G, source, J() * wc(), options.bounces, progress, [&](size_t r, size_t, const float* x) {
      store_rows(last, materials, out, r, x, channels(), width());
    });
    if (!solution) return solution.error();
    gather_stored(G.shares(), out);
    solution->x = {};
    if (options.keep_terms)
      if (auto ok = keep_terms(G, source, last); !ok) return ok.error();
    report.rays = n() * (rays() + size_t(lobes.rays) * lobes.sharp.size()) + G.rays_again();
    report.bounce_seconds = seconds_since(start);
    report.working_memory = fixed + G.bytes();
    return finish(G.buried(), solution->error, std::move(out), last);
  }

  Result<MatrixBake> run() {
    const auto last = prepare();
    if (!last) return last.error();
    return options.bounces == 0 || matrix.simulate_paths ? run_apart(*last) : run_bounced(*last);
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
        within("outgoing lobes", m.outgoing_lobes, 4, max_outgoing_lobes),
        within("order and incident-order together", o.order + m.incident_order, 2, max_sh_order + 1),
        within("svd rows", m.svd_rows, 1, sh_count(m.incident_order)), within("grid", m.grid, 8, 256)})
    if (!ok) return ok.error();
  if (o.keep_terms && m.simulate_paths && o.bounces > 0)
    return Error{"terms", "are not known of simulated paths, which are followed whole"};
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
                                        options.samples, options.seed, square_to_cosine_hemisphere, progress);
  for (const LinearMaterial& m : materials.materials)
    if (tints(m.black)) setup.channels = 3;
  if (options.bounces == 0) setup.channels = setup.sky_channels;  // direct light is coloured by glass alone
  const size_t needed = matrix_memory(receivers.count(), setup.channels, options, matrix);
  if (needed > options.memory)
    return Error{scene.path, "baking needs at least " + std::to_string(needed) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  MatrixBaker baker{{scene, receivers, materials, options, matrix, std::move(setup)}, progress, r};
  return baker.run();
}

}  // namespace lambent
