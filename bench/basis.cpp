// Spherical harmonics on one thread: evaluating one direction and many, rotating and multiplying, orders 2 to 16.
// Inputs change from call to call and stay in the first-level cache. Limits are the plain code for the same thing in
// the same run; "public" is what the best published code is known to need on one thread of a like machine, in ns. Not
// measured here: building the tables.
#include "bench.h"

#include <lambent/basis/sh_fixed.h>
#include <lambent/basis/sh_product.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/aligned.h>
#include <lambent/core/random.h>

#include <bit>
#include <map>

namespace lambent::bench {
namespace {

constexpr int inputs = 16, runs = 31;

// Least nanoseconds a call of f(i), i < inputs; `calls` of them a run. f returns a number that depends on what it did.
template <class F>
double nanoseconds(int calls, F&& f) {
  uint32_t bits = 0;  // no sum of floats, which a call makes wait for memory: 3 ns a call whatever it does
  const double seconds = least_seconds(runs, [&] {
    uint32_t seen = bits;
    for (int i = 0; i < calls; ++i) seen ^= std::bit_cast<uint32_t>(f(size_t(i) % inputs));
    bits = seen;
  });
  if (bits == 42) std::fprintf(stderr, "unlikely bits\n");  // the result is used
  return 1e9 * seconds / calls;
}

nlohmann::json about(int order, const std::map<int, double>& published, double ours,
                     nlohmann::json more = nlohmann::json::object()) {
  more["order"] = order, more["threads_used"] = 1;
  if (auto found = published.find(order); found != published.end()) {
    more["public_ns"] = found->second;
    more["ratio_to_public"] = ours / found->second;
  }
  return more;
}

// The recurrences of sh_tables.h as a loop, one direction at a time: the yardstick.
[[gnu::noinline]] void evaluate_plain(int order, Vec3 d, std::span<float> out) {
  static const ShTables t = make_sh_tables();  // in memory, not as literals
  float c = 1, s = 0;
  for (int m = 0; m < order; ++m) {
    float q1 = float(t.diagonal[m]), q2 = 0;
    for (int l = m; l < order; ++l) {
      if (l > m) {
        const float q = d.z * float(t.a[l][m]) * q1 + float(t.b[l][m]) * q2;
        q2 = q1, q1 = q;
      }
      out[size_t(sh_index(l, m))] = q1 * c;
      if (m > 0) out[size_t(sh_index(l, -m))] = q1 * s;
    }
    const float next = c * d.x - s * d.y;
    s = c * d.y + s * d.x, c = next;
  }
}

// What calling alone takes, which is a good part of what a low order does.
[[gnu::noinline]] void evaluate_nothing(int order, Vec3 d, std::span<float> out) {
  out[0] = d.x;
  asm volatile("" : : "r"(order));
}

// The same within this loop, its order known to the compiler.
template <int order>
double fixed_nanoseconds(std::span<const Vec3> directions) {
  float out[size_t(sh_count(order))];
  return nanoseconds(2000, [&](size_t i) {
    evaluate_sh<order>(directions[i], std::span<float, size_t(sh_count(order))>(out));
    asm volatile("" : : "r"(out) : "memory");  // every value is wanted
    return out[size_t(sh_count(order)) - 1];
  });
}
double fixed_nanoseconds(int order, std::span<const Vec3> directions) {
  switch (order) {
    case 2: return fixed_nanoseconds<2>(directions);
    case 3: return fixed_nanoseconds<3>(directions);
    case 4: return fixed_nanoseconds<4>(directions);
    case 5: return fixed_nanoseconds<5>(directions);
    case 6: return fixed_nanoseconds<6>(directions);
    default: return 0;
  }
}

void evaluate_case(int order) {
  const size_t count = size_t(sh_count(order)), many = 64;
  Random random(2);
  std::vector<Vec3> directions;
  AlignedVector<float> x, y, z, table(count * many);
  for (size_t i = 0; i < many; ++i) {
    const Vec3 d = normalize(Vec3(random.next() - 0.5f, random.next() - 0.5f, random.next() - 0.5f));
    directions.push_back(d), x.push_back(d.x), y.push_back(d.y), z.push_back(d.z);
  }
  std::vector<float> out(count);
  std::vector<double> exact(count);
  const double plain =
      nanoseconds(2000, [&](size_t i) { return evaluate_plain(order, directions[i], out), out.back(); });
  const double call =
      nanoseconds(2000, [&](size_t i) { return evaluate_nothing(order, directions[i], out), out.back(); });
  const double one = nanoseconds(2000, [&](size_t i) { return evaluate_sh(order, directions[i], out), out.back(); });
  const double one_double =
      nanoseconds(2000, [&](size_t i) { return evaluate_sh(order, Vec3d(directions[i]), exact), float(exact.back()); });
  const double batch =
      nanoseconds(100, [&](size_t) { return evaluate_sh(order, x, y, z, many, table), table.back(); }) / double(many);
  const std::string loop = "the recurrence as a loop, a direction at a time";
  report("sh_evaluate", one, plain, "ns", loop,
         about(order, {}, one,
               {{"speedup", plain / one}, {"call_ns", call}, {"double_ns", one_double}, {"aim", "speedup >= 4.5"}}));
  if (const double fixed = fixed_nanoseconds(order, directions); fixed > 0)
    report("sh_evaluate_fixed", fixed, plain, "ns", loop,
           about(order, {}, fixed, {{"speedup", plain / fixed}, {"aim", "speedup >= 4.5"}}));
  report("sh_evaluate_many", batch, plain, "ns a direction", loop,
         about(order, {}, batch, {{"speedup", plain / batch}, {"directions", many}, {"aim", "speedup >= 16"}}));
}

void basis_case(int order) {
  const size_t count = size_t(sh_count(order));
  Random random(1);
  std::vector<std::vector<float>> f(inputs, std::vector<float>(count));
  for (auto& c : f)
    for (float& x : c) x = 2 * random.next() - 1;
  std::vector<Mat3> rotations;
  for (int i = 0; i < inputs; ++i) {
    rotations.push_back(
        rotation_from_yaw_pitch_roll({360 * random.next(), 180 * random.next() - 90, 360 * random.next()}));
  }
  std::vector<float> out(count);
  const double rotate = nanoseconds(1000, [&](size_t i) { return rotate_sh_zyz(rotations[i], f[i], out), out.back(); });
  const double dense = nanoseconds(std::max(20, 2000 / int(count)), [&](size_t i) {
    return rotate_sh(make_sh_rotation(order, rotations[i]), f[i], out), out.back();
  });
  const ShRotation built = make_sh_rotation(order, rotations[0]);
  const double applied = nanoseconds(1000, [&](size_t i) { return rotate_sh(built, f[i], out), out.back(); });
  report("sh_rotate", rotate, dense, "ns", "building the dense blocks and applying them",
         about(order, {{3, 16.7}, {4, 25.9}, {5, 41.7}, {6, 64}}, rotate,
               {{"dense_blocks_given_ns", applied}, {"aim", "<= the public figure"}}));

  const TriplingTensor tensor = make_tripling_tensor(order, order, order);
  const int calls = std::max(10, 400000 / int(tensor.value.size()));
  const double product =
      nanoseconds(1000, [&](size_t i) { return multiply_sh(f[i], f[(i + 1) % inputs], out), out.back(); });
  const double plain = nanoseconds(std::min(calls, 1000), [&](size_t i) {
    return multiply_sh_plain(tensor, f[i], f[(i + 1) % inputs], out), out.back();
  });
  report("sh_product", product, plain, "ns", "the plain loop over the sparse tensor",
         about(order, {{3, 20.5}, {4, 67}, {5, 197}, {6, 690}, {8, 4240}, {10, 11700}}, product,
               {{"coefficients", tensor.value.size()}, {"speedup", plain / product}, {"aim", "speedup >= 4"}}));
}

}  // namespace

void bench_basis() {
  for (int order : {2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 16}) evaluate_case(order);
  for (int order : {2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16}) basis_case(order);
}

}  // namespace lambent::bench
