#include <lambent/basis/sh.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/factors.h>
#include <lambent/relight/relighter.h>

#include <gtest/gtest.h>

#include <numeric>

namespace lambent {
namespace {

constexpr size_t count = 37;  // two blocks and a part of one

VertexPlacement vertices() {
  VertexPlacement p;
  p.front.resize(count);
  std::iota(p.front.begin(), p.front.end(), 0u);
  return p;
}

std::vector<Vec3> random_light(size_t columns) {
  Random random(columns);
  std::vector<Vec3> light;
  for (size_t k = 0; k < columns; ++k) light.push_back({random.next(), random.next() - 0.5f, -random.next()});
  return light;
}

// Row by row and column by column.
std::vector<Vec3> product(std::span<const float> values, size_t rows, size_t channels, std::span<const Vec3> light) {
  std::vector<Vec3> out(rows, Vec3(0));
  const size_t C = light.size();
  for (size_t row = 0; row < rows; ++row)
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 0; k < C; ++k) out[row][c] += values[(row * channels + c % channels) * C + k] * light[k][c];
  return out;
}

void expect_near(const Relit& out, size_t receiver, std::span<const Vec3> expected, float tolerance) {
  ASSERT_EQ(out.rows, int(expected.size()));
  for (size_t row = 0; row < expected.size(); ++row)
    for (size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(out.at(receiver, int(row))[c], expected[row][c], tolerance) << "receiver " << receiver;
}

Relighter make(const Field& field, RelighterOptions options = {}) {
  auto r = Relighter::make(field, std::move(options));
  if (!r) ADD_FAILURE() << r.error().text(), std::abort();
  return std::move(*r);
}

std::string message(const Result<void>& r) { return r ? "" : r.error().message; }

Field dense_field(int channels, Precision precision) {
  const LightBasis light{3, LobeKind::von_mises_fisher, {{Vec3(0, 1, 0), 20}}, {"desk"}};
  WritableTransfer w = make_transfer(light, 4, channels, count, precision);
  Random random{uint64_t(channels)};
  std::vector<float> values(w.transfer.receiver_values());
  for (size_t r = 0; r < count; ++r) {
    for (float& v : values) v = random.next() - 0.5f;
    store_receiver(w, r, values);
  }
  return {vertices(), w.transfer, DirectionalRows{DirectionalKind::sh2}};
}

// Receivers of some blocks alone: those to the bit, others 0, or kept. The middle one of three blocks is not seen.
void expect_in_part(Relighter& relighter) {
  Relit all, part;
  ASSERT_EQ(message(relighter.relight({}, all)), "");
  const std::vector<uint32_t> seen{3, 36}, none_seen, beyond{uint32_t(count)};
  ASSERT_EQ(message(relighter.relight({.seen = seen}, part)), "");
  for (uint32_t r = 0; r < count; ++r)
    for (int row = 0; row < relighter.rows(); ++row)
      EXPECT_EQ(part.at(r, row), r / 16 == 1 ? Vec3(0) : all.at(r, row)) << "receiver " << r;
  part = all;
  part.set(20, 0, Vec3(7)), part.set(36, 0, Vec3(7));
  ASSERT_EQ(message(relighter.relight({.keep = true, .seen = seen}, part)), "");
  EXPECT_EQ(part.at(20), Vec3(7));
  EXPECT_EQ(part.at(36), all.at(36));
  ASSERT_EQ(message(relighter.relight({.seen = none_seen}, part)), "");
  EXPECT_EQ(part.at(36), Vec3(0));
  EXPECT_NE(message(relighter.relight({.seen = beyond}, part)), "");
  std::vector<float> memory(count * 3 * size_t(relighter.rows()));
  ASSERT_EQ(message(relighter.relight({.seen = seen}, memory, 3 * size_t(relighter.rows()))), "");
  EXPECT_EQ(memory[3 * 3 * size_t(relighter.rows())], all.at(3).x);
  EXPECT_EQ(memory[20 * 3 * size_t(relighter.rows())], 0);
}

TEST(Relighter, OfDenseTransfer) {
  for (int channels : {1, 3})
    for (Precision precision : {Precision::half, Precision::single}) {
      const Field field = dense_field(channels, precision);
      const auto& t = std::get<Transfer>(field.store);
      Relighter relighter = make(field);
      ASSERT_EQ(relighter.light().count(), 11u);
      EXPECT_EQ(relighter.rows(), 4);
      const std::vector<Vec3> light = random_light(11);
      ASSERT_EQ(message(relighter.set_light(light)), "");
      Relit out, direct;
      ASSERT_EQ(message(relighter.relight({}, out)), "");
      relight(t, light, direct);
      EXPECT_EQ(out.values, direct.values);
      for (size_t r = 0; r < count; ++r)
        expect_near(out, r, product(load_receiver(t, r), 4, size_t(channels), light), 2e-6f);
    }
}

TEST(Relighter, OfClusters) {
  CpcaTransfer t{.light = {.order = 3}, .rows = 4, .channels = 3, .receivers = count, .clusters = 3, .rank = 5};
  Random random(5);
  for (size_t i = 0; i < 3 * 6 * t.receiver_values(); ++i) t.vectors.push_back(random.next() - 0.5f);
  for (size_t r = 0; r < count; ++r) t.cluster_of.push_back(uint16_t(r % 3));
  for (size_t i = 0; i < count * 5; ++i) t.weights.push_back(float_to_half(2 * random.next() - 1));
  const Field field{vertices(), t, DirectionalRows{DirectionalKind::sh2}};
  Relighter relighter = make(field);
  const std::vector<Vec3> light = random_light(9);
  ASSERT_EQ(message(relighter.set_light(light)), "");
  Relit out, direct;
  ASSERT_EQ(message(relighter.relight({}, out)), "");
  relight(t, light, direct);
  EXPECT_EQ(out.values, direct.values);
  for (size_t r = 0; r < count; ++r) expect_near(out, r, product(load_receiver(t, r), 4, 3, light), 5e-6f);
  expect_in_part(relighter);
}

// Lobes as baked, turned, and under a light of each receiver's own; by the table and directly.
TEST(Relighter, OfLobes) {
  const WritableZonalTransfer w = make_zonal_transfer(5, 3, 3, count, Precision::single, 2);
  Random random(6);
  std::vector<Mat3> rotations;
  for (size_t r = 0; r < count; ++r) {
    std::vector<float> values(w.transfer.receiver_values());
    for (float& v : values) v = random.next() - 0.5f;
    for (size_t row = 0; row < 2; ++row)
      for (size_t i = 0; i < 3; ++i) {
        float* a = values.data() + row * w.transfer.row_values() + w.transfer.exact_values() +
                   i * w.transfer.lobe_values();
        const Vec3 axis = square_to_sphere(random.next2());
        a[0] = axis.x, a[1] = axis.y, a[2] = axis.z;
      }
    store_receiver(w, r, values);
    rotations.push_back(rotation_from_yaw_pitch_roll({360 * random.next(), 90 * random.next(), 360 * random.next()}));
  }
  // Hemispherical rows of order 1 with b: two of them.
  Outgoing outgoing{OutgoingKind::hsh, 1, true, {}, {}, std::vector<Mat3>(count, Mat3(1.0f))};
  ASSERT_EQ(outgoing.rows(), 2);
  const Field field{vertices(), w.transfer, outgoing};
  const ReceiverFrames frames = make_receiver_frames(rotations);
  const std::vector<Vec3> light = random_light(25);
  LocalLight near{light, {{Vec3(2, 1, 0), 0.5f, Vec3(3)}}, {}};
  std::vector<Vec3> places;
  for (size_t r = 0; r < count; ++r) places.push_back({0.1f * float(r), 0, 0});
  const LightField local = make_light_field(near, places);
  auto expected = [&](size_t r, bool turned, std::span<const Vec3> l) {
    const std::vector<float> values = load_receiver(w.transfer, r);
    std::vector<float> rows;
    for (size_t row = 0; row < 2; ++row) {
      const auto sh = zonal_harmonics(w.transfer,
                                      std::span(values).subspan(row * w.transfer.row_values(), w.transfer.row_values()),
                                      turned ? rotations[r] : Mat3(1.0f));
      rows.insert(rows.end(), sh.begin(), sh.end());
    }
    return product(rows, 2, 3, l);
  };
  ZonalLight table;
  specialise_light(w.transfer, light, table);
  for (bool directly : {false, true}) {
    Relighter relighter = make(field, {.direct_lobes = directly});
    ASSERT_EQ(message(relighter.set_light(light)), "");
    for (bool turned : {false, true}) {
      const ReceiverFrames* f = turned ? &frames : nullptr;
      Relit out, direct;
      ASSERT_EQ(message(relighter.relight({.frames = f}, out)), "");
      if (directly) relight_zonal(w.transfer, f, light, direct);
      else relight_zonal(w.transfer, f, table, direct);
      EXPECT_EQ(out.values, direct.values);
      // The table's own error: zonal_test.cpp.
      for (size_t r = 0; r < count; ++r) expect_near(out, r, expected(r, turned, light), directly ? 1e-4f : 0.06f);
      ASSERT_EQ(message(relighter.relight({.frames = f, .light = &local}, out)), "");
      std::vector<Vec3> here(25);
      for (size_t r = 0; r < count; ++r) {
        light_at(near, places[r], here);
        expect_near(out, r, expected(r, turned, here), 1e-4f);
      }
    }
  }
  Relighter relighter = make(field);
  Relit out;
  EXPECT_EQ(message(relighter.relight({.light = &local}, out)), "");  // no other light is needed
  const ReceiverFrames few = make_receiver_frames(std::span(rotations).first(5));
  EXPECT_NE(message(relighter.relight({.frames = &few, .light = &local}, out)), "");
  const LightField coarse = make_light_field({std::vector<Vec3>(16), {}, {}}, places);
  EXPECT_NE(message(relighter.relight({.light = &coarse}, out)), "");
  ASSERT_EQ(message(relighter.set_light(light)), "");
  expect_in_part(relighter);
}

// Against the sum over directions: X_j = 1/pi sum of z_j L V cos, V cos / pi as the store has it.
TEST(Relighter, OfFactors) {
  constexpr int n = 3, m = 2;
  WritableTransfer w = make_transfer({.order = n + m - 1}, 1, 1, count, Precision::single);
  Outgoing outgoing{.kind = OutgoingKind::map, .order = m};
  outgoing.maps.push_back({2, sh_count(m), std::vector<ViewWeights>(4 * size_t(sh_count(m)))});
  outgoing.map_of.assign(count, 0);
  Random random(7);
  for (size_t r = 0; r < count; ++r) {
    std::vector<float> values(w.transfer.receiver_values());
    for (float& v : values) v = random.next() - 0.5f;
    store_receiver(w, r, values);
    outgoing.frames.push_back(frame_about(square_to_sphere(random.next2())));
  }
  const Field field{vertices(), FactoredTransfer{w.transfer, m}, outgoing};
  Relighter relighter = make(field);
  EXPECT_EQ(relighter.light().order, n);
  EXPECT_EQ(relighter.rows(), 4);
  const std::vector<Vec3> light = random_light(9);
  ASSERT_EQ(message(relighter.set_light(light)), "");
  Relit out, direct;
  ASSERT_EQ(message(relighter.relight({}, out)), "");
  relight_factors(w.transfer, outgoing, light, direct);
  EXPECT_EQ(out.values, direct.values);
  const CosineBasis basis = make_cosine_basis(m);
  for (size_t r = 0; r < count; ++r) {
    const std::vector<float> V = load_receiver(w.transfer, r);
    std::vector<Vec3> expected(4);
    for (size_t c = 0; c < 3; ++c) {
      auto incident = [&](Vec3d d) {
        double L = 0, seen = 0, y[sh_count(n + m - 1)];
        evaluate_sh(n + m - 1, d, std::span<double>(y));
        for (size_t k = 0; k < 9; ++k) L += y[k] * double(light[k][c]);
        for (size_t k = 0; k < V.size(); ++k) seen += y[k] * double(V[k]);
        return L * seen;
      };
      // Harmonics of the product, in the receiver's frame; then the incident basis, which is triangular in them.
      const std::vector<double> sh = project_sh(m, [&](Vec3d d) {
        const Mat3d f(outgoing.frames[r]);
        return incident(f * d);
      });
      for (size_t j = 0; j < 4; ++j) {
        double sum = 0;
        for (size_t k = 0; k <= j; ++k) sum += basis.from_sh[j * 4 + k] * sh[k];
        expected[j][c] = float(sum);
      }
    }
    expect_near(out, r, expected, 5e-6f);
  }
}

struct Blocks {
  Field field;
  ProductReceivers receivers;
  CubeLight light;
};
Blocks make_blocks() {
  constexpr int size = 16;
  const Cube cube = make_cube(size);
  Blocks b{{vertices(), Store{}, SightRows{}}, {}, {}};
  Random random(8);
  std::vector<std::vector<uint8_t>> pieces(1);
  std::vector<uint32_t> lengths;
  for (size_t r = 0; r < count; ++r) {
    b.receivers.positions.push_back({float(r), 0, 0});
    b.receivers.frames.push_back(frame_about(square_to_sphere(random.next2())));
    b.receivers.material_of.push_back(uint32_t(r % 2));
    std::vector<uint8_t> levels(cube.count());
    for (size_t t = 0; t < levels.size(); ++t)
      levels[t] = dot(b.receivers.frames[r][2], cube.texels.at(t)) > 0 && cube.texels.at(t).x < 0.7f;
    const size_t before = pieces[0].size();
    encode_visibility(size, 1, levels, pieces[0]);
    lengths.push_back(uint32_t(pieces[0].size() - before));
  }
  b.field.store = make_visibility(size, 1, std::move(pieces), lengths);
  for (const Brdf& brdf : {Brdf(Lambert{Vec3(0.8f, 0.5f, 0.2f)}), Brdf(Phong{Vec3(0.2f), Vec3(0.7f, 0.5f, 0.3f), 8})})
    b.receivers.materials.push_back(make_product_material(brdf, cube, {SamplingRule::full}));
  b.light =
      cube_light(make_environment("", 64, 32, [](Vec3 d) { return Vec3(1 + d.x, 1 + d.y, 1 - d.z * d.y); }), size);
  return b;
}

TEST(Relighter, OfBlocks) {
  const Blocks b = make_blocks();
  const auto& v = std::get<Visibility>(b.field.store);
  const Vec3 eye(3, 4, 5);
  BlockLight light;
  set_light(light, b.light);
  const HaarLight haar = make_haar_light(b.light, 0.5);
  std::vector<uint32_t> all(count);
  std::iota(all.begin(), all.end(), 0u);
  for (Product product : {Product::blocks, Product::standard, Product::haar}) {
    Relighter relighter = make(b.field, {.receivers = b.receivers, .product = product, .haar_fraction = 0.5});
    EXPECT_EQ(relighter.light().count(), 0u);
    EXPECT_EQ(relighter.rows(), 1);
    ASSERT_EQ(message(relighter.set_light(b.light)), "");
    Relit out, direct;
    ASSERT_EQ(message(relighter.relight({.eye = eye}, out)), "");
    shade_receivers(product, light, &haar, v, b.receivers, all, eye, direct);
    EXPECT_EQ(out.values, direct.values);
    if (product != Product::haar)
      for (size_t r = 0; r < count; ++r) {
        const Vec3 expected = shade_standard_scalar(light, v, r, b.receivers.materials[r % 2], b.receivers.frames[r],
                                                    normalize(eye - b.receivers.positions[r]));
        expect_near(out, r, std::span(&expected, 1), 2e-4f);
      }
    const std::vector<uint32_t> seen{3, 20};
    Breakdown breakdown;
    ASSERT_EQ(message(relighter.relight({.eye = eye, .seen = seen, .breakdown = &breakdown}, out)), "");
    for (uint32_t r = 0; r < count; ++r) EXPECT_EQ(out.at(r), r == 3 || r == 20 ? direct.at(r) : Vec3(0));
    EXPECT_EQ(breakdown.triple + breakdown.light_brdf > 0, product == Product::blocks);
  }
  // Materials and places that do not fit, light of the wrong kind, a receiver that is not there.
  EXPECT_FALSE(Relighter::make(b.field));
  ProductReceivers wrong = b.receivers;
  wrong.material_of[5] = 2;
  EXPECT_FALSE(Relighter::make(b.field, {.receivers = wrong}));
  Relighter relighter = make(b.field, {.receivers = b.receivers});
  Relit out;
  EXPECT_NE(message(relighter.relight({.eye = eye}, out)), "");  // no light
  EXPECT_NE(message(relighter.set_light(random_light(9))), "");
  EXPECT_NE(message(relighter.set_light(cube_light(make_environment("", 8, 4, [](Vec3) { return Vec3(1); }), 32))), "");
  ASSERT_EQ(message(relighter.set_light(b.light)), "");
  const std::vector<uint32_t> beyond{uint32_t(count)};
  EXPECT_NE(message(relighter.relight({.eye = eye, .seen = beyond}, out)), "");
}

TEST(Relighter, OfDenseTransferInPart) {
  for (int channels : {1, 3}) {
    const Field field = dense_field(channels, channels == 1 ? Precision::half : Precision::single);
    Relighter relighter = make(field);
    ASSERT_EQ(message(relighter.set_light(random_light(11))), "");
    expect_in_part(relighter);
  }
}

TEST(Relighter, RefusesWhatAStoreCannotUse) {
  const Field field = dense_field(1, Precision::half);
  Relighter relighter = make(field);
  Relit out;
  EXPECT_NE(message(relighter.relight({}, out)), "");  // no light
  EXPECT_NE(message(relighter.set_light(random_light(10))), "");
  EXPECT_NE(message(relighter.set_light(random_light(12))), "");
  EXPECT_NE(message(relighter.set_light(CubeLight{})), "");
  ASSERT_EQ(message(relighter.set_light(random_light(11))), "");
  const ReceiverFrames frames = make_receiver_frames(std::vector<Mat3>(count, Mat3(1.0f)));
  const LightField light = make_light_field({random_light(9), {}, {}}, std::vector<Vec3>(count));
  EXPECT_NE(message(relighter.relight({.frames = &frames}, out)), "");
  EXPECT_NE(message(relighter.relight({.light = &light}, out)), "");
  Field wrong = field;
  wrong.rows = DiffuseRows{};
  EXPECT_FALSE(Relighter::make(wrong));
}

// The caller's memory has what a Relit has, and nothing else is touched: aligned or not, tight or with gaps.
TEST(Relighter, FillsTheCallersMemory) {
  for (int channels : {1, 3})
    for (int rows : {1, 4}) {
      Field field = dense_field(channels, Precision::half);
      if (rows == 1) {
        const WritableTransfer w = make_transfer({.order = 3}, 1, channels, count, Precision::half);
        std::vector<float> values(w.transfer.receiver_values());
        for (size_t r = 0; r < count; ++r) {
          for (size_t k = 0; k < values.size(); ++k) values[k] = std::sin(float(r * 31 + k));
          store_receiver(w, r, values);
        }
        field.store = w.transfer, field.rows = DiffuseRows{};
      }
      Relighter relighter = make(field);
      const std::vector<Vec3> light = random_light(relighter.light().count());
      ASSERT_EQ(message(relighter.set_light(light)), "");
      Relit expected;
      ASSERT_EQ(message(relighter.relight({}, expected)), "");
      const size_t each = 3 * size_t(rows);
      for (size_t stride : {each, each + 1})
        for (size_t offset : {size_t(0), size_t(3)}) {
          AlignedVector<float> memory(offset + count * stride + 8, -7.0f);
          ASSERT_EQ(
              message(relighter.relight({}, std::span(memory).subspan(offset, (count - 1) * stride + each), stride)),
              "");
          std::vector<bool> touched(memory.size(), false);
          for (size_t r = 0; r < count; ++r)
            for (size_t i = 0; i < each; ++i) {
              EXPECT_EQ(memory[offset + r * stride + i], expected.at(r, int(i / 3))[i % 3]) << r << ' ' << i;
              touched[offset + r * stride + i] = true;
            }
          for (size_t i = 0; i < memory.size(); ++i)
            if (!touched[i]) {
              EXPECT_EQ(memory[i], -7.0f);
            }
          EXPECT_NE(message(relighter.relight({}, std::span(memory).first((count - 1) * stride + each - 1), stride)),
                    "");
          EXPECT_NE(message(relighter.relight({}, memory, each - 1)), "");
        }
    }
}

TEST(Relighter, MovesWithItsState) {
  const Field field = dense_field(3, Precision::single);
  Relighter a = make(field);
  ASSERT_EQ(message(a.set_light(random_light(11))), "");
  Relit first, second;
  ASSERT_EQ(message(a.relight({}, first)), "");
  Relighter b = std::move(a);
  const float* place = first.values.data();
  ASSERT_EQ(message(b.relight({}, second)), "");
  EXPECT_EQ(first.values, second.values);
  ASSERT_EQ(message(b.relight({}, first)), "");
  EXPECT_EQ(first.values.data(), place);
}

}  // namespace
}  // namespace lambent
