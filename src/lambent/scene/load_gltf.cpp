// glTF 2.0 specification (ISO/IEC 12113): the loader. Sections 3.7.2 (meshes, morph targets) and 3.7.3 (skins) in the
// rest pose.
#include <lambent/scene/clean.h>
#include <lambent/scene/gltf_compressed.h>
#include <lambent/core/uri.h>
#include <lambent/scene/gltf_extensions.h>
#include <lambent/scene/gltf_instances.h>
#include <lambent/scene/gltf_materials.h>
#include <lambent/scene/gltf_primitives.h>
#include <lambent/scene/gltf_read.h>
#include <lambent/scene/gltf_unbake.h>
#include <lambent/scene/load.h>

#include <map>

namespace lambent {

using Json = nlohmann::json;

namespace {

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
    auto path = find_external_file(uri, folder_, where);
    if (!path) return path.error();
    auto file = MappedFile::open(*path);
    if (!file) return Error{where, in_quotes(uri) + " cannot be read: " + file.error().message};
    document_.files.push_back(*file);
    return files_[uri] = file->bytes();
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
  if (!read_primitives(check, document, pose, was_baked, scene)) return false;
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
