// Follows: locally-adaptive-products, section 4 (Algorithm 1).
#include <lambent/relight/block_kernels.h>

#include <hwy/cache_control.h>

#include <bit>
#include <chrono>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/block_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <lambent/core/clock.h>
#include <lambent/relight/block_nodes-inl.h>
#include <lambent/relight/block_rows-inl.h>
#include <lambent/relight/product_lobes-inl.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {

// The low bit of each pair, of 32 pairs.
HWY_INLINE uint32_t EvenBits(uint64_t x) {
  x &= 0x5555555555555555;
  x = (x | x >> 1) & 0x3333333333333333, x = (x | x >> 2) & 0x0f0f0f0f0f0f0f0f;
  x = (x | x >> 4) & 0x00ff00ff00ff00ff, x = (x | x >> 8) & 0x0000ffff0000ffff;
  return uint32_t(x | x >> 16);
}

// Which blocks are seen, and of mixed ones that no lobe reaches the rows of the sums that are begins and ends of what
// is seen, so that summing them is one loop.
template <bool binary>
void ReadSight(BlockScratch& s, const float* sums, const Visibility& visibility, size_t receiver, bool want_rows) {
  using U = hn::CappedTag<uint32_t, 16>;
  using B = hn::Rebind<uint8_t, U>;
  const U du;
  const size_t blocks = size_t(visibility.blocks()), words = (blocks + 31) / 32;
  const uint8_t* flags = visibility.data.data() + visibility.begin[receiver];
  const uint8_t* last = visibility.data.data() + visibility.data.size();
  const uint8_t* at = flags + visibility.flag_bytes();
  const float scale = 1 / float(visibility.top());
  s.row_count = 0, s.changes.clear();
  for (size_t w = 0; w < words; ++w) {
    uint64_t pairs = 0;
    std::memcpy(&pairs, flags + 8 * w, std::min<size_t>(8, visibility.flag_bytes() - 8 * w));
    s.clear[w] = EvenBits(pairs), s.mixed[w] = EvenBits(pairs >> 1);
    for (uint32_t bits = s.mixed[w]; bits; bits &= bits - 1) {
      const auto bit = uint32_t(std::countr_zero(bits));
      int count = *at & 127;
      if (*at++ & 128) count |= int(*at++) << 7;
      const BlockChanges c{at, binary ? nullptr : at + count, count};
      at += binary ? count : 2 * count;
      if (s.lit[w] >> bit & 1) {
        s.changes.push_back(c);
        const float* block = sums + (w * 32 + bit) * block_texels * sum_width;
        for (int i = 0; i < c.count; ++i) hwy::Prefetch(block + sum_width * c.where[i]);
        continue;
      }
      if (!want_rows) continue;
      const auto base = (uint32_t(w) * 32 + bit) * uint32_t(block_texels);
      uint32_t* to = s.rows.data() + s.row_count;
      // By whole lanes, past the end of the block's, but not past the end of all.
      int i = 0;
      if (last - c.where >= count + int(hn::Lanes(du)))
        for (; i < count; i += int(hn::Lanes(du)))
          hn::StoreU(hn::Add(hn::PromoteTo(du, hn::LoadU(B(), c.where + i)), hn::Set(du, base)), du, to + i);
      for (; i < count; ++i) to[i] = base + c.where[i];
      if constexpr (binary) {
        if (count % 2) to[count++] = uint32_t(blocks) * uint32_t(block_texels);  // a row of nothing
      } else {
        for (int k = 0, before = 0; k < count; ++k) {
          s.steps[s.row_count + size_t(k)] = float(int(c.level[k]) - before) * scale, before = c.level[k];
        }
      }
      s.row_count += size_t(count);
    }
  }
}

