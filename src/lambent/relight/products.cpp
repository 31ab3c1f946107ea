// Follows: locally-adaptive-products, section 4 and appendix A; Ng, Ramamoorthi and Hanrahan 2004 (Haar wavelets).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/relight/block_kernels.h>

#include <bit>
#include <mutex>
#include <optional>

namespace lambent {
namespace {

// Exponent of a Phong lobe as wide as the model's: half-vector slopes of width alpha turn the mirror image by twice the
// angle.
float equivalent_exponent(const Brdf& brdf) {
  auto of_alpha = [](float alpha) { return 1 / (2 * alpha * alpha); };
  if (const auto* b = std::get_if<Phong>(&brdf)) return b->exponent;
  if (const auto* b = std::get_if<Ward>(&brdf)) return of_alpha(std::min(widths(b->alpha).x, widths(b->alpha).y));
  if (const auto* b = std::get_if<Ggx>(&brdf)) return of_alpha(std::min(widths(b->alpha).x, widths(b->alpha).y));
  if (const auto* b = std::get_if<CookTorrance>(&brdf)) return of_alpha(widths(Vec2(b->m)).x);
  if (const auto* b = std::get_if<MetallicRoughness>(&brdf))
    return of_alpha(widths(Vec2(b->roughness * b->roughness)).x);
  return 0;
}

// Largest error over a block, whose middle is `angle` from a Phong lobe's axis, of no sample, 1, 4, 16 and 64:
// numerically, on a flat block.
std::array<float, 5> phong_errors(float exponent, float angle, float half_width, const Cube& cube) {
  std::array<float, 5> errors{};
  for (float turn : {0.0f, pi / 4}) {
    auto lobe = [&](float x, float y) {
      const float u = x * std::cos(turn) - y * std::sin(turn) + angle, v = x * std::sin(turn) + y * std::cos(turn),
                  theta = std::sqrt(u * u + v * v);
      return theta < pi / 2 ? std::pow(std::cos(theta), exponent) * (exponent + 2) / (2 * pi) : 0.0f;
    };
    auto place = [&](float texel) { return (texel / 8 - 1) * half_width; };
    float nodes[4][64];
    for (int k = 0; k < 4; ++k)
      for (int i = 0; i < node_sides[k] * node_sides[k]; ++i) {
        const int n = node_sides[k];
        nodes[k][i] = lobe(place(float(node_place(n, i % n))), place(float(node_place(n, i / n))));
      }
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) {
        const float truth = lobe(place(float(x) + 0.5f), place(float(y) + 0.5f));
        errors[0] = std::max(errors[0], truth);
        for (int k = 0; k < 4; ++k) {
          float sum = 0;
          const int n = node_sides[k];
          for (int i = 0; i < n * n; ++i)
            sum += nodes[k][i] * cube.cardinal[size_t(k)][size_t(i % n * 16 + x)] *
                   cube.cardinal[size_t(k)][size_t(i / n * 16 + y)];
          errors[size_t(k + 1)] = std::max(errors[size_t(k + 1)], std::abs(sum - truth));
        }
      }
  }
  return errors;
}

struct Scratch {
  BlockScratch blocks;
  alignas(64) float terms[3 * block_texels], weights[block_texels];
};

constexpr uint32_t all_rows = (1u << block_side) - 1;

void expand(const BlockChanges& c, float scale, float* weights) {
  int t = 0;
  float now = 0;
  for (int i = 0; i < c.count; ++i) {
    for (; t < c.where[i]; ++t) weights[t] = now;
    now = float(c.level_after(i)) * scale;
  }
  for (; t < block_texels; ++t) weights[t] = now;
}

Vec3 total(const Terms& t, const Vec3* sums) {
  Vec3 out = t.lambert * sums[0];
  for (int k = 0; k < t.count; ++k) out += t.colour[k] * sums[k + 1];
  return out;
}

Vec3 shade_standard_with(Scratch& s, const BlockLight& light, const Visibility& visibility, size_t receiver,
                         const ProductMaterial& material, const Mat3& frame, Vec3 wo) {
  const Terms t = make_terms(material.brdf, frame, wo);
  if (!(t.wo.z > least_cosine)) return Vec3(0);
  const float scale = 1 / float(visibility.top());
  Vec3 sums[4] = {};
  VisibilityReader reader(visibility, receiver);
  for (int b = 0; b < light.cube->blocks(); ++b) {
    const BlockSight sight = reader.sight(b);
    if (sight == BlockSight::blocked) continue;
    if (sight == BlockSight::mixed) expand(reader.next(), scale, s.weights);
    const float* texels = light.texels.data() + size_t(b) * 6 * block_texels;
    evaluate_terms(t, texels, texels + 256, texels + 512, block_texels, s.terms, block_texels);
    const float* weights = sight == BlockSight::clear ? nullptr : s.weights;
    integrate_texels(texels, weights, frame[2], s.terms, t.count, true, all_rows, sums);
  }
  return total(t, sums);
}

}  // namespace

