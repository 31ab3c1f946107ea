#pragma once
// Reading glTF JSON and accessors that nobody has checked; shared by the loader and the writer.
#include <lambent/scene/gltf.h>

#include <optional>

namespace lambent {

// A place in a document for messages: {"mesh", 2, "primitive", 1}.
struct GltfWhere {
  const char* kind = nullptr;
  size_t index = 0;
  const char* inner_kind = nullptr;
  size_t inner_index = 0;
};

// Reads members of JSON objects with their types and ranges checked. The first thing that is wrong is kept as the
// error; reads that fail give the fallback, so that a caller may read a whole object and look at ok() once.
class GltfCheck {
 public:
  using Json = nlohmann::json;
  explicit GltfCheck(std::string path) : path_(std::move(path)) {}

  bool ok() const { return !error_; }
  const Error& error() const { return *error_; }
  bool fail(const GltfWhere& where, const std::string& message);  // returns false

  // Null where absent. `parent` itself must be an object.
  const Json* object(const Json& parent, const char* key, const GltfWhere& where);
  const Json* array(const Json& parent, const char* key, const GltfWhere& where);

  // Integers in [0, limit). index() is nullopt where absent.
  uint64_t integer(const Json& parent, const char* key, uint64_t fallback, uint64_t limit, const GltfWhere& where);
  std::optional<size_t> index(const Json& parent, const char* key, size_t limit, const GltfWhere& where);
  std::optional<uint64_t> integer(const Json& value, const char* name, uint64_t limit, const GltfWhere& where);

  double number(const Json& parent, const char* key, double fallback, const GltfWhere& where);
  bool boolean(const Json& parent, const char* key, bool fallback, const GltfWhere& where);
  std::string text(const Json& parent, const char* key, const GltfWhere& where);  // "" where absent
  // Fills `values` from an array of exactly that many numbers; false, and untouched, where absent or wrong.
  bool numbers(const Json& parent, const char* key, std::span<double> values, const GltfWhere& where);

 private:
  const Json* member(const Json& parent, const char* key, const GltfWhere& where);
  std::string path_;
  std::optional<Error> error_;
};

// Warnings of one kind, told in one line: the first, and how many more there were of what `many` names.
class GltfTold {
 public:
  void add(std::string text) {
    if (count_++ == 0) first_ = std::move(text);
  }
  void tell(std::vector<std::string>& warnings, const char* many) const {
    if (count_ == 0) return;
    warnings.push_back(first_ + (count_ > 1 ? " (and " + std::to_string(count_ - 1) + " more " + many + ")" : ""));
  }

 private:
  std::string first_;
  size_t count_ = 0;
};

// The elements of a top-level array: 0 where absent.
size_t gltf_count(const nlohmann::json& document, const char* key);
// One of them; the loader has made sure that it is an object.
const nlohmann::json& gltf_item(const nlohmann::json& document, const char* key, size_t index);

// The member at the end of a path of keys in JSON that nobody has checked; null where there is none.
nlohmann::json* gltf_member(nlohmann::json& value, std::initializer_list<const char*> path);

// Component types, by their OpenGL numbers.
enum class GltfType { none = 0, i8 = 5120, u8 = 5121, i16 = 5122, u16 = 5123, u32 = 5125, f32 = 5126 };
size_t component_size(GltfType type);

// Typed access to part of a buffer, checked as a whole so that elements need no further check.
struct GltfAccessor {
  std::span<const uint8_t> data;  // from the first element on; empty when all elements are zero
  size_t count = 0, stride = 0, element_size = 0;
  GltfType type = GltfType::none;
  const char* shape = "";  // "SCALAR", "VEC2", ...
  int components = 0;      // 1 SCALAR, 2 to 4 VECn, 4, 9, 16 MATn
  bool is_matrix = false, normalized = false;
  // Elements that differ: strictly increasing indices, and the values in their order.
  std::span<const uint8_t> sparse_indices, sparse_values;
  size_t sparse_count = 0;
  GltfType sparse_type = GltfType::none;

  const uint8_t* element(size_t i) const;            // raw bytes; null for zeros
  void read(size_t i, std::span<double> out) const;  // as numbers, normalised integers scaled; as many as fit `out`
  Vec3d read3(size_t i) const;
  uint32_t integer(size_t i) const;                       // of a scalar of unsigned type
  double component(const uint8_t* element, int c) const;  // as stored, not scaled
};

// Bytes of a buffer view. Failure gives an empty span.
std::span<const uint8_t> read_buffer_view(GltfCheck& check, const GltfDocument& document, size_t index, size_t* stride);
GltfAccessor read_accessor(GltfCheck& check, const GltfDocument& document, size_t index);
// The accessor that member `key` names, of `count` elements; nullopt where absent or wrong.
std::optional<GltfAccessor> read_attribute(GltfCheck& check, const GltfDocument& document, const nlohmann::json& parent,
                                           const char* key, size_t count, const GltfWhere& where);

// Where nodes stand in the rest pose, and what of them is shown.
struct GltfPose {
  Vec3d origin{0.0};          // taken off every place below; set before reading (Scene::origin)
  std::vector<Mat4d> world;   // of each node
  std::vector<size_t> shown;  // nodes of the default scene (or all, where there is none), depth first,
                              // less those that KHR_node_visibility hides with all below them
  size_t inner_roots = 0;     // roots of the scene that have a parent, which moves them, or stand there twice
  std::vector<std::vector<Mat4d>> joints;  // of each skin that a shown mesh uses: joint to world times inverse bind
};
bool read_pose(GltfCheck& check, const GltfDocument& document, GltfPose& pose);

// What Scene::origin is for a document, from a pose about 0 and the bounds that its accessors state: where its meshes
// stand far from 0, the place of the first one if they are near it, else far_origin of all.
Vec3d document_origin(const GltfDocument& document, const GltfPose& pose);

// Lamps of shown nodes, KHR_lights_punctual, into scene.lights. Cones that are not 0 <= inner < outer <= pi/2 are
// clamped, lamps that cannot be read are left out; warnings say so.
void read_lights(const GltfDocument& document, const GltfPose& pose, Scene& scene);

// Takes vertices of one primitive of one node to the world: by the node's transform, or by the joints alone where it is
// skinned.
struct GltfPlacement {
  Mat4d world{1.0};
  bool mirrored = false;                       // triangles change their winding
  const std::vector<Mat4d>* joints = nullptr;  // null: not skinned
  std::vector<GltfAccessor> joint_sets, weight_sets;
  Mat4d at(size_t vertex) const;
};
// Which of an accessor's elements a primitive uses: the first `count`, or, where there is one, those of a list.
struct GltfVertices {
  size_t count = 0;
  std::span<const uint32_t> list;
  size_t size() const { return list.empty() ? count : list.size(); }
  size_t operator[](size_t i) const { return list.empty() ? i : list[i]; }
};
// Of accessors of `vertices.count` elements; weights are checked of the vertices in use.
bool read_placement(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, size_t node,
                    const nlohmann::json& primitive, const GltfVertices& vertices, const GltfWhere& where,
                    GltfPlacement& placement);

// The inverse transpose of the upper 3 x 3 part up to a positive factor; finite for singular matrices too.
Mat3d normal_matrix(const Mat4d& m);

}  // namespace lambent
