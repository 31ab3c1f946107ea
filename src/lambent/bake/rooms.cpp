// Follows: radiosity, "Problem Size". Jacobi within a room, Gauss-Seidel over rooms, of which those that do not touch
// are visited side by side, each by the rank that it belongs to.
#include <lambent/bake/rooms.h>

#include <lambent/bake/room_rows-inl.h>
#include <lambent/core/clock.h>
#include <lambent/core/own_part.h>
#include <lambent/core/parallel.h>
#include <lambent/scene/see_through.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace lambent {
namespace {

constexpr int inner_most = 6;  // iterations within a room at a visit

}  // namespace

size_t RoomBaker::rows_of(int rank) const {
  size_t sum = 0;
  for (size_t room = 0; room < room_count(); ++room) sum += work.owner[room] == rank ? rows_in(room) : 0;
  return sum;
}

// Of all ranks: whether each has done its part.
Result<void> RoomBaker::agreed(Result<void> mine) const {
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  if (ranks.all(bool(mine))) return {};
  return mine ? Error{scene.path, "another rank has no tree of a room"} : std::move(mine);
}

void RoomBaker::assign_receivers() {
  receivers_of.assign(room_count(), {}), room_of.resize(n());
  for (uint32_t r = 0; r < n(); ++r) {
    room_of[r] = space.room_at(receivers.origins[r]);
    receivers_of[room_of[r]].push_back(r);
  }
  for (const auto& own : receivers_of) told.largest = std::max(told.largest, own.size());
  share_rooms();
}

void RoomBaker::share_rooms() {
  std::vector<size_t> cost;
  for (const auto& own : receivers_of) cost.push_back(own.size());
  work = RoomWork(space, cost);
  space.clear_nodes();
}

// The most that light fields may be, for less memory than so many rays that are handed on take, and less work: such a
// ray has up to three entries of rows, a node a row of x and e of its own, and its rays are kept beside their entries.
FieldSize RoomBaker::cheapest_fields(double handed_on) const {
  constexpr double bytes_a_ray = 9;
  return {size_t(bytes_a_ray * handed_on / double(4 * (width + coefficients))), size_t(handed_on / 3)};
}

// Fields at all openings at first; then, where some lose more than they may, those alone that stay.
Result<void> RoomBaker::find_all_nodes() {
  FieldSize most{SIZE_MAX, SIZE_MAX};
  bool all = how.loss <= 0;  // are handed on
  if (!all && how.cheapest) {
    auto share = share_that_crosses(space, work, surfaces, receivers, receivers_of, options.seed, progress);
    if (!share) return share.error();
    most = cheapest_fields(*share * double(n()) * double(options.samples));
  }
  const auto find = [&]() -> Result<void> {
    auto few = find_nodes(space, work, surfaces, receivers, receivers_of, options.seed, most, progress);
    if (!few) return few.error();
    all = !*few;
    return {};
  };
  if (!all)
    if (auto ok = find(); !ok) return ok;
  if (!all && std::isfinite(how.loss)) {
    auto loss =
        hand_on_what_fields_lose(space, work, surfaces, receivers, receivers_of, options.seed, how.loss, progress);
    if (!loss) return loss.error();
    told.loss = loss->left, told.loss_of_all = loss->all, told.handed = loss->handed;
    all = told.handed == space.openings.size();
    if (!all && told.handed > 0) {
      share_rooms();
      if (auto ok = find(); !ok) return ok;
    }
  }
  if (!all) return {};
  told.loss = 0;
  for (Opening& o : space.openings) o.handed = true;
  told.handed = space.openings.size();
  share_rooms();
  return {};
}

void RoomBaker::number_rows() {
  first_row.resize(room_count()), node_row.resize(room_count()), row_of.resize(n());
  rows = 0;
  for (size_t room = 0; room < room_count(); ++room) {
    first_row[room] = rows;
    for (size_t i = 0; i < receivers_of[room].size(); ++i) row_of[receivers_of[room][i]] = uint32_t(rows + i);
    rows += padded_rows(receivers_of[room].size());
    node_row[room] = rows;
    rows += padded_rows(space.nodes_in[room]);
  }
  lent = lent_receivers(space, scene, basis, room_of), copy_of.assign(n(), none), is_near.assign(n(), 0);
  for (const auto& own : lent)
    for (const uint32_t r : own) is_near[r] = 1;
  for (const Opening& o : space.openings)  // whom rays from beyond may meet
    if (o.handed) lent[o.beyond] = receivers_of[o.beyond];
  columns = rows;
  for (const auto& own : lent)
    for (const uint32_t r : own) copy_of[r] = uint32_t(columns++);
  columns = padded_rows(columns);
  told.rooms = room_count(), told.openings = space.openings.size(), told.nodes = space.node_count();
}

void RoomBaker::expand(const float* from, float* to) const {
  for (size_t k = 0; k < coefficients; ++k)
    for (size_t c = 0; c < size_t(channels); ++c) to[k * size_t(channels) + c] = from[k];
  std::fill(to + coefficients * size_t(channels), to + width, 0.0f);
}

// Receivers inside something have what their neighbours have, be they of other rooms.
void RoomBaker::arrange_filling() {
  fill.assign(room_count(), {});
  for (FillStep& step : make_fill_steps(scene, receivers.basis, buried))
    fill[room_of[step.receiver]].push_back(std::move(step));
}

