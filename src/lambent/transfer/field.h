#pragma once
// The waist: everything that a bake makes and that relighting reads is a FIELD, along four axes, each a closed set:
//   where    Placement   vertices, texels of an atlas, patches (triangles), a lattice in free space, pixels of a
//   picture, shells about an object light    LightBasis  the columns of the store: harmonics, lobes, lamps by group
//   (transfer.h) how      Store dense, clustered, zonal lobes, factored, visibility in blocks, direct to indirect light
//   over surfels, Haar wavelets meaning  Rows what the rows of T . light are
// A stage that treats stores, placements or rows differently visits them, so that a new kind does not compile until
// each stage has said what becomes of it.
#include <lambent/core/camera.h>
#include <lambent/transfer/cpca_transfer.h>
#include <lambent/transfer/directional.h>
#include <lambent/transfer/haar_transfer.h>
#include <lambent/transfer/indirect.h>
#include <lambent/transfer/lattice.h>
#include <lambent/transfer/outgoing.h>
#include <lambent/transfer/shells.h>
#include <lambent/transfer/transfer.h>
#include <lambent/transfer/visibility.h>
#include <lambent/transfer/zonal_transfer.h>

#include <array>
#include <string>
#include <variant>
#include <vector>

namespace lambent {

// This side receives nothing.
inline constexpr uint32_t no_receiver = 0xffffffffu;

// WHERE. Vertices and triangles are the scene's, parts one after another; `back` is empty where the whole scene is
// one-sided, and no_receiver stands where a side receives nothing.
struct VertexPlacement {
  std::vector<uint32_t> front, back;  // receiver of each vertex, by side
  // Which vertex of the scene's input each one is, counted from 0; no_receiver for those that the bake made. Empty
  // where that is not known.
  std::vector<uint32_t> input = {};
  uint32_t input_count = 0;
};
struct TexelPlacement {
  int width = 0, height = 0;
  std::vector<uint32_t> texels;   // receiver of each texel of the atlas, row by row
  std::vector<Vec2> front, back;  // place of each vertex in the atlas, in texels; texel (i, j) is centred at + 1/2
};
struct PatchPlacement {
  std::vector<uint32_t> front, back;  // receiver of each triangle, by side
};
struct LatticePlacement {
  Lattice lattice;             // receivers are its points, in the order of Lattice::index
  std::vector<uint8_t> valid;  // by point; 0: it lies inside something and has its neighbours' values
};
// Receivers are the pixels of a picture, row by row from the top (fix_view() in render/render.h).
struct FixedView {
  Camera camera;  // `up` is the default
  int width = 0, height = 0;
  std::vector<float> coverage;  // [0, 1] a pixel: how much of it the scene covers
};
// Receivers are the points around an object, in the order of shell_point().
struct ShellPlacement {
  Shells shells;
};
using Placement =
    std::variant<VertexPlacement, TexelPlacement, PatchPlacement, LatticePlacement, FixedView, ShellPlacement>;

// HOW. Visibility times cosine over pi in light order + incident order - 1 bands, one row and channel; the rows are
// made of the product with the light, once a frame (relight/factors.h).
struct FactoredTransfer {
  Transfer visibility;
  int incident_order = 0;
  int light_order() const { return visibility.light.order - incident_order + 1; }
};
using Store =
    std::variant<Transfer, CpcaTransfer, ZonalTransfer, FactoredTransfer, Visibility, IndirectTransfer, HaarTransfer>;

// Of any store.
// The columns; none of visibility and of wavelets, which take light on a cube, and of direct to indirect light, which
// takes direct light at its surfels.
LightBasis light_of(const Store& store);
int cube_of(const Store& store);  // texels a side of the cube that light is taken on; 0 where it is not
size_t receivers_of(const Store& store);
size_t bytes_of(const Store& store);
int rows_of(const Store& store);     // that are stored; 0 of visibility
int rows_relit(const Store& store);  // that relighting makes of those; of visibility 1
int channels_of(const Store& store);
const char* name_of(const Store& store);  // "dense", "clusters", "lobes", "factors", "blocks", "surfels", "wavelets"

// MEANING of the rows of T . light.
struct DiffuseRows {};  // one: exit radiance of a white surface
struct DirectionalRows {
  DirectionalKind kind = DirectionalKind::none;
};
struct IncidentRows {
  int order = 0;  // harmonics, world axes, of the radiance that arrives: order^2 rows
};
struct PixelRows {};   // one: what the pixel shows
struct SightRows {};   // of visibility: nothing is summed before light, view and material are known
struct HiddenRows {};  // one: of the light over the whole sphere, what an object is in the way of
using Rows = std::variant<DiffuseRows, DirectionalRows, Outgoing, IncidentRows, PixelRows, SightRows, HiddenRows>;

// What is baked: where, how and what it means.
struct Field {
  Placement where;
  Store store;
  Rows rows;
  std::vector<float> fit_errors = {};  // where the store is a fit and they were kept: relative RMS of each receiver's
};

// Null where the rows are not those of a last reflection.
inline const Outgoing* outgoing_of(const Field& field) { return std::get_if<Outgoing>(&field.rows); }
DirectionalKind directional_of(const Field& field);

// From the scene's input back to receivers: pairs of a vertex of the input and a receiver of its front, sorted, each
// once. A vertex that was split, at a crease or a seam of its normals, has several. Empty where the input is not known.
std::vector<std::array<uint32_t, 2>> input_receivers(const VertexPlacement& where);

// Light in free space as a field.
Field lattice_field(LatticeTransfer lattice);

// Whether the three fit one another: as many receivers as the placement has, as many rows as they mean.
bool is_consistent(const Field& field);

}  // namespace lambent
