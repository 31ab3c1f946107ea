// glTF 2.0 specification (ISO/IEC 12113), sections 3.5 (nodes) and 3.7.3 (skins).
#include <lambent/scene/gltf_read.h>

#include <lambent/core/check.h>
#include <lambent/scene/mesh_file.h>

#include <algorithm>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr size_t no_parent = SIZE_MAX;

Mat4d local_matrix(GltfCheck& check, const Json& node, const GltfWhere& where) {
  double m[16];
  if (check.numbers(node, "matrix", m, where)) {
    Mat4d matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = m[i];
    return matrix;
  }
  double t[3] = {0, 0, 0}, r[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
  check.numbers(node, "translation", t, where);
  check.numbers(node, "rotation", r, where);
  check.numbers(node, "scale", s, where);
  const double length = std::sqrt((r[3] * r[3] + r[0] * r[0]) + (r[1] * r[1] + r[2] * r[2]));
  // Stored quaternions are unit up to rounding; scaling by that error would let long chains drift.
  Vec4d q(r[0], r[1], r[2], r[3]);
  if (length > 0) q /= length;
  Mat4d matrix(rotation_from_quaternion(q));
  for (int c = 0; c < 3; ++c) matrix[c] *= s[c];
  matrix[3] = Vec4d(t[0], t[1], t[2], 1);
  return matrix;
}

// Parents of all nodes; a node has at most one.
std::vector<size_t> read_parents(GltfCheck& check, const Json& document) {
  const size_t count = gltf_count(document, "nodes");
  std::vector<size_t> parents(count, no_parent);
  for (size_t n = 0; n < count; ++n) {
    GltfWhere where{"node", n};
    const Json* children = check.array(gltf_item(document, "nodes", n), "children", where);
    if (!children) continue;
    for (const Json& child : *children) {
      auto index = check.integer(child, "a child", count, where);
      if (!index) return {};
      if (parents[*index] != no_parent) {
        check.fail({"node", *index},
                   "is a child of two nodes, " + std::to_string(parents[*index]) + " and " + std::to_string(n));
        return {};
      }
      parents[*index] = n;
    }
  }
  return parents;
}

// Appends the node and all below it, depth first, children in their order; nothing of what is `seen` already.
void append_tree(const Json& document, size_t root, std::vector<bool>& seen, std::vector<size_t>& order) {
  std::vector<size_t> pending{root};
  while (!pending.empty()) {
    size_t n = pending.back();
    pending.pop_back();
    if (seen[n]) continue;
    seen[n] = true;
    order.push_back(n);
    const Json& node = gltf_item(document, "nodes", n);
    auto children = node.find("children");
    if (children == node.end()) continue;
    for (size_t i = children->size(); i-- > 0;) pending.push_back((*children)[i].get<size_t>());
  }
}

// KHR_node_visibility: whether each node is hidden, by itself or with what it hangs on. `order`: parents before
// children.
std::vector<bool> read_hidden(GltfCheck& check, const Json& document, const std::vector<size_t>& parents,
                              const std::vector<size_t>& order) {
  std::vector<bool> hidden(parents.size());
  for (size_t n : order) {
    const GltfWhere where{"node", n};
    const Json* extensions = check.object(gltf_item(document, "nodes", n), "extensions", where);
    const Json* own = extensions ? check.object(*extensions, "KHR_node_visibility", where) : nullptr;
    hidden[n] = (parents[n] != no_parent && hidden[parents[n]]) ||
                (own && !check.boolean(*own, "visible", true, where));
  }
  return hidden;
}

// Roots may be named twice, or be below other nodes, as some exporters write them: each is shown once, where its
// parents put it.
bool read_shown(GltfCheck& check, const Json& document, const std::vector<size_t>& parents, GltfPose& pose) {
  const size_t scenes = gltf_count(document, "scenes");
  std::vector<bool> seen(parents.size()), named(parents.size());
  if (scenes == 0) {
    for (size_t n = 0; n < parents.size(); ++n) {
      if (parents[n] == no_parent) append_tree(document, n, seen, pose.shown);
    }
    return true;
  }
  size_t scene = check.integer(document, "scene", 0, scenes, {});
  if (!check.ok()) return false;
  GltfWhere where{"scene", scene};
  const Json* roots = check.array(gltf_item(document, "scenes", scene), "nodes", where);
  for (const Json& root : roots ? *roots : Json::array()) {
    auto n = check.integer(root, "a node", parents.size(), where);
    if (!n) return false;
    pose.inner_roots += named[*n] || parents[*n] != no_parent;
    named[*n] = true;
    append_tree(document, *n, seen, pose.shown);
  }
  return check.ok();
}

bool read_joints(GltfCheck& check, const GltfDocument& document, size_t index, GltfPose& pose) {
  const Json& skin = gltf_item(document.json, "skins", index);
  GltfWhere where{"skin", index};
  const Json* joints = check.array(skin, "joints", where);
  if (!check.ok()) return false;
  if (!joints || joints->empty()) return check.fail(where, "has no joints");
  GltfAccessor bind;
  auto bind_index = check.index(skin, "inverseBindMatrices", gltf_count(document.json, "accessors"), where);
  if (bind_index) {
    bind = read_accessor(check, document, *bind_index);
    if (check.ok() && (bind.components != 16 || bind.type != GltfType::f32 || bind.count < joints->size())) {
      check.fail(where, "inverseBindMatrices are not one 4 x 4 matrix of floats a joint");
    }
  }
  if (!check.ok()) return false;
  std::vector<Mat4d>& matrices = pose.joints[index];
  matrices.reserve(joints->size());
  for (size_t j = 0; j < joints->size(); ++j) {
    auto node = check.integer((*joints)[j], "a joint", pose.world.size(), where);
    if (!node) return false;
    Mat4d inverse_bind(1.0);
    if (bind_index) {
      double m[16] = {};
      bind.read(j, m);
      for (int i = 0; i < 16; ++i) inverse_bind[i / 4][i % 4] = m[i];
    }
    matrices.push_back(pose.world[*node] * inverse_bind);
  }
  return true;
}

double determinant3(const Mat4d& m) { return dot(Vec3d(m[0]), cross(Vec3d(m[1]), Vec3d(m[2]))); }

}  // namespace

