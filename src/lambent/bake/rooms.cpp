// Follows: radiosity, "Problem Size". Jacobi within a room, Gauss-Seidel over rooms, of which those that do not touch
// are visited side by side, each by the rank that it belongs to.
#include <lambent/bake/rooms.h>

#include <lambent/bake/block_builder.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/kept_rows.h>
#include <lambent/bake/room_nodes.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/ranks.h>
#include <lambent/scene/see_through.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <numeric>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

constexpr int inner_most = 6;  // iterations within a room at a visit
constexpr size_t padded(size_t n) { return (n + gather_block - 1) / gather_block * gather_block; }

struct RowScratch {
  BlockBuilder rows;
  AlignedVector<float> x, y, z;
  std::vector<Hit> hits;
  std::vector<float> harmonics, sky;
};

// What a block of rows is beside its rows: its sky, [row][coefficient], and counts of its rays.
struct BlockFacts {
  std::vector<float> e;
  std::array<uint8_t, gather_block> buried{};
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
  const DirectionSets sets = make_direction_sets(std::max(options.order, 1), options.samples, 8, options.seed);
  const size_t coefficients = size_t(sh_count(options.order));
  const int channels = has_coloured_albedo(scene) ? 3 : 1;
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
  AlignedVector<float> x{};             // [row][coefficient][channel]; of other ranks' rows those that are handed on
  std::vector<uint8_t> buried{};        // of receivers
  std::vector<std::vector<FillStep>> fill{};  // of each room
  // Receivers that other rooms ask for, by their rooms. A copy of each, as it was at the end of the last step, is a row
  // beyond those of rooms.
  std::vector<std::vector<uint32_t>> lent{};
  std::vector<uint32_t> copy_of{};  // of each receiver, its copy's row; none
  std::unique_ptr<KeptRows> kept{};
  std::vector<uint8_t> is_kept{};  // of each of this rank's rooms: all its rows are
  uint64_t crossed = 0, lost = 0;

  size_t n() const { return receivers.count(); }
  size_t room_count() const { return space.rooms.size(); }
  size_t receiver_blocks(size_t room) const { return padded(receivers_of[room].size()) / gather_block; }
  size_t rooms_end(size_t room) const { return room + 1 < room_count() ? first_row[room + 1] : rows; }
  size_t rows_in(size_t room) const { return rooms_end(room) - first_row[room]; }
  // Where a room finds a receiver.
  uint32_t column(size_t room, uint32_t r) const { return room_of[r] == room ? row_of[r] : copy_of[r]; }
  size_t rows_of(int rank) const {
    size_t sum = 0;
    for (size_t room = 0; room < room_count(); ++room) sum += work.owner[room] == rank ? rows_in(room) : 0;
    return sum;
  }
  bool is_own(size_t room) const { return work.owner[room] == ranks.rank(); }

  void assign_receivers() {
    receivers_of.assign(room_count(), {}), room_of.resize(n());
    for (uint32_t r = 0; r < n(); ++r) {
      room_of[r] = space.room_at(receivers.origins[r]);
      receivers_of[room_of[r]].push_back(r);
    }
    std::vector<size_t> cost;
    for (const auto& own : receivers_of) cost.push_back(own.size()), told.largest = std::max(told.largest, own.size());
    work = RoomWork(space, cost);
  }

  void number_rows() {
    first_row.resize(room_count()), node_row.resize(room_count()), row_of.resize(n());
    rows = 0;
    for (size_t room = 0; room < room_count(); ++room) {
      first_row[room] = rows;
      for (size_t i = 0; i < receivers_of[room].size(); ++i) row_of[receivers_of[room][i]] = uint32_t(rows + i);
      rows += padded(receivers_of[room].size());
      node_row[room] = rows;
      rows += padded(space.nodes_of[room].size());
    }
    lent = lent_receivers(space, scene, basis, room_of), copy_of.assign(n(), none);
    columns = rows;
    for (const auto& own : lent)
      for (const uint32_t r : own) copy_of[r] = uint32_t(columns++);
    columns = padded(columns);
    told.rooms = room_count(), told.openings = space.openings.size(), told.nodes = space.node_count();
  }

  Vec3 albedo_of(uint32_t triangle, const Corners& at, const Hit& hit) const {
    const Material& m = scene.materials[scene.parts[at.part].material];
    return m.base_color_texture >= 0 || !scene.colors.empty() ? albedo(scene, scene.triangles[triangle], hit.u, hit.v)
                                                              : m.base_color;
  }

