#include <lambent/relight/arriving.h>

#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

namespace lambent {
namespace {

// What light below the horizon weighs beside a wrong one above it.
constexpr double below_weight = 1e-3;

}  // namespace

ArrivingLight arriving_light(const Relit& relit, const Outgoing& o) {
  LAMBENT_CHECK(o.kind == OutgoingKind::map && relit.rows == sh_count(o.order));
  const size_t n = size_t(sh_count(o.order));
  const std::vector<double> extend = extend_below(make_cosine_basis(o.order), below_weight);
  ArrivingLight out{o.order, std::vector<Vec3>(o.frames.size() * n)};
  parallel_for(o.frames.size(), 64, [&](size_t begin, size_t end) {
    std::vector<float> local(n), turned(n);
    for (size_t r = begin; r < end; ++r)
      for (int c = 0; c < 3; ++c) {
        for (size_t k = 0; k < n; ++k) {
          double sum = 0;
          for (size_t j = 0; j < n; ++j) sum += extend[k * n + j] * double(relit.at(r, int(j))[c]);
          local[k] = float(sum);
        }
        rotate_sh_zyz(o.frames[r], std::span<const float>(local), std::span<float>(turned));
        for (size_t k = 0; k < n; ++k) out.light[r * n + k][c] = turned[k];
      }
  });
  return out;
}

}  // namespace lambent
