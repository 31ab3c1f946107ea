// Follows: locally-adaptive-products, section 4.2.
#include <lambent/bake/open_sky.h>
#include <lambent/bake/visibility.h>
#include <lambent/core/check.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/pool.h>
#include <lambent/core/ranks.h>

#include <atomic>
#include <numeric>

namespace lambent {
namespace {

constexpr size_t piece_receivers = 64;
constexpr int fine = 8;  // rays a side of a texel that is seen in part

struct Scratch {
  std::vector<uint8_t> levels;
  std::vector<size_t> texels;  // above the horizon
  AlignedVector<float> x, y, z, seen;
  TileMask open;
};

// Texels a side of a tile: whole tiles a block, and no more a face than a mask holds.
int tile_side(int size) {
  int side = 1;
  while (size / side > most_tiles) side *= 2;
  return side;
}

struct RayCount {
  size_t all = 0, certain = 0;
};

struct VisibilityTracer {
  const Tracer& tracer;
  const VisibilityOptions& options;
  Cube cube = make_cube(options.size);
  int tile = tile_side(options.size);
  OpenSky sky = OpenSky(options.scene ? *options.scene : Scene{}, options.size / tile);

  float top() const { return float((1 << options.bits) - 1); }
  bool is_open(const Scratch& s, int face, int column, int row) const {
    return s.open[size_t(face)][size_t(row / tile)] >> (column / tile) & 1;
  }

  // Levels at the centres, rounded. Tile by tile, block by block: rays that follow one another point alike.
  // `look`: for what is certain.
  RayCount trace_centres(Vec3 origin, Vec3 n, bool look, Scratch& s) const {
    s.levels.assign(cube.count(), 0), s.texels.resize(cube.count());
    s.x.resize(cube.count()), s.y.resize(cube.count()), s.z.resize(cube.count());
    const DirectionArray& d = cube.texels;
    const TileMask above = sky.above(n);
    s.open = look ? above : TileMask{};
    if (look) sky.close(origin, n, s.open);
    RayCount rays;
    size_t count = 0;
    const auto clear = uint8_t(top());
    const int side = tile, each = block_side / side, blocks = options.size / block_side;
    for (int face = 0; face < 6; ++face)
      for (int k = 0; k < each * each * blocks * blocks; ++k) {
        const int block = k / (each * each), within = k % (each * each), column = block % blocks * each + within % each,
                  row = block / blocks * each + within / each;
        if (!(above[size_t(face)][size_t(row)] >> column & 1)) continue;
        const bool open = s.open[size_t(face)][size_t(row)] >> column & 1;
        for (int j = 0; j < side; ++j) {
          const size_t first = cube_texel(options.size, face, column * side, row * side + j);
          for (size_t t = first; t < first + size_t(side); ++t) {
            const bool seen = n.x * d.x[t] + n.y * d.y[t] + n.z * d.z[t] > 0;
            if (open) {
              s.levels[t] = seen ? clear : uint8_t(0), rays.certain += seen;
            } else {
              s.texels[count] = t, s.x[count] = d.x[t], s.y[count] = d.y[t], s.z[count] = d.z[t], count += seen;
            }
          }
        }
      }
    s.seen.resize(cube.count());
    tracer.visible_fan(origin, {s.x.data(), s.y.data(), s.z.data(), count}, s.seen.data());
    for (size_t i = 0; i < count; ++i) s.levels[s.texels[i]] = uint8_t(s.seen[i] * top() + 0.5f);
    rays.all = rays.certain + count;
    return rays;
  }

