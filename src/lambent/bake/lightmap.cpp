// Follows: radiosity ("One Last Practical Detail": irradiance is stored, albedo multiplied when shading).
#include <lambent/bake/columns.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/lightmap_error.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/receivers/seams.h>

#include <fmt/format.h>

#include <algorithm>

namespace lambent {
namespace {

// Beyond any lamp in any unit (the sun is 1.6e9 cd/m2), and far from where products of a few such numbers overflow.
constexpr float brightest_lamp = 1e15f;
// Half floats end there; below, they have fewer digits.
constexpr float half_max = 65504, half_min = 0x1p-14f;
std::string too_bright(const char* what, const std::string& name, float value) {
  return fmt::format("{} \"{}\" shines with {:.3g}; the most that is taken is {:g}", what, name, value, brightest_lamp);
}

// Of x, [receiver][row][column][channel]: a value that half floats hold only coarsely or not at all; 0: none. Brightest
// first, then groups whose light lies below half floats' normal numbers.
float beyond_half(const LightBasis& light, const AlignedVector<float>& x, size_t width) {
  std::vector<float> most(width, 0);
  for (size_t i = 0; i < x.size(); i += width)
    for (size_t k = 0; k < width; ++k) most[k] = std::max(most[k], std::abs(x[i + k]));
  const float brightest = *std::max_element(most.begin(), most.end());
  if (brightest > half_max) return brightest;
  const size_t columns = light.count(), first = columns - light.groups.size();
  for (size_t k = first; k < columns; ++k)
    if (const float value = std::max({most[3 * k], most[3 * k + 1], most[3 * k + 2]}); value > 0 && value < half_min)
      return value;
  return 0;
}

// Transfer of harmonics, one channel for all where nothing colours the light, into the first columns of e.
void add_sky(const GatherSetup& setup, const std::vector<float>& sky, size_t width, AlignedVector<float>& e) {
  const size_t harmonics = setup.coefficients();
  parallel_for(sky.size() / setup.sky_width(), gather_block, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t j = 0; j < 3 * harmonics; ++j)
        e[i * width + j] = sky[i * setup.sky_width() + setup.sky_channel(j % 3) * harmonics + j / 3];
  });
}

// All rows, on all ranks.
Result<AlignedVector<float>> solution(const GatherOperator& op, const AlignedVector<float>& e, size_t width,
                                      const LightmapOptions& o, SolveReport& report, Progress* progress) {
  AlignedVector<float> x;
  if (o.converge > 0) {
    auto solved = solve(op, e.data(), width, {o.solver, o.converge, 200}, &report, progress);
    if (!solved) return solved.error();
    x = std::move(*solved);
  } else {
    const int bounces = std::max(o.bounces - (o.directional != DirectionalKind::none), 0);
    auto bounced = bounce(op, source_of(e.data(), width), width, bounces, progress);
    if (!bounced) return bounced.error();
    x = std::move(bounced->x);
  }
  op.shares().gather(x.data(), width);
  return x;
}

// [receiver][row][width]
Result<AlignedVector<float>> directional_rows_of(const GatherSetup& setup, const Lamps& lamps, const LightmapOptions& o,
                                                 const float* x, size_t width, Progress* progress) {
  const size_t n = setup.receivers.count(), rows = size_t(directional_rows(o.directional));
  AlignedVector<float> wide(n * rows * width, 0.0f);
  const Shares shares(n, gather_block);
  ProgressStage stage(progress, "directions", shares.own());
  const KeptPieces pieces(progress, "directions", n / gather_block);
  shares.for_own([&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    const std::span<float> own(wide.data() + begin * rows * width, (end - begin) * rows * width);
    const bool loaded = pieces.load(begin / gather_block, own);
    for (size_t r = begin; r < end && !loaded && !stage.cancelled(); ++r)
      gather_directional(setup, lamps, o.lamp_samples, o.directional, x, width, r, 1, wide.data() + r * rows * width);
    if (!loaded) pieces.save(begin / gather_block, own);
    stage.advance(end - begin);
  });
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares.gather(wide.data(), rows * width);
  return wide;
}

// Solutions as they are kept, seams closed.
struct Storing {
  const Scene& scene;
  const Receivers& receivers;
  LightBasis light;
  size_t width;
  Precision precision;  // all light decides, and its parts follow
  LightmapReport& report;
  Progress* progress;

