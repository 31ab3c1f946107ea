#pragma once
// Direct light at a vertex as the integral over all directions of light x visibility x BRDF x cosine, light, view and
// material all free: in blocks (locally-adaptive-products, Algorithm 1), in the standard basis (every texel), and in
// Haar wavelets (Ng et al. 2004).
//
// What differs from the paper: the cosine is not folded into the BRDF. It is linear in the direction, so light is kept
// times each coordinate of the direction, and Lambert's law costs one sample a block and has no error. The small
// inverses of eq. 4 are folded into the light: it is kept as integrals against the cardinal functions of the samples.
#include <lambent/basis/haar.h>
#include <lambent/brdf/brdf.h>
#include <lambent/light/cube_light.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/visibility.h>

#include <array>
#include <memory>
#include <span>

namespace lambent {

// Light in its three forms for each block. M is energy x direction of a texel: x, y, z, each (r, g, b, 0), so that n .
// M is irradiance.
struct BlockLight {
  std::shared_ptr<const Cube> cube;
  AlignedVector<float> texels;  // standard: [block][direction x, y, z, energy r, g, b][256]
  AlignedVector<float> sums;    // eq. 6: [block][texel][12], M summed from the texel to the block's end; and a 0
  AlignedVector<float> whole;   // [block][12], M summed over the block
  AlignedVector<float> coarse;  // [block][4 + 16 + 64][12], M times the cardinal functions of so many samples
  std::vector<float> rise;      // by block, sine of its reach: its part of the horizon
  // By block, whether one of its texels has a thousandth of all light or more: where in the texel that comes from is
  // seen, and samples are taken there.
  std::vector<uint8_t> sharp;
  std::array<float, 16> middle_weights{};  // of the values at 16 nodes, in what they interpolate at a block's middle
  AlignedVector<float> between;            // [64][16], of those at 64 nodes, in what they interpolate at the 16
};
// Rebuilds all three. Allocates the first time only.
void set_light(BlockLight& out, const CubeLight& light);

// How many samples of a BRDF a block gets: 1, 4, 16, 64 or 256.
enum class SamplingRule {
  bounded,     // as few as keep the error of BRDF x pi, times the lobe's colour, under a tolerance
  appendix_a,  // the paper's angles and exponents; other models than Phong's by the exponent of a lobe as wide
  full,        // 256 always
};
struct Sampling {
  SamplingRule rule = SamplingRule::bounded;
  float tolerance = 0.2f;
};

// A BRDF, and how near to the mirror image of the view a block has to be to get more samples: cosines of the angle
// between that and the block's middle, for 1 sample (below it the lobe is left out), 4, 16, 64 and 256.
struct ProductMaterial {
  Brdf brdf;
  std::array<float, 5> cosines{-2, 2, 2, 2, 2};
  bool by_values = false;  // bounded, for other models than Phong's: samples tell whether 1, 16, 64 or 256 do
  float tolerance = 0;
};
ProductMaterial make_product_material(const Brdf& brdf, const Cube& cube, const Sampling& sampling);

// Colour of the Lambert part; 0 where the model has none of its own (Ggx, Measured).
Vec3 diffuse_albedo(const Brdf& brdf);

// Nanoseconds of a thread that some receivers took, stage by stage: which blocks are seen and where; BRDFs; sums.
struct StageTimes {
  double visibility = 0, brdf = 0, integral = 0;
  size_t receivers = 0;
};

// Blocks by what was done with them (Table 1) and by BRDF samples (Table 2). Of one receiver in 64: what its stages
// took; and where samples are limited, how far that is from none being so, and how bright it is then.
struct Breakdown {
  size_t blocked = 0, light_brdf = 0, light_visibility = 0, triple = 0;
  std::array<size_t, 5> samples{0, 0, 0, 0, 0};  // 1, 4, 16, 64, 256
  StageTimes times = {};
  double largest_off = 0, squares_off = 0, squares = 0;  // of radiance, the largest channel
  size_t all_samples() const { return samples[0] + samples[1] + samples[2] + samples[3] + samples[4]; }
  double error() const { return squares > 0 ? std::sqrt(squares_off / squares) : 0; }
  void add(const Breakdown& b);
};

// Exit radiance towards the unit direction wo, world space; `frame` has columns tangent, bitangent, normal; the normal
// must be the one that the visibility was baked for. Nothing is seen from below the surface.
Vec3 shade_blocks(const BlockLight& light, const Visibility& visibility, size_t receiver,
                  const ProductMaterial& material, const Mat3& frame, Vec3 wo, Breakdown* breakdown = nullptr);
// The same sum over every texel that is not in a blocked block, in SIMD; and over every texel, plainly, one after
// another.
Vec3 shade_standard(const BlockLight& light, const Visibility& visibility, size_t receiver,
                    const ProductMaterial& material, const Mat3& frame, Vec3 wo);
Vec3 shade_standard_scalar(const BlockLight& light, const Visibility& visibility, size_t receiver,
                           const ProductMaterial& material, const Mat3& frame, Vec3 wo);

// Light and BRDFs in Haar wavelets on whole faces, of which `fraction` is kept; visibility in all of its own, of so
// many bits each (0: floats). Cubes of 2^k texels a side.
struct HaarLight {
  std::shared_ptr<const Cube> cube;
  double fraction = 1;
  int visibility_bits = 8;
  std::array<std::vector<HaarTree>, 3> trees;  // by channel, six faces
  std::vector<Vec3> direction;                 // by texel
};
HaarLight make_haar_light(const CubeLight& light, double fraction, int visibility_bits = 8);
struct HaarScratch {
  std::array<std::vector<HaarTree>, 3> brdf;
  std::vector<HaarTree> visibility;
  std::vector<uint8_t> levels;
  std::vector<float> faces;
};
// The first half makes the coefficients of one vertex, which Ng et al. keep ready; the second is the triple product
// that they time.
void project_haar(const HaarLight& light, const Visibility& visibility, size_t receiver,
                  const ProductMaterial& material, const Mat3& frame, Vec3 wo, HaarScratch& scratch);
Vec3 multiply_haar(const HaarLight& light, const HaarScratch& scratch, size_t* visited = nullptr);

// What shading a list of receivers takes.
struct ProductReceivers {
  std::vector<Vec3> positions;
  std::vector<Mat3> frames;
  std::vector<ProductMaterial> materials;
  std::vector<uint32_t> material_of;
};
enum class Product { blocks, standard, haar };

// What threads at work need, kept from frame to frame.
class ProductScratch {
 public:
  ProductScratch();
  ProductScratch(ProductScratch&&) noexcept;
  ~ProductScratch();
  struct Pools;
  Pools& pools() { return *pools_; }

 private:
  std::unique_ptr<Pools> pools_;
};

// Exit radiance of the receivers in `seen` towards the eye, row 0 of `out`; others are 0 or, where `keep`, what they
// were (0 at first). All cores. Sizes `out` and `scratch` on first use and allocates nothing after that. With `scratch`
// only those that it shaded in the last frames are set to 0 again, as long as `out` stays where it is. `most_samples`:
// of a block, 1, 4, 16, 64 or 256; blocks only.
void shade_receivers(Product product, const BlockLight& light, const HaarLight* haar, const Visibility& visibility,
                     const ProductReceivers& receivers, std::span<const uint32_t> seen, Vec3 eye, Relit& out,
                     Breakdown* breakdown = nullptr, ProductScratch* scratch = nullptr, bool keep = false,
                     int most_samples = 256);

}  // namespace lambent
