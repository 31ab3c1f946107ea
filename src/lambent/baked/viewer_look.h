#pragma once
// Materials and primitives by which viewers without our extension show a baked lightmap.
#include <lambent/baked/baked_file.h>
#include <lambent/scene/gltf.h>

namespace lambent {

// For save_gltf: appends its blobs after the caller's, then edits the document. Does nothing without a look or without
// texels.
class LookWriter {
 public:
  LookWriter(const Scene& scene, const SpatialBasis& basis, const ViewerLook* look);
  void add_blobs(std::vector<GltfBlob>& blobs);
  void write(nlohmann::json& document, const GltfPlaces& places) const;

 private:
  struct Side {
    std::vector<Vec2> at;           // texture coordinates of a part's vertices, in [0, 1]
    std::vector<uint32_t> indices;  // of its triangles as seen from the back; empty on the front
  };
  size_t object_of(size_t part) const { return look_->objects.empty() ? 0 : look_->object_of_part[part]; }
  const ViewerPicture& picture(size_t object) const;
  size_t lit_material(nlohmann::json& document, const nlohmann::json& original, size_t texture, size_t set,
                      size_t object) const;
  size_t glowing_material(nlohmann::json& document, const nlohmann::json& original, size_t texture, size_t set) const;
  const Scene& scene_;
  const ViewerLook* look_;
  std::vector<Side> fronts_, backs_;  // of each part; a back without indices is none
  size_t first_blob_ = 0, pictures_ = 0;
};

}  // namespace lambent
