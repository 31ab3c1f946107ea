#pragma once
// Transfer MATRICES: what arrives at each receiver from every direction, X = T . light over the incident basis
// (basis/cosine_basis.h), and its last reflection. Direct light is the triple product of light, visibility and incident
// basis; bounces are the Neumann recursion with glossy scattering at the hits,
//   X_{k+1} = T0 + G X_k,    (G X)(p) = mean over rays of z(w) sum over corners of the hit of b_c O_c(-w) . X_c,
// the same gather as diffuse baking (gather.h), where z and O have the one row z_0 = 1, O_0 = albedo.
// Source: general-prt ("Transfer Matrix for Bounce k+1", "Final reflection"); triple-product-integrals.
#include <lambent/bake/bake.h>
#include <lambent/bake/response.h>
#include <lambent/scene/reflection.h>

namespace lambent {

// More make files that are larger than maps, and no sharper.
inline constexpr int max_outgoing_lobes = 128;

struct MatrixOptions {
  int incident_order =
      5;  // bands of the incident basis, [1, max_incident_order]; order + incident_order <= max_sh_order + 1
  OutgoingKind outgoing = OutgoingKind::svd;
  int outgoing_order = 5;       // sh, hemisphere, hsh: bands
  int outgoing_lobes = 64;      // directional: how many, [4, max_outgoing_lobes]
  int svd_rows = 6;             // svd: rows a material, [1, incident_order^2]
  int grid = 64;                // nodes a side of the view maps, [8, 256]
  int response_samples = 2048;  // directions a view when a BRDF is projected
  int scatter_rows = 8;  // rows at most with which surfaces scatter between bounces; as few as leave scatter_error
  double scatter_error = 0.01;
  // Bounces by following every ray to its end instead of the recursion: each hit samples the BRDF there, not the rows
  // of vertices around it, so it takes any path (caustics) and any tessellation, at the price of noise. With bounces,
  // light must be harmonics alone.
  bool simulate_paths = false;
};

// The materials of a bake: which one each receiver has.
struct ReceiverMaterials {
  std::vector<LinearMaterial> materials;
  std::vector<uint16_t> of_receiver;
  std::vector<Mat3> frames;  // by receiver: tangent, bitangent, normal
  Reflection reflection;     // the same surfaces between receivers, for simulated paths
};

struct MatrixBake {
  Transfer transfer;
  Outgoing outgoing;
};

// Bytes of working memory that such a bake needs, beyond scene and result.
size_t matrix_memory(size_t receivers, int channels, const BakeOptions& options, const MatrixOptions& matrix);

// Errors: options out of range; memory too small (says what is needed, before it starts); cancelled.
Result<MatrixBake> bake_matrix(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                               const ReceiverMaterials& materials, const BakeOptions& options,
                               const MatrixOptions& matrix, BakeReport* report = nullptr, Progress* progress = nullptr);

}  // namespace lambent