namespace {

void set_cube(BlockLight& out, int size) {
  if (out.cube && out.cube->size == size) return;
  out.cube = std::make_shared<const Cube>(make_cube(size)), out.rise.clear();
  for (float reach : out.cube->reach) out.rise.push_back(std::sin(reach));
  // Halfway between texels 7 and 8, along both sides.
  const std::vector<float>& c = out.cube->cardinal[2];
  auto half_way = [&](size_t i) { return 0.5f * (c[i * 16 + 7] + c[i * 16 + 8]); };
  for (size_t i = 0; i < 16; ++i) out.middle_weights[i] = half_way(i % 4) * half_way(i / 4);
  auto between = [](int node, int at) { return fine_cardinal(node, node_place(4, at)); };
  out.between.resize(64 * 16);
  for (int i = 0; i < 64 * 16; ++i) {
    const int node = i / 16, at = i % 16;
    out.between[size_t(i)] = float(between(node % 8, at % 4) * between(node / 8, at / 4));
  }
}

}  // namespace

void set_light(BlockLight& out, const CubeLight& light) {
  set_cube(out, light.size);
  const Cube& cube = *out.cube;
  const size_t blocks = size_t(cube.blocks());
  // Rows are read by sixteen numbers.
  out.texels.resize(blocks * 6 * block_texels), out.sums.resize((blocks * block_texels + 2) * sum_width),
      out.whole.resize((blocks + 1) * sum_width), out.coarse.resize((blocks * coarse_each + 1) * sum_width);
  out.sharp.resize(blocks);
  double all = 0;
  for (const Vec3& e : light.energy) all += double(largest(e));
  const auto much = float(1e-3 * all);
  parallel_for(blocks, 8, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      out.sharp[b] = 0;
      float* texels = out.texels.data() + b * 6 * block_texels;
      float* coarse = out.coarse.data() + b * coarse_each * sum_width;
      double sum[sum_width] = {};
      alignas(64) float moments[block_texels * sum_width];
      for (size_t t = block_texels; t-- > 0;) {
        const Vec3 d = light.direction[b * block_texels + t], e = light.energy[b * block_texels + t];
        out.sharp[b] |= largest(e) > much;
        float* m = moments + t * sum_width;
        std::fill(m, m + sum_width, 0.0f);
        for (size_t k = 0; k < 3; ++k) {
          texels[k * block_texels + t] = d[int(k)], texels[(3 + k) * block_texels + t] = e[int(k)];
          for (size_t c = 0; c < 3; ++c) m[4 * k + c] = d[int(k)] * e[int(c)];
        }
        float* sums = out.sums.data() + (b * block_texels + t) * sum_width;
        for (size_t i = 0; i < sum_width; ++i) sum[i] += double(m[i]), sums[i] = float(sum[i]);
      }
      fold_moments(cube, moments, coarse);
      std::copy_n(out.sums.data() + b * block_texels * sum_width, sum_width, out.whole.data() + b * sum_width);
    }
  });
}

