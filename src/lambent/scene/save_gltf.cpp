// glTF 2.0 specification (ISO/IEC 12113): the writer. KHR_texture_transform, KHR_materials_emissive_strength.
#include <lambent/core/check.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/gltf_materials.h>
#include <lambent/scene/gltf_write.h>
#include <lambent/scene/material_writer.h>
#include <lambent/scene/textures.h>

#include <map>
#include <numeric>

namespace lambent {

using Json = nlohmann::json;

namespace {

// A member of JSON that nobody may have checked; nullopt where it is no integer in [0, limit).
std::optional<size_t> whole_number(const Json& parent, const char* key, size_t limit) {
  GltfCheck check("");
  return parent.is_object() ? check.index(parent, key, limit, {}) : std::nullopt;
}

// Takes a unit normal of the world back into the frame that `m` leads out of.
Vec3 local_normal(const Mat4d& m, Vec3 world) {
  Vec3d n = transpose(Mat3d(m)) * Vec3d(world);
  double length = lambent::length(n);
  return length > 0 && std::isfinite(length) ? Vec3(n / length) : world;
}

std::span<const float> floats(const std::vector<Vec3>& v) { return {v.empty() ? nullptr : &v[0].x, v.size() * 3}; }
std::span<const float> floats(const std::vector<Vec4>& v) { return {v.empty() ? nullptr : &v[0].x, v.size() * 4}; }
std::span<const float> floats(const std::vector<Vec2>& v) { return {v.empty() ? nullptr : &v[0].x, v.size() * 2}; }

size_t add_triangles(GltfWriter& out, const Scene& scene, const Part& part, bool mirrored) {
  std::vector<uint32_t> indices;
  indices.reserve(size_t(part.triangle_count) * 3);
  for (size_t t = 0; t < part.triangle_count; ++t) {
    const uint32_t* v = scene.triangles[part.first_triangle + t].v;
    for (int k : {0, mirrored ? 2 : 1, mirrored ? 1 : 2}) indices.push_back(v[k] - part.first_vertex);
  }
  if (indices.empty()) indices.assign(3, 0);  // accessors may not be empty; a point is drawn by nobody
  return out.add_indices(indices);
}

// Replaces the geometry of `primitive` by the part's as it stands in the world, in the frame that `frame` leads out of.
// Attributes are written where they say something, or where the primitive had them before.
void write_geometry(GltfWriter& out, const Scene& scene, const Part& part, const Mat4d& frame, Json& primitive) {
  const Json before = primitive.contains("attributes") ? primitive["attributes"] : Json::object();
  const Mat4d inverse = inverse_affine(frame);
  const bool is_identity = frame == Mat4d(1.0);
  const size_t first = part.first_vertex, count = part.vertex_count;
  std::vector<Vec3> positions(scene.positions.begin() + first, scene.positions.begin() + first + count);
  std::vector<Vec3> normals(scene.normals.begin() + first, scene.normals.begin() + first + count);
  if (!is_identity) {
    for (Vec3& p : positions) p = Vec3(Vec3d(inverse * Vec4d(p, 1)));
    for (Vec3& n : normals) n = local_normal(frame, n);
  }
  Json attributes = {{"POSITION", out.add_vectors(floats(positions), 3, true)},
                     {"NORMAL", out.add_vectors(floats(normals), 3, false)}};
  for (size_t set = 0; set < scene.texcoords.size(); ++set) {
    if (scene.texcoords[set].empty()) continue;
    const std::vector<Vec2> uv(scene.texcoords[set].begin() + first, scene.texcoords[set].begin() + first + count);
    const std::string name = "TEXCOORD_" + std::to_string(set);
    bool says = std::any_of(uv.begin(), uv.end(), [](Vec2 t) { return t != Vec2(0.0f); });
    if (says || before.contains(name)) attributes[name] = out.add_vectors(floats(uv), 2, false);
  }
  if (!scene.colors.empty()) {
    const std::vector<Vec3> colors(scene.colors.begin() + first, scene.colors.begin() + first + count);
    bool says = std::any_of(colors.begin(), colors.end(), [](Vec3 c) { return c != Vec3(1.0f); });
    if (says || before.contains("COLOR_0")) attributes["COLOR_0"] = out.add_vectors(floats(colors), 3, false);
  }
  const bool mirrored = determinant(Mat3d(frame)) < 0;
  if (!scene.tangents.empty()) {
    std::vector<Vec4> tangents(scene.tangents.begin() + first, scene.tangents.begin() + first + count);
    for (Vec4& t : tangents) {
      const Vec3d local = Mat3d(inverse) * Vec3d(t);
      const double length = lambent::length(local);
      t = Vec4(length > 0 && std::isfinite(length) ? Vec3(local / length) : Vec3(0), mirrored ? -t.w : t.w);
    }
    // A tangent that is missing may not be written: then viewers make all of them.
    bool says = std::all_of(tangents.begin(), tangents.end(), [](Vec4 t) { return Vec3(t) != Vec3(0) && t.w != 0; });
    if (says) attributes["TANGENT"] = out.add_vectors(floats(tangents), 4, false);
  }
  primitive["attributes"] = std::move(attributes);
  primitive["indices"] = add_triangles(out, scene, part, mirrored);
  primitive.erase("mode");
}

// A node that takes the scene's space to the file's.
Json placed_node(const Scene& scene) {
  Json node = Json::object();
  if (Vec3d o = scene.origin; o != Vec3d(0)) node["translation"] = {o.x, o.y, o.z};
  return node;
}

// Adds a node to the default scene, or, where there are no scenes, to the nodes, all of which then are shown.
size_t add_root(GltfWriter& out, Json node) {
  size_t number = out.push("nodes", std::move(node));
  if (!out.json.contains("scenes") || out.json["scenes"].empty()) return number;
  size_t scene = out.json.contains("scene") ? out.json["scene"].get<size_t>() : 0;
  Json& roots = out.json["scenes"][scene]["nodes"];
  if (!roots.is_array()) roots = Json::array();
  roots.push_back(number);
  return number;
}

// The document part of the output: rewrites what changed in a copy of the document.
class DocumentWriter {
 public:
  DocumentWriter(GltfWriter& out, const Scene& scene, GltfPlaces& places)
      : out_(out), scene_(scene), document_(*scene.document), places_(places), pose_{.origin = scene.origin} {}

