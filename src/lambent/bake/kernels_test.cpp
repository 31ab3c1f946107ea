#include <lambent/bake/gather.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Kernels, MultiplyEntriesIsTheSparseProduct) {
  for (int channels : {1, 3})
    for (size_t width : {size_t{16}, size_t{48}, size_t{112}, size_t{144}, size_t{432}}) {
      Random random(width);
      const size_t receivers = 300;
      AlignedVector<float> x(receivers * width);
      for (float& v : x) v = random.next() - 0.5f;
      SparseBlock block;
      block.row_count = 5;
      std::vector<double> expected(5 * width, 0.0);
      for (uint32_t column = 0; column < receivers; column += 1 + uint32_t(random.next() * 3)) {
        for (int row = 0; row < 5; ++row) {
          if (random.next() < 0.3f) continue;
          block.rows.push_back(uint8_t(row));
          float w[3];
          for (int c = 0; c < channels; ++c) {
            block.weights.push_back(float_to_half(random.next()));
            w[c] = half_to_float(block.weights.back());
          }
          for (size_t j = 0; j < width; ++j)
            expected[size_t(row) * width + j] += double(w[channels == 1 ? 0 : j % 3]) * x[column * width + j];
        }
        if (block.rows.size() > (block.ends.empty() ? 0 : block.ends.back())) {
          block.columns.push_back(column);
          block.ends.push_back(uint32_t(block.rows.size()));
        }
      }
      AlignedVector<float> y(5 * width, 1.0f);
      multiply_entries(block.view().entries, channels, x.data(), width, y.data());
      for (size_t i = 0; i < y.size(); ++i)
        EXPECT_NEAR(y[i], 1 + expected[i], 4e-5) << "channels " << channels << " width " << width;
    }
}

TEST(Kernels, FloatsToHalvesRoundsAsOneByOne) {
  Random random(8);
  std::vector<float> floats(1003);
  for (float& f : floats) f = (random.next() - 0.5f) * std::exp(20 * random.next() - 12);
  std::vector<uint16_t> halves(floats.size());
  floats_to_halves(floats.data(), floats.size(), halves.data());
  for (size_t i = 0; i < floats.size(); ++i) EXPECT_EQ(halves[i], float_to_half(floats[i])) << floats[i];
}

TEST(Kernels, WeightedRowsIsTheDenseProduct) {
  Random random(3);
  for (size_t rows : {size_t{1}, size_t{4}, size_t{9}, size_t{35}}) {
    const size_t stride = 96, count = 64;
    AlignedVector<float> table(rows * stride), weights(count);
    for (float& v : table) v = random.next() - 0.5f;
    for (float& v : weights) v = random.next();
    std::vector<float> out(rows);
    weighted_rows(table.data(), rows, stride, weights.data(), count, out.data());
    for (size_t i = 0; i < rows; ++i) {
      double sum = 0;
      for (size_t j = 0; j < count; ++j) sum += double(table[i * stride + j]) * weights[j];
      EXPECT_NEAR(out[i], sum, 1e-5);
    }
  }
}

TEST(Kernels, RotateDirectionsIsTheMatrix) {
  const Mat3 R = rotation_from_yaw_pitch_roll({20, 30, 40});
  float x[16], y[16], z[16], ox[16], oy[16], oz[16];
  for (int i = 0; i < 16; ++i) x[i] = float(i), y[i] = 1 - float(i), z[i] = 0.5f * float(i);
  rotate_directions(R, x, y, z, 16, ox, oy, oz);
  for (int i = 0; i < 16; ++i) EXPECT_LT(length(R * Vec3(x[i], y[i], z[i]) - Vec3(ox[i], oy[i], oz[i])), 1e-5f);
}

TEST(Kernels, LobeValuesAreTheLobe) {
  Random random(3);
  const size_t n = 160;
  AlignedVector<float> x(n), y(n), z(n), out(n);
  for (size_t i = 0; i < n; ++i) {
    const Vec3 d = normalize_or(Vec3(random.next(), random.next(), random.next()) - 0.5f, Vec3(0, 0, 1));
    x[i] = d.x, y[i] = d.y, z[i] = d.z;
  }
  const Vec3 axis = normalize(Vec3(0.3f, -0.6f, 0.5f));
  x[0] = axis.x, y[0] = axis.y, z[0] = axis.z, x[1] = -axis.x, y[1] = -axis.y, z[1] = -axis.z;
  for (LobeKind kind : {LobeKind::von_mises_fisher, LobeKind::cosine_power, LobeKind::compact, LobeKind::band_limited})
    for (float s : {1.0f, 7.0f, 16.0f, 300.0f, 40000.0f}) {
      if (!is_lobe(kind, {axis, s})) continue;
      lobe_values(kind, axis, s, 2.5f, x.data(), y.data(), z.data(), n, out.data());
      // A cosine's rounding, times the sharpness.
      for (size_t i = 0; i < n; ++i)
        EXPECT_NEAR(out[i], 2.5 * lobe_value(kind, s, dot(Vec3d(axis), Vec3d(x[i], y[i], z[i]))), 1e-6 + 5e-7 * s)
            << i << " " << s;
    }
  AlignedVector<float> product(n);
  multiply_values(x.data(), y.data(), n, product.data());
  for (size_t i = 0; i < n; ++i) EXPECT_EQ(product[i], x[i] * y[i]);
}

}  // namespace
}  // namespace lambent
