#include <lambent/basis/sh.h>
#include <lambent/core/huffman.h>
#include <lambent/transfer/indirect.h>

#include <algorithm>
#include <cmath>

namespace lambent {

size_t Surfels::first_node(size_t level) const {
  size_t first = 0;
  for (size_t l = 0; l < level; ++l) first += counts[l];
  return first;
}

IndirectTransfer::Bytes IndirectTransfer::bytes_of_parts() const {
  const size_t n = surfels.count(), coarsest = surfels.counts.empty() ? 0 : surfels.counts[0];
  const auto coded = [](const std::vector<uint8_t>& bytes) { return huffman_encode(bytes).size(); };
  const auto of = [&](const NodeRows& r) { return coded(pack_rows(r)) + coded(r.weights) + r.scales.size() * 4; };
  // Places 8, normals 4, areas 2, albedos 6, materials 1; parents of those that are not their own, two bytes mostly.
  return {n * (8 + 4 + 2 + 6 + 1) + (n - coarsest) * 2, of(gather), coded(pack_kernels(*this)),
          lattice ? of(lattice->rows) + lattice->valid.size() : 0};
}

namespace {

Result<void> check_surfels(const Surfels& s, const std::string& where) {
  const size_t n = s.count();
  if (s.levels() == 0 || s.levels() > max_surfel_levels || s.spacings.size() != s.levels())
    return Error{where, "there are no levels of surfels, or too many"};
  for (size_t l = 0; l < s.levels(); ++l) {
    if (s.counts[l] < 1 || s.counts[l] > n || (l > 0 && s.counts[l] < s.counts[l - 1]))
      return Error{where, "level " + std::to_string(l) + " has a number of surfels out of range"};
    if (!(s.spacings[l] > 0) || !std::isfinite(s.spacings[l]) || (l > 0 && s.spacings[l] > s.spacings[l - 1]))
      return Error{where, "the spacing of level " + std::to_string(l) + " is out of range"};
  }
  if (s.counts.back() != n || n > max_surfels) return Error{where, "the last level does not have all surfels"};
  if (s.normals.size() != n || s.areas.size() != n || s.albedos.size() != n || s.materials.size() != n)
    return Error{where, "places, normals, areas, albedos and materials of surfels are not alike in number"};
  if (s.parents.size() != s.nodes() - s.counts[0]) return Error{where, "there is not a parent for each surfel"};
  for (size_t l = 1, at = 0; l < s.levels(); ++l)
    for (size_t i = 0; i < s.counts[l]; ++i, ++at)
      if (s.parents[at] >= s.counts[l - 1])
        return Error{where,
                     "parent " + std::to_string(s.parents[at]) + " does not exist on level " + std::to_string(l - 1)};
      else if (i < s.counts[l - 1] && s.parents[at] != i)
        return Error{where, "surfel " + std::to_string(i) + " is not its own parent on level " + std::to_string(l - 1)};
  for (size_t i = 0; i < n; ++i) {
    const Vec3 a = s.albedos[i];
    if (s.materials[i] >= s.names.size()) return Error{where, "surfel " + std::to_string(i) + " has no material"};
    if (!is_finite(s.positions[i]) || largest(abs(s.positions[i])) > 1e9f ||
        !(std::abs(length(s.normals[i]) - 1) < 1e-2f) || !(s.areas[i] > 0) || !std::isfinite(s.areas[i]) ||
        !(std::min({a.x, a.y, a.z}) >= 0) || !(largest(a) <= 1))
      return Error{where, "surfel " + std::to_string(i) + " has a place, normal, area or albedo out of range"};
  }
  return {};
}

Result<void> check_rows(const NodeRows& t, size_t rows, size_t nodes, const std::string& where) {
  if (t.first.size() != rows + 1 || t.first.front() != 0 || t.first.back() != t.nodes.size() ||
      t.weights.size() != t.nodes.size() || t.scales.size() != rows)
    return Error{where, "rows and entries do not fit one another"};
  for (size_t r = 0; r < rows; ++r) {
    if (t.first[r + 1] < t.first[r]) return Error{where, "row " + std::to_string(r) + " ends before it begins"};
    double sum = 0;
    for (size_t e = t.first[r]; e < t.first[r + 1]; ++e) {
      if (t.nodes[e] >= nodes || (e > t.first[r] && t.nodes[e] <= t.nodes[e - 1]))
        return Error{where, "node " + std::to_string(t.nodes[e]) + " does not exist, or stands out of order"};
      sum += double(share(t.weights[e]));
    }
    // More than all of a hemisphere would make bounces grow without end.
    if (!(t.scales[r] >= 0) || !(sum * double(t.scales[r]) <= 1.001))
      return Error{where, "row " + std::to_string(r) + " sees more than a hemisphere"};
  }
  return {};
}

Result<void> check_free_space(const IndirectLattice& f, size_t nodes, const std::string& where) {
  const Lattice& l = f.lattice;
  for (int n : {l.nx, l.ny, l.nz})
    if (n < 1 || n > max_lattice_points) return Error{where, "the lattice has too few or too many points"};
  if (!is_finite(l.min) || !is_finite(l.max) || !all_at_most(l.min, l.max) || f.order < 1 || f.order > max_sh_order)
    return Error{where, "the lattice has no box, or an order out of range"};
  if (f.valid.size() != l.count()) return Error{where, "the lattice does not say which points are valid"};
  return check_rows(f.rows, l.count(), nodes, where + ": lattice");
}

}  // namespace

Result<void> check_indirect(const IndirectTransfer& t, const std::string& where) {
  if (auto ok = check_surfels(t.surfels, where); !ok) return ok;
  if (t.gather_level >= t.surfels.levels()) return Error{where, "the gathering level does not exist"};
  const size_t rows = t.gathering(), nodes = t.surfels.nodes();
  if (auto ok = check_rows(t.gather, rows, nodes, where); !ok) return ok;
  if (t.lattice)
    if (auto ok = check_free_space(*t.lattice, nodes, where); !ok) return ok;
  const size_t slots = t.receivers * kernel_slots;
  if (t.reader_surfels.size() != slots || t.reader_weights.size() != slots)
    return Error{where, "there are not kernels for each receiver"};
  for (uint32_t s : t.reader_surfels)
    if (s >= rows) return Error{where, "a receiver reads surfel " + std::to_string(s) + ", which has no row"};
  for (uint16_t w : t.reader_weights)
    if ((w & 0x7fffu) > 0x4800u) return Error{where, "the weight of a kernel is out of range"};  // 8 in halves
  return {};
}

}  // namespace lambent