// Light of the runs that ReadSight() found, and of clear blocks.
template <bool binary>
Row SumSeen(const BlockScratch& s, const BlockLight& light, size_t words) {
  Row even = ZeroRow(), odd = even;
  const float* sums = light.sums.data();
  const uint32_t* at = s.rows.data();
  size_t i = 0;
  if constexpr (binary) {
    for (; i + 4 <= s.row_count; i += 4) {
      AddDifference(even, sums + sum_width * at[i], sums + sum_width * at[i + 1]);
      AddDifference(odd, sums + sum_width * at[i + 2], sums + sum_width * at[i + 3]);
    }
    if (i < s.row_count) AddDifference(even, sums + sum_width * at[i], sums + sum_width * at[i + 1]);
  } else {
    for (; i < s.row_count; ++i) AddTimes(i % 2 ? odd : even, s.steps[i], LoadRow(sums + sum_width * at[i]));
  }
  for (size_t w = 0; w < words; ++w) {
    const float* whole = light.whole.data() + w * 32 * sum_width;
    uint32_t bits = s.clear[w];
    while (bits) {
      AddRow(even, LoadRow(whole + size_t(std::countr_zero(bits)) * sum_width));
      bits &= bits - 1;
      if (!bits) break;
      AddRow(odd, LoadRow(whole + size_t(std::countr_zero(bits)) * sum_width));
      bits &= bits - 1;
    }
  }
  AddRow(even, odd);
  return even;
}

// Light of what is seen of one mixed block.
HWY_INLINE Row SumChanges(const float* sums, const BlockChanges& c, float scale) {
  Row out = ZeroRow(), odd = out;
  int i = 0;
  if (!c.level) {
    for (; i + 4 <= c.count; i += 4) {
      AddDifference(out, sums + sum_width * c.where[i], sums + sum_width * c.where[i + 1]);
      AddDifference(odd, sums + sum_width * c.where[i + 2], sums + sum_width * c.where[i + 3]);
    }
    if (i + 2 <= c.count) AddDifference(out, sums + sum_width * c.where[i], sums + sum_width * c.where[i + 1]), i += 2;
    if (i < c.count) AddRow(odd, LoadRow(sums + sum_width * c.where[i]));
    AddRow(out, odd);
    return out;
  }
  for (int before = 0; i < c.count; ++i) {
    AddTimes(out, float(int(c.level[i]) - before) * scale, LoadRow(sums + sum_width * c.where[i]));
    before = c.level[i];
  }
  return out;
}

// Texels of a block that are seen: a bit each, and how much of each where that is not all.
struct Seen {
  uint16_t rows[block_side];
  const float* weights = nullptr;
};
void ReadTexels(const BlockChanges& c, float scale, float* weights, Seen& out) {
  uint64_t bits[4] = {};
  if (!c.level) {
    // Runs end where the count of changes up to there is even.
    for (int i = 0; i < c.count; ++i) bits[c.where[i] >> 6] |= uint64_t{1} << (c.where[i] & 63);
    uint64_t carry = 0;
    for (uint64_t& word : bits) {
      for (int shift = 1; shift < 64; shift *= 2) word ^= word << shift;
      word ^= carry, carry = 0 - (word >> 63);
    }
    out.weights = nullptr;
  } else {
    int t = 0;
    float now = 0;
    for (int i = 0; i < c.count; ++i) {
      for (; t < c.where[i]; ++t) weights[t] = now, bits[t >> 6] |= uint64_t(now > 0) << (t & 63);
      now = float(c.level[i]) * scale;
    }
    for (; t < block_texels; ++t) weights[t] = now, bits[t >> 6] |= uint64_t(now > 0) << (t & 63);
    out.weights = weights;
  }
  for (size_t r = 0; r < size_t(block_side); ++r) out.rows[r] = uint16_t(bits[r / 4] >> (r % 4 * 16));
}

// Sums over texels, of a term: by channel.
template <int count>
struct TexelSums {
  V acc[count][3];
  TexelSums() {
    for (auto& a : acc)
      for (V& v : a) v = hn::Zero(F());
  }
};