bool read_pose(GltfCheck& check, const GltfDocument& document, GltfPose& pose) {
  const Json& json = document.json;
  std::vector<size_t> parents = read_parents(check, json);
  if (!check.ok()) return false;
  const size_t count = parents.size();

  std::vector<size_t> order;  // parents before children
  order.reserve(count);
  std::vector<bool> seen(count);
  for (size_t n = 0; n < count; ++n) {
    if (parents[n] == no_parent) append_tree(json, n, seen, order);
  }
  if (order.size() != count) return check.fail({}, "the node hierarchy has a cycle");
  pose.world.assign(count, Mat4d(1.0));
  for (size_t n : order) {
    Mat4d local = local_matrix(check, gltf_item(json, "nodes", n), {"node", n});
    if (parents[n] == no_parent) {
      for (size_t k = 0; k < 3; ++k) local[3][k] -= pose.origin[k];
      pose.world[n] = local;
    } else {
      pose.world[n] = pose.world[parents[n]] * local;
    }
  }
  if (!check.ok() || !read_shown(check, json, parents, pose)) return false;
  const std::vector<bool> hidden = read_hidden(check, json, parents, order);
  std::erase_if(pose.shown, [&](size_t n) { return hidden[n]; });

  const size_t skins = gltf_count(json, "skins");
  pose.joints.resize(skins);
  for (size_t n : pose.shown) {
    const Json& node = gltf_item(json, "nodes", n);
    if (!node.contains("mesh")) continue;
    auto skin = check.index(node, "skin", skins, {"node", n});
    if (skin && pose.joints[*skin].empty() && !read_joints(check, document, *skin, pose)) return false;
  }
  return check.ok();
}

Vec3d document_origin(const GltfDocument& document, const GltfPose& pose) {
  const Json& json = document.json;
  GltfCheck check("");
  constexpr size_t enough = 100'000;  // nodes and primitives that share each other could be without end
  size_t visited = 0;
  Vec3d low(INFINITY), high(-INFINITY), first(0);
  for (size_t n : pose.shown) {
    const Json& node = gltf_item(json, "nodes", n);
    auto mesh = check.index(node, "mesh", gltf_count(json, "meshes"), {});
    const Json* primitives = mesh ? check.array(gltf_item(json, "meshes", *mesh), "primitives", {}) : nullptr;
    for (size_t i = 0; primitives && i < primitives->size() && visited < enough; ++i, ++visited) {
      const Json* attributes = check.object((*primitives)[i], "attributes", {});
      auto positions = attributes ? check.index(*attributes, "POSITION", gltf_count(json, "accessors"), {})
                                  : std::nullopt;
      if (!check.ok()) return Vec3d(0);  // which reading says in words
      if (!positions) continue;
      double box[2][3] = {{0, 0, 0}, {0, 0, 0}};
      const Json& accessor = gltf_item(json, "accessors", *positions);
      if (!check.numbers(accessor, "min", box[0], {}) || !check.numbers(accessor, "max", box[1], {}))
        check = GltfCheck("");
      if (!(low.x <= high.x)) first = Vec3d(pose.world[n][3]);
      for (int k = 0; k < 8; ++k) {
        Vec3d p(pose.world[n] * Vec4d(box[k & 1][0], box[k >> 1 & 1][1], box[k >> 2][2], 1));
        low = min(low, p), high = max(high, p);
      }
    }
  }
  const Vec3d origin = far_origin(low, high);
  if (origin == Vec3d(0)) return origin;
  return far_origin(low - first, high - first) == Vec3d(0) ? first : origin;
}