  // One ray into the row at hand.
  void add_ray(size_t room, const RoomGeometry& geometry, Vec3 origin, Vec3 direction, const Hit& hit, RowScratch& s,
               BlockFacts& facts, size_t& backs) {
    const Exit exit = space.exit(room, origin, direction, hit);
    if (exit.opening != none) {
      ++facts.crossed;
      const uint32_t node = space.find_node(exit);
      if (node == none) ++facts.lost;
      else s.rows.add(uint32_t(node_row[space.openings[exit.opening].beyond] + node), Vec3(1));
      return;
    }
    if (exit.outside) {
      evaluate_sh(options.order, direction, s.harmonics);
      for (size_t k = 0; k < coefficients; ++k) s.sky[k] += s.harmonics[k];
      return;
    }
    const uint32_t triangle = geometry.triangles[hit.triangle];
    const Corners* at = basis.find(triangle, hit.front);
    if (!at) {
      ++backs;
      return;
    }
    const Vec3 rho = albedo_of(triangle, *at, hit);
    basis.spread(*at, hit.u, hit.v, [&](uint32_t r, float weight) { s.rows.add(column(room, r), weight * rho); });
  }

  // Block b of a room. The number of rays that a row averages.
  size_t trace_block(size_t room, const RoomGeometry& geometry, size_t b, RowScratch& s, SparseBlock& out,
                     BlockFacts& facts) {
    const bool of_nodes = b >= receiver_blocks(room);
    const size_t begin = (of_nodes ? b - receiver_blocks(room) : b) * gather_block;
    const size_t all = of_nodes ? space.nodes_of[room].size() : receivers_of[room].size();
    const size_t rays = of_nodes ? size_t(most_node_rays) : size_t(options.samples);
    facts.e.assign(gather_block * coefficients, 0.0f);
    s.rows.begin_block();
    for (size_t i = begin; i < begin + gather_block; ++i) {
      s.rows.begin_row();
      std::fill(s.sky.begin(), s.sky.end(), 0.0f);
      size_t backs = 0;
      if (i < all && of_nodes) {
        const std::span<const NodeRay> own = space.rays_of(space.nodes_of[room][i]);
        // As if all nodes had as many rays.
        for (size_t j = 0; j < rays && !own.empty(); ++j) {
          const NodeRay& ray = own[j % own.size()];
          add_ray(room, geometry, ray.origin, ray.direction, geometry.tracer.closest(ray.origin, ray.direction), s,
                  facts, backs);
        }
      } else if (i < all) {
        const uint32_t r = receivers_of[room][i];
        const DirectionChoice c = choose_directions(sets, receivers.normals[r], options.seed, r);
        const size_t base = size_t(c.set) * sets.stride;
        rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                          s.x.data(), s.y.data(), s.z.data());
        geometry.tracer.closest_fan(receivers.origins[r], {s.x.data(), s.y.data(), s.z.data(), rays}, s.hits.data());
        for (size_t j = 0; j < rays; ++j)
          add_ray(room, geometry, receivers.origins[r], {s.x[j], s.y[j], s.z[j]}, s.hits[j], s, facts, backs);
        facts.buried[i - begin] = 2 * backs > rays;
      }
      s.rows.end_row();
      float* row = facts.e.data() + (i - begin) * coefficients;
      for (size_t k = 0; k < coefficients; ++k) row[k] = s.sky[k] / float(rays);
    }
    s.rows.finish(channels, of_nodes ? 1.0f : weight_unit, out);
    return rays;
  }

  Pool<RowScratch> scratch{[this] {
    return std::unique_ptr<RowScratch>(
        new RowScratch{BlockBuilder(columns), AlignedVector<float>(sets.stride), AlignedVector<float>(sets.stride),
                       AlignedVector<float>(sets.stride), std::vector<Hit>(size_t(options.samples)),
                       std::vector<float>(coefficients), std::vector<float>(coefficients)});
  }};

  // What the rank with the most rows needs beside rows of the operator: all ranks agree on it.
  size_t fixed_bytes() const {
    size_t most = 0;
    for (int k = 0; k < ranks.count(); ++k) most = std::max(most, rows_of(k));
    return 4 * coefficients * most + 4 * width * (columns + n()) + space.bytes();
  }

  // A room's blocks, but for those that have been kept before.
  Result<void> trace_room(size_t room, const KeptPieces& pieces, ProgressStage& stage) {
    const size_t first = first_row[room] / gather_block, blocks = rows_in(room) / gather_block;
    e[room].assign(rows_in(room) * coefficients, 0.0f);
    std::vector<uint8_t> waiting(blocks, 0), missing(blocks, 0);
    std::vector<BlockFacts> counts(blocks);
    const auto finish = [&](size_t b, const PackedBlock& packed, BlockFacts& facts) {
      missing[b] = !kept->keep(first + b, packed);
      std::copy(facts.e.begin(), facts.e.end(), e[room].data() + b * gather_block * coefficients);
      for (size_t i = 0; b < receiver_blocks(room) && i < gather_block; ++i)
        if (facts.buried[i]) buried[receivers_of[room][b * gather_block + i]] = 1;
      facts.e = {}, counts[b] = std::move(facts);
      stage.advance(gather_block);
    };
    parallel_for(blocks, 1, [&](size_t b, size_t) {
      PackedBlock packed;
      BlockFacts facts;
      const bool is_there = pieces.load(first + b, packed.rows, facts.e, facts.buried, facts.crossed, facts.lost) &&
                            facts.e.size() == gather_block * coefficients;
      if (is_there) return finish(b, packed, facts);
      waiting[b] = 1;
    });
    if (std::find(waiting.begin(), waiting.end(), 1) != waiting.end()) {
      auto geometry = space.geometry(room, scene);
      if (!geometry) return geometry.error();
      parallel_for(blocks, 1, [&](size_t b, size_t) {
        if (!waiting[b] || stage.cancelled()) return;
        SparseBlock block;
        PackedBlock packed;
        BlockFacts facts;
        trace_block(room, *geometry, b, *scratch.borrow(), block, facts);
        pack(block, packed.rows);
        pieces.save(first + b, packed.rows, facts.e, facts.buried, facts.crossed, facts.lost);
        finish(b, packed, facts);
      });
    }
    is_kept[room] = std::find(missing.begin(), missing.end(), 1) == missing.end();
    for (const BlockFacts& c : counts) crossed += c.crossed, lost += c.lost;
    return {};
  }

  Result<void> trace() {
    const auto start = Clock::now();
    e.assign(room_count(), {}), buried.assign(n(), 0), is_kept.assign(room_count(), 0);
    const size_t fixed = fixed_bytes();
    if (options.memory < fixed)
      return Error{scene.path, "baking needs at least " + std::to_string(fixed) +
                                   " bytes of working memory, and was allowed " + std::to_string(options.memory)};
    kept = std::make_unique<KeptRows>(rows / gather_block, options.memory - fixed,
                                      most_bytes(size_t(options.samples), rows, channels), how.scratch);
    ProgressStage stage(progress, "tracing rooms", rows_of(ranks.rank()));
    const KeptPieces pieces(progress, "rooms", rows / gather_block);
    Result<void> ok;
    for (size_t room = 0; room < room_count() && ok && !stage.cancelled(); ++room)
      if (is_own(room)) ok = trace_room(room, pieces, stage);
    if (auto well = agreed(std::move(ok)); !well) return well;
    for (const auto& theirs : ranks.gather(buried))
      for (size_t r = 0; r < n(); ++r) buried[r] |= theirs[r];
    crossed = ranks.sum(crossed), lost = ranks.sum(lost);
    arrange_filling();
    report.trace_seconds = seconds_since(start);
    report.working_memory = fixed + kept->bytes();
    report.operator_bytes = ranks.sum(kept->bytes()), report.operator_file_bytes = ranks.sum(kept->file_bytes());
    report.operator_kept = double(ranks.sum(kept->count())) / double(rows / gather_block);
    return {};
  }

  // Of all ranks: whether each has done its part.
  Result<void> agreed(Result<void> mine) const {
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (ranks.all(bool(mine))) return {};
    return mine ? Error{scene.path, "another rank has no tree of a room"} : std::move(mine);
  }

  void expand(const float* from, float* to) const {
    for (size_t k = 0; k < coefficients; ++k)
      for (size_t c = 0; c < size_t(channels); ++c) to[k * size_t(channels) + c] = from[k];
    std::fill(to + coefficients * size_t(channels), to + width, 0.0f);
  }

  // Receivers inside something have what their neighbours have, be they of other rooms.
  void arrange_filling() {
    fill.assign(room_count(), {});
    for (FillStep& step : make_fill_steps(scene, receivers.basis, buried))
      fill[room_of[step.receiver]].push_back(std::move(step));
  }

  void fill_rows(size_t room) {
    for (const FillStep& step : fill[room]) {
      float* out = x.data() + size_t(row_of[step.receiver]) * width;
      std::fill(out, out + width, 0.0f);
      for (const uint32_t s : step.sources) {
        const float* from = x.data() + size_t(column(room, s)) * width;
        for (size_t k = 0; k < width; ++k) out[k] += from[k] / float(step.sources.size());
      }
    }
  }

  // Rows of these rooms become known to all ranks: all of them, or those that other rooms ask for.
  void hand_on(const std::vector<uint32_t>& these, bool all) {
    const auto runs_of = [&](uint32_t room) {
      RowRuns runs{{all ? first_row[room] : node_row[room], all ? node_row[room] : rooms_end(room)}};
      for (size_t i = 0; i < lent[room].size() && !all; ++i)
        runs.emplace_back(row_of[lent[room][i]], row_of[lent[room][i]] + 1);
      return runs;
    };
    const uint64_t bytes = hand_rows(work, these, runs_of, x.data(), width);
    ranks.asked_bytes += all ? 0 : bytes;
    for (const uint32_t room : these)
      for (const uint32_t r : lent[room])
        std::copy_n(x.data() + size_t(row_of[r]) * width, width, x.data() + size_t(copy_of[r]) * width);
  }

  // Whether row i of a room is of a receiver inside something, whose equation is another.
  bool is_filled(size_t room, size_t i) const { return i < receivers_of[room].size() && buried[receivers_of[room][i]]; }

  struct Change {
    double change = 0, all = 0;
  };

  // All rows of a room once, from what x was before.
  Result<Change> iterate(size_t room, AlignedVector<float>& fresh, std::optional<RoomGeometry>& geometry) {
    const size_t first = first_row[room], count = rooms_end(room) - first;
    fresh.resize(count * width);
    std::vector<Change> changes(count / gather_block);
    if (!is_kept[room] && !geometry) {
      auto made = space.geometry(room, scene);
      if (!made) return made.error();
      geometry = std::move(*made);
    }
    parallel_for(count, gather_block, [&](size_t begin, size_t end) {
      if (is_cancelled(progress)) return;
      const size_t b = begin / gather_block;
      SparseBlock block;
      std::vector<uint8_t> buffer;
      KeptRows::Block packed;
      const size_t rays = b < receiver_blocks(room) ? size_t(options.samples) : size_t(most_node_rays);
      if (!kept->find(first / gather_block + b, buffer, packed) || !unpack(packed.rows, columns, channels, block)) {
        BlockFacts known;
        trace_block(room, *geometry, b, *scratch.borrow(), block, known);
      }
      AlignedVector<float> sums(gather_block * width, 0.0f);
      multiply_entries(block.view().entries, channels, x.data(), width, sums.data());
      const float scale = 1.0f / ((b < receiver_blocks(room) ? weight_unit : 1.0f) * float(rays));
      Change& c = changes[b];
      for (size_t i = begin; i < end; ++i) {
        float* y = fresh.data() + i * width;
        const float* old = x.data() + (first + i) * width;
        expand(e[room].data() + i * coefficients, y);
        for (size_t k = 0; k < width; ++k) y[k] += scale * sums[(i - begin) * width + k];
        if (is_filled(room, i)) continue;
        for (size_t k = 0; k < width; ++k)
          c.change += double(y[k] - old[k]) * double(y[k] - old[k]), c.all += double(y[k]) * double(y[k]);
      }
    });
    if (is_cancelled(progress)) return Error{"", "cancelled"};
    Change sum;
    for (const Change& c : changes) sum.change += c.change, sum.all += c.all;
    return sum;
  }

  // The rows of receivers inside something are not gathered but filled.
  void store(size_t room, const AlignedVector<float>& fresh) {
    const size_t first = first_row[room], count = rooms_end(room) - first;
    parallel_for(count, gather_block, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (is_filled(room, i)) continue;
        std::copy_n(fresh.data() + i * width, width, x.data() + (first + i) * width);
      }
    });
  }

  // Iterations within a room, with the newest light of its openings.
  Result<void> visit(size_t room, size_t piece, const KeptPieces& pieces, Change& met) {
    const std::span<float> own(x.data() + first_row[room] * width, rows_in(room) * width);
    if (pieces.load(piece, own, met.change, met.all)) return {};
    std::optional<RoomGeometry> geometry;
    AlignedVector<float> fresh;
    for (int inner = 0; inner < inner_most; ++inner) {
      auto change = iterate(room, fresh, geometry);
      if (!change) return change.error();
      if (inner == 0) met = *change;  // as the room was met
      store(room, fresh), fill_rows(room);
      if (change->change <= 0.1 * how.residual * how.residual * change->all) break;
    }
    pieces.save(piece, own, met.change, met.all);
    return {};
  }

  // Of all rooms, in one order, whoever visited them.
  double residual_of(const std::vector<Change>& met) const {
    const auto* bytes = reinterpret_cast<const uint8_t*>(met.data());
    const auto each = ranks.gather({bytes, bytes + met.size() * sizeof(Change)});
    Change sum;
    for (size_t room = 0; room < room_count(); ++room) {
      Change c;
      std::memcpy(&c, each[size_t(work.owner[room])].data() + room * sizeof c, sizeof c);
      sum.change += c.change, sum.all += c.all;
    }
    return sum.all > 0 ? std::sqrt(sum.change / sum.all) : 0.0;
  }

  Result<void> solve() {
    const auto start = Clock::now();
    x.assign(columns * width, 0.0f);
    std::vector<uint32_t> every(room_count());
    std::iota(every.begin(), every.end(), 0u);
    for (uint32_t room : every)
      for (size_t i = 0; is_own(room) && i < rows_in(room); ++i)
        expand(e[room].data() + i * coefficients, x.data() + (first_row[room] + i) * width);
    hand_on(every, false);
    for (const uint32_t room : every)
      if (is_own(room)) fill_rows(room);
    const KeptPieces pieces(progress, "joining", size_t(how.most_sweeps) * room_count());
    for (int sweep = 0; sweep < how.most_sweeps && !told.converged; ++sweep) {
      ProgressStage stage(progress, "joining rooms, sweep " + std::to_string(sweep + 1), room_count());
      std::vector<Change> met(room_count());
      for (const auto& step : work.steps) {
        Result<void> ok;
        for (const uint32_t room : step) {
          if (is_own(room) && ok) ok = visit(room, size_t(sweep) * room_count() + room, pieces, met[room]);
          stage.advance();
        }
        if (auto well = agreed(std::move(ok)); !well) return well;
        hand_on(step, false);
      }
      ++ranks.asks;
      told.residuals.push_back(residual_of(met));
      told.converged = told.residuals.back() <= how.residual;
    }
    hand_on(every, true);
    report.bounce_seconds = seconds_since(start);
    return {};
  }

  Result<Transfer> bake() {
    assign_receivers();
    if (auto ok = find_nodes(space, work, scene, receivers, receivers_of, options.seed, progress); !ok)
      return ok.error();
    number_rows();
    if (auto ok = trace(); !ok) return ok.error();
    if (auto ok = solve(); !ok) return ok.error();
    kept.reset(), e = {};
    AlignedVector<float> all(n() * width);
    for (size_t r = 0; r < n(); ++r) std::copy_n(x.data() + size_t(row_of[r]) * width, width, all.data() + r * width);
    x = {};
    for (uint8_t b : buried) report.buried += b;
    told.lost = crossed > 0 ? double(lost) / double(crossed) : 0.0;
    report.receivers = n(), report.samples = options.samples;
    report.rays = n() * size_t(options.samples) + told.nodes * size_t(most_node_rays);
    Transfer out = store_columns(options.light(), all.data(), 1, channels, n(), width, options.precision);
    report.bytes = out.bytes();
    return out;
  }
};

}  // namespace

