#pragma once
// What one receiver of a transfer matrix gathers: direct light as a triple product, and what hits scatter to it
// (matrix.h). Directions as in gather.h.
#include <lambent/bake/gather.h>
#include <lambent/bake/lobes.h>
#include <lambent/bake/matrix.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/pool.h>

namespace lambent {

// A hit that scatters, as it is kept for the bounces.
struct MatrixHit {
  uint32_t corner;  // triangle, and in the lowest bit whether its front was met
  uint32_t ray;
  uint16_t u, v;    // of 65535
  uint16_t rgb[3];  // halves: base colour there
};

struct MatrixHits {  // of a block of receivers
  std::vector<MatrixHit> hits;
  std::vector<Vec3> weights;   // of each hit, what it counts for; empty where all surfaces are solid
  std::vector<uint32_t> ends;  // by receiver
  size_t bytes() const {
    return hits.size() * sizeof(MatrixHit) + weights.size() * sizeof(Vec3) + ends.size() * 4 + sizeof(MatrixHits);
  }
};

// What a thread needs for one receiver at a time.
struct MatrixScratch {
  AlignedVector<float> x, y, z, lobe;
  std::vector<AlignedVector<float>> visible;  // of each sky channel
  std::vector<Hit> hits;
  std::vector<Passage> passages;
  std::vector<float> V, column_row;
  AlignedVector<float> sh_rows, v, zb, full, half;
  std::vector<ViewWeights> weights;
  std::vector<float> scalars, z_values;
  std::vector<double> lobe_sums;
  LobeRays lobe_rays;
  DirectionChoice choice{};
  float phi = 0;  // from the set's frame to the receiver's, about the normal
};

struct MatrixGather {
  const Scene& scene;
  Receivers receivers;  // a copy: buried ones move
  const ReceiverMaterials& materials;
  const BakeOptions& options;
  const MatrixOptions& matrix;
  const GatherSetup setup;

  const LobeSets lobes = make_lobe_sets(options.lobe_kind, options.lobes, options.samples, options.seed);
  CosineBasis basis = make_cosine_basis(matrix.incident_order);
  TriplingTensor tensor =
      make_tripling_tensor(options.order, matrix.incident_order, options.order + matrix.incident_order - 1);
  ShZyzRotator rotator{options.order};
  std::vector<FactoredResponse> scatter{};
  std::vector<size_t> first_row{};  // of each receiver's scattered rows; one more at the end
  Pool<MatrixScratch> scratch{[this] { return make_scratch(); }};

  const CornerReceivers& corners() const { return std::get<CornerReceivers>(receivers.basis); }
  size_t n() const { return receivers.count(); }
  size_t J() const { return size_t(basis.count()); }  // rows of X
  size_t harmonics() const { return size_t(sh_count(options.order)); }
  size_t C() const { return harmonics() + lobes.count(); }  // columns
  size_t channels() const { return size_t(setup.channels); }
  size_t width() const { return pad_lanes(C()); }  // floats of a row of one channel
  size_t wc() const { return channels() * width(); }
  size_t sky_channels() const { return size_t(setup.sky_channels); }
  size_t t0_width() const { return sky_channels() * J() * width(); }
  size_t V_count() const { return setup.coefficients(); }
  size_t rays() const { return size_t(setup.sets.samples); }
  bool has_halves() const { return setup.sets.half < rays(); }

  std::unique_ptr<MatrixScratch> make_scratch() const;
  Directions aim(MatrixScratch& s, size_t r) const;
  // Rows over the harmonics of the set's frame -> rows over the incident basis of the receiver's frame, into
  // out[j][width].
  void to_incident(float* sh_rows, float phi, size_t w, float scale, float* out) const;
  // Direct light from the first `count` rays: X0_ji = mean of V y_i z_j = sum_k C_ijk V_k. out is [sky
  // channel][J][width].
  void direct(MatrixScratch& s, size_t count, float* out) const;
  void direct(MatrixScratch& s, const AlignedVector<float>& visible, size_t count, float* out) const;
  // Direct light of the sharp lobes, by rays of their own: X0_jk = 1/pi integral of V b_k z_j cos, into out and, if
  // given, half_out.
  void direct_sharp_lobes(MatrixScratch& s, size_t r, float* out, float* half_out) const;
  // All direct light of a receiver that was traced, [sky channel][J][width]; half may be null.
  void direct_light(MatrixScratch& s, size_t r, float* full, float* half) const {
    direct(s, rays(), full);
    if (half) direct(s, std::min(setup.sets.half, rays()), half);
    direct_sharp_lobes(s, r, full, half);
  }
  // To [J][channel][width]; the same in every channel where the sky has one.
  void expand(const float* t, float* x) const;
  // Light that the hits of rays below `limit` scatter to receiver r, added to out[J][channel][width]; Y holds scattered
  // rows. `through`: the hits' weights, or null.
  void scattered(MatrixScratch& s, std::span<const MatrixHit> hits, const Vec3* through, size_t limit, const float* Y,
                 float* out) const;
  // The same light by following the rays below `limit` on from their hits, each to its end.
  void simulated(MatrixScratch& s, size_t r, std::span<const MatrixHit> hits, size_t limit, float* out) const;
  // Adds the last hits of a sum over rays, and the sum, as rows over the incident basis, to out.
  void add_rest(MatrixScratch& s, size_t in_batch, size_t limit, float* out) const;
  // Traces receiver r: its visible rays, and its scattering hits if wanted. True: it lies inside something.
  bool trace(MatrixScratch& s, size_t r, MatrixHits* hits) const;
};

}  // namespace lambent
