#include <lambent/brdf/load_measured.h>
#include <lambent/core/color.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "sanitizers.h"
#include "test_meshes.h"

namespace lambent {
namespace {

Vec3 direction(double theta, double phi) {
  return Vec3(Vec3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)));
}

std::span<const uint8_t> as_bytes(const std::string& text) { return test::bytes_of(text); }

// --- Angles

TEST(HalfDifference, RoundTripAndReciprocal) {
  Random random(1);
  constexpr float rounding = 2e-6f;
  for (int i = 0; i < 2000; ++i) {
    const HalfDifference a{random.next() * 1.5f + 0.01f, random.next() * 1.5f + 0.01f, random.next() * 3.1f + 0.01f};
    const DirectionPair pair = directions(a);
    const float relative = rounding / (std::sin(a.theta_d) * std::sin(a.theta_h) * std::cos(a.theta_d));
    for (const HalfDifference& b : {half_difference(pair.wi, pair.wo), half_difference(pair.wo, pair.wi)}) {
      EXPECT_NEAR(b.theta_h, a.theta_h, relative);
      EXPECT_NEAR(b.theta_d, a.theta_d, relative);
      EXPECT_NEAR(std::cos(2 * b.phi_d), std::cos(2 * a.phi_d), 2 * relative);
      EXPECT_NEAR(std::sin(2 * b.phi_d), std::sin(2 * a.phi_d), 2 * relative);
    }
  }
  // Isotropic: a turn about the normal changes nothing.
  const Vec3 wi = direction(0.7, 0.4), wo = direction(1.1, 2.9);
  const HalfDifference a = half_difference(wi, wo), b = half_difference(direction(0.7, 1.4), direction(1.1, 3.9));
  EXPECT_NEAR(a.theta_h, b.theta_h, rounding);
  EXPECT_NEAR(a.theta_d, b.theta_d, rounding);
  EXPECT_NEAR(a.phi_d, b.phi_d, rounding);
}

TEST(HalfDifference, KnownPairs) {
  constexpr float rounding = 1e-6f;
  const HalfDifference mirror = half_difference(direction(0.5, 0), direction(0.5, std::numbers::pi));
  EXPECT_NEAR(mirror.theta_h, 0, rounding);
  EXPECT_NEAR(mirror.theta_d, 0.5f, rounding);
  const HalfDifference back = half_difference(direction(0.8, 1), direction(0.8, 1));
  EXPECT_NEAR(back.theta_h, 0.8f, rounding);
  EXPECT_NEAR(back.theta_d, 0, rounding);
  const HalfDifference in_plane = half_difference(direction(0.9, 2), direction(0.1, 2));  // h at 0.5, wi further down
  EXPECT_NEAR(in_plane.theta_h, 0.5f, rounding);
  EXPECT_NEAR(in_plane.theta_d, 0.4f, rounding);
  EXPECT_NEAR(std::sin(in_plane.phi_d), 0, rounding);
}

// --- Colour

TEST(Color, WhiteOfD65AndTheMatchingFunctions) {
  // D65 under the CIE 1931 observer: x = 0.3127, y = 0.3290. The lobes fit the observer to 1 % of its peaks.
  constexpr double fit = 2e-3;
  Vec3d sum(0);
  for (double nm = 380; nm <= 780; nm += 5) sum += illuminant_d65(nm) * cie_matching_functions(nm);
  EXPECT_NEAR(sum.x / (sum.x + sum.y + sum.z), 0.3127, fit);
  EXPECT_NEAR(sum.y / (sum.x + sum.y + sum.z), 0.3290, fit);
  const Vec3d white = rec709_from_xyz({0.95047, 1, 1.08883});
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 1, 3e-4);  // the standard rounds its white to four digits
  EXPECT_EQ(illuminant_d65(560), 100);
  EXPECT_NEAR(illuminant_d65(565), (100 + 96.3342) / 2, 1e-9);
  EXPECT_EQ(illuminant_d65(379), 0);
  EXPECT_EQ(illuminant_d65(NAN), 0);
}

// --- MERL

constexpr double merl_scale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};

// A table of an isotropic BRDF, as its authors would write it: -1 where a direction lies below the horizon.
std::string merl_file(const Brdf& brdf, uint32_t h, uint32_t d, uint32_t p) {
  MeasuredTable shape;
  shape.theta_h = int(h), shape.theta_d = int(d), shape.phi_d = int(p);
  const uint32_t counts[3] = {h, d, p};
  std::string file(12 + size_t(h) * d * p * 24, '\0');
  std::memcpy(file.data(), counts, 12);
  const size_t cells = size_t(h) * d * p;
  for (int i = 0; i < int(h); ++i)
    for (int j = 0; j < int(d); ++j)
      for (int k = 0; k < int(p); ++k) {
        const DirectionPair pair = directions(cell_angles(shape, i, j, k));
        const bool above = pair.wi.z > 0 && pair.wo.z > 0;
        const Vec3 f = evaluate(brdf, pair.wi, pair.wo);
        for (int c = 0; c < 3; ++c) {
          const double x = above ? double(f[c]) / merl_scale[c] : -1;
          std::memcpy(file.data() + 12 + (size_t(c) * cells + shape.index(i, j, k)) * 8, &x, 8);
        }
      }
  return file;
}

