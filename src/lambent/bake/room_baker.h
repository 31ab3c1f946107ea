#pragma once
// A bake by rooms under way (rooms.h): its rows are traced in room_rows.cpp and solved for in rooms.cpp.
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/bake/block_builder.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/kept_rows.h>
#include <lambent/bake/room_nodes.h>
#include <lambent/bake/room_rays.h>
#include <lambent/bake/rooms.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/own_part.h>
#include <lambent/core/pool.h>
#include <lambent/core/ranks.h>

#include <array>
#include <memory>
#include <optional>

namespace lambent {

constexpr size_t padded_rows(size_t n) { return (n + gather_block - 1) / gather_block * gather_block; }

inline constexpr size_t least_at_once = size_t{1} << 17;  // rays that are followed at once

// What rays on their way and rooms' trees had lies between what stays, where malloc keeps it for more of its kind.
void give_back_memory();

struct RowScratch {
  BlockBuilder rows;
  AlignedVector<float> x, y, z;
  std::vector<Hit> hits;
  std::vector<float> harmonics, sky, excess;
  ShZyzRotator rotator;
  std::array<NodeRay, most_node_rays> of_node{};
  float weight = 1;  // of a ray of the row at hand
  size_t open = 0;   // rays of it that leave the scene
};

// What a block of rows is beside its rows: its sky, [row][coefficient], and counts of its rays.
struct BlockFacts {
  std::vector<float> e;
  std::array<uint32_t, gather_block> backs{}, fields{};  // rays of rows that met the back of something, or a field
  uint64_t crossed = 0, lost = 0;
};

struct RoomBaker {
  const Scene& scene;
  const Receivers& receivers;
  const BakeOptions& options;
  const RoomsOptions& how;
  RoomSpace space;
  BakeReport& report;
  RoomsReport& told;
  Progress* progress;

  const CornerReceivers& basis = std::get<CornerReceivers>(receivers.basis);
  const RoomSurfaces surfaces{scene, basis};
  const DirectionSets sets = make_direction_sets(std::max(options.order, 1), options.samples, 8, options.seed);
  const size_t coefficients = size_t(sh_count(options.order));
  const int channels;
  const size_t width = pad_lanes(coefficients * size_t(channels));
  const float weight_unit = std::min(1.0f, 16384.0f / float(options.samples));
  std::vector<std::vector<uint32_t>> receivers_of{};  // of each room
  std::vector<size_t> first_row{};  // of each room: its receivers, padded, then nodes of openings into it, padded
  std::vector<size_t> node_row{};   // of each room: the first of the nodes
  std::vector<uint32_t> row_of{}, room_of{};  // of each receiver
  size_t rows = 0, columns = 0;               // columns: with copies
  Ranks& ranks = this_ranks();
  RoomWork work{};
  std::vector<std::vector<float>> e{};  // of each of this rank's rooms, [row of the room][coefficient]
  ZeroPages x{};                        // [row][coefficient][channel]; of other ranks' rows those that are handed on
  std::vector<uint8_t> buried{};        // of receivers
  std::vector<std::vector<FillStep>> fill{};  // of each room
  // Receivers that other rooms ask for, by their rooms. A copy of each, as it was at the end of the last step, is a row
  // beyond those of rooms.
  std::vector<std::vector<uint32_t>> lent{};
  std::vector<uint32_t> copy_of{};  // of each receiver, its copy's row; none
  std::vector<uint8_t> is_near{};   // whether another room reaches the surface that it is on
  std::unique_ptr<KeptRows> kept{};
  std::vector<uint8_t> is_kept{};  // of each of this rank's rooms: all its rows are
  // The same rows' entries by rays that were handed on, which are all kept; of each block, whether it has any.
  std::unique_ptr<KeptRows> handed{};
  std::vector<uint8_t> has_handed{};
  std::vector<uint32_t> backs{}, fields{};  // of rows, as in BlockFacts
  uint64_t crossed = 0, lost = 0, handed_rays = 0;
  size_t handed_bytes = 0;  // of rows

  size_t n() const { return receivers.count(); }
  size_t room_count() const { return space.rooms.size(); }
  size_t receiver_blocks(size_t room) const { return padded_rows(receivers_of[room].size()) / gather_block; }
  size_t rooms_end(size_t room) const { return room + 1 < room_count() ? first_row[room + 1] : rows; }
  size_t rows_in(size_t room) const { return rooms_end(room) - first_row[room]; }
  size_t rays_in(size_t room, size_t block) const {  // that a row averages
    return block < receiver_blocks(room) ? size_t(options.samples) : size_t(most_node_rays);
  }
  // Where a room finds a receiver.
  uint32_t column(size_t room, uint32_t r) const { return room_of[r] == room ? row_of[r] : copy_of[r]; }
  size_t rows_of(int rank) const;
  bool is_own(size_t room) const { return work.owner[room] == ranks.rank(); }
  // Of all ranks: whether each has done its part.
  Result<void> agreed(Result<void> mine) const;

  // rooms.cpp: who has what, and the iteration.
  struct Change {
    double change = 0, all = 0;
  };
  void assign_receivers();
  void share_rooms();
  FieldSize cheapest_fields(double handed_on) const;
  Result<void> find_all_nodes();
  void number_rows();
  void arrange_filling();
  void fill_rows(size_t room);
  void hand_on(const std::vector<uint32_t>& these, bool all);
  bool is_filled(size_t room, size_t i) const;
  void expand(const float* from, float* to) const;
  void add_block(size_t room, size_t block, std::optional<RoomGeometry>& geometry, float* sums);
  Result<Change> iterate(size_t room, AlignedVector<float>& fresh, std::optional<RoomGeometry>& geometry);
  void store(size_t room, const AlignedVector<float>& fresh);
  Result<void> visit(size_t room, size_t piece, const KeptPieces& pieces, Change& met);
  double residual_of(const std::vector<Change>& met) const;
  Result<void> solve();
  Transfer transfer() const;
  Transfer own_part() const;
  Result<Transfer> bake();

  // room_rows.cpp: rows by rays.
  template <class F>
  void each_ray(size_t room, const RoomGeometry& geometry, size_t block, size_t i, RowScratch& s, F f) const;
  void add_surface(size_t room, const std::array<uint32_t, 3>& receiver, float u, float v, Vec3 reflected,
                   RowScratch& s) const;
  void begin_row(size_t room, size_t block, size_t i, RowScratch& s) const;
  void add_sky(Vec3 direction, RowScratch& s) const;
  void end_row(size_t room, size_t block, size_t i, RowScratch& s, BlockFacts& facts) const;
  void trace_block(size_t room, const RoomGeometry& geometry, size_t block, RowScratch& s, SparseBlock& out,
                   BlockFacts& facts);
  Result<void> trace_room(size_t room, const KeptPieces& pieces, ProgressStage& stage);
  Result<void> trace();
  Result<void> decide_buried();
  size_t most_of_ranks(size_t mine) const;
  size_t fixed_bytes() const;
  std::unique_ptr<RowScratch> make_scratch() const;
  Pool<RowScratch> scratch{[this] { return make_scratch(); }};

  // room_handed.cpp: rows by rays that are handed on.
  struct HandedBlock {
    size_t room = 0, block = 0;
  };
  Result<void> hand_rays();
  Result<std::vector<Traveller>> leave(std::span<const HandedBlock> blocks);
  void pack_handed(const HandedBlock& at, std::span<const Traveller> ends, PackedBlock& out, BlockFacts& facts);
  bool take_handed(const HandedBlock& at, const PackedBlock& packed, const BlockFacts& facts);
  void lend_what_is_asked();
};

}  // namespace lambent
