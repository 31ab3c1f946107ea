// Follows: radiosity ("One Last Practical Detail": irradiance is stored, albedo multiplied when shading).
#include <lambent/bake/kernels.h>
#include <lambent/bake/lightmap.h>
#include <lambent/core/parallel.h>
#include <lambent/receivers/seams.h>

#include <fmt/format.h>

#include <chrono>
#include <numeric>

namespace lambent {
namespace {

// Beyond any lamp in any unit (the sun is 1.6e9 cd/m2), and far from where products of a few such numbers overflow.
constexpr float brightest_lamp = 1e15f;
std::string too_bright(const char* what, const std::string& name, float value) {
  return fmt::format("{} \"{}\" shines with {:.3g}; the most that is taken is {:g}", what, name, value, brightest_lamp);
}

Result<void> check_options(const Scene& scene, const Lamps& lamps, const LightmapOptions& o) {
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

// x, [receiver][row][column][channel], as a Transfer.
Result<Transfer> to_transfer(const LightBasis& light, const AlignedVector<float>& x, size_t rows, size_t receivers,
                             size_t width, Precision precision) {
  const size_t columns = light.count();
  const float brightest = std::transform_reduce(
      x.begin(), x.end(), 0.0f, [](float a, float b) { return std::max(a, b); }, [](float v) { return std::abs(v); });
  if (precision == Precision::half && !(brightest <= 65504.0f))
    return Error{
        "lightmap",
        fmt::format(
            "its values go up to {:.3g}, and half floats to 65504: dim the lamps, or keep it in single precision",
            brightest)};
  WritableTransfer out = make_transfer(light, int(rows), 3, receivers, precision);
  parallel_for(receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values(rows * 3 * columns);
    for (size_t r = begin; r < end; ++r) {
      for (size_t row = 0; row < rows; ++row)
        for (size_t k = 0; k < columns; ++k)
          for (size_t c = 0; c < 3; ++c) values[(row * 3 + c) * columns + k] = x[(r * rows + row) * width + 3 * k + c];
      store_receiver(out, r, values);
    }
  });
  return std::move(out.transfer);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

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
  if (auto ok = check_options(scene, lamps, o); !ok) return ok.error();
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  const size_t least = least_lightmap_memory(receivers.count(), lamps.groups(), o);
  if (o.memory < least)
    return Error{scene.path, "baking needs at least " + std::to_string(least) +
                                 " bytes of working memory, and was allowed " + std::to_string(o.memory)};
  LightmapReport unwanted;
  LightmapReport& r = report ? *report : unwanted;
  r = {};
  const size_t n = receivers.count(), harmonics = size_t(sh_count(o.order)),
               width = pad_lanes(3 * (harmonics + lamps.groups()));
  const int order = std::max(o.order, 1);
  DirectionSets cube = o.gather == GatherKind::hemicube ? make_hemicube_set(order, o.samples) : DirectionSets{};
  GatherSetup setup =
      make_gather_setup(scene, tracer, receivers, order, cube.samples ? cube.samples : o.samples, o.seed);
  if (cube.samples) setup.sets = std::move(cube);
  const LightBasis light{.order = o.order, .groups = lamps.names};

  // e: [harmonics | groups][channel]
  AlignedVector<float> e(n * width, 0.0f);
  std::vector<float> sky(harmonics ? n * harmonics : 0);
  const bool bounces = o.converge > 0 || o.bounces > 0;
  const GatherDirect direct{lamps, o.lamp_samples, e.data() + 3 * harmonics, width};
  auto op = GatherOperator::trace(setup, lamps.groups() ? &direct : nullptr, harmonics ? sky.data() : nullptr, bounces,
                                  o.memory - least, progress);
  if (!op) return op.error();
  parallel_for(harmonics ? n : 0, gather_block, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t k = 0; k < harmonics; ++k)
        for (size_t c = 0; c < 3; ++c) e[i * width + 3 * k + c] = sky[i * harmonics + k];
  });
  r.trace_seconds = op->report().seconds;

  const auto start = std::chrono::steady_clock::now();
  const bool directional = o.directional != DirectionalKind::none;
  // A directional lightmap's last bounce is gathered with its directions.
  auto x = o.converge > 0 ? solve(*op, e.data(), width, {o.solver, o.converge, 200}, &r.solve, progress)
                          : bounce(*op, e.data(), width, std::max(o.bounces - directional, 0), progress);
  if (!x) return x.error();
  const size_t rows = size_t(directional_rows(o.directional));
  if (directional) {
    AlignedVector<float> wide(n * rows * width, 0.0f);
    ProgressStage stage(progress, "directions", n);
    parallel_for(n, gather_block, [&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      gather_directional(setup, lamps, o.lamp_samples, o.directional, bounces ? x->data() : nullptr, width, begin,
                         end - begin, wide.data() + begin * rows * width);
      stage.advance(end - begin);
    });
    if (stage.cancelled()) return Error{"", "cancelled"};
    op->fill(wide.data(), rows * width);
    *x = std::move(wide);
  }
  r.bounce_seconds = seconds_since(start);
  if (const auto* texels = std::get_if<TexelReceivers>(&receivers.basis)) {
    smooth_seams(scene, *texels, x->data(), rows * width, rows == 1 ? 3 * light.count() : rows * width);
    if (direct_apart) smooth_seams(scene, *texels, e.data(), width, 3 * light.count());
  }
  r.receivers = n, r.buried = op->report().buried, r.rays = op->report().rays;
  r.operator_bytes = op->report().bytes, r.operator_kept = bounces ? op->report().kept : 1;

  auto all = to_transfer(light, *x, rows, n, width, o.precision);
  if (!all) return all.error();
  Lightmap map{std::move(*all), std::nullopt};
  if (direct_apart) {
    auto direct = to_transfer(light, e, 1, n, width, o.precision);
    if (!direct) return direct.error();
    map.direct = std::move(*direct);
  }
  return map;
}

}  // namespace lambent
