#pragma once
// The baked file: a glTF 2.0 binary that any viewer opens, the input's scene kept, with the transfer in the extension
// LAMBENT_transfer (docs/file-format.md; schema in docs/schema/).
#include <lambent/core/camera.h>
#include <lambent/core/file.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/cpca_transfer.h>
#include <lambent/transfer/lattice.h>
#include <lambent/transfer/outgoing.h>
#include <lambent/transfer/directional.h>
#include <lambent/transfer/transfer.h>
#include <lambent/transfer/visibility.h>
#include <lambent/transfer/zonal_transfer.h>

#include <optional>
#include <string>

namespace lambent {

inline constexpr int baked_file_version = 1;

// A bake whose view is fixed: its receivers are the pixels of a picture, row by row from the top (relight/fix_view.h).
struct FixedView {
  Camera camera;  // `up` is the default
  int width = 0, height = 0;
  std::vector<float> coverage;  // [0, 1] a pixel: how much of it the scene covers
};

struct Baked {
  Scene scene;
  std::vector<uint32_t> front,
      back;            // receiver of each scene vertex, by side, as in Receivers; of vertex receivers alone
  SpatialBasis basis;  // how values between receivers interpolate
  Transfer transfer;   // read in place: its data lies in the mapped file
  std::optional<Outgoing> outgoing;  // the last reflection of a transfer matrix, or of its rows as lobes
  DirectionalKind directional = DirectionalKind::none;  // what the rows of a directional lightmap are
  std::optional<LatticeTransfer>
      lattice;                         // light in free space, for the same light; its data lies in the mapped file too
  std::optional<ZonalTransfer> zonal;  // in place of `transfer`, which then has no receivers; read in place too
  std::vector<float> fit_errors;       // of zonal transfer, where they were kept: relative RMS of each receiver's fit
  std::optional<Visibility>
      visibility;  // in place of `transfer` as well: all-frequency light; its records are read in place
  std::optional<CpcaTransfer> cpca;  // likewise in place of `transfer`
  bool factors =
      false;  // `transfer` is visibility times cosine, from which relight_factors() makes the rows of `outgoing`
  std::optional<FixedView> view;  // then receivers are pixels, and no surface has any
  std::string provenance;         // JSON text: inputs and their hashes, options, version, what the bake reported
};

// What viewers without our extension are to show of a bake over texels: every surface glows with one picture over the
// atlas, the light that leaves it, as an emissive texture of a black material. Lamps keep their own emission.
struct ViewerLook {
  std::vector<uint8_t> png;  // sRGB, of radiance / strength
  float strength = 1;
};

// What some bakes have beside transfer.
struct BakedExtras {
  const Outgoing* outgoing = nullptr;                   // of a transfer matrix, or of its rows as lobes
  DirectionalKind directional = DirectionalKind::none;  // of a directional lightmap
  const ViewerLook* look = nullptr;
  const LatticeTransfer* lattice = nullptr;  // light in free space, for the same light as the transfer
  bool factors = false;  // `transfer` is visibility times cosine, of one row and channel; needs `outgoing`, a map
  const FixedView* view = nullptr;    // the receivers are its pixels
  std::span<const float> fit_errors;  // of zonal transfer: relative RMS of each receiver's fit
};

// What all kinds have. The light is what relighting takes.
LightBasis light_of(const Baked& baked);
size_t receivers_of(const Baked& baked);

// With a look, primitives get materials for it, two-sided ones a second primitive for their backs; the scene's own
// materials stay in the file, and loading finds them again. Errors: the disk's; more than 4 GiB, which a GLB cannot
// hold.
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const Transfer& transfer, const std::string& provenance, const BakedExtras& extras = {});
// Of the extras, the last reflection and the errors of the fit.
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const ZonalTransfer& transfer, const std::string& provenance, const BakedExtras& extras = {});
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const Visibility& visibility, const std::string& provenance);
// In place of the transfer that it was made of.
Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const CpcaTransfer& transfer, const std::string& provenance, const BakedExtras& extras = {});

// Errors: not a baked file, another version, anything that does not fit.
Result<Baked> load_baked(const std::string& path);
Result<Baked> load_baked(const MappedFile& file, const std::string& path);

// Whether the file is a glTF with our extension; false for anything else, unreadable files too.
bool is_baked(const std::string& path);

}  // namespace lambent
