// glTF 2.0 specification (ISO/IEC 12113), sections 3.7.2 (meshes, morph targets) and 3.7.3 (skins) in the rest pose.
#include <lambent/scene/gltf_primitives.h>

#include <lambent/scene/gltf_flat.h>
#include <lambent/scene/gltf_geometry.h>

#include <numeric>

namespace lambent {

using Json = nlohmann::json;

namespace {

// What a file may grow to, however small it is. A mesh may be shown by many nodes, and an accessor without bytes is all
// zeros.
constexpr uint64_t max_vertices = uint64_t{1} << 28, max_triangles = uint64_t{1} << 29;
constexpr uint64_t max_zeros = uint64_t{1} << 22, max_parts = uint64_t{1} << 20;

// Reads the primitives of all shown nodes into the scene.
class PrimitiveReader {
 public:
  // With `keep_all`, parts have all vertices of their accessors: what was baked counts them.
  PrimitiveReader(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, bool keep_all, Scene& scene)
      : check_(check),
        document_(document),
        pose_(pose),
        scene_(scene),
        keep_all_(keep_all),
        users_(keep_all ? std::vector<uint32_t>() : count_users(document)) {}

  bool read_all() {
    reserve();
    for (size_t n : pose_.shown) {
      const Json& node = gltf_item(document_.json, "nodes", n);
      auto mesh = check_.index(node, "mesh", gltf_count(document_.json, "meshes"), {"node", n});
      if (!check_.ok()) return false;
      if (!mesh) continue;
      const Json* primitives = check_.array(gltf_item(document_.json, "meshes", *mesh), "primitives", {"mesh", *mesh});
      for (size_t p = 0; primitives && p < primitives->size(); ++p) {
        if (++visited_ > max_parts)
          return check_.fail({}, "has more than " + std::to_string(max_parts) + " primitives to show");
        if (!read_primitive(n, *mesh, p, (*primitives)[p])) return false;
      }
      if (!check_.ok()) return false;
    }
    if (skipped_) {
      scene_.warnings.push_back(
          std::to_string(skipped_) +
          (skipped_ == 1 ? " primitive of points or lines is" : " primitives of points or lines are") + " not lit");
    }
    if (faded_)
      scene_.warnings.push_back("the alpha of vertex colours is not read (" + std::to_string(faded_) +
                                (faded_ == 1 ? " primitive)" : " primitives)"));
    return true;
  }

 private:
  static constexpr uint64_t triangle_list = 4, triangle_strip = 5, triangle_fan = 6;