  void embed_buffers() {
    std::vector<size_t> starts;
    for (std::span<const uint8_t> buffer : document_.buffers) starts.push_back(out_.append(buffer, buffer_alignment));
    if (!out_.json.contains("bufferViews")) return;
    for (Json& view : out_.list("bufferViews")) {
      auto buffer = whole_number(view, "buffer", starts.size());
      if (!buffer) continue;
      size_t offset = whole_number(view, "byteOffset", SIZE_MAX / 2).value_or(0);
      view["buffer"] = 0, view["byteOffset"] = starts[*buffer] + offset;
    }
  }

  void embed_images() {
    std::map<std::pair<const uint8_t*, size_t>, size_t> views;
    for (size_t i = 0; i < document_.images.size(); ++i) {
      std::span<const uint8_t> bytes = document_.images[i];
      if (bytes.empty()) continue;
      Json& image = out_.json["images"][i];
      std::string type = image_mime_type(bytes);
      auto told = image.find("mimeType");
      if (type.empty() && told != image.end() && told->is_string()) type = told->get<std::string>();
      if (type.empty())
        type = "image/" +
               file_extension(image.contains("uri") && image["uri"].is_string() ? image["uri"].get<std::string>() : "");
      auto [view, is_new] = views.try_emplace({bytes.data(), bytes.size()}, 0);
      if (is_new) view->second = out_.add_view(bytes, 4);
      image.erase("uri");
      image["mimeType"] = type, image["bufferView"] = view->second;
    }
  }

  void rewrite_changed_parts() {
    std::map<int, std::vector<size_t>> nodes;
    bool any = false;
    for (size_t p = 0; p < scene_.parts.size(); ++p) {
      const Part& part = scene_.parts[p];
      if (part.node < 0) continue;
      nodes[part.node].push_back(p);
      any = any || part.changed;
    }
    if (!any) return;
    GltfCheck check("");
    LAMBENT_CHECK(read_pose(check, document_, pose_));
    users_.assign(gltf_count(document_.json, "meshes"), 0);
    for (size_t n = 0; n < gltf_count(document_.json, "nodes"); ++n) {
      if (auto mesh = mesh_of(n)) ++users_[*mesh];
    }
    std::erase_if(nodes, [&](const auto& entry) {
      return std::none_of(entry.second.begin(), entry.second.end(), [&](size_t p) { return scene_.parts[p].changed; });
    });
    for (const auto& [node, parts] : nodes) --users_[*mesh_of(size_t(node))];
    for (const auto& [node, parts] : nodes) rewrite_node(size_t(node), parts);
  }

 private:
  static constexpr size_t buffer_alignment = 64;

  std::optional<size_t> mesh_of(size_t node) const {
    return whole_number(gltf_item(document_.json, "nodes", node), "mesh", gltf_count(document_.json, "meshes"));
  }