// Adds light x what is seen x s_k x cosine over a block, where term(row, column) gives s_k; `seen` null: all of it.
template <int count, class Term>
HWY_INLINE void AddTexels(TexelSums<count>& sums, const float* light, const Seen* seen, Vec3 n, Term term) {
  const F d;
  const V nx = Fill(n.x), ny = Fill(n.y), nz = Fill(n.z);
  for (size_t row = 0; row < size_t(block_side); ++row) {
    const uint32_t bits = seen ? seen->rows[row] : 0xffffu;
    if (!bits) continue;
    for (size_t column = 0; column < size_t(block_side); column += lanes) {
      const float* l = light + row * block_side + column;
      const V x = hn::Load(d, l), y = hn::Load(d, l + 256), z = hn::Load(d, l + 512);
      V cosine = hn::MulAdd(nx, x, hn::MulAdd(ny, y, hn::Mul(nz, z)));
      if (seen && seen->weights) {
        cosine = hn::Mul(cosine, hn::Load(d, seen->weights + row * block_side + column));
      } else if (bits != 0xffffu) {
        const auto part = uint16_t(bits >> column);
        uint8_t bytes[8] = {};
        std::memcpy(bytes, &part, 2);
        cosine = hn::IfThenElseZero(hn::LoadMaskBits(d, bytes), cosine);
      }
      V s[count];
      term(row, column, x, y, z, s);
      const V r = hn::Load(d, l + 768), g = hn::Load(d, l + 1024), b = hn::Load(d, l + 1280);
      for (int k = 0; k < count; ++k) {
        const V f = hn::Mul(cosine, s[k]);
        sums.acc[k][0] = hn::MulAdd(f, r, sums.acc[k][0]), sums.acc[k][1] = hn::MulAdd(f, g, sums.acc[k][1]),
        sums.acc[k][2] = hn::MulAdd(f, b, sums.acc[k][2]);
      }
    }
  }
}

// The same of s_k between its values at side x side nodes, those of a term `stride` apart.
template <int side, int count>
HWY_NOINLINE void AddBetween(TexelSums<count>& sums, const float* light, const Seen& seen, Vec3 n, const float* nodes,
                             int stride, const Cube& cube, float* along) {
  constexpr size_t grid = side == 2 ? 1 : side == 4 ? 2 : 3;
  AddTexels(sums, light, &seen, n, Interpolate<count, side>(nodes, stride, cube.cardinal[grid].data(), along));
}

// Blocks that the lobe reaches, of those that are seen; and the lobe at their middles.
template <class Lobe>
void FindLit(const Lobe& lobe, BlockScratch& s, const Cube& cube, const ProductMaterial& m) {
  const F d;
  const DirectionArray& middles = cube.nodes[0];
  const size_t stride = middles.x.size();
  const Vec3 mirror = lobe.t.mirror;
  for (size_t w = 0; w < s.lit.size(); ++w) s.lit[w] = 0;
  for (size_t i = 0; i < stride; i += lanes) {
    const V x = hn::Load(d, &middles.x[i]), y = hn::Load(d, &middles.y[i]), z = hn::Load(d, &middles.z[i]);
    const V cosine = Along(mirror, x, y, z);
    hn::Store(cosine, d, &s.cosines[i]);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Gt(cosine, Fill(m.cosines[0])), bits);
    uint32_t reached = 0;
    std::memcpy(&reached, bits, 2);
    reached &= (1u << lanes) - 1;
    if (!reached) continue;
    s.lit[i / 32] |= reached << (i % 32);
    V values[Lobe::count];
    lobe(x, y, z, values);
    for (int k = 0; k < Lobe::count; ++k) hn::Store(values[k], d, &s.middles[size_t(k) * stride + i]);
  }
}