  Result<Transfer> stored(AlignedVector<float>& values, size_t rows, bool is_all) {
    if (const auto* texels = std::get_if<TexelReceivers>(&receivers.basis))
      smooth_seams(scene, *texels, values.data(), rows * width, rows == 1 ? 3 * light.count() : rows * width, 0.95f,
                   0.05f, progress);
    if (is_cancelled(progress)) return Error{"", "cancelled"};
    const float value = precision == Precision::half ? beyond_half(light, values, width) : 0;
    if (value > half_max || (is_all && value > 0)) precision = Precision::single, report.beyond_half = value;
    return store_columns(light, values.data(), rows, 3, receivers.count(), width, precision);
  }
  Result<void> add_term(AlignedVector<float>& values, Lightmap& map) {
    auto transfer = stored(values, 1, false);
    if (!transfer) return transfer.error();
    map.terms.push_back(std::move(*transfer));
    return {};
  }
  // Seams are closed in place: nothing is to start from these values afterwards.
  Result<void> add_direct(AlignedVector<float>& values, Lightmap& map) {
    auto transfer = stored(values, 1, false);
    if (!transfer) return transfer.error();
    map.direct = std::move(*transfer);
    return {};
  }
};

Result<Lightmap> bake_to_error(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Lamps& lamps,
                               const LightmapOptions& o, bool direct_apart, LightmapReport& r, Progress* progress) {
  auto solved = solve_lightmap_to_error(scene, tracer, receivers, lamps, o, r, progress);
  if (!solved) return solved.error();
  Storing storing{scene, receivers, {.order = 0, .groups = lamps.names}, pad_lanes(3 * lamps.groups()), o.precision,
                  r,     progress};
  auto all = storing.stored(solved->all, 1, true);
  if (!all) return all.error();
  Lightmap map{std::move(*all), std::nullopt, {}};
  for (AlignedVector<float>& term : solved->terms)
    if (auto ok = storing.add_term(term, map); !ok) return ok.error();
  if (direct_apart)
    if (auto ok = storing.add_direct(solved->direct, map); !ok) return ok.error();
  r.receivers = receivers.count();
  return map;
}

}  // namespace

Result<void> check_lightmap(const Scene& scene, const Lamps& lamps, const LightmapOptions& o) {
  if (o.order < 0 || o.order > max_sh_order)
    return Error{"order", "must lie between 0 and " + std::to_string(max_sh_order)};
  if (o.samples < 1 || o.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(o.samples)};
  if (o.lamp_samples < 1 || o.lamp_samples > 1 << 16) return Error{"lamp samples", "must lie between 1 and 65536"};
  if (o.bounces < 0 || o.bounces > 64)
    return Error{"bounces", "must lie between 0 and 64, not " + std::to_string(o.bounces)};
  if (!(o.converge >= 0 && o.converge < 1)) return Error{"converge", "must lie between 0 and 1"};
  if (o.directional != DirectionalKind::none && o.order > 0)
    return Error{"directional", "lightmaps hold lamps alone: leave the order out"};
  if (!(o.error >= 0 && o.error <= 1))
    return Error{"error", "must lie between 0 and 1, not " + std::to_string(o.error)};
  if (o.error > 0 && (o.order > 0 || o.directional != DirectionalKind::none || o.gather != GatherKind::rays))
    return Error{"error", "is of lamps alone, without directions and by rays"};
  if (o.projection != Projection::collocation) {
    const bool by_rows = o.converge > 0 && o.solver != Solver::jacobi && o.solver != Solver::gmres;
    if (o.error > 0 || o.directional != DirectionalKind::none || o.gather != GatherKind::rays || by_rows)
      return Error{"projection", "least squares are of samples by rays, without directions, by jacobi or gmres"};
    if (auto ok = check_projection_ranks(); !ok) return ok;
  }
  if (o.keep_terms && (o.converge > 0 || o.directional != DirectionalKind::none))
    return Error{"terms", "are kept of counted bounces, and not of directional lightmaps"};
  for (const AreaLamp& lamp : lamps.area)
    if (!(largest(lamp.radiance) <= brightest_lamp))
      return Error{scene.path, too_bright("a lamp of the group", lamps.names[lamp.group], largest(lamp.radiance))};
  for (const PunctualLight& light : scene.lights)
    if (!(largest(light.intensity) <= brightest_lamp))
      return Error{scene.path, too_bright("the light", light.name, largest(light.intensity))};
  const size_t columns = size_t(sh_count(o.order)) + lamps.groups();
  if (columns == 0)
    return Error{scene.path, "nothing gives light: no emissive material, no lamp, no sky, no harmonics"};
  if (columns > max_columns)
    return Error{scene.path, std::to_string(columns) + " columns are more than " + std::to_string(max_columns)};
  return {};
}

