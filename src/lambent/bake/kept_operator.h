#pragma once
// An operator whose applications are kept (core/checkpoint.h): rows that an earlier run has computed are read, not
// computed again. Bounces and solvers ask for each piece of rows once an application, so that the number of times a
// piece was asked for says which application it is of.
#include <lambent/bake/linear.h>
#include <lambent/core/checkpoint.h>

namespace lambent {

class KeptOperator final : public LinearOperator {
 public:
  // `applications`: how many there will be, or 0. Without a checkpoint it is `op`.
  KeptOperator(const LinearOperator& op, Progress* progress, const char* stage, int applications)
      : op_(op), kept_(progress, stage, size_t(applications) * piece_count()), asked_(kept_ ? piece_count() : 0) {}

  size_t rows() const override { return op_.rows(); }
  size_t piece() const override { return op_.piece(); }
  size_t size(size_t width) const override { return op_.size(width); }
  void keep(size_t first, size_t count, const float* y, size_t width, float* x) const override {
    op_.keep(first, count, y, width, x);
  }
  Shares shares() const override { return op_.shares(); }
  void fetch(float* x, size_t width) const override { op_.fetch(x, width); }
  bool is_filled(size_t row) const override { return op_.is_filled(row); }
  void fill(float* x, size_t width) const override { op_.fill(x, width); }
  std::optional<TransposedRows> transposed() const override { return op_.transposed(); }

  // What is kept is y as it leaves, with what it held before.
  void add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float* half) const override {
    if (!kept_) return op_.add_rows(first, count, x, width, y, half);
    const size_t piece_number = first / piece();
    const uint64_t number = uint64_t(asked_[piece_number]++) * piece_count() + piece_number;
    const std::span<float> out(y, count * width),
        half_out(half, half ? (checked_count(first + count) - checked_count(first)) * width : 0);
    if (kept_.load(number, out, half_out)) return;
    op_.add_rows(first, count, x, width, y, half);
    kept_.save(number, out, half_out);
  }

 private:
  size_t piece_count() const { return (op_.rows() + op_.piece() - 1) / op_.piece(); }
  const LinearOperator& op_;
  KeptPieces kept_;
  mutable std::vector<uint32_t> asked_;  // of each piece; one thread at a time has it
};

}  // namespace lambent
