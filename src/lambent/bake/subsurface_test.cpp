// Light through media, against Chandrasekhar's closed form, the furnace, and a walk that goes the other way.
#include <lambent/bake/patch.h>
#include <lambent/bake/subsurface.h>
#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace lambent {
namespace {

Transfer baked(const Scene& scene, const Receivers& receivers, const Medium& medium, int samples, int bounces = 0,
               float period = 0, SubsurfaceReport* walks = nullptr) {
  auto tracer = Tracer::build(scene);
  EXPECT_TRUE(tracer);
  const BakeOptions options{.samples = samples, .bounces = bounces, .precision = Precision::single};
  auto t = bake_subsurface(scene, *tracer, receivers, options, {medium, period}, nullptr, walks);
  EXPECT_TRUE(t) << (t ? "" : t.error().text());
  return *t;
}

// Mean over receivers of the zonal coefficients of transfer about the normal.
std::array<double, 6> mean_zonal(const Transfer& t, const Receivers& receivers, int channel = 0) {
  std::array<double, 6> mean{};
  for (size_t r = 0; r < receivers.count(); ++r) {
    const std::vector<float> row = load_receiver(t, r);
    double y[36];
    evaluate_sh(6, Vec3d(receivers.normals[r]), y);
    for (int k = 0; k < 36; ++k) {
      const int l = sh_band(k);
      const double value = double(row[size_t(channel) * 36 + size_t(k)]) * y[k];
      mean[size_t(l)] += value / std::sqrt((2 * l + 1) / (4 * std::numbers::pi)) / double(receivers.count());
    }
  }
  return mean;
}

std::array<double, 6> zonal_at(double cosine) {
  double y[36];
  evaluate_sh(6, Vec3d(std::sqrt(std::max(0.0, 1 - cosine * cosine)), 0, cosine), y);
  return {y[0], y[2], y[6], y[12], y[20], y[30]};
}

// S. Chandrasekhar, Radiative Transfer, 1950: a half-space that scatters evenly reflects 1 - H(mu) sqrt(1 - albedo) of
// the light that comes at cosine mu, where 1 / H(mu) = sqrt(1 - albedo) + albedo/2 int_0^1 nu H(nu) / (mu + nu) dnu.
std::vector<double> half_space_reflectance(double albedo, const std::vector<QuadratureNode>& nodes) {
  std::vector<double> H(nodes.size(), 1.0);
  for (int iteration = 0; iteration < 2000; ++iteration)
    for (size_t i = 0; i < nodes.size(); ++i) {
      double sum = 0;
      for (size_t j = 0; j < nodes.size(); ++j) sum += nodes[j].weight * nodes[j].x * H[j] / (nodes[i].x + nodes[j].x);
      H[i] = 1 / (std::sqrt(1 - albedo) + albedo / 2 * sum);
    }
  for (double& h : H) h = 1 - h * std::sqrt(1 - albedo);
  return H;
}

// The exponential integrals E_n(x), n from 1.
double exponential_integral(int n, double x) {
  if (n == 1) return -std::expint(-x);
  return x == 0 ? 1.0 / (n - 1) : (std::exp(-x) - x * exponential_integral(n - 1, x)) / (n - 1);
}

// Of even light on one side, what a slab of that optical depth lets through that scatters evenly and absorbs nothing:
// its mean radiance S(t) = E2(t) / 2 + 1/2 int S(u) E1(|t - u|) du, constant in each of `slices`, thin towards the
// faces, by elimination; and 2 E3(depth) + 2 int S(t) E2(depth - t) dt of it.
double slab_lets_through(double depth, size_t slices) {
  std::vector<double> at, middle;
  for (size_t i = 0; i <= slices; ++i)
    at.push_back(depth / 2 * (1 - std::cos(std::numbers::pi * double(i) / double(slices))));
  for (size_t i = 0; i < slices; ++i) middle.push_back((at[i] + at[i + 1]) / 2);
  std::vector<std::vector<double>> rows(slices, std::vector<double>(slices + 1));
  for (size_t i = 0; i < slices; ++i) {
    for (size_t j = 0; j < slices; ++j) {
      const double near = exponential_integral(2, std::abs(at[j] - middle[i])),
                   far = exponential_integral(2, std::abs(at[j + 1] - middle[i]));
      rows[i][j] = i == j ? 1 - (2 - near - far) / 2 : -std::abs(near - far) / 2;
    }
    rows[i][slices] = exponential_integral(2, middle[i]) / 2;
  }
  for (size_t k = 0; k < slices; ++k)
    for (size_t i = 0; i < slices; ++i) {
      if (i == k) continue;
      const double share = rows[i][k] / rows[k][k];
      for (size_t j = k; j <= slices; ++j) rows[i][j] -= share * rows[k][j];
    }
  double through = 2 * exponential_integral(3, depth);
  for (size_t j = 0; j < slices; ++j)
    through += 2 * rows[j][slices] / rows[j][j] *
               (exponential_integral(3, depth - at[j + 1]) - exponential_integral(3, depth - at[j]));
  return through;
}

// Walks against the integral equation of the slab, solved without them.
TEST(Subsurface, AFloorLetsThroughWhatTheIntegralEquationSays) {
  SKIP_UNDER_SANITIZERS();
  constexpr int order = 16;
  double behind[order];  // integrals of the zonal harmonics over z < 0
  for (int l = 0; l < order; ++l) {
    behind[l] = 0;
    for (const QuadratureNode& node : gauss_legendre(64, -1, 0))
      behind[l] += 2 * std::numbers::pi * node.weight * std::sqrt((2 * l + 1) / (4 * std::numbers::pi)) *
                   std::legendre(unsigned(l), node.x);
  }
  for (const float depth : {0.5f, 1.0f, 2.0f}) {
    const double through = slab_lets_through(double(depth), 80);
    EXPECT_NEAR(through, slab_lets_through(double(depth), 40), 4e-4);
    PatchScene patch = make_patch({8, std::vector<float>(64, 0.3f)}, Vec3(1));
    add_floor(patch, depth / 40);
    auto tracer = Tracer::build(patch.scene);
    ASSERT_TRUE(tracer);
    SubsurfaceReport walks;
    auto t = bake_subsurface(patch.scene, *tracer, patch.receivers,
                             {.order = order, .samples = 4096, .bounces = 0, .precision = Precision::single},
                             {{Vec3(40), Vec3(0), 0, 1}, 1}, nullptr, &walks);
    ASSERT_TRUE(t) << t.error().text();
    double all = 0, below = 0;
    for (size_t r = 0; r < t->receivers; ++r) {
      const std::vector<float> row = load_receiver(*t, r);
      all += double(row[0]) * std::sqrt(4 * std::numbers::pi) / double(t->receivers);
      for (int l = 0; l < order; ++l) below += double(row[size_t(l * l + l)]) * behind[l] / double(t->receivers);
    }
    RecordProperty("through_" + std::to_string(depth), std::to_string(below));
    EXPECT_NEAR(all, 1, 1e-3);
    EXPECT_NEAR(below, through, 0.01) << depth;  // 262,144 walks, and 16 bands of half a sphere
  }
}

TEST(Subsurface, HalfSpaceReflectsWhatChandrasekharFound) {
  SKIP_UNDER_SANITIZERS();
  const auto nodes = gauss_legendre(64, 0, 1);
  const PatchScene patch = make_patch({8, std::vector<float>(64, 0.3f)}, Vec3(1));
  const Vec3 albedo(0.5f, 0.9f, 0.99f);
  SubsurfaceReport walks;
  const Transfer t =
      baked(patch.scene, patch.receivers, {40.0f * albedo, 40.0f * (1.0f - albedo), 0, 1}, 4096, 0, 1, &walks);
  ASSERT_EQ(t.channels, 3);
  EXPECT_EQ(walks.lost, 0);
  for (int c = 0; c < 3; ++c) {
    const std::vector<double> R = half_space_reflectance(albedo[c], nodes);
    std::array<double, 6> exact{};
    double diffuse = 0;
    for (size_t i = 0; i < nodes.size(); ++i) {
      const auto y = zonal_at(nodes[i].x);
      diffuse += 2 * nodes[i].weight * nodes[i].x * R[i];
      for (size_t l = 0; l < 6; ++l) exact[l] += 2 * nodes[i].weight * nodes[i].x * R[i] * y[l];
    }
    // The equation is solved right: H's mean is known, 2 (1 - sqrt(1 - albedo)) / albedo.
    double mean = 0;
    for (size_t i = 0; i < nodes.size(); ++i) mean += nodes[i].weight * (1 - R[i]) / std::sqrt(1 - double(albedo[c]));
    EXPECT_NEAR(mean, 2 * (1 - std::sqrt(1 - double(albedo[c]))) / double(albedo[c]), 1e-5);
    RecordProperty("diffuse" + std::to_string(c), std::to_string(diffuse));
    const auto of_channel = mean_zonal(t, patch.receivers, c);
    for (size_t l = 0; l < 6; ++l)
      EXPECT_NEAR(of_channel[l], exact[l], 0.002) << c << " " << l;  // 262,144 walks: 0.001 RMS or less
  }
}

TEST(Subsurface, ClosedBodiesWithoutAbsorptionGiveBackEvenLight) {
  const Scene sphere = make_sphere(1, 3, Vec3(1));
  const Receivers receivers = make_vertex_receivers(sphere);
  const float even = std::sqrt(4 * pi);
  for (float g : {0.0f, 0.8f}) {  // every walk ends in the light, and weighs 1
    SubsurfaceReport walks;
    const Transfer t = baked(sphere, receivers, {Vec3(5), Vec3(0), g, 1}, 32, 0, 0, &walks);
    EXPECT_LT(walks.lost, 1e-4);
    size_t apart = 0;
    for (size_t r = 0; r < receivers.count(); ++r) apart += std::abs(load_receiver(t, r)[0] * even - 1) > 1e-5;
    EXPECT_LE(apart, size_t(walks.lost * 32 * double(receivers.count()) + 0.5));
    // The mean chord of a convex body is 4 V / S, whatever scatters in it; a walk has an event for each free path, and
    // its last.
    EXPECT_NEAR(walks.events, 5 * 4.0 / 3 + 1, 0.15);
  }
  // A boundary mirrors some of it on the outside: the mean of Fresnel's reflectance over the cosine, 9.18% for 1.5.
  const auto nodes = gauss_legendre(64, 0, 1);
  double mirrored = 0;
  for (const QuadratureNode& q : nodes) mirrored += 2 * q.weight * q.x * fresnel_reflectance(q.x, 1.5);
  EXPECT_NEAR(mirrored, 0.0918, 1e-4);
  SubsurfaceReport walks;
  const Transfer t = baked(sphere, receivers, {Vec3(5), Vec3(0), 0, 1.5f}, 64, 0, 0, &walks);
  EXPECT_NEAR(mean_zonal(t, receivers)[0] * even, 1 - mirrored, 2e-3);
  EXPECT_LT(walks.lost, 1e-4);
}

// Photons from one direction into a sphere of the unit radius by its equation, counted where they leave.
std::array<double, 6> forward_sphere(double sigma_s, double sigma_a, double g, double eta, int photons,
                                     double* inward) {
  std::array<double, 6> sum{};
  Random random(77);
  auto uniform = [&] { return double(random.next64() >> 11) * 0x1p-53; };
  double taken = 0;
  for (int i = 0; i < photons; ++i) {
    const double radius = std::sqrt(uniform()), turn = 2 * std::numbers::pi * uniform();
    Vec3d p(radius * std::cos(turn), radius * std::sin(turn), std::sqrt(1 - radius * radius)), d(0, 0, -1);
    const double cosine = p.z, inside = std::sqrt(1 - (1 - cosine * cosine) / (eta * eta));
    const double rs = (cosine - eta * inside) / (cosine + eta * inside),
                 rp = (eta * cosine - inside) / (eta * cosine + inside);
    if (uniform() < (rs * rs + rp * rp) / 2) continue;
    ++taken;
    d = normalize(d / eta + (cosine / eta - inside) * p);
    while (true) {
      const double along = dot(p, d), to_wall = -along + std::sqrt(std::max(0.0, along * along + 1 - dot(p, p)));
      const double flight = -std::log(1 - uniform()) / (sigma_s + sigma_a);
      if (flight < to_wall) {
        p += flight * d;
        if (uniform() * (sigma_s + sigma_a) > sigma_s) break;
        // Henyey and Greenstein's cosine by its inverse, and a spin about d.
        const double q = (1 - g * g) / (1 - g + 2 * g * uniform()), c = (1 + g * g - q * q) / (2 * g),
                     a = 2 * std::numbers::pi * uniform();
        const Vec3d u = normalize(cross(d, std::abs(d.x) > 0.5 ? Vec3d(0, 1, 0) : Vec3d(1, 0, 0)));
        d = normalize(c * d + std::sqrt(std::max(0.0, 1 - c * c)) * (std::cos(a) * u + std::sin(a) * cross(d, u)));
        continue;
      }
      p = normalize(p + to_wall * d);
      const double ci = dot(d, p), s2 = (1 - ci * ci) * eta * eta;
      double reflects = 1;
      if (s2 < 1) {
        const double ct = std::sqrt(1 - s2), a = (eta * ci - ct) / (eta * ci + ct),
                     b = (ci - eta * ct) / (ci + eta * ct);
        reflects = (a * a + b * b) / 2;
      }
      if (uniform() < reflects) {
        d -= 2 * ci * p;
        continue;
      }
      const auto y = zonal_at(p.z);
      for (size_t l = 0; l < 6; ++l) sum[l] += y[l] / photons;
      break;
    }
  }
  *inward = taken / photons;
  return sum;
}

TEST(Subsurface, WalksBackwardsAgreeWithWalksForwards) {
  // By symmetry transfer is zonal about the normal, and its value for light at an angle from it is how much leaves at
  // that angle from the light.
  const Scene sphere = make_sphere(1, 4, Vec3(1));
  const Receivers receivers = make_vertex_receivers(sphere);
  double inward = 0;
  const auto forward = forward_sphere(4, 0.3, 0.6, 1.4, 400000, &inward);
  const Transfer t = baked(sphere, receivers, {Vec3(4), Vec3(0.3f), 0.6f, 1.4f}, 128);
  const auto backward = mean_zonal(t, receivers);
  for (size_t l = 0; l < 6; ++l)
    EXPECT_NEAR(backward[l], forward[l], 0.004) << l;  // noise of either 0.001; facets 1/500
  EXPECT_GT(inward, 0.85);
  EXPECT_LT(forward[1], 0.9 * forward[0]);  // light comes out behind as well
  // The other way of scattering is another result, so that g's sign is held.
  const auto other = mean_zonal(baked(sphere, receivers, {Vec3(4), Vec3(0.3f), -0.6f, 1.4f}, 16), receivers);
  EXPECT_GT(std::abs(other[1] - forward[1]), 0.03);
}

TEST(Subsurface, WhatComesOutMayEnterAgain) {
  // Two spheres side by side, all white: evenly lit, each bounce brings back some of what the other hides.
  Scene scene = make_sphere(1, 2, Vec3(1));
  add_sphere(scene, 0, "other", Vec3(2.2f, 0, 0), 1, 2);
  const Receivers receivers = make_vertex_receivers(scene);
  double last = 0;
  for (int bounces : {0, 1, 8}) {
    const double mean = mean_zonal(baked(scene, receivers, {Vec3(5), Vec3(0), 0, 1}, 64, bounces), receivers)[0] *
                        std::sqrt(4 * std::numbers::pi);
    EXPECT_GT(mean, last + 1e-3);
    last = mean;
  }
  EXPECT_NEAR(last, 1, 1e-3);
  EXPECT_LE(last, 1 + 1e-5);
}

TEST(Subsurface, IsTheSameOnOneThread) {
  const Scene sphere = make_sphere(1, 2, Vec3(0.9f, 0.5f, 0.2f));
  const Receivers receivers = make_vertex_receivers(sphere);
  const Medium medium{Vec3(3, 5, 8), Vec3(0.2f), 0.3f, 1.3f};
  const Transfer two = baked(sphere, receivers, medium, 16, 2);
  ThreadLimit one(1);
  const Transfer alone = baked(sphere, receivers, medium, 16, 2);
  EXPECT_TRUE(std::equal(two.data.begin(), two.data.end(), alone.data.begin(), alone.data.end()));
}

TEST(Subsurface, EndsWhateverItIsGiven) {
  const Scene quad = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 2, 2, Vec3(1));  // nothing behind it
  const Receivers receivers = make_vertex_receivers(quad);
  SubsurfaceReport walks;
  baked(quad, receivers, {Vec3(0), Vec3(0), 0, 1}, 8, 1, 0, &walks);
  EXPECT_EQ(walks.lost, 1);
  baked(quad, receivers, {Vec3(1e6f), Vec3(0), 0.999f, 3}, 8, 1, 0, &walks);
  EXPECT_GT(walks.lost, 0);
  const PatchScene patch = make_patch({2, std::vector<float>(4, 0)}, Vec3(1));
  baked(patch.scene, patch.receivers, {Vec3(0), Vec3(0), 0, 1}, 2, 0, 1, &walks);  // straight down for ever
  EXPECT_EQ(walks.lost, 1);
  auto tracer = Tracer::build(quad);
  auto fails = [&](BakeOptions options, const SubsurfaceOptions& medium) {
    return !bake_subsurface(quad, *tracer, receivers, options, medium);
  };
  EXPECT_TRUE(fails({.order = 0}, {}));
  EXPECT_TRUE(fails({.lobes = {{}}}, {}));
  EXPECT_TRUE(fails({.samples = 0}, {}));
  EXPECT_TRUE(fails({.bounces = 65}, {}));
  EXPECT_TRUE(fails({.memory = 100}, {}));
  EXPECT_TRUE(fails({}, {{Vec3(NAN), Vec3(0), 0, 1}}));
  EXPECT_TRUE(fails({}, {{Vec3(1), Vec3(-1), 0, 1}}));
  EXPECT_TRUE(fails({}, {{Vec3(1), Vec3(1), 1, 1}}));
  EXPECT_TRUE(fails({}, {{Vec3(1), Vec3(1), 0, 0.5f}}));
}

