#include <lambent/bake/room_rows-inl.h>

#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>

#include <malloc.h>

#include <algorithm>
#include <cstring>

namespace lambent {

std::unique_ptr<RowScratch> RoomBaker::make_scratch() const {
  const AlignedVector<float> directions(sets.stride);
  const std::vector<float> row(coefficients);
  return std::unique_ptr<RowScratch>(new RowScratch{BlockBuilder(columns), directions, directions, directions,
                                                    std::vector<Hit>(size_t(options.samples)), row, row, row,
                                                    ShZyzRotator(sets.order)});
}

void RoomBaker::add_surface(size_t room, const std::array<uint32_t, 3>& receiver, float u, float v, Vec3 reflected,
                            RowScratch& s) const {
  const Corners at{receiver};
  basis.spread(at, u, v, [&](uint32_t r, float weight) { s.rows.add(column(room, r), s.weight * weight * reflected); });
}

void RoomBaker::add_sky(Vec3 direction, RowScratch& s) const {
  evaluate_sh(options.order, direction, s.harmonics);
  for (size_t k = 0; k < coefficients; ++k) s.sky[k] += s.weight * s.harmonics[k];
  ++s.open;
}

// A node's rays count as if all nodes had as many.
void RoomBaker::begin_row(size_t room, size_t block, size_t i, RowScratch& s) const {
  const size_t node = block >= receiver_blocks(room) ? (block - receiver_blocks(room)) * gather_block + i : SIZE_MAX;
  s.weight = node < space.nodes_in[room] ? float(most_node_rays) / float(space.ray_count(room, node)) : 1.0f;
  s.rows.begin_row();
  std::fill(s.sky.begin(), s.sky.end(), 0.0f), s.open = 0;
}

// The row's sky, with the control variate of receivers' directions (DirectionSets::excess).
void RoomBaker::end_row(size_t room, size_t block, size_t i, RowScratch& s, BlockFacts& facts) const {
  s.rows.end_row();
  const float rays = float(rays_in(room, block));
  float* e = facts.e.data() + i * coefficients;
  for (size_t k = 0; k < coefficients; ++k) e[k] = s.sky[k] / rays;
  if (s.open == 0 || block >= receiver_blocks(room) || sets.excess.empty()) return;
  const uint32_t r = receivers_of[room][block * gather_block + i];
  const DirectionChoice c = choose_directions(sets, receivers.normals[r], options.seed, r);
  std::copy_n(sets.excess.data() + size_t(c.set) * 2 * coefficients, coefficients, s.excess.data());
  s.rotator.rotate(c.a, c.b, c.c, s.excess);
  for (size_t k = 0; k < coefficients; ++k) e[k] -= float(s.open) / rays * s.excess[k];
}

void RoomBaker::trace_block(size_t room, const RoomGeometry& geometry, size_t block, RowScratch& s, SparseBlock& out,
                            BlockFacts& facts) {
  facts.e.assign(gather_block * coefficients, 0.0f);
  s.rows.begin_block();
  for (size_t i = 0; i < gather_block; ++i) {
    begin_row(room, block, i, s);
    each_ray(room, geometry, block, i, s, [&](size_t, Vec3 origin, Vec3 direction, const Hit& hit) {
      const Exit exit = space.exit(room, origin, direction, hit);
      if (exit.outside) return add_sky(direction, s);
      if (exit.opening != none) {
        const Opening& o = space.openings[exit.opening];
        ++facts.crossed;
        if (o.handed) return;  // is of hand_rays()
        const uint32_t node = space.find_node(exit);
        ++facts.fields[i];
        if (node == none) ++facts.lost;
        else s.rows.add(uint32_t(node_row[o.beyond] + node), Vec3(s.weight));
        return;
      }
      const uint32_t triangle = geometry.triangles[hit.triangle];
      if (const Corners* at = basis.find(triangle, hit.front))
        add_surface(room, at->receiver, hit.u, hit.v, surfaces.reflected(triangle, *at, hit), s);
      else ++facts.backs[i];
    });
    end_row(room, block, i, s, facts);
  }
  s.rows.finish(channels, block < receiver_blocks(room) ? weight_unit : 1.0f, out);
}

// The most of all ranks'.
size_t RoomBaker::most_of_ranks(size_t mine) const {
  const auto* bytes = reinterpret_cast<const uint8_t*>(&mine);
  size_t most = mine;
  for (const auto& theirs : ranks.gather({bytes, bytes + sizeof mine})) {
    size_t other;
    std::memcpy(&other, theirs.data(), sizeof other);
    most = std::max(most, other);
  }
  return most;
}

// What a rank needs beside rows of the operator, of its own rooms' rows, all nodes and copies, and the result: all
// ranks agree on it.
size_t RoomBaker::fixed_bytes() const {
  size_t most = 0, nodes = 0;
  for (int k = 0; k < ranks.count(); ++k) most = std::max(most, rows_of(k));
  for (const size_t own : space.nodes_in) nodes += padded_rows(own);
  const size_t of_x = std::min(columns, most + nodes + columns - rows);
  return 4 * coefficients * most + 4 * width * of_x + most_of_ranks(space.bytes());
}

void give_back_memory() {
#ifdef __GLIBC__
  ::malloc_trim(0);
#endif
}

// A room's blocks, but for those that have been kept before.
Result<void> RoomBaker::trace_room(size_t room, const KeptPieces& pieces, ProgressStage& stage) {
  const size_t first = first_row[room] / gather_block, blocks = rows_in(room) / gather_block;
  std::vector<uint8_t> waiting(blocks, 0), missing(blocks, 0);
  std::vector<BlockFacts> counts(blocks);
  const auto finish = [&](size_t b, const PackedBlock& packed, BlockFacts& facts) {
    missing[b] = !kept->keep(first + b, packed);
    for (size_t k = 0; k < facts.e.size(); ++k) e[room][b * gather_block * coefficients + k] += facts.e[k];
    for (size_t i = 0; i < gather_block; ++i) {
      backs[(first + b) * gather_block + i] += facts.backs[i];
      fields[(first + b) * gather_block + i] += facts.fields[i];
    }
    facts.e = {}, counts[b] = std::move(facts);
    stage.advance(gather_block);
  };
  parallel_for(blocks, 1, [&](size_t b, size_t) {
    PackedBlock packed;
    BlockFacts facts;
    const bool is_there =
        pieces.load(first + b, packed.rows, facts.e, facts.backs, facts.fields, facts.crossed, facts.lost) &&
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
      pieces.save(first + b, packed.rows, facts.e, facts.backs, facts.fields, facts.crossed, facts.lost);
      finish(b, packed, facts);
    });
  }
  is_kept[room] = std::find(missing.begin(), missing.end(), 1) == missing.end();
  for (const BlockFacts& c : counts) crossed += c.crossed, lost += c.lost;
  return {};
}