  bool read_primitive(size_t node, size_t mesh, size_t number, const Json& primitive) {
    GltfWhere where{"mesh", mesh, "primitive", number};
    const uint64_t mode = check_.integer(primitive, "mode", triangle_list, triangle_fan + 1, where);
    const Json* attributes = check_.object(primitive, "attributes", where);
    if (!check_.ok()) return false;
    if (mode < triangle_list) return ++skipped_, true;
    if (!attributes) return check_.fail(where, "has no attributes");
    auto position_index = check_.index(*attributes, "POSITION", gltf_count(document_.json, "accessors"), where);
    if (!position_index) return check_.ok();  // to be ignored, says the specification
    GltfAccessor positions = read_accessor(check_, document_, *position_index);
    if (!check_.ok() || !check_gltf_vector(check_, positions, "POSITION", where)) return false;
    std::optional<GltfAccessor> indices;
    if (auto index = check_.index(primitive, "indices", gltf_count(document_.json, "accessors"), where)) {
      indices = read_accessor(check_, document_, *index);
      GltfType type = indices->type;
      bool fitting = type == GltfType::u8 || type == GltfType::u16 || type == GltfType::u32;
      if (check_.ok() && (indices->components != 1 || !fitting))
        check_.fail(where, "indices are not unsigned integers");
    }
    if (!check_.ok()) return false;
    const size_t corners = indices ? indices->count : positions.count;
    const size_t triangles = mode == triangle_list ? corners / 3 : corners < 3 ? 0 : corners - 2;
    if (triangles == 0) return true;

    std::vector<GltfMorph> targets;
    if (!read_morphs(check_, document_, node, mesh, primitive, positions.count, where, targets)) return false;
    if (!check_size(positions, indices, triangles, where)) return false;
    // Every attribute must be readable, so that the writer can copy it.
    for (auto attribute = attributes->begin(); attribute != attributes->end(); ++attribute) {
      read_attribute(check_, document_, *attributes, attribute.key().c_str(), positions.count, where);
    }
    if (!check_.ok()) return false;

    Part part;
    part.name = check_.text(gltf_item(document_.json, "nodes", node), "name", {"node", node});
    if (part.name.empty()) part.name = check_.text(gltf_item(document_.json, "meshes", mesh), "name", {"mesh", mesh});
    part.node = int(node), part.primitive = int(number);
    part.first_vertex = uint32_t(scene_.positions.size());
    part.first_triangle = uint32_t(scene_.triangles.size());
    auto material = check_.index(primitive, "material", gltf_count(document_.json, "materials"), where);
    if (!check_.ok()) return false;
    part.material = material ? uint32_t(*material) : default_material();
    if (!read_triangles(part, mode, indices, triangles, positions.count, where)) return false;
    const bool shared = *position_index < users_.size() && users_[*position_index] > 1;
    const GltfVertices vertices = number_vertices(part, positions.count, shared && part.triangle_count > 0);
    GltfPlacement placement;
    if (!check_vertices(vertices, targets.size(), where) ||
        !read_placement(check_, document_, pose_, node, primitive, vertices, where, placement) ||
        !read_vertices(check_, document_, *attributes, positions, vertices, targets, placement, where, scene_.positions,
                       scene_.normals) ||
        !read_texcoords(*attributes, vertices, where) ||
        !read_colors(*attributes, vertices, scene_.materials[part.material], where) ||
        !read_tangents(*attributes, vertices, placement, where)) {
      return false;
    }
    if (placement.mirrored)
      for (size_t t = part.first_triangle; t < scene_.triangles.size(); ++t)
        std::swap(scene_.triangles[t].v[1], scene_.triangles[t].v[2]);
    scene_.parts.push_back(std::move(part));
    return attributes->contains("NORMAL") ? number_inputs() : flatten(primitive, *attributes, positions.count, where);
  }

  // The last part's vertices, as they are.
  bool number_inputs() {
    const size_t first = scene_.input.size(), count = scene_.positions.size() - first;
    scene_.input.resize(scene_.positions.size());
    std::iota(scene_.input.begin() + ptrdiff_t(first), scene_.input.end(), scene_.input_count);
    scene_.input_count += uint32_t(count);
    return true;
  }

  // Gives the last part normals, and vertices that are alike in all that the writer would copy become one.
  bool flatten(const Json& primitive, const Json& attributes, size_t count, const GltfWhere& where) {
    std::vector<GltfAccessor> all;
    auto add = [&](const Json& named) {
      for (const auto& [name, value] : named.items()) {
        if (name == "NORMAL" || name == "TANGENT") continue;
        if (auto a = read_attribute(check_, document_, named, name.c_str(), count, where)) all.push_back(std::move(*a));
      }
    };
    if (!keep_all_) {
      add(attributes);
      if (const Json* targets = check_.array(primitive, "targets", where))
        for (const Json& target : *targets) add(target);
    }
    const size_t first = scene_.input.size(), left = flatten_last_part(scene_, all);
    for (size_t v = first; v < scene_.input.size(); ++v) scene_.input[v] += scene_.input_count;
    scene_.input_count += uint32_t(left);
    return check_.ok();
  }