void RoomBaker::fill_rows(size_t room) {
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
void RoomBaker::hand_on(const std::vector<uint32_t>& these, bool all) {
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
bool RoomBaker::is_filled(size_t room, size_t i) const {
  return i < receivers_of[room].size() && buried[receivers_of[room][i]];
}

// A block's entries times x.
void RoomBaker::add_block(size_t room, size_t block, std::optional<RoomGeometry>& geometry, float* sums) {
  SparseBlock entries;
  std::vector<uint8_t> buffer;
  KeptRows::Block packed;
  const size_t number = first_row[room] / gather_block + block;
  if (!kept->find(number, buffer, packed) || !unpack(packed.rows, columns, channels, entries)) {
    BlockFacts known;
    trace_block(room, *geometry, block, *scratch.borrow(), entries, known);
  }
  multiply_entries(entries.view().entries, channels, x.data(), width, sums);
  if (!has_handed[number] || !handed->find(number, buffer, packed) || !unpack(packed.rows, columns, channels, entries))
    return;
  multiply_entries(entries.view().entries, channels, x.data(), width, sums);
}

// All rows of a room once, from what x was before.
Result<RoomBaker::Change> RoomBaker::iterate(size_t room, AlignedVector<float>& fresh,
                                             std::optional<RoomGeometry>& geometry) {
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
    AlignedVector<float> sums(gather_block * width, 0.0f);
    add_block(room, b, geometry, sums.data());
    const float scale = 1.0f / ((b < receiver_blocks(room) ? weight_unit : 1.0f) * float(rays_in(room, b)));
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
void RoomBaker::store(size_t room, const AlignedVector<float>& fresh) {
  const size_t first = first_row[room], count = rooms_end(room) - first;
  parallel_for(count, gather_block, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (is_filled(room, i)) continue;
      std::copy_n(fresh.data() + i * width, width, x.data() + (first + i) * width);
    }
  });
}

// Iterations within a room, with the newest light of its openings.
Result<void> RoomBaker::visit(size_t room, size_t piece, const KeptPieces& pieces, Change& met) {
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
double RoomBaker::residual_of(const std::vector<Change>& met) const {
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

Result<void> RoomBaker::solve() {
  const auto start = Clock::now();
  x = ZeroPages(columns * width);
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
    if (how.keep_sweeps) hand_on(every, true), told.sweeps.push_back(transfer());
  }
  report.bounce_seconds = seconds_since(start);
  return {};
}

// Of all receivers, once all ranks know them.
Transfer RoomBaker::transfer() const {
  return store_columns(options.light(), x.data(), 1, channels, n(), width, options.precision, row_of);
}

// Blocks of storage are divided among ranks as they lie in the file; each takes what it has not of its part, a slice
// after the other.
Transfer RoomBaker::own_part() const {
  const size_t count = size_t(ranks.count()), self = size_t(ranks.rank()), slices = 16 * count,
               blocks = (n() + transfer_block - 1) / transfer_block;
  const auto first_of = [&](size_t slice) { return std::min(n(), blocks * slice / slices * transfer_block); };
  std::vector<size_t> ends;
  for (size_t k = 1; k <= count; ++k) ends.push_back(first_of(16 * k));
  const WritableTransfer out =
      make_parted_transfer(options.light(), channels, n(), options.precision, std::move(ends), count);
  for (size_t i = 0; i < 16; ++i) {
    std::vector<std::vector<float>> give(count), take(count);
    for (size_t k = 0; k < count; ++k)
      for (size_t r = first_of(16 * k + i); r < first_of(16 * k + i + 1); ++r) {
        const size_t owner = size_t(work.owner[room_of[r]]);
        if (k == self && owner != self) take[owner].resize(take[owner].size() + width);
        if (k == self || owner != self) continue;
        const float* row = x.data() + size_t(row_of[r]) * width;
        give[k].insert(give[k].end(), row, row + width);
      }
    std::vector<std::span<const uint8_t>> from;
    std::vector<std::span<uint8_t>> to;
    for (auto& rows_given : give) from.push_back(checkpoint_detail::bytes_of(rows_given));
    for (auto& rows_taken : take) to.push_back(checkpoint_detail::bytes_of(rows_taken));
    ranks.exchange(from, to);
    std::vector<size_t> next(count, 0);
    std::vector<float> values;
    for (size_t r = first_of(16 * self + i); r < first_of(16 * self + i + 1); ++r) {
      const size_t owner = size_t(work.owner[room_of[r]]);
      const float* row = owner == self ? x.data() + size_t(row_of[r]) * width : take[owner].data() + next[owner];
      if (owner != self) next[owner] += width;
      store_columns_of(out, r, row, width, values);
    }
  }
  return out.transfer;
}

Result<Transfer> RoomBaker::bake() {
  give_back_memory();
  assign_receivers();
  if (auto ok = find_all_nodes(); !ok) return ok.error();
  give_back_memory();
  number_rows();
  if (auto ok = trace(); !ok) return ok.error();
  if (auto ok = solve(); !ok) return ok.error();
  kept.reset(), handed.reset(), e = {};
  std::vector<uint32_t> every(room_count());
  std::iota(every.begin(), every.end(), 0u);
  const bool parted = how.own_part && ranks.count() > 1;
  if (!parted) hand_on(every, true);
  Transfer out = parted ? own_part() : transfer();
  x = {};
  for (uint8_t b : buried) report.buried += b;
  told.lost = crossed > 0 ? double(lost) / double(crossed) : 0.0;
  report.receivers = n(), report.samples = options.samples;
  report.rays = n() * size_t(options.samples) + told.nodes * size_t(most_node_rays);
  report.bytes = out.bytes();
  return out;
}

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
  const std::unique_ptr<RoomBaker> baker(new RoomBaker{.scene = scene,
                                                       .receivers = receivers,
                                                       .options = options,
                                                       .how = how,
                                                       .space = RoomSpace(scene, rooms, how.places, how.directions),
                                                       .report = r,
                                                       .told = t,
                                                       .progress = progress,
                                                       .channels = has_coloured_albedo(scene) ? 3 : 1});
  return baker->bake();
}

}  // namespace lambent