Brdf measured_of(const std::string& file) {
  auto table = load_measured(as_bytes(file), "made.binary");
  EXPECT_TRUE(table) << table.error().text();
  return Measured{std::make_shared<const MeasuredTable>(std::move(*table))};
}

TEST(LoadMerl, ReadsBackAKnownBrdf) {
  // Full size. Trilinear between cells of 1 degree and 0.02 degrees or more of theta_h: below 1 % away from grazing,
  // where D, F and G of this width are smooth.
  const Brdf known = Ggx{Vec3(0.9f, 0.5f, 0.2f), Vec2(0.3f)};
  const std::string file = merl_file(known, 90, 90, 180);
  EXPECT_EQ(file.size(), 34992012u);  // what files of the data base have
  const Brdf read = measured_of(file);
  Random random(2);
  for (int i = 0; i < 5000; ++i) {
    Vec3 wi = square_to_cosine_hemisphere(random.next2()), wo = square_to_cosine_hemisphere(random.next2());
    if (std::min(wi.z, wo.z) < 0.15f) continue;
    const Vec3 a = evaluate(known, wi, wo), b = evaluate(read, wi, wo);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(b[c], a[c], 0.01f * a[c]) << wi.z << " " << wo.z;
  }
}

TEST(LoadMerl, FillsWhatWasNotMeasured) {
  MeasuredTable shape;
  shape.theta_h = 3, shape.theta_d = 4, shape.phi_d = 2;
  std::string file = merl_file(Lambert{Vec3(1)}, 3, 4, 2);
  auto put = [&](int h, int d, int p, double x) {
    for (size_t c = 0; c < 3; ++c) {
      const double scaled = x < 0 ? -1 : x / merl_scale[c];
      std::memcpy(file.data() + 12 + (c * 24 + shape.index(h, d, p)) * 8, &scaled, 8);
    }
  };
  for (int h = 0; h < 3; ++h)
    for (int d = 0; d < 4; ++d)
      for (int p = 0; p < 2; ++p) put(h, d, p, h == 0 || d == 3 ? -1 : 100 * h + 10 * d + p);
  put(1, 0, 1, -1);
  auto table = load_measured(as_bytes(file), "made.binary");
  ASSERT_TRUE(table);
  auto at = [&](int h, int d, int p) { return table->f[table->index(h, d, p)].x; };
  EXPECT_FLOAT_EQ(at(2, 3, 1), 221);  // the last one measured
  EXPECT_FLOAT_EQ(at(1, 0, 1), 111);  // the first one measured
  EXPECT_FLOAT_EQ(at(0, 0, 0), 100);  // a whole column: the first column of which anything was measured
  EXPECT_FLOAT_EQ(at(0, 2, 1), 120);
}

TEST(LoadMerl, RefusesWhatIsBroken) {
  const std::string good = merl_file(Lambert{Vec3(0.5f)}, 4, 3, 2);
  ASSERT_TRUE(load_measured(as_bytes(good), "a"));
  for (size_t length = 0; length < good.size(); ++length) {
    auto result = load_measured(as_bytes(good.substr(0, length)), "cut.binary");
    ASSERT_FALSE(result) << length;
    EXPECT_EQ(result.error().text().rfind("cut.binary", 0), 0u);
    EXPECT_EQ(result.error().text().find('\n'), std::string::npos);
  }
  EXPECT_FALSE(load_measured(as_bytes(good + "x"), "long.binary"));
  auto with = [&](double x, size_t number) {
    std::string file = good;
    std::memcpy(file.data() + 12 + number * 8, &x, 8);
    return load_measured(as_bytes(file), "a");
  };
  EXPECT_FALSE(with(NAN, 5));
  EXPECT_FALSE(with(INFINITY, 71));
  EXPECT_FALSE(with(1e300, 0));
  EXPECT_TRUE(with(-1, 0));
  std::string unmeasured = good;
  for (size_t i = 0; i < 72; ++i) {
    const double x = -1;
    std::memcpy(unmeasured.data() + 12 + i * 8, &x, 8);
  }
  EXPECT_FALSE(load_measured(as_bytes(unmeasured), "a"));
  for (uint32_t count : {0u, 361u, 0x80000000u, 0xffffffffu}) {
    std::string file = good;
    std::memcpy(file.data(), &count, 4);
    EXPECT_FALSE(load_measured(as_bytes(file), "a")) << count;
  }
}