  // Memory for what is to come, as far as the file's bytes stand for it, since arrays that double take thrice as much.
  void reserve() {
    struct Size {
      uint64_t vertices = 0, triangles = 0;
      std::vector<bool> sets;
      bool colors = false, tangents = false, known = false;
    };
    std::vector<Size> meshes(gltf_count(document_.json, "meshes"));
    Size all;
    all.sets.resize(scene_.texcoords.size());
    for (size_t n : pose_.shown) {
      GltfCheck trial("");
      const auto mesh = trial.index(gltf_item(document_.json, "nodes", n), "mesh", meshes.size(), {});
      if (!mesh) continue;
      Size& size = meshes[*mesh];
      const Json* primitives = size.known ? nullptr
                                          : trial.array(gltf_item(document_.json, "meshes", *mesh), "primitives", {});
      size.known = true;
      for (size_t p = 0; primitives && p < primitives->size(); ++p) {
        const Json& primitive = (*primitives)[p];
        GltfCheck one("");
        const Json* attributes = one.object(primitive, "attributes", {});
        const auto place = attributes ? one.index(*attributes, "POSITION", gltf_count(document_.json, "accessors"), {})
                                      : std::nullopt;
        if (!place) continue;
        const GltfAccessor positions = read_accessor(one, document_, *place);
        const auto index = one.index(primitive, "indices", gltf_count(document_.json, "accessors"), {});
        const size_t corners = index ? read_accessor(one, document_, *index).count : positions.count;
        if (!one.ok() || positions.data.empty()) continue;
        size.triangles += one.integer(primitive, "mode", triangle_list, triangle_fan + 1, {}) == triangle_list
                            ? corners / 3
                            : corners;
        size.vertices += std::min(positions.count, corners);
        for (size_t set = 0; set < all.sets.size(); ++set)
          if (attributes->contains("TEXCOORD_" + std::to_string(set))) all.sets[set] = true;
        all.colors = all.colors || attributes->contains("COLOR_0");
        all.tangents = all.tangents || attributes->contains("TANGENT");
      }
      all.vertices += size.vertices, all.triangles += size.triangles;
    }
    if (all.vertices > max_vertices || all.triangles > max_triangles) return;  // an error will say so
    scene_.positions.reserve(all.vertices), scene_.normals.reserve(all.vertices), scene_.input.reserve(all.vertices);
    scene_.triangles.reserve(all.triangles);
    for (size_t set = 0; set < all.sets.size(); ++set)
      if (all.sets[set]) scene_.texcoords[set].reserve(all.vertices);
    if (all.colors) scene_.colors.reserve(all.vertices);
    if (all.tangents) scene_.tangents.reserve(all.vertices);
  }

  bool check_size(const GltfAccessor& positions, const std::optional<GltfAccessor>& indices, size_t triangles,
                  const GltfWhere& where) {
    if (positions.data.empty()) zeros_ += positions.count;
    if (indices && indices->data.empty()) zeros_ += indices->count;
    if (zeros_ > max_zeros) return check_.fail(where, "too many vertices or indices have no bytes in a buffer");
    triangles_ += triangles;
    return triangles_ <= max_triangles || too_large(where);
  }

  // A vertex costs its place and the time of its morph targets.
  bool check_vertices(const GltfVertices& vertices, size_t targets, const GltfWhere& where) {
    work_ += uint64_t(vertices.size()) * (1 + targets);
    return work_ <= max_vertices || too_large(where);
  }

  bool too_large(const GltfWhere& where) {
    return check_.fail(where, "the scene expands to more than " + std::to_string(max_vertices) + " vertices or " +
                                  std::to_string(max_triangles) + " triangles");
  }

