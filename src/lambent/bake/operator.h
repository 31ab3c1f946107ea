#pragma once
// The gather operator as a whole: traced once, kept as far as a budget goes, and applied to any number of columns.
//   y = F B x,   F: values of buried receivers are those of their neighbours.
// Columns are light groups times channels, or coefficients times channels; a row of x holds them all, `width` padded
// floats.
#include <lambent/bake/kept_rows.h>
#include <lambent/core/pool.h>
#include <lambent/core/progress.h>

namespace lambent {

class GatherOperator {
 public:
  struct Report {
    size_t rays = 0, bytes = 0;  // traced so far; of the rows kept
    size_t buried = 0;
    double kept = 1;     // fraction of the blocks kept; the rest is traced again at each application
    double seconds = 0;  // of the first tracing
  };

  // Traces all receivers. By the same rays, on the way: `direct` (may be null; rows for all receivers) and the sky
  // rows, T0, into `sky` (may be null; [receiver][coefficient]); buried receivers' rows of both come from their
  // neighbours. At most `memory` bytes of hit rows are kept; with no `hits` none are made, and the operator is not to
  // be applied. The setup must outlive the operator. Errors: cancelled.
  static Result<GatherOperator> trace(const GatherSetup& setup, const GatherDirect* direct, float* sky, bool hits,
                                      size_t memory, Progress* progress = nullptr);

  size_t rows() const { return setup_->receivers.count(); }
  size_t blocks() const { return (rows() + gather_block - 1) / gather_block; }
  const Report& report() const { return report_; }
  const std::vector<uint8_t>& buried() const { return buried_; }

  // y = F B x; not in place. All cores; sums in a fixed order.
  void apply(const float* x, size_t width, float* y) const;
  // Rows of B x of one block, without F; y has room for gather_block rows.
  void apply_block(size_t block, const float* x, size_t width, float* y) const;
  // x = F x.
  void fill(float* x, size_t width) const { fill_buried(fill_, x, width, width); }
  // The matrix of x = e + A' x transposed, as lists: for receiver j, all (i, weight) with A'_ij. Rows of A' are those
  // of B, but for buried receivers, whose rows are the means of F. For solvers that push light; takes memory of its
  // own, 8 bytes an entry.
  struct Push {
    std::vector<size_t> first;  // of column j, into the two below; one more at the end
    std::vector<uint32_t> row;
    std::vector<float> weight;  // [entry][channel]
    int channels = 1;
  };
  Push transposed() const;

 private:
  const GatherSetup* setup_ = nullptr;
  // Calls f with the rows of a block, kept or traced again.
  void with_rows(size_t block, auto f) const;

  std::vector<uint8_t> buried_;
  std::vector<FillStep> fill_;
  std::shared_ptr<KeptRows> kept_;
  std::shared_ptr<Pool<GatherBlock>> gathered_;
  std::shared_ptr<Pool<GatherScratch, DeleteScratch>> scratch_;
  mutable Report report_;
};

}  // namespace lambent