ProductMaterial make_product_material(const Brdf& brdf, const Cube& cube, const Sampling& sampling) {
  ProductMaterial m;
  m.brdf = brdf, m.tolerance = sampling.tolerance;
  const float exponent = equivalent_exponent(brdf);
  const auto* phong = std::get_if<Phong>(&brdf);
  if (sampling.rule == SamplingRule::full) {
    m.cosines = {-2, -2, -2, -2, -2};
  } else if (sampling.rule == SamplingRule::appendix_a) {
    const float wide = std::cos(pi / 4), narrow = std::cos(pi / 8);
    const float most = exponent > 250 ? narrow : 2;
    if (exponent < 30) m.cosines = {-2, exponent > 0 ? wide : 2, 2, 2, 2};
    else m.cosines = {-2, wide, narrow, most, most};
  } else if (phong) {
    // From the far side on, the first angle at which the error is too large; twice the tolerance, since this is the
    // worst of the block.
    constexpr int steps = 90;
    m.cosines = {2, 2, 2, 2, 2};
    const float half_width = cube.widest / std::sqrt(2.0f), weight = pi * largest(phong->specular);
    for (int i = steps; i >= 0; --i) {
      const float angle = float(i) * pi / steps;
      const std::array<float, 5> errors = phong_errors(phong->exponent, angle, half_width, cube);
      for (size_t k = 0; k < 5; ++k)
        if (m.cosines[k] > 1 && weight * errors[k] > (k < 4 ? 2 : 0.1f) * sampling.tolerance)
          m.cosines[k] = std::cos(std::min(pi, angle + pi / steps)) - 1e-6f;
    }
    // More samples are never wrong: the classes are nested.
    for (size_t k = 4; k > 0; --k) m.cosines[k - 1] = std::min(m.cosines[k - 1], m.cosines[k]);
  } else {
    // Near a lobe narrower than the nodes' spacing, values at 16 nodes say nothing; nor, of a narrower one, at 64.
    m.by_values = true;
    const float deviation = exponent > 0 ? 1 / std::sqrt(exponent) : 1;
    const float near = std::cos(std::min(pi, cube.widest + 3 * deviation));
    m.cosines = {-2, 2, 2, deviation < cube.widest / 2 ? near : 2, deviation < cube.widest / 4 ? near : 2};
  }
  return m;
}

Vec3 diffuse_albedo(const Brdf& brdf) {
  if (const auto* b = std::get_if<Lambert>(&brdf)) return b->albedo;
  if (const auto* b = std::get_if<Phong>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<Ward>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<CookTorrance>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<MetallicRoughness>(&brdf)) return b->base_color * (1 - b->metallic);
  return Vec3(0);
}

void Breakdown::add(const Breakdown& b) {
  blocked += b.blocked, light_brdf += b.light_brdf, light_visibility += b.light_visibility, triple += b.triple;
  for (size_t k = 0; k < samples.size(); ++k) samples[k] += b.samples[k];
  times.visibility += b.times.visibility, times.brdf += b.times.brdf, times.integral += b.times.integral,
      times.receivers += b.times.receivers;
  largest_off = std::max(largest_off, b.largest_off), squares_off += b.squares_off, squares += b.squares;
}

Vec3 shade_blocks(const BlockLight& light, const Visibility& visibility, size_t receiver,
                  const ProductMaterial& material, const Mat3& frame, Vec3 wo, Breakdown* breakdown) {
  Scratch s;
  Breakdown tally;
  const Vec3 out = shade_blocks_in_simd(s.blocks, light, visibility, receiver, material,
                                        make_terms(material.brdf, frame, wo), tally);
  if (breakdown) breakdown->add(tally);
  return out;
}

Vec3 shade_standard(const BlockLight& light, const Visibility& visibility, size_t receiver,
                    const ProductMaterial& material, const Mat3& frame, Vec3 wo) {
  Scratch s;
  return shade_standard_with(s, light, visibility, receiver, material, frame, wo);
}

Vec3 shade_standard_scalar(const BlockLight& light, const Visibility& visibility, size_t receiver,
                           const ProductMaterial& material, const Mat3& frame, Vec3 wo) {
  const size_t count = light.cube->count();
  std::vector<uint8_t> levels(count);
  decode_visibility(visibility, receiver, levels);
  auto local = [&](Vec3 w) { return Vec3(dot(frame[0], w), dot(frame[1], w), dot(frame[2], w)); };
  const Vec3 view = local(wo);
  Vec3d sum(0);
  for (size_t t = 0; t < count; ++t) {
    const float* p = light.texels.data() + t / block_texels * 6 * block_texels + t % block_texels;
    const Vec3 wi = local(Vec3(p[0], p[256], p[512]));
    sum += Vec3d(evaluate(material.brdf, wi, view) * Vec3(p[768], p[1024], p[1280]) *
                 (wi.z * float(levels[t]) / float(visibility.top())));
  }
  return Vec3(sum);
}