  // The sets that materials read, and the first two.
  bool read_texcoords(const Json& attributes, const GltfVertices& vertices, const GltfWhere& where) {
    const size_t count = vertices.size(), first = scene_.positions.size() - count;
    for (size_t set = 0; set < scene_.texcoords.size(); ++set) {
      std::vector<Vec2>& texcoords = scene_.texcoords[set];
      std::string name = "TEXCOORD_" + std::to_string(set);
      auto a = read_attribute(check_, document_, attributes, name.c_str(), vertices.count, where);
      if (!check_.ok()) return false;
      if (a && (a->components != 2 || a->type == GltfType::u32)) {
        return check_.fail(where, name + " is not two floats or small integers");
      }
      if (!a && texcoords.empty()) continue;
      texcoords.resize(first + count);
      for (size_t i = 0; a && i < count; ++i) {
        double uv[2] = {};
        a->read(vertices[i], uv);
        if (std::isfinite(uv[0]) && std::isfinite(uv[1])) texcoords[first + i] = Vec2(float(uv[0]), float(uv[1]));
      }
    }
    return true;
  }

  bool read_colors(const Json& attributes, const GltfVertices& vertices, const Material& material,
                   const GltfWhere& where) {
    const size_t count = vertices.size(), first = scene_.positions.size() - count;
    auto a = read_attribute(check_, document_, attributes, "COLOR_0", vertices.count, where);
    if (!check_.ok()) return false;
    if (a) {
      a->normalized = true;  // the only kind of integers that colours may be
      bool fitting = a->type == GltfType::f32 || a->type == GltfType::u8 || a->type == GltfType::u16;
      if (a->is_matrix || a->components < 3 || !fitting) {
        return check_.fail(where, "COLOR_0 is not three or four colour components");
      }
    }
    if (a && a->components == 4 && material.alpha_mode != AlphaMode::opaque)
      for (size_t i = 0; i < count; ++i) {
        double rgba[4] = {};
        a->read(vertices[i], rgba);
        if (rgba[3] >= 1) continue;
        ++faded_;
        break;
      }
    if (!a && scene_.colors.empty()) return true;
    scene_.colors.resize(first + count, Vec3(1.0f));
    for (size_t i = 0; a && i < count; ++i) {
      Vec3 color(a->read3(vertices[i]));
      if (is_finite(color)) scene_.colors[first + i] = max(color, Vec3(0.0f));
    }
    return true;
  }

  bool read_tangents(const Json& attributes, const GltfVertices& vertices, const GltfPlacement& placement,
                     const GltfWhere& where) {
    auto a = read_attribute(check_, document_, attributes, "TANGENT", vertices.count, where);
    if (!check_.ok()) return false;
    if (a && (a->components != 4 || a->is_matrix || a->type == GltfType::u32))
      return check_.fail(where, "TANGENT is not four floats or small integers");
    if (!attributes.contains("NORMAL")) a.reset();  // void without
    if (!a && scene_.tangents.empty()) return true;
    const size_t count = vertices.size(), first = scene_.positions.size() - count;
    scene_.tangents.resize(first + count, Vec4(0.0f));
    for (size_t i = 0; a && i < count; ++i) {
      double t[4] = {};
      a->read(vertices[i], t);
      const Mat3d world(placement.joints ? placement.at(vertices[i]) : placement.world);
      const Vec3 along = normalize_or(Vec3(world * Vec3d(t[0], t[1], t[2])), Vec3(0.0f));
      if (along == Vec3(0) || !(std::abs(t[3]) > 0)) continue;
      scene_.tangents[first + i] = Vec4(along, (t[3] > 0) == (determinant(world) > 0) ? 1.0f : -1.0f);
    }
    return true;
  }