Result<Transfer> bake_rooms(const Scene& scene, const Receivers& receivers, const std::vector<Room>& rooms,
                            const BakeOptions& options, const RoomsOptions& how, BakeReport* report,
                            RoomsReport* rooms_report, Progress* progress) {
  if (auto ok = check_light_basis(options, 1); !ok) return ok.error();
  if (!options.lobes.empty()) return Error{"lobes", "are not joined between rooms"};
  if (options.samples < 1 || options.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(options.samples)};
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  if (!std::holds_alternative<CornerReceivers>(receivers.basis))
    return Error{"rooms", "join receivers at vertices alone"};
  const std::vector<uint8_t> passing = see_through_materials(scene);
  for (const Part& part : scene.parts)
    if (!passing.empty() && passing[part.material])
      return Error{"--rooms", "does not know surfaces that let light pass: \"" + part.name + "\" is one", true};
  BakeReport unwanted;
  RoomsReport untold;
  BakeReport& r = report ? *report : unwanted;
  RoomsReport& t = rooms_report ? *rooms_report : untold;
  r = {}, t = {};
  const std::unique_ptr<RoomBaker> baker(new RoomBaker{
      scene, receivers, options, how, RoomSpace(scene, rooms, how.places, how.directions), r, t, progress});
  return baker->bake();
}

}  // namespace lambent