HaarLight make_haar_light(const CubeLight& light, double fraction, int visibility_bits) {
  HaarLight out{std::make_shared<const Cube>(make_cube(light.size)), fraction, visibility_bits, {}, light.direction};
  const int size = light.size, levels = std::countr_zero(unsigned(size));
  LAMBENT_CHECK(std::has_single_bit(unsigned(size)));
  std::vector<float> face(size_t(size) * size_t(size));
  for (int c = 0; c < 3; ++c) {
    out.trees[size_t(c)].resize(6);
    for (int f = 0; f < 6; ++f) {
      // Of area 1: the integral is the sum of energies.
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
          face[size_t(y * size + x)] = light.energy[cube_texel(size, f, x, y)][c] * float(size) * float(size);
      haar_transform(levels, face, out.trees[size_t(c)][size_t(f)]);
    }
    keep_largest(out.trees[size_t(c)], fraction);
  }
  return out;
}

void project_haar(const HaarLight& light, const Visibility& visibility, size_t receiver,
                  const ProductMaterial& material, const Mat3& frame, Vec3 wo, HaarScratch& s) {
  const int size = light.cube->size, levels = std::countr_zero(unsigned(size));
  const size_t count = light.cube->count(), area = size_t(size) * size_t(size);
  s.levels.resize(count), s.faces.resize(4 * count);
  decode_visibility(visibility, receiver, s.levels);
  auto local = [&](Vec3 w) { return Vec3(dot(frame[0], w), dot(frame[1], w), dot(frame[2], w)); };
  const Vec3 view = local(wo);
  for (int f = 0; f < 6; ++f)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        const size_t t = cube_texel(size, f, x, y), at = size_t(f) * area + size_t(y * size + x);
        const Vec3 wi = local(light.direction[t]), value = evaluate(material.brdf, wi, view) * wi.z;
        for (size_t c = 0; c < 3; ++c) s.faces[c * count + at] = value[int(c)];
        s.faces[3 * count + at] = float(s.levels[t]) / float(visibility.top());
      }
  for (size_t c = 0; c < 4; ++c) {
    std::vector<HaarTree>& trees = c < 3 ? s.brdf[c] : s.visibility;
    trees.resize(6);
    for (size_t f = 0; f < 6; ++f)
      haar_transform(levels, std::span<const float>(s.faces).subspan(c * count + f * area, area), trees[f]);
    if (c < 3) keep_largest(trees, light.fraction);
    else if (light.visibility_bits > 0)
      for (HaarTree& tree : trees) quantise_haar(tree, light.visibility_bits);
  }
}

Vec3 multiply_haar(const HaarLight& light, const HaarScratch& s, size_t* visited) {
  Vec3d sum(0);
  for (size_t c = 0; c < 3; ++c)
    for (size_t f = 0; f < 6; ++f)
      sum[int(c)] += haar_triple_product(light.trees[c][f], s.brdf[c][f], s.visibility[f], visited);
  return Vec3(sum);
}

struct ProductScratch::Pools {
  Pool<Scratch> products{[] { return std::make_unique<Scratch>(); }};
  Pool<HaarScratch> haar{[] { return std::make_unique<HaarScratch>(); }};
  // What of the last output may not be 0, and where that is; null: nobody knows.
  std::vector<uint32_t> lit;
  const float* output = nullptr;
};