// Samples by class of a block that is lit, 1 to 5, with the lobe at its nodes where values were asked.
template <class Lobe>
HWY_NOINLINE int ClassOf(const Lobe& lobe, BlockScratch& s, const BlockLight& light, const ProductMaterial& m, Vec3 n,
                         size_t b, bool clear, Known& known) {
  constexpr bool phong = std::is_same_v<Lobe, PhongLobe>;
  const Cube& cube = *light.cube;
  const size_t stride = cube.nodes[0].x.size();
  int samples = 1;
  while (samples < all_classes && s.cosines[b] > m.cosines[size_t(samples)]) ++samples;
  const float height = phong || clear ? 1 : dot(n, cube.nodes[0].at(b));
  const bool cut = !phong && !clear && height < light.rise[b];
  // Nodes below the horizon say nothing about the block's part above it.
  if (height <= 0 || (cut && samples > 1)) return s.most_class;
  if (m.by_values && samples < all_classes) {
    AtNodes(lobe, 16, cube.nodes[2], b, s.nodes), known.nodes = true;
    if (samples < 4) samples = ClassByValues<Lobe::count>(s.colour_weights, m, light, s.nodes, &s.middles[b], stride);
    if (cut && samples > 1) samples = all_classes;
    if (samples == 4 && !light.sharp[b] && s.most_class >= 4) {
      AtNodes(lobe, 64, cube.nodes[3], b, s.fine), known.fine = true;
      if (!IsFineEnough<Lobe::count>(s.colour_weights, m, light, s.fine, s.nodes)) samples = all_classes;
    }
  }
  // Phong's lobe at a texel is no dearer than what interpolates it there.
  if (samples == 4 && (light.sharp[b] || (phong && !clear))) samples = all_classes;
  return std::min(samples, s.most_class);
}

// Light in a block times the lobe at its nodes, in four sums, which do not wait for one another.
HWY_INLINE Row SumCoarse(const float* coarse, const float* nodes, size_t count) {
  Row first = ZeroRow(), second = first, third = first, fourth = first;
  for (size_t i = 0; i < count; i += 4, coarse += 4 * sum_width) {
    AddTimes(first, nodes[i], LoadRow(coarse)), AddTimes(second, nodes[i + 1], LoadRow(coarse + sum_width));
    AddTimes(third, nodes[i + 2], LoadRow(coarse + 2 * sum_width));
    AddTimes(fourth, nodes[i + 3], LoadRow(coarse + 3 * sum_width));
  }
  AddRow(first, second), AddRow(third, fourth), AddRow(first, third);
  return first;
}

// What a receiver's lobe makes of it.
template <class Lobe>
struct LobeSums {
  Row rows[Lobe::count + 1];  // times 1 (Lambert's law), times each term
  TexelSums<Lobe::count> texels;
  LobeSums() {
    for (Row& r : rows) r = ZeroRow();
  }
};

