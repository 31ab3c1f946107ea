#include <lambent/bake/linear.h>
#include <lambent/core/parallel.h>

#include <algorithm>

namespace lambent {

void LinearOperator::keep(size_t first, size_t count, const float* y, size_t width, float* x) const {
  std::copy_n(y, count * width, x + first * width);
}

void LinearOperator::apply(const float* x, size_t width, float* y, const Progress* progress) const {
  shares().for_own([&](size_t begin, size_t end) {
    for (size_t first = begin; first < end; first += piece()) {
      if (is_cancelled(progress)) return;
      const size_t count = std::min(piece(), end - first);
      std::fill_n(y + first * width, count * width, 0.0f);
      add_rows(first, count, x, width, y + first * width, nullptr);
    }
  });
  fill(y, width);
}

}  // namespace lambent
