#pragma once
// The glossy rows of a matrix bake (matrix.h) as a linear operator: (G Y)(p), what the hits around a receiver scatter
// to it, kept or traced again. Its x are scattered rows Y = H X, as few as a material's response takes.
#include <lambent/bake/asked_rows.h>
#include <lambent/bake/linear.h>
#include <lambent/bake/matrix_gather.h>
#include <lambent/core/checkpoint.h>

#include <atomic>

namespace lambent {

class MatrixRows final : public LinearOperator {
 public:
  // Keeps at most `budget` bytes of hits. `gather` must outlive it; its buried receivers move.
  MatrixRows(MatrixGather& gather, size_t budget);
  // Traces all receivers. Errors: cancelled.
  Result<void> trace(Progress* progress);

  size_t rows() const override { return gather_.n(); }
  size_t piece() const override { return 1; }
  bool is_filled(size_t row) const override { return buried_[row]; }
  void add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float* half) const override;
  size_t size(size_t) const override { return gather_.first_row.back() * gather_.wc(); }
  void keep(size_t first, size_t count, const float* y, size_t width, float* x) const override;
  Shares shares() const override { return shares_; }
  void fetch(float* x, size_t width) const override;

  // Of this rank's rows.
  const float* T0(size_t row) const { return T0_.data() + row * gather_.t0_width(); }
  const float* T0_half(size_t row) const { return T0_half_.data() + row / check_every * gather_.t0_width(); }
  const std::vector<uint8_t>& buried() const { return buried_; }
  // Of all ranks together.
  size_t bytes() const { return shares_.ranks().sum(used_); }
  double kept() const;                                               // fraction of the blocks
  size_t rays_again() const { return shares_.ranks().sum(again_); }  // traced after the first time

 private:
  void trace_receiver(MatrixScratch& s, size_t r, MatrixHits& hits);
  void trace_block(size_t block, const KeptPieces* pieces);
  bool is_sound(const MatrixHits& hits, size_t receivers) const;
  void move_buried(Progress* progress);
  void note_asked(const MatrixHits& hits);

  MatrixGather& gather_;
  const size_t budget_;
  Shares shares_;
  AskedRows asked_;
  std::vector<uint8_t> asks_;  // by receiver; empty: one rank
  AlignedVector<float> T0_;
  std::vector<float> T0_half_;
  std::vector<uint8_t> buried_, is_kept_;
  std::vector<MatrixHits> kept_;  // by block
  std::atomic<size_t> used_{0};
  mutable std::atomic<size_t> again_{0};
};

}  // namespace lambent