// As is_buried() does of a scene that is whole: who is in doubt sends a fan of its own, to all ends.
Result<void> RoomBaker::decide_buried() {
  std::vector<uint32_t> in_doubt;
  const size_t all = size_t(options.samples), count = FixedFan::count;
  for (uint32_t room = 0; room < room_count(); ++room)
    for (size_t i = 0; is_own(room) && i < receivers_of[room].size(); ++i) {
      const uint32_t r = receivers_of[room][i];
      const size_t met = backs[row_of[r]], most = met + fields[row_of[r]];
      buried[r] = 4 * met > 3 * all;
      if (met > 0 && !buried[r] && 4 * most >= all) in_doubt.push_back(r);
    }
  const size_t at_once = std::max(least_at_once, n()) / count;
  for (size_t begin = 0; !ranks.all(begin == in_doubt.size());) {
    const std::span<const uint32_t> now(in_doubt.data() + begin, std::min(at_once, in_doubt.size() - begin));
    std::vector<Traveller> rays;
    rays.reserve(now.size() * count);
    for (size_t i = 0; i < now.size(); ++i) {
      const FixedFan fan(receivers.normals[now[i]]);
      for (size_t k = 0; k < count; ++k)
        rays.push_back(
            {i * count + k, receivers.origins[now[i]], fan[k], uint16_t(room_of[now[i]]), 0, uint16_t(ranks.rank())});
    }
    auto ends = follow(space, work, surfaces, std::move(rays), true, progress);
    if (!ends) return ends.error();
    std::vector<size_t> met(now.size(), 0);
    for (const Traveller& t : *ends) met[t.tag / count] += t.end == Traveller::End::back;
    for (size_t i = 0; i < now.size(); ++i) buried[now[i]] = 2 * met[i] > count;
    begin += now.size();
  }
  for (const auto& theirs : ranks.gather(buried))
    for (size_t r = 0; r < n(); ++r) buried[r] |= theirs[r];
  return {};
}

Result<void> RoomBaker::trace() {
  const auto start = Clock::now();
  e.assign(room_count(), {}), buried.assign(n(), 0), is_kept.assign(room_count(), 0);
  for (size_t room = 0; room < room_count(); ++room)
    if (is_own(room)) e[room].assign(rows_in(room) * coefficients, 0.0f);
  if (auto ok = hand_rays(); !ok) return ok;
  give_back_memory();
  const size_t fixed = fixed_bytes();
  // All of what was handed on where there is no file for it.
  const size_t most = most_of_ranks(handed_bytes);
  const size_t needed = fixed + (how.scratch.empty() ? most : 0);
  if (options.memory < needed)
    return Error{scene.path, "baking needs at least " + std::to_string(needed) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  kept = std::make_unique<KeptRows>(rows / gather_block, options.memory - fixed - handed->bytes(),
                                    most_bytes(size_t(options.samples), rows, channels), how.scratch);
  ProgressStage stage(progress, "tracing rooms", rows_of(ranks.rank()));
  const KeptPieces pieces(progress, "rooms", rows / gather_block);
  Result<void> ok;
  for (size_t room = 0; room < room_count() && ok && !stage.cancelled(); ++room)
    if (is_own(room)) ok = trace_room(room, pieces, stage);
  if (auto well = agreed(std::move(ok)); !well) return well;
  if (auto well = decide_buried(); !well) return well;
  backs = {}, fields = {};
  give_back_memory();
  crossed = ranks.sum(crossed), lost = ranks.sum(lost);
  arrange_filling();
  report.trace_seconds = seconds_since(start);
  report.working_memory = fixed + kept->bytes() + handed->bytes();
  report.operator_bytes = ranks.sum(kept->bytes() + handed->bytes());
  report.operator_file_bytes = ranks.sum(kept->file_bytes() + handed->file_bytes());
  report.operator_kept = double(ranks.sum(kept->count())) / double(rows / gather_block);
  return {};
}

}  // namespace lambent
