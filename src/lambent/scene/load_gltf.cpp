// glTF 2.0 specification (ISO/IEC 12113): the loader. Sections 3.7.2 (meshes, morph targets) and 3.7.3 (skins) in the
// rest pose.
#include <lambent/scene/clean.h>
#include <lambent/scene/gltf_compressed.h>
#include <lambent/scene/gltf_container.h>
#include <lambent/scene/gltf_extensions.h>
#include <lambent/scene/gltf_geometry.h>
#include <lambent/scene/gltf_instances.h>
#include <lambent/scene/gltf_materials.h>
#include <lambent/scene/gltf_read.h>
#include <lambent/scene/gltf_unbake.h>
#include <lambent/scene/load.h>

#include <map>

namespace lambent {

using Json = nlohmann::json;

namespace {

// What a file may grow to, however small it is. A mesh may be shown by many nodes, and an accessor without bytes is all
// zeros.
constexpr uint64_t max_vertices = uint64_t{1} << 28, max_triangles = uint64_t{1} << 29;
constexpr uint64_t max_zeros = uint64_t{1} << 22, max_parts = uint64_t{1} << 20;

// The document's own statements, and the shape of its top level, on which all later look-ups rely.
bool check_document(GltfCheck& check, const Json& json) {
  const Json* asset = check.object(json, "asset", {});
  std::string version = asset ? check.text(*asset, "version", {}) : "";
  std::string minimum = asset ? check.text(*asset, "minVersion", {}) : "";
  if (!check.ok()) return false;
  if (version.empty()) return check.fail({}, "not glTF: asset.version is missing");
  if (!version.starts_with("2."))
    return check.fail({}, "glTF version " + in_quotes(version) + " is not supported, only 2");
  if (!minimum.empty() && minimum != "2.0") {
    return check.fail({}, "asks for glTF " + in_quotes(minimum) + "; only 2.0 is supported");
  }
  if (const Json* required = check.array(json, "extensionsRequired", {})) {
    for (const Json& name : *required) {
      if (!name.is_string()) return check.fail({}, "extensionsRequired holds something that is not a string");
      std::string text = name.get<std::string>();
      if (!is_supported_extension(text)) {
        return check.fail({}, "needs the extension " + in_quotes(text) + ", which is not supported");
      }
    }
  }
  check.array(json, "extensionsUsed", {});
  for (const char* key : {"scenes", "nodes", "meshes", "skins", "accessors", "bufferViews", "buffers", "materials",
                          "textures", "images", "samplers", "animations", "cameras"}) {
    const Json* list = check.array(json, key, {});
    if (key == std::string_view("animations")) continue;  // each is checked when it is asked for
    for (size_t i = 0; list && i < list->size(); ++i) {
      if (!(*list)[i].is_object()) return check.fail({key, i}, "is not an object");
    }
  }
  return check.ok();
}

// Bytes that a URI names; data URIs leave the JSON. Files that are named twice are read once.
class UriReader {
 public:
  UriReader(GltfDocument& document, const std::string& folder) : document_(document), folder_(folder) {}

  Result<std::span<const uint8_t>> read(Json& item, const std::string& where) {
    std::string uri = item["uri"].get<std::string>();
    if (is_data_uri(uri)) {
      std::string type;
      auto bytes = decode_data_uri(uri, where, &type);
      if (!bytes) return bytes.error();
      item.erase("uri");
      type_ = type;
      return keep(std::move(*bytes));
    }
    type_.clear();
    auto known = files_.find(uri);
    if (known != files_.end()) return known->second;
    auto bytes = read_external_file(uri, folder_, where);
    if (!bytes) return bytes.error();
    return files_[uri] = keep(std::move(*bytes));
  }
  const std::string& media_type() const { return type_; }  // of the last data URI

