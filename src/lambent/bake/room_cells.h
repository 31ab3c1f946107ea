#pragma once
// The cells of a light field (room_space.h) that rays have met, and of each the rays that stand for it.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lambent {

// Rays that stand for a cell, of those that were met there.
inline constexpr int most_node_rays = 24;

// A ray through a cell: 16 bits of a key that tells it from others, whatever the order in which they are found, then 12
// each of where it is within its cell, of place along two axes and of direction along the square's.
using CellRay = uint64_t;
inline constexpr int cell_ray_bits = 12;

struct Crossing {
  uint32_t opening = 0, cell = 0;
  CellRay ray = 0;
};

// Sorts them, and leaves of each cell the rays that are least, at most most_node_rays.
void keep_least(std::vector<Crossing>& crossings);

// A bit a cell, and how many have been met before each 64: two bits a cell, however many of them rays have met.
class CellSet {
 public:
  CellSet() = default;
  CellSet(size_t cells, std::span<const uint32_t> met);  // met: that rise
  bool empty() const { return bits_.empty(); }
  bool has(uint32_t cell) const { return bits_[cell / 64] >> (cell % 64) & 1; }
  uint32_t number(uint32_t cell) const;  // of one that was met, among them
  size_t bytes() const { return bits_.size() * (sizeof(uint64_t) + sizeof(uint32_t)); }

 private:
  std::vector<uint64_t> bits_;
  std::vector<uint32_t> before_;
};

// In the order of cells.
struct CellRays {
  std::vector<uint32_t> cells, first{0};  // first: ray of each cell, and their end
  std::vector<uint8_t> generation;        // of each cell: that of the search which met it
  std::vector<CellRay> rays;              // of each cell rising

  // Adds crossings of one opening, as keep_least() leaves them: of each cell the least stay.
  void merge(std::span<const Crossing> found, uint8_t generation);
  std::span<const CellRay> of(size_t i) const { return {rays.data() + first[i], first[i + 1] - first[i]}; }
  size_t bytes() const { return 9 * cells.size() + sizeof(CellRay) * rays.size(); }
};

}  // namespace lambent
