// Spherical harmonics one function at a time, on one thread: evaluating, rotating and multiplying, orders 2 to 12.
// Inputs change from call to call and stay in the first-level cache. Limits are the plain code for the same thing in
// the same run; "public" is what the best published code is known to need on one thread of a like machine, in ns. Not
// measured here: building the tables.
#include "bench.h"

#include <lambent/basis/sh_product.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/random.h>

#include <map>

namespace lambent::bench {
namespace {

constexpr int inputs = 16, runs = 31;

// Least nanoseconds a call of f(i), i < inputs; `calls` of them a run. f returns a number that depends on what it did.
template <class F>
double nanoseconds(int calls, F&& f) {
  float sum = 0;
  const double seconds = least_seconds(runs, [&] {
    for (int i = 0; i < calls; ++i) sum += f(size_t(i) % inputs);
  });
  if (sum == 42.125f) std::fprintf(stderr, "an unlikely sum\n");  // the result is used
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

void basis_case(int order) {
  const size_t count = size_t(sh_count(order));
  Random random(1);
  std::vector<std::vector<float>> f(inputs, std::vector<float>(count));
  for (auto& c : f)
    for (float& x : c) x = 2 * random.next() - 1;
  std::vector<Vec3> directions;
  std::vector<Mat3> rotations;
  for (int i = 0; i < inputs; ++i) {
    directions.push_back(normalize(Vec3(random.next() - 0.5f, random.next() - 0.5f, random.next() - 0.5f)));
    rotations.push_back(
        rotation_from_yaw_pitch_roll({360 * random.next(), 180 * random.next() - 90, 360 * random.next()}));
  }
  std::vector<float> out(count);
  std::vector<double> exact(count);

  const double evaluate =
      nanoseconds(2000, [&](size_t i) { return evaluate_sh(order, directions[i], out), out.back(); });
  const double evaluate_double =
      nanoseconds(2000, [&](size_t i) { return evaluate_sh(order, Vec3d(directions[i]), exact), float(exact.back()); });
  report("sh_evaluate", evaluate, evaluate_double, "ns", "the same in double", about(order, {}, evaluate));

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
  report(
      "sh_product", product, plain, "ns", "the plain loop over the sparse tensor",
      about(order, {{3, 20.5}, {4, 67}, {5, 197}, {6, 690}, {8, 4240}, {10, 11700}}, product,
            {{"coefficients", tensor.value.size()}, {"speedup", plain / product}, {"aim", "speedup >= 3 at order 6"}}));
}

}  // namespace

void bench_basis() {
  for (int order : {2, 3, 4, 5, 6, 7, 8, 9, 10, 12}) basis_case(order);
}

}  // namespace lambent::bench
