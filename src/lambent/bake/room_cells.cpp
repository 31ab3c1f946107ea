#include <lambent/bake/room_cells.h>

#include <algorithm>
#include <bit>
#include <tuple>

namespace lambent {

void keep_least(std::vector<Crossing>& crossings) {
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.opening, a.cell, a.ray) < std::tie(b.opening, b.cell, b.ray);
  });
  size_t count = 0, of_cell = 0;
  for (size_t i = 0; i < crossings.size(); ++i) {
    const bool same = count > 0 && crossings[i].opening == crossings[count - 1].opening &&
                      crossings[i].cell == crossings[count - 1].cell;
    of_cell = same ? of_cell + 1 : 0;
    if (of_cell < size_t(most_node_rays)) crossings[count++] = crossings[i];
  }
  crossings.resize(count);
}

CellSet::CellSet(size_t cells, std::span<const uint32_t> met) {
  bits_.assign((cells + 63) / 64, 0), before_.assign(bits_.size(), 0);
  for (const uint32_t cell : met) bits_[cell / 64] |= uint64_t{1} << (cell % 64);
  for (size_t i = 1; i < bits_.size(); ++i) before_[i] = before_[i - 1] + uint32_t(std::popcount(bits_[i - 1]));
}

uint32_t CellSet::number(uint32_t cell) const {
  const uint64_t below = bits_[cell / 64] & ((uint64_t{1} << (cell % 64)) - 1);
  return before_[cell / 64] + uint32_t(std::popcount(below));
}

void CellRays::merge(std::span<const Crossing> found, uint8_t of_search) {
  if (found.empty()) return;
  CellRays out;
  out.cells.reserve(cells.size() + found.size() / 4), out.rays.reserve(rays.size() + found.size());
  for (size_t i = 0, j = 0; i < cells.size() || j < found.size();) {
    const uint32_t cell =
        std::min(i < cells.size() ? cells[i] : UINT32_MAX, j < found.size() ? found[j].cell : UINT32_MAX);
    const bool old = i < cells.size() && cells[i] == cell;
    std::span<const CellRay> mine = old ? of(i) : std::span<const CellRay>();
    out.cells.push_back(cell), out.generation.push_back(old ? generation[i] : of_search);
    size_t m = 0;
    for (int kept = 0; kept < most_node_rays; ++kept) {
      const bool theirs = j < found.size() && found[j].cell == cell;
      if (m < mine.size() && (!theirs || mine[m] <= found[j].ray)) out.rays.push_back(mine[m++]);
      else if (theirs) out.rays.push_back(found[j++].ray);
      else break;
    }
    while (j < found.size() && found[j].cell == cell) ++j;
    out.first.push_back(uint32_t(out.rays.size()));
    i += old;
  }
  out.cells.shrink_to_fit(), out.rays.shrink_to_fit(), out.first.shrink_to_fit(), out.generation.shrink_to_fit();
  *this = std::move(out);
}

}  // namespace lambent
