// EXT_mesh_gpu_instancing (multi-vendor).
#include <lambent/scene/gltf_instances.h>

#include <algorithm>
#include <map>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr const char* extension_name = "EXT_mesh_gpu_instancing";
// Accessors without bytes are zeros, as many as they like to say.
constexpr size_t max_instances = size_t{1} << 20, max_channels = size_t{1} << 20, max_zeros = 4096;

struct Property {
  const char *attribute, *member;
  size_t components;
  bool integers;  // normalised ones
};
constexpr Property properties[] = {
    {"TRANSLATION", "translation", 3, false}, {"ROTATION", "rotation", 4, true}, {"SCALE", "scale", 3, false}};

struct Instances {
  size_t count = 0;
  std::array<std::optional<GltfAccessor>, 3> values;  // of `properties`
};

bool read_instances(GltfCheck& check, const GltfDocument& document, const Json& attributes, const GltfWhere& where,
                    Instances& out) {
  bool any = false;
  for (const auto& [name, value] : attributes.items()) {
    const auto index = check.integer(value, name.c_str(), gltf_count(document.json, "accessors"), where);
    if (!index) return false;
    GltfAccessor a = read_accessor(check, document, *index);
    if (!check.ok()) return false;
    if (any && a.count != out.count) return check.fail(where, "attributes of its instances differ in number");
    if (a.data.empty() && a.count > max_zeros) return check.fail(where, "its instances have no bytes in a buffer");
    any = true, out.count = a.count;
    for (size_t k = 0; k < std::size(properties); ++k) {
      const Property& p = properties[k];
      if (name != p.attribute) continue;
      const bool small = p.integers && a.normalized && (a.type == GltfType::i8 || a.type == GltfType::i16);
      if (a.is_matrix || size_t(a.components) != p.components || (a.type != GltfType::f32 && !small))
        return check.fail(where, std::string(p.attribute) + " of its instances is not " + std::to_string(p.components) +
                                     " floats" + (p.integers ? " or normalised integers" : ""));
      out.values[k] = a;
    }
  }
  if (!any) out.count = 1;  // without attributes there is one, where the node is
  return true;
}

// A node that stands where the instance does, without a mesh yet.
bool instance_node(GltfCheck& check, const Instances& instances, size_t i, const GltfWhere& where, Json& node) {
  node = Json::object();
  for (size_t k = 0; k < std::size(properties); ++k) {
    if (!instances.values[k]) continue;
    double v[4] = {};
    const size_t n = properties[k].components;
    instances.values[k]->read(i, std::span(v, n));
    if (!std::all_of(v, v + n, [](double x) { return std::isfinite(x); }))
      return check.fail(where, "instance " + std::to_string(i) + " is not at a finite place");
    Json numbers = Json::array();
    for (size_t c = 0; c < n; ++c) numbers.push_back(v[c]);
    node[properties[k].member] = std::move(numbers);
  }
  return true;
}

// Animations of weights move the meshes, wherever these have gone.
bool move_weight_channels(GltfCheck& check, Json& document,
                          const std::map<size_t, std::pair<size_t, size_t>>& children) {
  const auto animations = document.find("animations");
  if (animations == document.end()) return true;
  size_t total = 0;
  for (Json& animation : *animations) {
    Json* channels = gltf_member(animation, {"channels"});
    if (!channels || !channels->is_array()) continue;
    Json moved = Json::array();
    for (Json& channel : *channels) {
      const Json *path = gltf_member(channel, {"target", "path"}), *node = gltf_member(channel, {"target", "node"});
      const auto run = path && *path == "weights" && node && node->is_number_unsigned()
                         ? children.find(node->get<size_t>())
                         : children.end();
      if (run == children.end()) {
        moved.push_back(std::move(channel));
        continue;
      }
      total += run->second.second;
      if (total > max_channels) return check.fail({}, "animations move too many instances");
      for (size_t i = 0; i < run->second.second; ++i) {
        moved.push_back(channel);
        moved.back()["target"]["node"] = run->second.first + i;
      }
    }
    *channels = std::move(moved);
  }
  return true;
}

void forget_extension(Json& document) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const auto list = document.find(key);
    if (list == document.end() || !list->is_array()) continue;
    list->erase(std::remove(list->begin(), list->end(), Json(extension_name)), list->end());
    if (list->empty()) document.erase(list);
  }
}

}  // namespace

bool expand_instances(GltfCheck& check, GltfDocument& document, std::vector<std::string>& warnings) {
  const size_t nodes = gltf_count(document.json, "nodes");
  std::map<size_t, std::pair<size_t, size_t>> children;  // of a node: the first of its instances, and how many
  size_t total = 0, skinned = 0, coloured = 0;
  bool stays = false;  // the extension, somewhere
  for (size_t n = 0; n < nodes; ++n) {
    const GltfWhere where{"node", n};
    Json& node = document.json["nodes"][n];
    const Json* extensions = check.object(node, "extensions", where);
    const Json* extension = extensions ? check.object(*extensions, extension_name, where) : nullptr;
    if (!check.ok()) return false;
    if (!extension) continue;
    const bool skin = node.contains("skin");
    if (skin || !node.contains("mesh")) {
      skinned += skin, stays = true;
      continue;
    }
    const Json* attributes = check.object(*extension, "attributes", where);
    Instances instances;
    if (!check.ok() || !read_instances(check, document, attributes ? *attributes : Json::object(), where, instances))
      return false;
    total += instances.count;
    if (total > max_instances)
      return check.fail(where, "the scene has more than " + std::to_string(max_instances) + " instances");
    coloured += attributes && (attributes->contains("_COLOR_0") || attributes->contains("COLOR_0"));
    node["extensions"].erase(extension_name);
    if (node["extensions"].empty()) node.erase("extensions");
    Json drawn = Json::object();  // what each instance has of the node
    for (const char* key : {"mesh", "weights", "name"})
      if (node.contains(key)) drawn[key] = node[key];
    node.erase("mesh"), node.erase("weights");
    const size_t first = document.json["nodes"].size();
    children[n] = {first, instances.count};
    std::vector<Json> copies(instances.count);
    Json numbers = node.contains("children") ? node["children"] : Json::array();
    if (!numbers.is_array()) return check.fail(where, "children is not an array");
    for (size_t i = 0; i < instances.count; ++i) {
      if (!instance_node(check, instances, i, where, copies[i])) return false;
      copies[i].update(drawn);
      numbers.push_back(first + i);
    }
    if (!numbers.empty()) node["children"] = std::move(numbers);
    for (Json& copy : copies) document.json["nodes"].push_back(std::move(copy));  // `node` is void from here on
  }
  if (!move_weight_channels(check, document.json, children)) return false;
  if (!stays) forget_extension(document.json);
  if (skinned)
    warnings.push_back("instances of " + std::to_string(skinned) +
                       (skinned == 1 ? " skinned node are" : " skinned nodes are") + " shown once");
  if (coloured)
    warnings.push_back("colours of instances are not read (" + std::to_string(coloured) +
                       (coloured == 1 ? " node)" : " nodes)"));
  return true;
}

}  // namespace lambent
