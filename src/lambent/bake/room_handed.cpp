// Rows' entries by rays that are handed on through openings without a light field: to receivers of other rooms, or to
// nodes of openings further on. They are blocks of their own beside those of rays that end in their room.
#include <lambent/bake/room_rows-inl.h>

#include <lambent/core/parallel.h>

#include <algorithm>

namespace lambent {
namespace {

// Rays that leave at once: each batch builds the trees of the rooms that they come into, and takes no more than what
// the rows will.
constexpr size_t batches = 12;

}  // namespace

// The rays of these blocks that leave through such an opening, to their ends. All ranks.
Result<std::vector<Traveller>> RoomBaker::leave(std::span<const HandedBlock> blocks) {
  std::vector<std::vector<Traveller>> of_block(blocks.size());
  const size_t stride = std::max(size_t(options.samples), size_t(most_node_rays));
  Result<void> ok;
  for (size_t first = 0, end; first < blocks.size() && ok && !is_cancelled(progress); first = end) {
    const size_t room = blocks[first].room;
    for (end = first; end < blocks.size() && blocks[end].room == room;) ++end;
    auto geometry = space.geometry(room, scene);
    if (!geometry) {
      ok = geometry.error();
      break;
    }
    parallel_for(end - first, 1, [&](size_t k, size_t) {
      const size_t at = first + k;
      const auto s = scratch.borrow();
      for (size_t i = 0; i < gather_block && !is_cancelled(progress); ++i)
        each_ray(room, *geometry, blocks[at].block, i, *s, [&](size_t j, Vec3 origin, Vec3 direction, const Hit& hit) {
          const Exit exit = space.exit(room, origin, direction, hit);
          if (exit.opening == none || !space.openings[exit.opening].handed) return;
          of_block[at].push_back({(at * gather_block + i) * stride + j, exit.at, direction,
                                  uint16_t(space.openings[exit.opening].beyond), 1, uint16_t(ranks.rank())});
        });
    });
  }
  if (auto well = agreed(std::move(ok)); !well) return well.error();
  std::vector<Traveller> all;
  size_t count = 0;
  for (const auto& of : of_block) count += of.size();
  all.reserve(count);
  for (auto& of : of_block) all.insert(all.end(), of.begin(), of.end()), of = {};
  handed_rays += all.size();
  return follow(space, work, surfaces, std::move(all), false, progress);
}

// A block of rows from the ends of its rays, row by row.
void RoomBaker::pack_handed(const HandedBlock& at, std::span<const Traveller> ends, PackedBlock& out,
                            BlockFacts& facts) {
  const auto s = scratch.borrow();
  const size_t stride = std::max(size_t(options.samples), size_t(most_node_rays));
  facts.e.assign(gather_block * coefficients, 0.0f);
  s->rows.begin_block();
  size_t next = 0;
  for (size_t i = 0; i < gather_block; ++i) {
    begin_row(at.room, at.block, i, *s);
    for (; next < ends.size() && ends[next].tag / stride % gather_block == i; ++next) {
      const Traveller& t = ends[next];
      if (t.end == Traveller::End::outside) add_sky(t.direction, *s);
      else if (t.end == Traveller::End::surface)
        add_surface(at.room, t.receiver, t.direction.x, t.direction.y, t.at, *s);
      else if (t.end == Traveller::End::back) ++facts.backs[i];
      else {
        const Exit exit{t.receiver[0], false, t.receiver[1], t.at, t.direction};
        const uint32_t node = t.end == Traveller::End::field ? space.find_node(exit) : none;
        ++facts.fields[i];
        if (node == none) ++facts.lost;
        else s->rows.add(uint32_t(node_row[space.openings[exit.opening].beyond] + node), Vec3(s->weight));
      }
    }
    end_row(at.room, at.block, i, *s, facts);
  }
  SparseBlock block;
  s->rows.finish(channels, at.block < receiver_blocks(at.room) ? weight_unit : 1.0f, block);
  pack(block, out.rows);
}

// False where there is no room for it.
bool RoomBaker::take_handed(const HandedBlock& at, const PackedBlock& packed, const BlockFacts& facts) {
  const size_t block = first_row[at.room] / gather_block + at.block;
  std::copy(facts.e.begin(), facts.e.end(), e[at.room].data() + at.block * gather_block * coefficients);
  std::copy(facts.backs.begin(), facts.backs.end(), backs.data() + block * gather_block);
  std::copy(facts.fields.begin(), facts.fields.end(), fields.data() + block * gather_block);
  has_handed[block] = 1;
  return handed->keep(block, packed);
}

// Of receivers that any ray might have met, those that one has.
void RoomBaker::lend_what_is_asked() {
  std::vector<uint8_t> asked(columns - rows, 0);
  std::vector<uint8_t> buffer;
  for (size_t b = 0; b < has_handed.size(); ++b) {
    KeptRows::Block packed;
    SparseBlock block;
    if (!has_handed[b] || !handed->find(b, buffer, packed) || !unpack(packed.rows, columns, channels, block)) continue;
    for (const uint32_t c : block.columns)
      if (c >= rows) asked[c - rows] = 1;
  }
  for (const auto& theirs : ranks.gather(asked))
    for (size_t k = 0; k < asked.size(); ++k) asked[k] |= theirs[k];
  for (auto& own : lent) std::erase_if(own, [&](uint32_t r) { return !is_near[r] && !asked[copy_of[r] - rows]; });
}

Result<void> RoomBaker::hand_rays() {
  const size_t fixed = fixed_bytes(), left = options.memory > fixed ? options.memory - fixed : 0;
  handed = std::make_unique<KeptRows>(told.handed > 0 ? rows / gather_block : 0,
                                      how.scratch.empty() ? SIZE_MAX / 4 : left,
                                      most_bytes(size_t(options.samples), columns, channels), how.scratch);
  has_handed.assign(rows / gather_block, 0), backs.assign(rows, 0), fields.assign(rows, 0);
  if (told.handed == 0) return {};
  const KeptPieces pieces(progress, "handed", rows / gather_block);
  std::vector<HandedBlock> missing;
  Result<void> ok;
  const Error no_room{scene.path, "there is no room for rows by rays that were handed on between rooms (--scratch)"};
  for (size_t room = 0; room < room_count(); ++room) {
    const auto leads = [&](const Opening& o) { return o.handed && o.room == room; };
    if (!is_own(room) || std::none_of(space.openings.begin(), space.openings.end(), leads)) continue;
    for (size_t b = 0; b < rows_in(room) / gather_block; ++b) {
      PackedBlock packed;
      BlockFacts facts;
      if (!pieces.load(first_row[room] / gather_block + b, packed.rows, facts.e, facts.backs, facts.fields,
                       facts.lost) ||
          facts.e.size() != gather_block * coefficients)
        missing.push_back({room, b});
      else if (lost += facts.lost; !take_handed({room, b}, packed, facts)) ok = no_room;
    }
  }
  const size_t all_rays = (rows_of(ranks.rank()) + 1) * size_t(options.samples),
               rays = std::clamp(all_rays / batches, least_at_once,
                                 std::max(least_at_once, options.memory / 8 / sizeof(Traveller))),
               at_once = std::max<size_t>(rays / gather_block / size_t(options.samples), 1),
               stride = std::max(size_t(options.samples), size_t(most_node_rays)) * gather_block;
  ProgressStage stage(progress, "handing rays on", missing.size() * gather_block);
  for (size_t begin = 0; !ranks.all(begin == missing.size());) {
    const std::span<const HandedBlock> now(missing.data() + begin, std::min(at_once, missing.size() - begin));
    auto ends = leave(now);
    if (!ends) return ends.error();
    std::vector<uint64_t> of_block(now.size(), 0);
    std::vector<uint8_t> has_room(now.size(), 1);
    parallel_for(now.size(), 1, [&](size_t k, size_t) {
      const auto less = [&](const Traveller& t, size_t block) { return t.tag / stride < block; };
      const auto first = std::lower_bound(ends->begin(), ends->end(), k, less),
                 end = std::lower_bound(first, ends->end(), k + 1, less);
      PackedBlock packed;
      BlockFacts facts;
      pack_handed(now[k], {first, end}, packed, facts);
      pieces.save(first_row[now[k].room] / gather_block + now[k].block, packed.rows, facts.e, facts.backs, facts.fields,
                  facts.lost);
      of_block[k] = facts.lost, has_room[k] = take_handed(now[k], packed, facts);
    });
    for (size_t k = 0; k < now.size(); ++k) {
      lost += of_block[k];
      if (!has_room[k]) ok = no_room;
    }
    begin += now.size(), stage.advance(now.size() * gather_block);
  }
  if (auto well = agreed(std::move(ok)); !well) return well;
  handed_bytes = handed->bytes() + handed->file_bytes();
  told.handed_rays = ranks.sum(handed_rays);
  lend_what_is_asked();
  return {};
}

}  // namespace lambent