// --- Cornell

// The directions that the Cornell files have: theta_i 10 to 80 degrees, theta_o ten steps to 79 degrees, azimuths about
// every 10.
std::string cornell_file(const Brdf& brdf, const std::function<double(double)>& spectrum) {
  std::string text = "# made by a test\n\n31 # wavelengths\n";
  for (int nm = 400; nm <= 700; nm += 10) text += fmt::format("{} ", nm);
  text += "\n# theta_i phi_i theta_o phi_o f\n";
  for (int i = 1; i <= 8; ++i)
    for (int j = 0; j < 10; ++j)
      for (int k = 0; k <= 18; ++k) {
        const double ti = radians(10.0 * i), to = radians(std::min(8.2 * j + 0.06 * j * j, 79.0)),
                     po = radians(-10.0 * k);
        if (j == 0 && k > 0) continue;
        const float f = evaluate(brdf, direction(ti, 0), direction(to, po)).x;
        text += fmt::format("{:.6f} {:.6f} {:.6f} {:.6f}", ti, 0.0, to, po);
        for (int nm = 400; nm <= 700; nm += 10) text += fmt::format(" {:.6g}", double(f) * spectrum(nm));
        text += "\n";
      }
  return text;
}

TEST(LoadCornell, ReadsBackAKnownBrdf) {
  // 1,400 samples, ten degrees apart, say of a lobe of this width what a mean of neighbours can: half of the
  // hemisphere's pairs are within 1 % (outside the lobe), nine tenths within 8 %.
  const Brdf known = Phong{Vec3(0.3f), Vec3(0.6f), 12};
  const Brdf read = measured_of(cornell_file(known, [](double) { return 1.0; }));
  Random random(3);
  std::vector<double> errors;
  for (int i = 0; i < 20000; ++i) {
    Vec3 wi = square_to_cosine_hemisphere(random.next2()), wo = square_to_cosine_hemisphere(random.next2());
    if (std::min(wi.z, wo.z) < 0.2f) continue;
    const Vec3 a = evaluate(known, wi, wo), b = evaluate(read, wi, wo);
    errors.push_back(std::abs(double(b.x) / double(a.x) - 1));
    EXPECT_NEAR(b.y, b.x, 1e-4f * b.x);  // a flat spectrum is grey
    EXPECT_NEAR(b.z, b.x, 1e-4f * b.x);
  }
  std::sort(errors.begin(), errors.end());
  std::printf("relative error: median %.4f, 90 %% below %.4f, largest %.4f\n", errors[errors.size() / 2],
              errors[errors.size() * 9 / 10], errors.back());
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.08);
}

TEST(LoadCornell, ColoursOfSpectra) {
  SKIP_UNDER_SANITIZERS();
  auto color = [](const std::function<double(double)>& spectrum) {
    return evaluate(measured_of(cornell_file(Lambert{Vec3(0.5f)}, spectrum)), Vec3(0, 0, 1), direction(0.5, 1)) * pi;
  };
  const Vec3 white = color([](double) { return 1.0; });
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 0.5f, 1e-4f);
  const Vec3 red = color([](double nm) { return nm > 600 ? 1.0 : 0.0; });
  EXPECT_GT(red.x, 0.3f);
  EXPECT_LT(std::max(red.y, red.z), 0.03f);
  const Vec3 blue = color([](double nm) { return nm < 480 ? 1.0 : 0.0; });
  EXPECT_GT(blue.z, 0.4f);
  EXPECT_LT(std::max(blue.x, blue.y), 0.1f);
  // Two halves of the spectrum add up to the whole.
  const Vec3 low = color([](double nm) { return nm < 545 ? 0.9 : 0.3; }),
             high = color([](double nm) { return nm < 545 ? 0.1 : 0.7; });
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(low[c] + high[c], 0.5f, 1e-3f);
}

TEST(Resample, CellsAtSamplesHaveTheirValues) {
  // Samples at the centres of a coarse table's cells, in all of it: resampled to the same cells, they come back.
  MeasuredTable shape;
  shape.theta_h = 5, shape.theta_d = 4, shape.phi_d = 4;
  std::vector<MeasuredSample> samples;
  Random random(4);
  for (int h = 0; h < 5; ++h)
    for (int d = 0; d < 4; ++d)
      for (int p = 0; p < 2; ++p) samples.push_back({cell_angles(shape, h, d, p), Vec3(0.1f + random.next())});
  const MeasuredTable table = resample_measured(samples, 5, 4, 4);
  size_t i = 0;
  for (int h = 0; h < 5; ++h)
    for (int d = 0; d < 4; ++d)
      for (int p = 0; p < 2; ++p, ++i) {
        EXPECT_NEAR(table.f[table.index(h, d, p)].x, samples[i].f.x, 1e-3f);
        EXPECT_EQ(table.f[table.index(h, d, 3 - p)], table.f[table.index(h, d, p)]);  // mirror image
      }
  // One sample, and several of one place.
  for (size_t count : {size_t{1}, size_t{30}}) {
    const std::vector<MeasuredSample> same(count, {cell_angles(shape, 1, 1, 1), Vec3(0.25f)});
    for (Vec3 f : resample_measured(same, 3, 3, 3).f) EXPECT_NEAR(f.x, 0.25f, 1e-6f);
  }
}

