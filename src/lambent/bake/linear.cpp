#include <lambent/bake/linear.h>
#include <lambent/core/parallel.h>

#include <algorithm>

namespace lambent {

void LinearOperator::keep(size_t first, size_t count, const float* y, size_t width, float* x) const {
  std::copy_n(y, count * width, x + first * width);
}

void LinearOperator::apply(const float* x, size_t width, float* y, const Progress* progress) const {
  parallel_for(rows(), piece(), [&](size_t begin, size_t end) {
    if (is_cancelled(progress)) return;
    std::fill(y + begin * width, y + end * width, 0.0f);
    add_rows(begin, end - begin, x, width, y + begin * width, nullptr);
  });
  fill(y, width);
}

}  // namespace lambent
