#pragma once
// The baked file: a glTF 2.0 that any viewer opens, in one binary (.glb) or with its data beside it (.gltf), the
// input's scene kept, with the transfer in the extension LAMBENT_transfer (docs/file-format.md; schema in
// docs/schema/).
#include <lambent/baked/fields.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>

#include <optional>

namespace lambent {

static_assert(none == no_receiver);

// A scene and what was baked for it.
struct Baked : BakedFields {
  Scene scene;
  SpatialBasis basis;  // how values between the surface's receivers interpolate over the scene; unused of a fixed view
};

// What a bake at `receivers` makes; the provenance is left empty. A fixed view's placement is given instead.
Baked make_baked(Scene scene, const Receivers& receivers, Store store, Rows rows);
Baked make_baked(Scene scene, FixedView view, Store store);

// Receivers as a placement, and back: how values between the placement's receivers interpolate over the scene.
Placement placement_of(const Scene& scene, const Receivers& receivers);
SpatialBasis spatial_basis(const Scene& scene, const Placement& where);

// The receivers of vertices by side; null where the surface's are others.
inline const VertexPlacement* vertices_of(const Baked& baked) {
  return std::get_if<VertexPlacement>(&baked.surface.where);
}
// Light in free space; null where there is none.
const Field* lattice_of(const Baked& baked);
// What the scene, as an object, hides around it, what it shines with, and how it reflects; null where that is not
// known.
const Field* hiding_of(const Baked& baked);
const Field* shining_of(const Baked& baked);
const Field* reflecting_of(const Baked& baked);

// What viewers without our extension are to show of a bake over texels. emission: every surface glows with one picture
// over the atlas, the light that leaves it, as an emissive texture of a black material; lamps keep their own emission.
// moz_lightmap: the scene's own materials with the light that arrives, in the vendor extension MOZ_lightmap.
// coordinates: no picture, the scene's own materials and TEXCOORD_1 for pictures that an engine is given apart; nodes
// with meshes get names that no other has.
enum class LookKind : uint8_t { emission, moz_lightmap, coordinates };
struct ViewerPicture {
  std::vector<uint8_t> png;  // sRGB, of radiance / strength; MOZ_lightmap's is linear, of irradiance / strength
  float strength = 1;
};
struct ViewerLook : ViewerPicture {
  LookKind kind = LookKind::emission;
  std::vector<ViewerPicture> objects = {};    // in place of the one picture: one an object (object_atlas.h)
  std::vector<uint32_t> object_of_part = {};  // into objects, where there are any
};

// A .glb, or a .gltf of any size with its data in NAME.0.bin, NAME.1.bin, ... of at most bin_limit bytes each (>=
// 65536; what glTF's own accessors and images have in one piece may be longer); all of them appear together, or none.
// With a look, primitives get materials for it, two-sided ones a second primitive for their backs; the scene's own
// materials stay in the file, and loading finds them again. Errors: the disk's; more than 4 GiB, which a .glb cannot
// hold.
inline constexpr size_t default_bin_limit = size_t{1} << 30;  // what browsers take as one array
Result<void> save_baked(const std::string& path, const Baked& baked, const ViewerLook* look = nullptr,
                        size_t bin_limit = default_bin_limit);

// The scene with a look and without the transfer, for other programs. `nodes` gets, where it is given, the names of
// each part's node and of those above it, topmost first; none of parts without vertices. Errors: as above; coordinates
// whose set the scene's materials use.
Result<void> save_look(const std::string& path, const Baked& baked, const ViewerLook& look,
                       std::vector<std::vector<std::string>>* nodes = nullptr);

// The scene comes without what an earlier bake had put into its file. Errors: as read_fields() and load_gltf().
Result<Baked> load_baked(const std::string& path);
Result<Baked> load_baked(const MappedFile& file, const std::string& path);

// What save_baked() was given to show; nullopt where the file has none.
std::optional<ViewerLook> load_look(const MappedFile& file, const std::string& path);

// A baked file and the files of its buffers, where it has any; and how many bytes they are, 0 where it is not there.
std::vector<std::string> files_of(const std::string& path);
size_t bytes_on_disk(const std::string& path);

// Whether the file is a glTF with our extension; false for anything else, unreadable files too.
bool is_baked(const std::string& path);

}  // namespace lambent
