#pragma once
// The gather operator as a whole: traced once, kept as far as a budget goes, and applied to any number of columns.
//   y = F B x,   F: values of buried receivers are those of their neighbours.
// Columns are light groups times channels, or coefficients times channels; a row of x holds them all, `width` padded
// floats.
#include <lambent/bake/asked_rows.h>
#include <lambent/bake/kept_rows.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/pool.h>
#include <lambent/core/result.h>

#include <atomic>
#include <functional>

namespace lambent {

// What tracing is to yield. Buried receivers' rows of `direct` and `sky` come from their neighbours.
struct GatherWanted {
  const GatherDirect* direct = nullptr;  // rows for all receivers
  GatherSky sky{};                       // for all receivers, `buried` not read; rows may be null
  // More columns of the sky rows of receivers [first, first + count), before they are filled.
  std::function<void(size_t first, size_t count, const GatherSky& sky)> more{};
  bool hits = true;     // hit rows; with none the operator is not to be applied
  bool halves = false;  // and those of half of the rays
  size_t memory = 0;    // bytes of hit rows kept in memory, at most; more go where the progress says (`scratch`)
};

class GatherOperator final : public LinearOperator {
 public:
  struct Report {                                // of all ranks together
    size_t rays = 0, bytes = 0, file_bytes = 0;  // traced so far; of the rows kept, in memory and beyond it in a file
    size_t buried = 0;
    double kept = 1;     // fraction of the blocks kept; the rest is traced again at each application
    double seconds = 0;  // of the first tracing
  };

  // Traces all receivers; of those of other ranks it knows who is buried, and nothing else. The setup must outlive the
  // operator. Errors: cancelled.
  static Result<GatherOperator> trace(const GatherSetup& setup, const GatherWanted& wanted,
                                      Progress* progress = nullptr);
  // `direct` and `sky` ([receiver][sky channel][coefficient]) may be null.
  static Result<GatherOperator> trace(const GatherSetup& setup, const GatherDirect* direct, float* sky, bool hits,
                                      size_t memory, Progress* progress = nullptr);

  size_t rows() const override { return setup_->receivers.count(); }
  size_t blocks() const { return (rows() + gather_block - 1) / gather_block; }
  Report report() const;  // all ranks together
  const std::vector<uint8_t>& buried() const { return buried_; }

  void add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float* half) const override;
  bool is_filled(size_t row) const override { return buried_[row]; }
  Shares shares() const override { return shares_; }
  void fetch(float* x, size_t width) const override { ++shares_.ranks().asks, asked_.fetch(x, width); }
  void fill(float* x, size_t width) const override { fill(x, width, width); }
  // The same of rows that lie `stride` floats apart. With a projection F makes coefficients of means, too: what x
  // begins with (Source) are means.
  void fill(float* x, size_t stride, size_t width) const;
  std::optional<TransposedRows> transposed() const override;

 private:
  void fill_means(float* x, size_t stride, size_t width) const;
  struct Traced {
    KeptRows kept;
    Pool<GatherBlock> blocks;
    Pool<PackedBlock> packed;
    Pool<GatherScratch, DeleteScratch> scratch;
    Pool<AlignedVector<float>> sums;  // of a block's entries, not yet scaled
    std::atomic<size_t> rays{0};
  };
  // Calls f with the rows of a block, kept or traced again; those of half of the rays only where asked for.
  void with_rows(size_t block, bool halves, auto f) const;
  void trace_block(const GatherWanted& wanted, size_t begin, size_t end, const KeptPieces& pieces,
                   std::vector<uint8_t>& asked);

  const GatherSetup* setup_ = nullptr;
  Shares shares_;
  AskedRows asked_, sources_;  // by hits; of own rows that are filled
  std::vector<uint8_t> buried_;
  std::vector<FillStep> fill_;
  std::shared_ptr<Traced> traced_;
  Report report_;
};

}  // namespace lambent