TEST(Subsurface, ReadsMedia) {
  auto m = parse_medium("sigma_s=1,2,3,sigma_a=0.5,g=-0.2,eta=1.3");
  ASSERT_TRUE(m) << m.error().text();
  EXPECT_EQ(m->sigma_s, Vec3(1, 2, 3));
  EXPECT_EQ(m->sigma_a, Vec3(0.5f));
  EXPECT_EQ(m->g, -0.2f);
  EXPECT_EQ(m->eta, 1.3f);
  m = parse_medium("marble:10");
  ASSERT_TRUE(m);
  EXPECT_NEAR(m->sigma_s.x, 21.9f, 1e-5f);
  EXPECT_EQ(m->eta, 1.5f);
  EXPECT_NEAR(parse_medium("ketchup")->sigma_a.z, 1450, 1e-2);
  for (const char* bad : {"",
                          "jelly",
                          "marble:",
                          "marble:0",
                          "marble:-1",
                          "marble:nan",
                          "marble:1,2",
                          "marble:1e9",
                          "sigma_s=1",
                          "sigma_a=1",
                          "sigma_s=,sigma_a=1",
                          "sigma_s=1,2,sigma_a=1",
                          "sigma_s=1sigma_a=1",
                          "sigma_s=1,sigma_a=1,",
                          "sigma_s=1,sigma_a=-1",
                          "sigma_s=1,sigma_a=inf",
                          "sigma_s=1,sigma_a=1,g=1",
                          "sigma_s=1,sigma_a=1,eta=0",
                          "sigma_s=1,sigma_a=1,mu=3",
                          "=1",
                          "=",
                          "sigma_s=1,=,=",
                          "sigma_s==1"})
    EXPECT_FALSE(parse_medium(bad)) << bad;
}

}  // namespace
}  // namespace lambent