  void rewrite_node(size_t node, const std::vector<size_t>& parts) {
    const std::optional<size_t> mesh_index = mesh_of(node);
    LAMBENT_CHECK(mesh_index);
    Json mesh = gltf_item(document_.json, "meshes", *mesh_index);
    const bool new_vertices = std::any_of(parts.begin(), parts.end(), [&](size_t p) {
      return scene_.parts[p].changed && scene_.parts[p].source.empty();
    });
    const bool skinned = gltf_item(document_.json, "nodes", node).contains("skin");
    const bool morphs = std::any_of(mesh["primitives"].begin(), mesh["primitives"].end(),
                                    [](const Json& p) { return p.contains("targets") && !p["targets"].empty(); });
    // Vertices that are not the document's have no joints or morph targets to move by: the whole node gets its rest
    // pose.
    const Mat4d& world = pose_.world[node];
    const double determinant = lambent::determinant(Mat3d(world));
    const bool singular = determinant == 0 || !std::isfinite(1 / determinant);
    const bool still = new_vertices && (skinned || morphs || singular);
    const bool apart = new_vertices && (skinned || singular);  // then it stands in the world, on a node of its own
    for (size_t p : parts) {
      const Part& part = scene_.parts[p];
      if (!part.changed && !still) continue;
      Json& primitive = mesh["primitives"][size_t(part.primitive)];
      if (still || part.source.empty()) {
        write_geometry(out_, scene_, part, apart ? Mat4d(1.0) : world, primitive);
      } else {
        copy_geometry(node, part, primitive);
      }
    }
    if (still && morphs) {
      for (Json& primitive : mesh["primitives"]) primitive.erase("targets");
      mesh.erase("weights");
      drop_weight_animations(node);
    }
    place_mesh(node, *mesh_index, std::move(mesh), apart, still, parts);
  }

  void place_mesh(size_t node, size_t mesh_index, Json mesh, bool apart, bool still, const std::vector<size_t>& parts) {
    // Copies of one mesh that were changed alike stay copies of one.
    const auto [known, is_new] = written_.try_emplace({mesh_index, mesh.dump()}, mesh_index);
    if (!is_new) {
      mesh_index = known->second;
    } else if (users_[mesh_index]++ == 0) {
      out_.list("meshes")[mesh_index] = std::move(mesh);
    } else {
      mesh_index = known->second = out_.push("meshes", std::move(mesh));
    }
    Json& json = out_.list("nodes")[node];
    if (still) json.erase("weights");
    if (!apart) {
      json["mesh"] = mesh_index;
      return;
    }
    Json fresh = placed_node(scene_);
    fresh["mesh"] = mesh_index;
    if (json.contains("name")) fresh["name"] = json["name"];
    json.erase("mesh"), json.erase("skin");
    int number = int(add_root(out_, std::move(fresh)));
    for (size_t p : parts) places_.part_nodes[p] = number;
  }

  // Replaces the geometry of `primitive` by copies of its own vertices, element by element; only normals may be new.
  void copy_geometry(size_t node, const Part& part, Json& primitive) {
    LAMBENT_CHECK(part.source.size() == part.vertex_count);
    GltfCheck check("");
    const Json before = primitive["attributes"];
    auto accessor = [&](const Json& holder, const std::string& key) {
      return read_accessor(check, document_, holder[key].get<size_t>());
    };
    const size_t old_count = accessor(before, "POSITION").count;
    for (uint32_t s : part.source) LAMBENT_CHECK(s < old_count);
    GltfPlacement placement;
    LAMBENT_CHECK(
        read_placement(check, document_, pose_, node, primitive, GltfVertices{old_count, part.source}, {}, placement));
    const bool had_normals = before.contains("NORMAL");
    // Where the document has no normals, what it says about tangents is void too.
    auto is_void = [&](const std::string& name) { return !had_normals && (name == "NORMAL" || name == "TANGENT"); };

    const GltfAccessor old_normals = had_normals ? accessor(before, "NORMAL") : GltfAccessor{};
    Json attributes = {{"NORMAL", copy_normals(part, placement, old_normals)}};
    for (auto item = before.begin(); item != before.end(); ++item) {
      if (item.key() == "NORMAL" || is_void(item.key())) continue;
      attributes[item.key()] = out_.add_copy(accessor(before, item.key()), part.source, item.key() == "POSITION");
    }
    if (primitive.contains("targets")) {
      for (Json& target : primitive["targets"]) {
        Json copies = Json::object();
        for (auto item = target.begin(); item != target.end(); ++item) {
          if (is_void(item.key())) continue;
          copies[item.key()] = out_.add_copy(accessor(target, item.key()), part.source, item.key() == "POSITION");
        }
        target = std::move(copies);
      }
    }
    LAMBENT_CHECK(check.ok());
    primitive["attributes"] = std::move(attributes);
    primitive["indices"] = add_triangles(out_, scene_, part, placement.mirrored);
    primitive.erase("mode");
  }

