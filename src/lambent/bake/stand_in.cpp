#include <lambent/bake/columns.h>
#include <lambent/bake/gather.h>
#include <lambent/bake/meshless.h>
#include <lambent/bake/stand_in.h>
#include <lambent/core/aligned.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr int pilot_order = 4, fewest_samples = 64;
constexpr double least_error = 0.01;  // below it, looking costs what it saves
constexpr double lost_part = 0.3;     // of the error, between those that are traced
constexpr double pilot_worth = 0.5;   // what is looked at is traced again
constexpr size_t pilot_piece = 16;

// Sums of surfels' rows by kernels.
void read_points(const PointReceivers& points, size_t vertex, const float* rows, size_t width, float* out) {
  std::fill_n(out, width, 0.0f);
  for (size_t k = points.first[vertex]; k < points.first[vertex + 1]; ++k)
    for (size_t j = 0; j < width; ++j) out[j] += points.weights[k] * rows[size_t(points.points[k]) * width + j];
}

}  // namespace

Result<StandIns> choose_stand_ins(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                  const BakeOptions& options, Progress* progress) {
  StandIns out;
  if (options.meshless) {
    auto points = make_point_receivers(scene, tracer, receivers, *options.meshless, options.seed, progress);
    if (!points) return points.error();
    out.own = std::move(*points);
    return out;
  }
  const size_t n = receivers.count();
  if (options.thin == 0 || n < 2 * options.thin || !options.lobes.empty() || !(options.error >= least_error)) {
    out.thinned = keep_all(n);
    return out;
  }
  const int order = std::min(options.order, pilot_order);
  // The pilot's noise, which falls as rays^-0.75, has to be told from what is lost.
  const int pilot_samples = int(fewest_samples * std::clamp(std::pow(0.025 / options.error, 1.33), 1.0, 4.0));
  const size_t coefficients = size_t(sh_count(order)), width = pad_lanes(coefficients);
  const PilotRows pilot = [&](std::span<const uint32_t> which, uint32_t pass, float* rows,
                              uint8_t* inside) -> Result<void> {
    const GatherSetup setup = make_gather_setup(scene, tracer, receivers, order, pilot_samples,
                                                uint32_t(hash64(options.seed, 0x57a + pass)),
                                                square_to_cosine_hemisphere, progress);
    Pool<GatherScratch, DeleteScratch> scratch([&] { return make_gather_scratch(setup); });
    const Shares shares(which.size(), pilot_piece);
    ProgressStage stage(progress, "looking where light changes", shares.own());
    shares.for_own([&](size_t begin, size_t end) {
      std::vector<float> sky(setup.sky_width());
      for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
        const uint32_t r = which[i];
        inside[i] = !gather_point(setup, *scratch.borrow(), receivers.origins[r], receivers.normals[r], r,
                                  {sky.data(), nullptr, setup.sky_width(), nullptr, nullptr}, nullptr, 0, nullptr);
        std::fill_n(rows + i * width, width, 0.0f);
        std::copy_n(sky.data(), coefficients, rows + i * width);  // of coloured glass, the first channel
      }
      if (!stage.cancelled()) stage.advance(end - begin);
    });
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    shares.gather(rows, width), shares.gather(inside);
    return {};
  };
  auto thinned = thin(scene, receivers, width, pilot,
                      {.error = lost_part * options.error, .fewest = options.thin, .worth = pilot_worth});
  if (!thinned) return thinned.error();
  out.rays = thinned->tried * size_t(pilot_samples);
  out.thinned = std::move(*thinned);
  if (!out.thinned.all()) out.own = thinned_receivers(receivers, out.thinned);
  return out;
}

Transfer spread_transfer(const Receivers& receivers, const StandIns& stand_ins, std::span<const uint8_t> buried,
                         const float* guide, const float* rows, size_t width, int channels,
                         const BakeOptions& options) {
  const auto* points = std::get_if<PointReceivers>(&stand_ins.own.basis);
  std::optional<Spread> of;
  if (!points) of.emplace(receivers, stand_ins.thinned, buried, guide, width);
  const LightBasis light = options.light();
  const size_t columns = light.count(), n = size_t(channels);
  WritableTransfer out = make_transfer(light, 1, channels, receivers.count(), options.precision);
  const Shares shares(receivers.count(), 4 * transfer_block);
  shares.for_own([&](size_t begin, size_t end) {
    AlignedVector<float> row(width);
    std::vector<float> values(n * columns);
    for (size_t r = begin; r < end; ++r) {
      if (points) read_points(*points, r, rows, width, row.data());
      else of->row(r, rows, width, row.data());
      for (size_t k = 0; k < columns; ++k)
        for (size_t c = 0; c < n; ++c) values[c * columns + k] = row[n * k + c];
      store_receiver(out, r, values);
    }
  });
  gather_stored(shares, out);
  return std::move(out.transfer);
}

}  // namespace lambent