  // Shares in place of those at the centres.
  RayCount refine(Vec3 origin, Vec3 n, Scratch& s) const {
    const int size = cube.size;
    const std::vector<uint8_t> centres = s.levels;
    RayCount rays;
    for (int face = 0; face < 6; ++face)
      for (int row = 0; row < size; ++row)
        for (int column = 0; column < size; ++column) {
          const size_t texel = cube_texel(size, face, column, row);
          if (!(dot(n, cube.texels.at(texel)) > 0)) continue;
          bool edge = false;
          for (int j = std::max(row - 1, 0); j <= std::min(row + 1, size - 1); ++j)
            for (int i = std::max(column - 1, 0); i <= std::min(column + 1, size - 1); ++i)
              edge |= centres[cube_texel(size, face, i, j)] != centres[texel];
          if (!edge) continue;
          s.x.clear(), s.y.clear(), s.z.clear();
          for (int k = 0; k < fine * fine; ++k) {
            const float u = float(column) + (float(k % fine) + 0.5f) / fine,
                        v = float(row) + (float(k / fine) + 0.5f) / fine;
            const Vec3 d = normalize(cube_point(face, 2 * u / float(size) - 1, 2 * v / float(size) - 1));
            if (dot(n, d) > 0) s.x.push_back(d.x), s.y.push_back(d.y), s.z.push_back(d.z);
          }
          s.seen.assign(s.x.size(), 1.0f), rays.all += s.x.size();
          if (is_open(s, face, column, row)) rays.certain += s.x.size();
          else tracer.visible_fan(origin, {s.x.data(), s.y.data(), s.z.data(), s.x.size()}, s.seen.data());
          float sum = 0;
          for (float seen : s.seen) sum += seen;
          s.levels[texel] = uint8_t(sum / float(fine * fine) * top() + 0.5f);
        }
    return rays;
  }
};

// Each rank has made its own, of as many bytes as their receivers' lengths add up to.
void gather_pieces(const Shares& shares, std::vector<std::vector<uint8_t>>& pieces,
                   const std::vector<uint32_t>& lengths) {
  if (shares.alone()) return;
  auto each_piece = [&](int rank, auto f) {
    shares.each_stripe(rank, [&](size_t begin, size_t end) {
      for (size_t at = begin; at < end; at += piece_receivers) f(pieces[at / piece_receivers], at);
    });
  };
  Ranks& ranks = shares.ranks();
  std::vector<uint8_t> mine;
  each_piece(ranks.rank(), [&](auto& piece, size_t) { mine.insert(mine.end(), piece.begin(), piece.end()); });
  const auto all = ranks.gather(std::move(mine));
  for (int k = 0; k < ranks.count(); ++k) {
    auto from = all[size_t(k)].begin();
    each_piece(k, [&](auto& piece, size_t first) {
      const size_t end = std::min(first + piece_receivers, lengths.size());
      const size_t bytes =
          std::accumulate(lengths.begin() + ptrdiff_t(first), lengths.begin() + ptrdiff_t(end), size_t{0});
      piece.assign(from, from + ptrdiff_t(bytes)), from += ptrdiff_t(bytes);
    });
  }
}

}  // namespace

size_t expected_visibility_bytes(size_t receivers, const VisibilityOptions& options) {
  // The paper's scenes come to 500 to 1,400 bytes a vertex on a cube of 64; runs grow with its side, flags with its
  // area.
  const size_t scale = size_t(options.size) * size_t(options.size) / 4096 + 1;
  return receivers * (700 * scale * (options.bits > 1 ? 2 : 1) + sizeof(uint64_t));
}

Result<Visibility> bake_visibility(const Tracer& tracer, const Receivers& receivers, const VisibilityOptions& options,
                                   VisibilityReport* report, Progress* progress) {
  LAMBENT_CHECK(is_cube_size(options.size) && options.bits >= 1 && options.bits <= max_visibility_bits);
  const size_t expected = expected_visibility_bytes(receivers.count(), options);
  if (expected > options.memory)
    return Error{"", "the visibility of " + std::to_string(receivers.count()) + " receivers may take " +
                         std::to_string(expected >> 20) +
                         " MiB, more than --memory allows; take a smaller --cube or fewer vertices"};
  const auto start = Clock::now();
  const VisibilityTracer work{tracer, options};
  Pool<Scratch> pool([] { return std::make_unique<Scratch>(); });
  std::vector<std::vector<uint8_t>> pieces((receivers.count() + piece_receivers - 1) / piece_receivers);
  std::vector<uint32_t> lengths(receivers.count());
  std::atomic<size_t> rays{0}, certain{0};
  {
    const Shares shares(receivers.count(), piece_receivers);
    ProgressStage stage(progress, "tracing", shares.own());
    const KeptPieces kept(progress, "tracing", pieces.size());
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      const auto s = pool.borrow();
      std::vector<uint8_t>& out = pieces[begin / piece_receivers];
      const std::span<uint32_t> own_lengths(lengths.data() + begin, end - begin);
      size_t traced = 0, untraced = 0, looked = 0;
      const bool loaded = kept.load(begin / piece_receivers, out, own_lengths, traced);
      for (size_t r = begin; r < end && !loaded && !stage.cancelled(); ++r) {
        auto count = [&](RayCount c) { traced += c.all, untraced += c.certain; };
        // Looking takes what a quarter of the rays do: among walls one receiver in eight says whether it is worth it.
        const bool look = options.scene && (4 * untraced >= looked || (r - begin) % 8 == 0);
        const RayCount centres = work.trace_centres(receivers.origins[r], receivers.normals[r], look, *s);
        if (look) looked += centres.all;
        count(centres);
        if (options.bits > 1) count(work.refine(receivers.origins[r], receivers.normals[r], *s));
        const size_t before = out.size();
        encode_visibility(options.size, options.bits, s->levels, out);
        lengths[r] = uint32_t(out.size() - before);
      }
      out.shrink_to_fit();
      if (!loaded) kept.save(begin / piece_receivers, out, own_lengths, traced);
      rays += traced, certain += untraced;
      stage.advance(end - begin);
    });
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    rays = shares.ranks().sum(rays), certain = shares.ranks().sum(certain);
    shares.gather(lengths.data());
    gather_pieces(shares, pieces, lengths);
  }
  Visibility v = make_visibility(options.size, options.bits, std::move(pieces), lengths);
  if (report) *report = {rays, certain, v.bytes(), seconds_since(start)};
  return v;
}

}  // namespace lambent