 private:
  std::span<const uint8_t> keep(std::vector<uint8_t> bytes) {
    document_.owned.push_back(std::move(bytes));
    return document_.owned.back();
  }
  GltfDocument& document_;
  const std::string& folder_;
  std::map<std::string, std::span<const uint8_t>> files_;
  std::string type_;
};

bool read_buffers(GltfCheck& check, GltfDocument& document, std::span<const uint8_t> binary, UriReader& files) {
  const size_t count = gltf_count(document.json, "buffers");
  const std::vector<bool> placeholders = find_placeholders(document);
  for (size_t i = 0; i < count; ++i) {
    GltfWhere where{"buffer", i};
    Json& buffer = document.json["buffers"][i];
    uint64_t length = check.integer(buffer, "byteLength", 0, UINT64_MAX, where);
    check.text(buffer, "uri", where);
    if (!check.ok()) return false;
    std::span<const uint8_t> bytes;
    if (buffer.contains("uri")) {
      auto read = files.read(buffer, "");
      if (!read && !placeholders[i]) return check.fail(where, read.error().message);
      if (read) bytes = *read;
    } else if (i == 0 && binary.data()) {
      bytes = binary;
    } else if (!placeholders[i]) {
      return check.fail(where, "has no bytes: neither a uri nor a GLB chunk");
    }
    if (placeholders[i]) length = std::min<uint64_t>(length, bytes.size());
    if (length > bytes.size()) {
      return check.fail(
          where, "is truncated: has " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
    }
    document.buffers.push_back(bytes.first(length));
  }
  DecodeBudget budget(document);
  if (!check.ok() || !decode_meshopt_views(check, document, budget)) return false;
  // All views, read here or not: the writer moves them.
  for (size_t i = 0; i < gltf_count(document.json, "bufferViews") && check.ok(); ++i) {
    read_buffer_view(check, document, i, nullptr);
  }
  return check.ok() && decode_draco_primitives(check, document, budget);
}

// Reads images that lie in files or URIs; what fails is only told, for it may not be needed.
bool read_images(GltfCheck& check, GltfDocument& document, UriReader& files, std::vector<std::string>& problems) {
  const size_t count = gltf_count(document.json, "images");
  document.images.resize(count), problems.resize(count);
  for (size_t i = 0; i < count; ++i) {
    Json& image = document.json["images"][i];
    check.text(image, "uri", {"image", i});
    if (!check.ok()) return false;
    if (!image.contains("uri")) continue;
    auto read = files.read(image, "");
    if (!read) {
      problems[i] = read.error().message;
      continue;
    }
    document.images[i] = *read;
    if (!image.contains("mimeType") && !files.media_type().empty()) image["mimeType"] = files.media_type();
  }
  return true;
}

// Reads the primitives of all shown nodes into the scene.
class PrimitiveReader {
 public:
  // With `keep_all`, parts have all vertices of their accessors: what was baked counts them.
  PrimitiveReader(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, bool keep_all, Scene& scene)
      : check_(check),
        document_(document),
        pose_(pose),
        scene_(scene),
        users_(keep_all ? std::vector<uint32_t>() : count_users(document)) {}

  bool read_all() {
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
  const std::vector<size_t>& parts_without_normals() const { return bare_; }

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
    if (!attributes->contains("NORMAL")) bare_.push_back(scene_.parts.size());
    scene_.parts.push_back(std::move(part));
    return true;
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
  const std::vector<uint32_t> users_;
  std::vector<size_t> bare_;
  std::vector<uint32_t> places_;  // of an accessor's elements among those in use; none between parts
  uint64_t visited_ = 0, skipped_ = 0, faded_ = 0, zeros_ = 0, work_ = 0, triangles_ = 0;
};

bool read_scene(GltfCheck& check, GltfDocument& document, std::span<const uint8_t> binary, const std::string& folder,
                Scene& scene) {
  UriReader files(document, folder);
  std::vector<std::string> image_problems;
  if (!check_document(check, document.json)) return false;
  const bool was_baked = unbake(document.json);
  warn_of_unread_extensions(document.json, scene.warnings);
  drop_unread_textures(document.json, scene.warnings);
  if (!read_buffers(check, document, binary, files) || !read_images(check, document, files, image_problems)) {
    return false;
  }
  std::vector<GltfMaterial> materials = read_materials(check, document);
  GltfPose pose;
  if (!check.ok() || !expand_instances(check, document, scene.warnings) || !read_pose(check, document, pose))
    return false;
  scene.origin = document_origin(document, pose);
  if (scene.origin != Vec3d(0)) {
    pose = {.origin = scene.origin};
    if (!read_pose(check, document, pose)) return false;
  }
  if (pose.inner_roots)
    scene.warnings.push_back(std::to_string(pose.inner_roots) +
                             (pose.inner_roots == 1 ? " root of the scene is" : " roots of the scene are") +
                             " below other nodes, or named twice: shown once, where their parents put them");
  for (const GltfMaterial& m : materials) scene.materials.push_back(m.material);
  scene.texcoords.resize(texcoord_sets(materials));
  PrimitiveReader primitives(check, document, pose, was_baked, scene);
  if (!primitives.read_all()) return false;
  read_lights(document, pose, scene);
  if (scene.triangles.empty()) return check.fail({}, "no triangles");
  bool usable = false;
  for (size_t t = 0; t < scene.triangles.size() && !usable; ++t) {
    usable = area_length(area_normal(scene, scene.triangles[t])) > 0;
  }
  if (!usable) return check.fail({}, "no triangles that have an area");

  std::vector<bool> used(scene.materials.size());
  for (const Part& part : scene.parts) used[part.material] = true;
  read_textures(check, document, materials, used, image_problems, scene);
  GltfTold links;
  for (size_t i = 0; i < image_problems.size(); ++i)
    if (!image_problems[i].empty())
      links.add("image " + std::to_string(i) + ": " + image_problems[i] + "; it stays a link");
  links.tell(scene.warnings, "images");
  make_normals(scene, primitives.parts_without_normals(), true);
  repair_normals(scene);
  merge_duplicate_triangles(scene);
  return true;
}

Result<Scene> load_document(std::shared_ptr<GltfDocument> document, std::span<const uint8_t> binary,
                            const std::string& path, const std::string& folder) {
  GltfCheck check(path);
  Scene scene;
  scene.path = path;
  if (!read_scene(check, *document, binary, folder, scene)) return check.error();
  scene.document = std::move(document);
  return scene;
}

}  // namespace

Result<Scene> load_gltf(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder) {
  auto chunks = split_gltf(bytes, path);
  if (!chunks) return chunks.error();
  auto document = std::make_shared<GltfDocument>();
  document->json = std::move(chunks->json);
  std::span<const uint8_t> binary;
  if (chunks->binary.data()) {
    document->owned.emplace_back(chunks->binary.begin(), chunks->binary.end());
    binary = document->owned.back();
  }
  return load_document(std::move(document), binary, path, folder);
}

Result<Scene> load_gltf(const MappedFile& file, const std::string& path, const std::string& folder) {
  auto document = std::make_shared<GltfDocument>();
  document->mapping = file;
  auto chunks = split_gltf(file.bytes(), path);
  if (!chunks) return chunks.error();
  document->json = std::move(chunks->json);
  return load_document(std::move(document), chunks->binary, path, folder);
}

}  // namespace lambent
