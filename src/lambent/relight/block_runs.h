#pragma once
// T . light of a part of all receivers, by blocks as transfer is stored: what a picture that moves shows of a large
// scene.
#include <lambent/core/parallel.h>
#include <lambent/relight/zonal.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace lambent {

// Of blocks, [first, end), rising; none longer than a piece of work.
using BlockRuns = std::vector<std::pair<size_t, size_t>>;

// The blocks that these receivers, each below `receivers`, lie in.
inline BlockRuns block_runs(std::span<const uint32_t> of, size_t receivers) {
  constexpr size_t longest = 64;
  std::vector<uint8_t> wanted((receivers + transfer_block - 1) / transfer_block, 0);
  for (uint32_t r : of) wanted[r / transfer_block] = 1;
  BlockRuns runs;
  for (size_t b = 0; b < wanted.size(); ++b)
    if (wanted[b]) {
      if (runs.empty() || runs.back().second != b || b - runs.back().first == longest) runs.emplace_back(b, b);
      runs.back().second = b + 1;
    }
  return runs;
}

// body(begin, end) over all blocks, `grain` at a time, or over `only` some.
template <class Body>
void parallel_blocks(size_t blocks, size_t grain, const BlockRuns* only, const Body& body) {
  if (!only) return parallel_for(blocks, grain, body);
  parallel_for(only->size(), 16, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) body((*only)[i].first, (*only)[i].second);
  });
}

// As the functions of the same names, to the bit, at the receivers of these blocks; what `out` has of others stays.
// Null: of all.
void relight(const Transfer& transfer, std::span<const Vec3> light, Relit& out, const BlockRuns* only);
void relight(const CpcaTransfer& transfer, std::span<const Vec3> light, Relit& out, const BlockRuns* only);
void relight_zonal(const ZonalTransfer& transfer, const ReceiverFrames* frames, const ZonalLight& light, Relit& out,
                   const BlockRuns* only);

}  // namespace lambent
