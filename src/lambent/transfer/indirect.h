#pragma once
// How DIRECT light on surfaces becomes indirect light: direct-to-indirect transport over a hierarchy of surfels, points
// on the scene's surfaces that know nothing of its mesh. The columns are direct light itself, a coefficient a surfel;
// geometry and reflectance are kept apart, so that lamps move and walls are repainted without a new bake.
//   x = G P R (d + U x)
// d: direct light at the finest surfels (leaves); R: their albedos; P: means over the tree, level by level; G: rows of
// gathering surfels over nodes of all levels, near ones fine and far ones coarse; U: a leaf has what its ancestor among
// the gathering surfels has. Source: radiosity, "Direct-to-indirect precomputed light transport using meshless
// hierarchical basis functions", "Adaptive refinement"; Lehtinen et al. 2008, "A meshless hierarchical representation
// for light transport".
#include <lambent/core/result.h>
#include <lambent/core/vec.h>
#include <lambent/transfer/lattice.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Surfels that a receiver reads, at most.
inline constexpr size_t kernel_slots = 8;
// Limits of a hierarchy: surfels in all,
inline constexpr size_t max_surfels = size_t{1} << 22;
// and levels.
inline constexpr size_t max_surfel_levels = 16;

// Points on surfaces, level by level: level l is the first counts[l] of them, no two that could stand for one another
// nearer than spacings[l]; the last level has them all, the leaves.
struct Surfels {
  std::vector<uint32_t> counts;     // by level, not falling, at least one
  std::vector<float> spacings;      // by level
  std::vector<Vec3> positions;      // on the surface
  std::vector<Vec3> normals;        // unit, towards the side that the surfel is on
  std::vector<float> areas;         // that a leaf stands for, > 0
  std::vector<Vec3> albedos;        // the mean over that area, as baked
  std::vector<uint32_t> materials;  // into the names below
  std::vector<std::string> names;   // of materials: a wall is repainted by its name
  // Of levels 1 and up, one after another: the surfel of the level above that each one is a part of; of those that the
  // level above has too, itself.
  std::vector<uint32_t> parents;

  size_t count() const { return positions.size(); }
  size_t levels() const { return counts.size(); }
  size_t first_node(size_t level) const;  // nodes are the surfels of level 0, then those of level 1, ...
  size_t nodes() const { return first_node(levels()); }
  size_t first_parent(size_t level) const { return first_node(level) - counts[0]; }  // level >= 1
};

// What a receiver sees of gathering surfels: kernels that sum to 1 (or, where none is near, all 0).
struct Kernels {
  std::array<uint32_t, kernel_slots> surfel{};
  std::array<float, kernel_slots> weight{};  // those in use first
  size_t count = 0;
};

// Rows over nodes: entries first[r] ... first[r + 1] of row r, each a node, rising within a row, and its share,
// weights^2 * scales[r]: roots keep small ones.
struct NodeRows {
  std::vector<uint32_t> first{0}, nodes;
  std::vector<uint8_t> weights;
  std::vector<float> scales;
  size_t count() const { return scales.size(); }
};

// Light in free space, at the points of a lattice: what of all directions each node takes. Harmonics come of it in the
// directions of nodes from the point, which are not kept.
struct IndirectLattice {
  Lattice lattice;
  int order = 0;               // bands of the radiance that arrives, order^2 rows, as of LatticeTransfer
  std::vector<uint8_t> valid;  // by point; 0: it lies inside something, has no entries, and its neighbours' values
  NodeRows rows;               // shares of the sphere
};

// The whole operator. Values of one channel serve all three: colour is in the albedos alone.
struct IndirectTransfer {
  Surfels surfels;
  uint32_t gather_level = 0;  // its surfels have rows
  NodeRows gather;            // G: shares of the hemisphere
  // Receivers' kernels, [receiver][kernel_slots]: gathering surfels, and halves.
  size_t receivers = 0;
  std::vector<uint32_t> reader_surfels;
  std::vector<uint16_t> reader_weights;
  std::optional<IndirectLattice> lattice = std::nullopt;
  double error = 0;  // relative RMS that compression and rounding of G made, over test lamps

  int rows = 1, channels = 1;  // rows: of a receiver, more than one of directional light
  size_t gathering() const { return surfels.counts.empty() ? 0 : surfels.counts[gather_level]; }
  // As stored in a file, about.
  struct Bytes {
    size_t surfels = 0, gather = 0, kernels = 0, lattice = 0;
    size_t all() const { return surfels + gather + kernels + lattice; }
  };
  Bytes bytes_of_parts() const;
  size_t bytes() const { return bytes_of_parts().all(); }
};

// Weights of kernels are multiples of this.
inline constexpr float kernel_step = 1.0f / 64;
// The kernel as it is kept: the largest weight makes up for the others' rounding, so that they sum to what they did.
void round_kernels(Kernels& kernels);
// Surfels as they are kept: places within their box to 21 bits an axis, normals, halves of albedos, areas to 8 bits.
void round_surfels(Surfels& surfels);

// What a stored weight stands for, before its row's scale.
inline float share(uint8_t weight) { return float(int(weight) * int(weight)); }

// Whether all numbers are within their ranges: a tree without cycles, nodes and surfels that exist, finite positions,
// unit normals. The error says what is not.
Result<void> check_indirect(const IndirectTransfer& t, const std::string& where);

// Entries of rows as stored: of each row its count, then the differences of its nodes, base-128.
std::vector<uint8_t> pack_rows(const NodeRows& rows);
// Of so many rows. Errors: bytes that end too soon or go on, entries beyond `most`.
Result<void> unpack_rows(std::span<const uint8_t> bytes, size_t rows, size_t most, NodeRows& out,
                         const std::string& where);

// Kernels of receivers as stored: those of neighbours along a curve have most of their surfels in common. Of each
// receiver a byte of those of the last one's surfels that it has too; how many others there are, and they, base-128,
// each as the difference from the one before; then all of its weights, a byte each, by surfel.
std::vector<uint8_t> pack_kernels(const IndirectTransfer& t);
// Sets kernels of t.receivers. Errors: bytes that end too soon or go on, more surfels than a kernel has.
Result<void> unpack_kernels(std::span<const uint8_t> bytes, IndirectTransfer& t, const std::string& where);

// A surfel's place in eight bytes, 21 bits an axis of a box, and its normal in four, a place in the octahedral map.
uint64_t pack_place(Vec3 p, const Bounds& box);
Vec3 unpack_place(uint64_t packed, const Bounds& box);
uint32_t pack_normal(Vec3 n);
Vec3 unpack_normal(uint32_t packed);
// The upper half of a float, rounded; above 0 stays above 0.
uint16_t pack_area(float area);
inline float unpack_area(uint16_t packed) { return __builtin_bit_cast(float, uint32_t(packed) << 16); }
Bounds surfel_box(const Surfels& surfels);

}  // namespace lambent