TEST(LoadCornell, RefusesWhatIsBroken) {
  const std::string head = "# c\n3\n440 540 640\n";
  auto error = [](const std::string& text) {
    auto result = load_measured(as_bytes(text), "x.brdf");
    return result ? std::string() : result.error().text();
  };
  const std::string waves = "# c\n4\n440 480 520 560\n", good = "# c\n6\n440 480 520 560 600 640\n";
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 6\n"), "");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 6 # end"), "");
  EXPECT_EQ(error(""), "x.brdf: is empty");
  EXPECT_EQ(error("hello"), "x.brdf: is neither a MERL table nor text that begins with the number of wavelengths");
  EXPECT_EQ(error("# nothing\n"),
            "x.brdf: is neither a MERL table nor text that begins with the number of wavelengths");
  EXPECT_EQ(error("1e9\n"), "x.brdf:1: the number of wavelengths is not between 3 and 1000");
  EXPECT_EQ(error("3.5\n"), "x.brdf:1: the number of wavelengths is not between 3 and 1000");
  EXPECT_EQ(error("3\n440 430 640\n"), "x.brdf:2: the wavelengths do not rise");
  EXPECT_EQ(error(head), "x.brdf:3: the wavelengths do not cover 440 to 640 nm in steps of at most 40 nm");
  EXPECT_EQ(error(waves), "x.brdf:3: the wavelengths do not cover 440 to 640 nm in steps of at most 40 nm");
  EXPECT_EQ(error(good), "x.brdf: has no measurements");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5\n"), "x.brdf: ends within a row of measurements");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 nan\n"), "x.brdf:4: a number is not finite");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 -6\n"), "x.brdf:4: a reflectance is negative");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 1e20\n"), "x.brdf:4: a reflectance is too large");
  EXPECT_EQ(error(good + "0.1 0 0.2 1 1 2 3 4 5 6x\n"), "x.brdf:4: expects a number");
  EXPECT_EQ(error(good + "1.6 0 0.2 1 1 2 3 4 5 6\n"), "x.brdf:4: a theta is not between 0 and pi / 2");
  EXPECT_EQ(error(good + "0.1 0 0.2 99 1 2 3 4 5 6\n"), "x.brdf:4: a phi is not between -8 and 8");
  EXPECT_FALSE(load_measured("no/such/file.brdf"));
}

// --- The data that come with the tests' data folder

TEST(LoadCornell, MeasuredPaints) {
  if (test::data_folder().empty()) GTEST_SKIP() << "no data folder";
  for (const char* name : {"krylon_blue", "mystique"}) {
    SCOPED_TRACE(name);
    auto table = load_measured(test::data_folder() + "/brdf/" + name + ".brdf");
    ASSERT_TRUE(table) << table.error().text();
    EXPECT_EQ(table->name, name);
    const Brdf brdf = Measured{std::make_shared<const MeasuredTable>(std::move(*table))};
    // Paints keep their energy, as far as the samples tell: each albedo by draws, at most 1 and not nearly black.
    for (double degrees : {10.0, 30.0, 50.0, 70.0}) {
      Random random(5);
      Vec3d sum(0);
      double squares = 0;
      constexpr int draws = 20000;
      for (int i = 0; i < draws; ++i) {
        const Vec3 w = sample(brdf, direction(radians(degrees), 0.3), random.next2()).weight;
        sum += Vec3d(w), squares += double(luminance(w)) * double(luminance(w));
      }
      const Vec3d albedo = sum / double(draws);
      const double mean = double(luminance(Vec3(albedo))), deviation = std::sqrt(squares / draws - mean * mean);
      std::printf("%s, eye at %.0f degrees: albedo %.3f %.3f %.3f, deviation of a draw %.2f of the mean\n", name,
                  degrees, albedo.x, albedo.y, albedo.z, deviation / mean);
      EXPECT_LT(std::max({albedo.x, albedo.y, albedo.z}), 1.0);
      EXPECT_GT(mean, 0.01);
      EXPECT_LT(deviation / mean, 4);
    }
  }
}

}  // namespace
}  // namespace lambent
