#pragma once
// A receiver's light in blocks, in SIMD lanes chosen at run time: what is seen of each block first, then BRDFs, then
// sums. Source: locally-adaptive-products, Algorithm 1.
#include <lambent/relight/product_kernels.h>

namespace lambent {

// What shading one receiver takes, kept from one to the next.
struct BlockScratch {
  // Of the blocks that are seen, 32 a word: those that are clear, and those that are seen in part.
  AlignedVector<uint32_t> clear, mixed, lit;
  std::vector<BlockChanges> changes;  // of mixed blocks in which the lobe has samples, in order
  AlignedVector<uint32_t> rows;       // of the sums: begins and ends of runs, in turn, of all other mixed blocks
  AlignedVector<float> steps;         // what of each is counted, where blocks are seen by shares
  size_t row_count = 0;
  int most_class = all_classes;  // 1 to 5: 1, 4, 16, 64 or 256 samples a block at most
  AlignedVector<float> cosines;  // of blocks' middles to the mirror image of the view
  AlignedVector<float> middles;  // lobes there
  float colour_weights[3] = {};  // what a term counts, the largest channel
  alignas(64) float weights[block_texels], nodes[3 * 16], fine[3 * 64], along[3 * 8 * 16];
};

// As shade_blocks() of products.h. `times`: what its parts took is added there.
Vec3 shade_blocks_in_simd(BlockScratch& scratch, const BlockLight& light, const Visibility& visibility, size_t receiver,
                          const ProductMaterial& material, const Terms& terms, Breakdown& tally,
                          StageTimes* times = nullptr);

}  // namespace lambent