bool read_placement(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, size_t node,
                    const Json& primitive, const GltfVertices& vertices, const GltfWhere& where,
                    GltfPlacement& placement) {
  placement.world = pose.world[node];
  placement.mirrored = determinant3(placement.world) < 0;
  auto skin = check.index(gltf_item(document.json, "nodes", node), "skin", pose.joints.size(), {"node", node});
  const Json* attributes = check.object(primitive, "attributes", where);
  if (!skin || !attributes) return check.ok();
  for (size_t set = 0;; ++set) {
    std::string joints = "JOINTS_" + std::to_string(set), weights = "WEIGHTS_" + std::to_string(set);
    auto j = read_attribute(check, document, *attributes, joints.c_str(), vertices.count, where);
    auto w = read_attribute(check, document, *attributes, weights.c_str(), vertices.count, where);
    if (!check.ok()) return false;
    if (!j || !w) break;
    if (j->components != 4 || j->is_matrix || (j->type != GltfType::u8 && j->type != GltfType::u16)) {
      return check.fail(where, joints + " is not four unsigned bytes or shorts");
    }
    bool small = (w->type == GltfType::u8 || w->type == GltfType::u16) && w->normalized;
    if (w->components != 4 || w->is_matrix || (w->type != GltfType::f32 && !small)) {
      return check.fail(where, weights + " is not four floats or normalised integers");
    }
    placement.joint_sets.push_back(*j), placement.weight_sets.push_back(*w);
  }
  if (placement.joint_sets.empty()) return true;  // the node's skin leaves this primitive alone
  placement.joints = &pose.joints[*skin];
  const size_t joint_count = placement.joints->size();
  for (size_t set = 0; set < placement.joint_sets.size(); ++set) {
    for (size_t k = 0; k < vertices.size(); ++k) {
      const size_t i = vertices[k];
      double j[4] = {}, w[4] = {};
      placement.joint_sets[set].read(i, j), placement.weight_sets[set].read(i, w);
      for (int c = 0; c < 4; ++c) {
        if (!(w[c] >= 0) || !std::isfinite(w[c]))
          return check.fail(where, "vertex " + std::to_string(i) + " has a bad weight");
        if (w[c] > 0 && j[c] >= double(joint_count)) {
          return check.fail(where, "vertex " + std::to_string(i) + " hangs on joint " + std::to_string(int(j[c])) +
                                       " of " + std::to_string(joint_count));
        }
      }
    }
  }
  // NOTE: the specification words the winding rule for the node's transform, which it also says a skinned mesh ignores;
  // what decides is therefore the transform that takes its place.
  size_t negative = size_t(std::count_if(placement.joints->begin(), placement.joints->end(),
                                         [](const Mat4d& m) { return determinant3(m) < 0; }));
  placement.mirrored = negative * 2 > joint_count;
  return true;
}

Mat4d GltfPlacement::at(size_t vertex) const {
  if (!joints) return world;
  Mat4d sum(0.0);
  double total = 0;
  for (size_t set = 0; set < joint_sets.size(); ++set) {
    double j[4] = {}, w[4] = {};
    joint_sets[set].read(vertex, j), weight_sets[set].read(vertex, w);
    for (int k = 0; k < 4; ++k) {
      if (w[k] > 0) sum += w[k] * (*joints)[size_t(j[k])], total += w[k];
    }
  }
  return total > 0 ? sum / total : joints->front();
}

Mat3d normal_matrix(const Mat4d& m) {
  Vec3d a(m[0]), b(m[1]), c(m[2]);
  Mat3d cofactors(cross(b, c), cross(c, a), cross(a, b));
  return dot(a, cofactors[0]) < 0 ? -cofactors : cofactors;
}

}  // namespace lambent