  // The document's normals where it has usable ones, else the scene's brought back to the part's own frame.
  size_t copy_normals(const Part& part, const GltfPlacement& placement, const GltfAccessor& before) {
    std::vector<Vec3> normals(part.vertex_count);
    for (size_t i = 0; i < normals.size(); ++i) {
      normals[i] = before.count ? Vec3(before.read3(part.source[i])) : Vec3(0.0f);
      if (!(dot(normals[i], normals[i]) > 0) || !is_finite(normals[i])) {
        normals[i] = local_normal(placement.at(part.source[i]), scene_.normals[part.first_vertex + i]);
      }
    }
    return out_.add_vectors(floats(normals), 3, false);
  }

  // Animations may not move weights of a node that has no morph targets.
  void drop_weight_animations(size_t node) {
    if (!out_.json.contains("animations")) return;
    Json kept = Json::array();
    for (Json& animation : out_.list("animations")) {
      if (animation.contains("channels") && animation["channels"].is_array()) {
        Json channels = Json::array();
        for (const Json& channel : animation["channels"]) {
          const Json target = channel.is_object() ? channel.value("target", Json()) : Json();
          bool drops = target.is_object() && target.value("node", Json()) == node &&
                       target.value("path", Json()) == "weights";
          if (!drops) channels.push_back(channel);
        }
        animation["channels"] = channels;
        if (channels.empty()) continue;
      }
      kept.push_back(animation);
    }
    if (kept.empty()) {
      out_.json.erase("animations");
    } else {
      out_.json["animations"] = std::move(kept);
    }
  }

  GltfWriter& out_;
  const Scene& scene_;
  const GltfDocument& document_;
  GltfPlaces& places_;
  GltfPose pose_;
  std::vector<size_t> users_;                                 // nodes that still show each mesh of the document
  std::map<std::pair<size_t, std::string>, size_t> written_;  // meshes written anew, by what they were and their JSON
};

}  // namespace

Result<void> save_gltf(const std::string& path, const Scene& scene, std::span<const GltfBlob> blobs,
                       const std::function<void(Json& document, const GltfPlaces& places)>& extend, size_t bin_limit) {
  GltfWriter out;
  GltfPlaces places;
  for (const Part& part : scene.parts) {
    LAMBENT_CHECK(part.node < 0 || scene.document);
    places.part_nodes.push_back(part.node), places.part_primitives.push_back(part.primitive);
  }
  size_t document_materials = 0;
  if (scene.document) {
    out.json = scene.document->json;
    document_materials = gltf_count(out.json, "materials");
    DocumentWriter document(out, scene, places);
    document.embed_buffers();
    document.embed_images();
    document.rewrite_changed_parts();
  } else {
    out.json["asset"] = {{"version", "2.0"}, {"generator", "lambent"}};
    out.json["scene"] = 0;
    out.push("scenes", {{"nodes", Json::array()}});
  }

  MaterialWriter materials(out, scene, path);
  if (scene.document) materials.update_document();
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    const Part& part = scene.parts[p];
    if (part.node >= 0 || part.vertex_count == 0) continue;
    Json primitive = Json::object();
    write_geometry(out, scene, part, Mat4d(1.0), primitive);
    if (part.material < document_materials) {
      primitive["material"] = part.material;
    } else {
      auto first = scene.triangles.begin() + part.first_triangle;
      bool two_sided = std::any_of(first, first + part.triangle_count, [](const Triangle& t) { return t.two_sided; });
      auto material = materials.add(part.material, two_sided);
      if (!material) return material.error();
      primitive["material"] = *material;
    }
    Json mesh = {{"primitives", Json::array({std::move(primitive)})}}, node = placed_node(scene);
    if (!part.name.empty()) mesh["name"] = part.name, node["name"] = part.name;
    node["mesh"] = out.push("meshes", std::move(mesh));
    places.part_nodes[p] = int(add_root(out, std::move(node)));
    places.part_primitives[p] = 0;
  }

  if (scene.document) out.compact();
  const size_t most = file_extension(path) == "gltf" ? bin_limit / split_alignment * split_alignment : 0;
  for (const GltfBlob& blob : blobs)
    places.views.push_back(out.add_views(blob.bytes, blob.alignment, blob.may_split ? most : 0));
  out.place_buffers(path, bin_limit);
  if (extend) extend(out.json, places);
  return out.write(path);
}

}  // namespace lambent
