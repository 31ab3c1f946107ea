#pragma once
// The linear operator A of x = e + A x, by its rows: hit rows that are kept or traced again (operator.h), glossy rows
// (matrix_rows.h), rows of walks through a medium (subsurface_rows.h). The solvers (solve.h) know nothing else of it.
#include <lambent/core/aligned.h>
#include <lambent/core/ranks.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace lambent {

// Receivers whose half-sample rows are kept too, to estimate the error: one in this many.
inline constexpr size_t check_every = 16;
constexpr size_t checked_count(size_t receivers) { return (receivers + check_every - 1) / check_every; }
// Receivers traced and multiplied as one piece of work.
inline constexpr size_t gather_block = 64;

// A' of x = e + A' x transposed, as lists: for row j, all (i, weight) with A'_ij. Rows of A' are those of A, but for
// filled rows, which are means of others. Takes memory of its own, 8 bytes an entry.
struct TransposedRows {
  std::vector<size_t> first;  // of column j, into the two below; one more at the end
  std::vector<uint32_t> row;
  std::vector<float> weight;  // [entry][channel]
  int channels = 1;
};

class LinearOperator {
 public:
  virtual ~LinearOperator() = default;
  virtual size_t rows() const = 0;
  // y += rows [first, first + count) of A x; y is [row][width], width a multiple of lane_multiple but for walks.
  // `first` is a multiple of piece() and count at most that. `half`, where not null, takes the same by the first half
  // of the rays, of the rows divisible by check_every. From any thread.
  virtual void add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float* half) const = 0;
  virtual size_t piece() const { return gather_block; }  // divides gather_block

  // The rows of A that are known here; of others nothing is asked. With more ranks than one (core/ranks.h) x and y have
  // all rows everywhere, and of them this rank's own are set, until fetch() has brought those that its rows of A meet.
  virtual Shares shares() const { return Shares::of_one(rows(), gather_block); }
  virtual void fetch(float*, size_t) const {}

  // Floats of x, and how rows y become part of it. By default x is those rows.
  virtual size_t size(size_t width) const { return rows() * width; }
  virtual void keep(size_t first, size_t count, const float* y, size_t width, float* x) const;

  // Rows of receivers inside something: x = F x, what their neighbours have. They tell nothing of the error.
  virtual bool is_filled(size_t) const { return false; }
  virtual void fill(float*, size_t) const {}
  // None where rows are not known by their entries.
  virtual std::optional<TransposedRows> transposed() const { return std::nullopt; }

  // y = F A x; not in place, x fetched. All cores; sums in a fixed order. Left unfinished when cancelled.
  void apply(const float* x, size_t width, float* y, const Progress* progress = nullptr) const;
};

}  // namespace lambent