  // Their vertices are the accessor's for now.
  bool read_triangles(Part& part, uint64_t mode, const std::optional<GltfAccessor>& indices, size_t count,
                      size_t vertex_count, const GltfWhere& where) {
    const bool two_sided = scene_.materials[part.material].double_sided;
    const uint32_t part_number = uint32_t(scene_.parts.size());
    for (size_t t = 0; t < count; ++t) {
      size_t corner[3] = {3 * t, 3 * t + 1, 3 * t + 2};
      if (mode == triangle_strip) corner[0] = t, corner[1] = t + 1 + t % 2, corner[2] = t + 2 - t % 2;
      if (mode == triangle_fan) corner[0] = t + 1, corner[1] = t + 2, corner[2] = 0;
      uint32_t v[3];
      for (int k = 0; k < 3; ++k) {
        v[k] = indices ? indices->integer(corner[k]) : uint32_t(corner[k]);
        if (v[k] >= vertex_count) {
          return check_.fail(where, "index " + std::to_string(corner[k]) + " is " + std::to_string(v[k]) +
                                        ", but there are " + std::to_string(vertex_count) + " vertices");
        }
      }
      if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;  // that is how strips begin anew elsewhere
      scene_.triangles.push_back({{v[0], v[1], v[2]}, part_number, two_sided});
    }
    part.triangle_count = uint32_t(scene_.triangles.size()) - part.first_triangle;
    return true;
  }

  // How many primitives have their places in each accessor.
  static std::vector<uint32_t> count_users(const GltfDocument& document) {
    std::vector<uint32_t> users(gltf_count(document.json, "accessors"));
    for (size_t m = 0; m < gltf_count(document.json, "meshes"); ++m) {
      GltfCheck check("");
      const Json* primitives = check.array(gltf_item(document.json, "meshes", m), "primitives", {});
      for (size_t p = 0; primitives && p < primitives->size(); ++p) {
        GltfCheck trial("");
        const Json* attributes = trial.object((*primitives)[p], "attributes", {});
        const auto index = attributes ? trial.index(*attributes, "POSITION", users.size(), {}) : std::nullopt;
        if (index) ++users[*index];
      }
    }
    return users;
  }

  // Gives the part the vertices of an accessor: all, or, where primitives share a large one, those that its triangles
  // use, in their order.
  GltfVertices number_vertices(Part& part, size_t count, bool only_used) {
    const std::span<Triangle> triangles = std::span(scene_.triangles).subspan(part.first_triangle);
    std::vector<uint32_t>& used = part.source;
    if (only_used) {
      if (places_.size() < count) places_.resize(count, none);
      for (const Triangle& t : triangles)
        for (uint32_t v : t.v)
          if (places_[v] == none) places_[v] = 0, used.push_back(v);
      std::sort(used.begin(), used.end());
      for (size_t i = 0; i < used.size(); ++i) places_[used[i]] = uint32_t(i);
      for (Triangle& t : triangles)
        for (uint32_t& v : t.v) v = places_[v];
      for (uint32_t v : used) places_[v] = none;
      part.changed = used.size() < count;
      if (!part.changed) used = {};
    }
    for (Triangle& t : triangles)
      for (uint32_t& v : t.v) v += part.first_vertex;
    const GltfVertices vertices{count, used};
    part.vertex_count = uint32_t(vertices.size());
    return vertices;
  }

  // What primitives without a material have, after all of the document's.
  uint32_t default_material() {
    const size_t count = gltf_count(document_.json, "materials");
    if (scene_.materials.size() == count) {
      Material material;
      material.name = "default", material.double_sided = false;
      scene_.materials.push_back(material);
    }
    return uint32_t(count);
  }

  GltfCheck& check_;
  const GltfDocument& document_;
  const GltfPose& pose_;
  Scene& scene_;
  const bool keep_all_;
  const std::vector<uint32_t> users_;
  std::vector<uint32_t> places_;  // of an accessor's elements among those in use; none between parts
  uint64_t visited_ = 0, skipped_ = 0, faded_ = 0, zeros_ = 0, work_ = 0, triangles_ = 0;
};

}  // namespace

bool read_primitives(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, bool keep_all,
                     Scene& scene) {
  return PrimitiveReader(check, document, pose, keep_all, scene).read_all();
}

}  // namespace lambent