size_t least_lightmap_memory(size_t receivers, size_t groups, const LightmapOptions& o) {
  const size_t harmonics = size_t(sh_count(o.order)), width = pad_lanes(3 * (harmonics + groups));
  // e, x and the next x; GMRES keeps its Krylov vectors; directional rows.
  const size_t vectors = o.converge > 0 && o.solver == Solver::gmres ? 13 : 3;
  const size_t rows = o.directional == DirectionalKind::none ? 0 : size_t(directional_rows(o.directional));
  return 4 * receivers * (width * (vectors + rows) + harmonics);
}

Result<Lightmap> bake_lightmap(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Lamps& lamps,
                               const LightmapOptions& o, bool direct_apart, LightmapReport* report,
                               Progress* progress) {
  if (auto ok = check_lightmap(scene, lamps, o); !ok) return ok.error();
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  const size_t least = least_lightmap_memory(receivers.count(), lamps.groups(), o);
  if (o.memory < least)
    return Error{scene.path, "baking needs at least " + std::to_string(least) +
                                 " bytes of working memory, and was allowed " + std::to_string(o.memory)};
  LightmapReport unwanted;
  LightmapReport& r = report ? *report : unwanted;
  r = {};
  if (o.error > 0) return bake_to_error(scene, tracer, receivers, lamps, o, direct_apart, r, progress);
  const size_t n = receivers.count(), harmonics = size_t(sh_count(o.order)),
               width = pad_lanes(3 * (harmonics + lamps.groups()));
  const int order = std::max(o.order, 1);
  DirectionSets cube = o.gather == GatherKind::hemicube ? make_hemicube_set(order, o.samples) : DirectionSets{};
  const std::optional<LeastSquares> projection = least_squares_of(scene, receivers, o.projection, o.samples, o.seed);
  GatherSetup setup = make_gather_setup(scene, tracer, receivers, order, cube.samples ? cube.samples : o.samples,
                                        o.seed, square_to_cosine_hemisphere, progress);
  setup.projection = projection ? &*projection : nullptr;
  if (cube.samples) setup.sets = std::move(cube);
  const LightBasis light{.order = o.order, .groups = lamps.names};

  // e: [harmonics | groups][channel]
  AlignedVector<float> e(n * width, 0.0f);
  std::vector<float> sky(harmonics ? n * setup.sky_width() : 0);
  const bool bounces = o.converge > 0 || o.bounces > 0;
  const GatherDirect direct{lamps, o.lamp_samples, e.data() + 3 * harmonics, width};
  auto op = GatherOperator::trace(setup, lamps.groups() ? &direct : nullptr, harmonics ? sky.data() : nullptr, bounces,
                                  o.memory - least, progress);
  if (!op) return op.error();
  if (harmonics) add_sky(setup, sky, width, e);
  r.trace_seconds = op->report().seconds;

  const auto start = Clock::now();
  // A directional lightmap's last bounce is gathered with its directions.
  auto x = solution(*op, e, width, o, r.solve, progress);
  if (!x) return x.error();
  const size_t rows = size_t(directional_rows(o.directional));
  if (o.directional != DirectionalKind::none) {
    auto wide = directional_rows_of(setup, lamps, o, bounces ? x->data() : nullptr, width, progress);
    if (!wide) return wide.error();
    *x = std::move(*wide);
    op->fill(x->data(), rows * width);
    op->shares().gather(x->data(), rows * width);  // each rank has filled its own
  }
  r.bounce_seconds = seconds_since(start);

  Storing storing{scene, receivers, light, width, o.precision, r, progress};
  auto all = storing.stored(*x, rows, true);
  if (!all) return all.error();
  Lightmap map{std::move(*all), std::nullopt, {}};
  if (o.keep_terms) {
    *x = {};
    auto take = [&](int, AlignedVector<float> term) -> Result<void> {
      op->shares().gather(term.data(), width);
      return storing.add_term(term, map);
    };
    if (auto ok = bounce_terms(*op, source_of(e.data(), width), width, o.bounces, progress, take); !ok)
      return ok.error();
  }
  if (direct_apart) {
    if (projection) op->fill(e.data(), width);
    op->shares().gather(e.data(), width);
    if (auto ok = storing.add_direct(e, map); !ok) return ok.error();
  }
  r.receivers = n, r.buried = op->report().buried, r.rays = op->report().rays;
  r.operator_bytes = op->report().bytes, r.operator_file_bytes = op->report().file_bytes;
  r.operator_kept = bounces ? op->report().kept : 1;
  return map;
}

}  // namespace lambent
