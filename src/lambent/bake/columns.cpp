#include <lambent/bake/bake.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/denoise.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/linear.h>
#include <lambent/basis/directional.h>
#include <lambent/basis/sh.h>
#include <lambent/core/own_part.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <memory>
#include <numbers>

namespace lambent {

size_t solution_bytes(size_t receivers, size_t coefficients, int channels, int sky_channels, const BakeOptions& o,
                      size_t ranks) {
  const size_t width = pad_lanes(coefficients * size_t(channels)),
               terms = o.keep_terms && o.denoise ? size_t(o.bounces) + 1 : 0;
  const size_t denoised = o.denoise ? width + (o.lobes.empty() ? 0 : (2 + terms) * width) + (terms ? width : 0) : 0;
  const size_t all = 4 * (coefficients * size_t(sky_channels) + (o.bounces > 0 ? 2 : 1) * width + width / check_every +
                          terms * width + denoised) +
                     (o.denoise ? denoise_bytes : 0);
  const size_t asked = ranks > 1 ? 4 * width : 0;
  return receivers * (asked + (all - asked + ranks - 1) / ranks);
}

void store_columns_of(const WritableTransfer& out, size_t receiver, const float* x, size_t width,
                      std::vector<float>& values) {
  const Transfer& t = out.transfer;
  const size_t columns = t.columns(), n = size_t(t.channels);
  values.resize(t.receiver_values());
  for (size_t row = 0; row < size_t(t.rows); ++row)
    for (size_t k = 0; k < columns; ++k)
      for (size_t c = 0; c < n; ++c) values[(row * n + c) * columns + k] = x[row * width + n * k + c];
  store_receiver(out, receiver, values);
}

Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision, std::span<const uint32_t> places) {
  WritableTransfer out = make_transfer(light, int(rows), channels, receivers, precision);
  parallel_for(receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values;
    for (size_t r = begin; r < end; ++r)
      store_columns_of(out, r, x + (places.empty() ? r : places[r]) * rows * width, width, values);
  });
  return std::move(out.transfer);
}

namespace {

// Memory for all of a result, of which a rank sets its own part.
struct PartedMemory {
  ZeroPages values;
  OwnPart part;
  PartedMemory(size_t bytes, std::vector<size_t> ends, size_t ranks)
      : values((bytes + 3) / 4),
        part({reinterpret_cast<const uint8_t*>(values.data()), bytes}, std::move(ends), ranks) {}
};

}  // namespace

WritableTransfer make_parted_transfer(const LightBasis& light, int channels, size_t receivers, Precision precision,
                                      std::vector<size_t> ends, size_t ranks) {
  WritableTransfer out;
  Transfer& t = out.transfer;
  t.light = light, t.channels = channels, t.receivers = receivers, t.precision = precision;
  const size_t block = t.block_values() * t.value_bytes();
  for (size_t& end : ends) end = (end + transfer_block - 1) / transfer_block * block;
  const auto memory = std::make_shared<PartedMemory>(t.bytes(), std::move(ends), ranks);
  out.values = reinterpret_cast<uint8_t*>(memory->values.data());
  t.data = memory->part.all, t.storage = memory;
  return out;
}

Transfer store_own_columns(const Shares& shares, const LightBasis& light, const float* x, int channels,
                           size_t receivers, size_t width, Precision precision) {
  std::vector<size_t> ends;
  const int count = shares.ranks().count();
  for (int k = 0; k < count; ++k) shares.each_stripe(k, [&](size_t, size_t end) { ends.push_back(end); });
  std::sort(ends.begin(), ends.end());
  const WritableTransfer out =
      make_parted_transfer(light, channels, receivers, precision, std::move(ends), size_t(count));
  shares.for_own([&](size_t begin, size_t end) {
    std::vector<float> values;
    for (size_t r = begin; r < end; ++r) store_columns_of(out, r, x + r * width, width, values);
  });
  return out.transfer;
}

Transfer unshadowed_transfer(const LightBasis& light, std::span<const Vec3> normals, Precision precision) {
  WritableTransfer out = make_transfer(light, 1, 1, normals.size(), precision);
  const size_t harmonics = size_t(sh_count(light.order));
  std::vector<std::vector<double>> irradiance;
  for (const Lobe& lobe : light.lobes) irradiance.push_back(lobe_irradiance(light.lobe_kind, lobe.sharpness));
  parallel_for(normals.size(), transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> row(light.count());
    for (size_t r = begin; r < end; ++r) {
      // An open plane: the clamped cosine, convolved (pi, 2 pi/3, pi/4, ...), over pi.
      evaluate_sh(light.order, normals[r], row);
      for (size_t k = 0; k < harmonics; ++k) row[k] *= float(clamped_cosine(sh_band(int(k))) / std::numbers::pi);
      for (size_t k = 0; k < irradiance.size(); ++k) {
        const Vec3d axis = normalize(Vec3d(light.lobes[k].axis));
        row[harmonics + k] = float(evaluate_legendre(irradiance[k], dot(axis, Vec3d(normals[r]))) / std::numbers::pi);
      }
      store_receiver(out, r, row);
    }
  });
  return std::move(out.transfer);
}

Transfer add_up_lobes(const Transfer& t, const LightBasis& light, Precision precision) {
  const DirectionalBasis basis = make_directional_basis(0, light.lobe_kind, light.lobes);
  const size_t harmonics = t.columns(), lobes = light.lobes.size();
  std::vector<std::vector<double>> sums;  // by lobe
  for (size_t k = 0; k < lobes; ++k) {
    std::vector<double> one(lobes, 0.0);
    one[k] = 1, sums.push_back(directional_to_sh(basis, one, t.light.order));
  }
  const WritableTransfer out = make_transfer(light, t.rows, t.channels, t.receivers, precision);
  parallel_for(t.receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values(out.transfer.receiver_values());
    for (size_t r = begin; r < end; ++r) {
      const std::vector<float> x = load_receiver(t, r);
      for (size_t i = 0; i < values.size(); ++i) {
        double sum = 0;
        for (size_t j = 0; j < harmonics; ++j) sum += sums[i % lobes][j] * double(x[i / lobes * harmonics + j]);
        values[i] = float(sum);
      }
      store_receiver(out, r, values);
    }
  });
  return out.transfer;
}

void gather_stored(const Shares& shares, const WritableTransfer& out) {
  const size_t block = out.transfer.block_values() * out.transfer.value_bytes();
  shares.gather_each(transfer_block, out.values, block);
}

}  // namespace lambent
