// First-fit decreasing-height shelves (Coffman, Garey, Johnson and Tarjan 1980), the first shelf with room found in a
// tree.
#include <lambent/core/check.h>
#include <lambent/receivers/atlas.h>

#include <bit>
#include <numeric>

namespace lambent {
namespace {

// Room left on each of many shelves; finds the first with enough.
class ShelfTree {
 public:
  explicit ShelfTree(size_t shelves) : leaves_(std::bit_ceil(std::max<size_t>(shelves, 1))), room_(2 * leaves_, 0) {}
  void set(size_t shelf, int room) {
    size_t i = leaves_ + shelf;
    room_[i] = room;
    while (i >>= 1) room_[i] = std::max(room_[2 * i], room_[2 * i + 1]);
  }
  int room(size_t shelf) const { return room_[leaves_ + shelf]; }
  size_t first(int wanted) const {  // leaves_ if there is none
    if (room_[1] < wanted) return leaves_;
    size_t i = 1;
    while (i < leaves_) i = room_[2 * i] >= wanted ? 2 * i : 2 * i + 1;
    return i - leaves_;
  }
  size_t capacity() const { return leaves_; }

 private:
  size_t leaves_;
  std::vector<int> room_;
};

}  // namespace

Packing pack_shelves(const std::vector<std::array<int, 2>>& sizes, int width) {
  std::vector<uint32_t> order(sizes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    if (sizes[a][1] != sizes[b][1]) return sizes[a][1] > sizes[b][1];
    return sizes[a][0] != sizes[b][0] ? sizes[a][0] > sizes[b][0] : a < b;
  });
  Packing packing;
  packing.places.resize(sizes.size());
  ShelfTree shelves(sizes.size());
  std::vector<int64_t> tops;
  for (uint32_t i : order) {
    const auto [w, h] = sizes[i];
    LAMBENT_CHECK(w >= 1 && h >= 1 && w <= width);
    size_t shelf = shelves.first(w);
    if (shelf == shelves.capacity()) {
      shelf = tops.size();
      tops.push_back(packing.height);
      packing.height += h;
      shelves.set(shelf, width);
    }
    packing.places[i] = {width - shelves.room(shelf), int(std::min<int64_t>(tops[shelf], INT32_MAX))};
    shelves.set(shelf, shelves.room(shelf) - w);
  }
  return packing;
}

}  // namespace lambent