// One block that is lit and seen; `changes` null: clear.
template <class Lobe>
void AddLitBlock(const Lobe& lobe, BlockScratch& s, const BlockLight& light, const ProductMaterial& m, Vec3 n, size_t b,
                 const BlockChanges* changes, float scale, LobeSums<Lobe>& sums, Breakdown& tally) {
  constexpr int count = Lobe::count;
  const Cube& cube = *light.cube;
  const size_t stride = cube.nodes[0].x.size();
  Known known;
  const int samples = ClassOf(lobe, s, light, m, n, b, !changes, known);
  ++tally.samples[size_t(samples - 1)];
  ++(!changes ? tally.light_brdf : samples == 1 ? tally.light_visibility : tally.triple);
  if (samples == 1 || (changes && lobe.t.lambert != Vec3(0))) {
    const Row seen = changes ? SumChanges(light.sums.data() + b * block_texels * sum_width, *changes, scale)
                             : LoadRow(light.whole.data() + b * sum_width);
    if (changes) AddRow(sums.rows[0], seen);
    if (samples == 1)
      for (int k = 0; k < count; ++k) AddTimes(sums.rows[k + 1], s.middles[size_t(k) * stride + b], seen);
  }
  if (samples == 1) return;
  AtKnownNodes(lobe, s, cube, samples, b, known);
  const size_t grid = size_t(samples - 1);
  const float* nodes = samples == 4 ? s.fine : s.nodes;
  if (samples < all_classes && !changes) {
    const float* row = light.coarse.data() + (b * coarse_each + coarse_begin[grid]) * sum_width;
    const size_t apart = samples == 4 ? 64 : 16;
    for (size_t k = 0; k < size_t(count); ++k, nodes += apart) {
      const Row part = SumCoarse(row, nodes, nodes_each[grid]);
      AddRow(sums.rows[k + 1], part);
    }
    return;
  }
  Seen seen;
  if (changes) ReadTexels(*changes, scale, s.weights, seen);
  const float* texels = light.texels.data() + b * 6 * block_texels;
  if (samples == all_classes)
    AddTexels(sums.texels, texels, changes ? &seen : nullptr, n,
              [&](size_t, size_t, V x, V y, V z, V* out) HWY_ATTR { lobe(x, y, z, out); });
  else if (samples == 2) AddBetween<2>(sums.texels, texels, seen, n, nodes, 16, cube, s.along);
  else if (samples == 3) AddBetween<4>(sums.texels, texels, seen, n, nodes, 16, cube, s.along);
  else AddBetween<8>(sums.texels, texels, seen, n, nodes, 64, cube, s.along);
}

// What BRDFs took of that, done once more.
template <class Lobe>
void EvaluateLit(const Lobe& lobe, BlockScratch& s, const BlockLight& light, const ProductMaterial& m, Vec3 n) {
  const F d;
  const Cube& cube = *light.cube;
  V sink = hn::Zero(d);
  for (size_t w = 0; w < s.lit.size(); ++w)
    for (uint32_t bits = (s.clear[w] | s.mixed[w]) & s.lit[w]; bits; bits &= bits - 1) {
      const auto bit = uint32_t(std::countr_zero(bits));
      const size_t b = w * 32 + bit;
      Known known;
      const int samples = ClassOf(lobe, s, light, m, n, b, s.clear[w] >> bit & 1, known);
      AtKnownNodes(lobe, s, cube, samples, b, known);
      const float* l = light.texels.data() + b * 6 * block_texels;
      for (size_t i = 0; i < size_t(block_texels) && samples == all_classes; i += lanes) {
        V values[Lobe::count];
        lobe(hn::Load(d, l + i), hn::Load(d, l + 256 + i), hn::Load(d, l + 512 + i), values);
        for (V v : values) sink = hn::Add(sink, v);
      }
    }
  hn::Store(sink, d, s.along);
}

// What a stage took, where it is asked for.
struct StageClock {
  StageTimes* times;
  Clock::time_point at = {};
  explicit StageClock(StageTimes* t) : times(t) {
    if (times) at = Clock::now(), ++times->receivers;
  }
  void Stage(double StageTimes::*of) {
    if (!times) return;
    const auto now = Clock::now();
    times->*of += std::chrono::duration<double, std::nano>(now - at).count(), at = now;
  }
};

void TallyDiffuse(const BlockScratch& s, size_t blocks, size_t words, Breakdown& tally) {
  size_t clear = 0, mixed = 0, clear_unlit = 0, mixed_unlit = 0;
  for (size_t w = 0; w < words; ++w) {
    clear += size_t(std::popcount(s.clear[w])), mixed += size_t(std::popcount(s.mixed[w]));
    clear_unlit += size_t(std::popcount(s.clear[w] & ~s.lit[w]));
    mixed_unlit += size_t(std::popcount(s.mixed[w] & ~s.lit[w]));
  }
  tally.blocked += blocks - clear - mixed, tally.light_brdf += clear_unlit, tally.light_visibility += mixed_unlit;
  tally.samples[0] += clear_unlit + mixed_unlit;
}