namespace {

// All that is not in `seen` to 0, or to what it was.
void clear_output(ProductScratch::Pools& pools, std::span<const uint32_t> seen, size_t receivers, bool keep,
                  Relit& out) {
  const size_t values = (receivers + transfer_block - 1) / transfer_block * 3 * transfer_block;
  const bool known = out.values.size() == values && out.values.data() == pools.output;
  if (out.values.size() != values || (!keep && !known)) {
    out.values.assign(values, 0.0f);
  } else if (!keep) {
    for (uint32_t r : pools.lit) out.set(r, 0, Vec3(0));
  } else if (!known || pools.lit.size() + seen.size() > 2 * receivers) {
    pools.output = nullptr;  // there is more than a list of it
    return;
  }
  if (!keep || !known) pools.lit.clear();
  pools.lit.reserve(2 * receivers);  // once: later frames allocate nothing
  pools.lit.insert(pools.lit.end(), seen.begin(), seen.end());
  pools.output = out.values.data();
}

// A receiver's blocks; of one in 64 what its stages take, and what fewer samples make of it.
Vec3 shade_one(BlockScratch& s, const BlockLight& light, const Visibility& visibility, size_t r,
               const ProductMaterial& material, const Terms& terms, int most_class, bool look, Breakdown& tally) {
  s.most_class = most_class;
  Breakdown other;
  StageTimes times;
  const Vec3 value = shade_blocks_in_simd(s, light, visibility, r, material, terms, tally, look ? &times : nullptr);
  if (!look) return value;
  constexpr double interrupted = 2e5;  // another process had the core
  if (times.visibility + times.brdf + times.integral < interrupted) {
    tally.times.visibility += times.visibility, tally.times.brdf += times.brdf, tally.times.integral += times.integral;
    ++tally.times.receivers;
  }
  if (most_class < all_classes) {
    s.most_class = all_classes;
    const Vec3 whole = shade_blocks_in_simd(s, light, visibility, r, material, terms, other);
    const double off = double(largest(abs(value - whole)));
    tally.largest_off = std::max(tally.largest_off, off), tally.squares_off += off * off;
    tally.squares += double(largest(whole)) * double(largest(whole));
  }
  return value;
}

}  // namespace
ProductScratch::ProductScratch() : pools_(std::make_unique<Pools>()) {}
ProductScratch::ProductScratch(ProductScratch&&) noexcept = default;
ProductScratch::~ProductScratch() = default;

void shade_receivers(Product product, const BlockLight& light, const HaarLight* haar, const Visibility& visibility,
                     const ProductReceivers& receivers, std::span<const uint32_t> seen, Vec3 eye, Relit& out,
                     Breakdown* breakdown, ProductScratch* scratch, bool keep, int most_samples) {
  LAMBENT_CHECK(light.cube && light.cube->size == visibility.size && (product != Product::haar || haar) &&
                receivers.positions.size() == visibility.receivers);
  out.rows = 1;
  std::mutex mutex;
  std::optional<ProductScratch> own;
  if (!scratch) scratch = &own.emplace();
  ProductScratch::Pools& pools = scratch->pools();
  clear_output(pools, seen, visibility.receivers, keep, out);
  const int most_class = most_samples >= 256 ? all_classes
                       : most_samples >= 64  ? 4
                       : most_samples >= 16  ? 3
                       : most_samples >= 4   ? 2
                                             : 1;
  parallel_for(seen.size(), 64, [&](size_t begin, size_t end) {
    const auto s = pools.products.borrow();
    Breakdown tally;
    for (size_t i = begin; i < end; ++i) {
      const size_t r = seen[i];
      const ProductMaterial& material = receivers.materials[receivers.material_of[r]];
      const Mat3& frame = receivers.frames[r];
      const Vec3 wo = normalize_or(eye - receivers.positions[r], frame[2]);
      Vec3 value(0);
      if (product == Product::blocks) {
        value = shade_one(s->blocks, light, visibility, r, material, make_terms(material.brdf, frame, wo), most_class,
                          breakdown && i % 64 == 0, tally);
      } else if (product == Product::standard) {
        value = shade_standard_with(*s, light, visibility, r, material, frame, wo);
      } else {
        const auto h = pools.haar.borrow();
        project_haar(*haar, visibility, r, material, frame, wo, *h);
        value = multiply_haar(*haar, *h);
      }
      out.set(r, 0, value);
    }
    if (breakdown) {
      std::lock_guard lock(mutex);
      breakdown->add(tally);
    }
  });
}

}  // namespace lambent
