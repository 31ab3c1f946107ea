#pragma once
// Rows of x that other ranks own (core/ranks.h) and that this one's rows of A ask for: nothing else of x is exchanged
// between bounces. Source: radiosity, "Discussion" (vertices over a cluster's nodes, synchronised at each bounce).
#include <lambent/core/own_part.h>
#include <lambent/core/ranks.h>

#include <functional>
#include <utility>
#include <vector>

namespace lambent {

class AskedRows {
 public:
  AskedRows() = default;  // asks for nothing
  // asked[row]: whether it is wanted here; own ones are there. All ranks.
  AskedRows(const Shares& shares, const std::vector<uint8_t>& asked);

  // Where a row lies in x: its first float, and how many.
  using Place = std::function<std::pair<size_t, size_t>(size_t row)>;
  // Brings the rows of x that are asked for. All ranks.
  void fetch(float* x, const Place& place) const;
  void fetch(float* x, size_t width) const {
    fetch(x, [width](size_t row) { return std::pair(row * width, width); });
  }

 private:
  Shares shares_;
  size_t parts_ = 1;                                // of an exchange
  std::vector<std::vector<uint32_t>> take_, give_;  // rows, by rank
};

// Rows of other ranks are asked for no more. x: [row][width].
void forget_others(const Shares& shares, ZeroPages& x, size_t width);

}  // namespace lambent