Vec3 ShadeBlocks(BlockScratch& s, const BlockLight& light, const Visibility& visibility, size_t receiver,
                 const ProductMaterial& material, const Terms& t, Breakdown& tally, StageTimes* times) {
  const Cube& cube = *light.cube;
  const size_t blocks = size_t(cube.blocks()), words = (blocks + 31) / 32;
  const bool binary = visibility.bits == 1;
  const Vec3 n = t.frame[2];
  const bool diffuse = t.lambert != Vec3(0);
  StageClock clock(times);
  std::fill(s.lit.begin(), s.lit.end(), 0u);
  for (size_t k = 0; k < 3; ++k) s.colour_weights[k] = largest(t.colour[k]);
  WithLobe(t, [&](auto lobe) HWY_ATTR { FindLit(lobe, s, cube, material); });
  clock.Stage(&StageTimes::brdf);
  if (binary) ReadSight<true>(s, light.sums.data(), visibility, receiver, diffuse);
  else ReadSight<false>(s, light.sums.data(), visibility, receiver, diffuse);
  TallyDiffuse(s, blocks, words, tally);
  clock.Stage(&StageTimes::visibility);
  Vec3 out(0);
  if (diffuse) out = t.lambert * Contract(binary ? SumSeen<true>(s, light, words) : SumSeen<false>(s, light, words), n);
  const float scale = 1 / float(visibility.top());
  WithLobe(t, [&](auto lobe) HWY_ATTR {
    using Lobe = decltype(lobe);
    LobeSums<Lobe> sums;
    const BlockChanges* changes = s.changes.data();
    for (size_t w = 0; w < words; ++w)
      for (uint32_t bits = (s.clear[w] | s.mixed[w]) & s.lit[w]; bits; bits &= bits - 1) {
        const auto bit = uint32_t(std::countr_zero(bits));
        const bool clear = s.clear[w] >> bit & 1;
        AddLitBlock(lobe, s, light, material, n, w * 32 + bit, clear ? nullptr : changes++, scale, sums, tally);
      }
    out += t.lambert * Contract(sums.rows[0], n);
    for (int k = 0; k < Lobe::count; ++k) {
      Vec3 of = Contract(sums.rows[k + 1], n);
      for (int c = 0; c < 3; ++c) of[size_t(c)] += hn::GetLane(hn::SumOfLanes(F(), sums.texels.acc[k][c]));
      out += t.colour[k] * of;
    }
  });
  clock.Stage(&StageTimes::integral);
  if (times && t.count > 0) {
    const double before = times->brdf;
    WithLobe(t, [&](auto lobe) HWY_ATTR { EvaluateLit(lobe, s, light, material, n); });
    clock.Stage(&StageTimes::brdf);
    times->integral = std::max(0.0, times->integral - (times->brdf - before));
  }
  return out;
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(ShadeBlocks);

}  // namespace

Vec3 shade_blocks_in_simd(BlockScratch& s, const BlockLight& light, const Visibility& visibility, size_t receiver,
                          const ProductMaterial& material, const Terms& terms, Breakdown& tally, StageTimes* times) {
  if (!(terms.wo.z > least_cosine)) return Vec3(0);
  const size_t blocks = size_t(light.cube->blocks()), words = (blocks + 31) / 32,
               stride = light.cube->nodes[0].x.size(), most = blocks * block_texels + 64;
  if (s.cosines.size() != stride) {
    s.clear.assign(words, 0), s.mixed.assign(words, 0), s.lit.assign(words, 0);
    s.cosines.resize(stride), s.middles.resize(3 * stride), s.rows.resize(most), s.changes.reserve(blocks);
  }
  if (visibility.bits > 1 && s.steps.size() != most) s.steps.resize(most);
  return HWY_DYNAMIC_DISPATCH(ShadeBlocks)(s, light, visibility, receiver, material, terms, tally, times);
}

}  // namespace lambent
#endif
