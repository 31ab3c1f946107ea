// Follows: local-deformable-prt, section 5; polar decomposition by Newton's iteration as in N. Higham, "Computing the
// polar decomposition" (1986); bending and twisting as in A. Barr, "Global and local deformations of solid primitives"
// (1984).
#include <lambent/scene/pose.h>

#include <lambent/core/parallel.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/gltf_animation.h>
#include <lambent/scene/gltf_geometry.h>

#include <charconv>

namespace lambent {
namespace {

using Json = nlohmann::json;

// The least rotation that takes unit a to unit b. Where they are (nearly) opposite, by way of a direction across.
Mat3d least_rotation(Vec3d a, Vec3d b) {
  const double c = dot(a, b);
  if (c < -1 + 1e-6) {
    const Vec3d across = normalize(cross(a, Vec3d(frame_about(Vec3(a))[1])));
    return least_rotation(across, b) * least_rotation(a, across);
  }
  const Vec3d v = cross(a, b);
  const Mat3d K(Vec3d(0, v.z, -v.y), Vec3d(-v.z, 0, v.x), Vec3d(v.y, -v.x, 0));
  return Mat3d(1.0) + K + K * K / (1 + c);
}

double frobenius(const Mat3d& m) { return std::sqrt(dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2])); }

// The nearest orthogonal matrix, or nothing where F is (nearly) singular.
std::optional<Mat3d> orthogonal_part(Mat3d F) {
  const double size = frobenius(F);
  if (!(size > 0) || !std::isfinite(size)) return std::nullopt;
  F /= size;
  if (std::abs(determinant(F)) < 1e-9) return std::nullopt;
  for (int i = 0; i < 30; ++i) {
    const Mat3d inverse = transpose(lambent::inverse(F));
    const double scale = std::sqrt(frobenius(inverse) / frobenius(F));
    const Mat3d next = 0.5 * (scale * F + inverse / scale);
    const double change = frobenius(next - F);
    F = next;
    if (change < 1e-13) break;
  }
  return F;
}

// Gradients of the map from rest to pose about each vertex: the mean over the faces around its position, by their rest
// areas. A face says what becomes of its edges; its normal keeps its length.
std::vector<Mat3d> gradients(const Scene& scene, const std::vector<Vec3>& positions,
                             const std::vector<uint8_t>& mirrored) {
  const PositionIds places = number_positions(scene.positions);
  std::vector<Mat3d> sums(places.count, Mat3d(0.0));
  for (const Triangle& t : scene.triangles) {
    auto edges = [&](const std::vector<Vec3>& p, double flip, Mat3d& E) {
      const Vec3d a(p[t.v[0]]), e1 = Vec3d(p[t.v[1]]) - a, e2 = Vec3d(p[t.v[2]]) - a, n = cross(e1, e2);
      const double area = length(n);
      E = Mat3d(e1, e2, area > 0 ? flip * n / area : Vec3d(0.0));
      return area;
    };
    Mat3d rest, now;
    const double area = edges(scene.positions, 1, rest);
    edges(positions, mirrored[t.part] ? -1 : 1, now);
    if (!(area > 0)) continue;
    const Mat3d F = now * inverse(rest);
    if (!std::isfinite(frobenius(F))) continue;
    for (uint32_t v : t.v) sums[places.ids[v]] += area * F;
  }
  std::vector<Mat3d> result(scene.positions.size());
  for (size_t v = 0; v < result.size(); ++v) result[v] = sums[places.ids[v]];
  return result;
}

// Where a pose has no normal of its own, the rest normal is carried along.
Vec3 carried_normal(const Mat3d& F, Vec3 normal) {
  const Mat3d cofactors(cross(F[1], F[2]), cross(F[2], F[0]), cross(F[0], F[1]));
  const Vec3d n = (determinant(F) < 0 ? -1.0 : 1.0) * (cofactors * Vec3d(normal));
  const double length = lambent::length(n);
  return length > 0 && std::isfinite(length) ? Vec3(n / length) : normal;
}

void finish_pose(const Scene& scene, Pose& pose) {
  const std::vector<Mat3d> F = gradients(scene, pose.positions, pose.mirrored);
  pose.rotations.resize(scene.positions.size());
  parallel_for(scene.positions.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      const float length = lambent::length(pose.normals[v]);
      pose.normals[v] = length > 0.5f ? pose.normals[v] / length : carried_normal(F[v], scene.normals[v]);
      pose.rotations[v] = pose_rotation(F[v], scene.normals[v], pose.normals[v]);
    }
  });
}

}  // namespace

Mat3 pose_rotation(const Mat3d& F, Vec3 rest_normal, Vec3 normal) {
  const Vec3d a = normalize(Vec3d(rest_normal)), b = normalize(Vec3d(normal));
  const std::optional<Mat3d> R = orthogonal_part(F);
  return Mat3(R ? least_rotation(normalize(*R * a), b) * *R : least_rotation(a, b));
}

Result<std::vector<AnimationInfo>> list_animations(const Scene& scene) {
  if (!scene.document) return Error{scene.path, "has no animations: it is not glTF"};
  std::vector<AnimationInfo> list(gltf_count(scene.document->json, "animations"));
  for (size_t i = 0; i < list.size(); ++i) {
    GltfCheck check("");
    list[i].name = animation_name(*scene.document, i);
    if (!read_times(check, *scene.document, i, list[i].from, list[i].to)) list[i].problem = check.error().text();
  }
  return list;
}

Result<size_t> find_animation(const Scene& scene, const std::string& text) {
  if (!scene.document) return Error{scene.path, "has no animations: it is not glTF"};
  std::vector<std::string> all(gltf_count(scene.document->json, "animations"));
  for (size_t i = 0; i < all.size(); ++i) all[i] = animation_name(*scene.document, i);
  if (all.empty()) return Error{scene.path, "has no animations"};
  for (size_t i = 0; i < all.size(); ++i)
    if (all[i] == text) return i;
  size_t index = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (status == std::errc() && end == text.data() + text.size() && index < all.size()) return index;
  std::string names;
  for (size_t i = 0; i < all.size() && names.size() < 300; ++i)
    names += (i ? ", " : "") + (all[i].empty() ? std::to_string(i) : "\"" + all[i].substr(0, 40) + "\"");
  return Error{scene.path, "has no animation \"" + text + "\"; there are " + std::to_string(all.size()) + ": " +
                               names.substr(0, 300)};
}

Result<Pose> pose_scene(const Scene& scene, size_t animation, double time) {
  if (!scene.document) return Error{scene.path, "has no animations: it is not glTF"};
  if (!std::isfinite(time)) return Error{scene.path, "the time is not a finite number"};
  GltfCheck check(scene.path);
  const GltfDocument& rest = *scene.document;
  if (animation >= gltf_count(rest.json, "animations"))
    return Error{scene.path, "has no animation " + std::to_string(animation)};
  GltfDocument moved;  // the same bytes, other nodes
  Json nodes;
  if (!animate_nodes(check, rest, animation, time, nodes)) return check.error();
  moved.json = rest.json, moved.buffers = rest.buffers;
  moved.json["nodes"] = std::move(nodes);
  GltfPose rest_pose{.origin = scene.origin}, moved_pose = rest_pose;
  if (!read_pose(check, rest, rest_pose) || !read_pose(check, moved, moved_pose)) return check.error();

  Pose pose;
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    const Part& part = scene.parts[p];
    const std::string place = "part \"" + part.name.substr(0, 60) + "\"";
    if (part.node < 0) {  // a floor that was added: it stands still
      for (size_t v = part.first_vertex; v < part.first_vertex + part.vertex_count; ++v)
        pose.positions.push_back(scene.positions[v]), pose.normals.push_back(scene.normals[v]);
      pose.mirrored.push_back(0);
      continue;
    }
    const size_t node = size_t(part.node);
    const Json& json_node = gltf_item(moved.json, "nodes", node);
    auto mesh = check.index(json_node, "mesh", gltf_count(moved.json, "meshes"), {"node", node});
    if (!check.ok()) return check.error();
    if (!mesh) return Error{scene.path, place + " has lost its mesh"};
    const Json* primitives = check.array(gltf_item(moved.json, "meshes", *mesh), "primitives", {"mesh", *mesh});
    if (!primitives || size_t(part.primitive) >= primitives->size())
      return Error{scene.path, place + " has lost its primitive"};
    const Json& primitive = (*primitives)[size_t(part.primitive)];
    const GltfWhere where{"mesh", *mesh, "primitive", size_t(part.primitive)};
    const Json* attributes = check.object(primitive, "attributes", where);
    if (!attributes) return Error{scene.path, place + " has no attributes"};
    auto index = check.index(*attributes, "POSITION", gltf_count(moved.json, "accessors"), where);
    if (!index) return Error{scene.path, place + " has no positions"};
    const GltfAccessor accessor = read_accessor(check, moved, *index);
    std::vector<GltfMorph> morphs;
    const GltfVertices vertices{accessor.count, part.source};
    if (vertices.size() != part.vertex_count)
      return Error{scene.path,
                   place + " was refined (--max-edge), so that its vertices no longer hang on anything that moves"};
    for (uint32_t v : part.source)
      if (v >= accessor.count) return Error{scene.path, place + " does not fit its mesh"};
    GltfPlacement at_rest, placement;
    if (!check.ok() || !check_gltf_vector(check, accessor, "POSITION", where) ||
        !read_morphs(check, moved, node, *mesh, primitive, accessor.count, where, morphs) ||
        !read_placement(check, rest, rest_pose, node, primitive, vertices, where, at_rest) ||
        !read_placement(check, moved, moved_pose, node, primitive, vertices, where, placement) ||
        !read_vertices(check, moved, *attributes, accessor, vertices, morphs, placement, where, pose.positions,
                       pose.normals))
      return check.error();
    pose.mirrored.push_back(placement.mirrored != at_rest.mirrored);
  }
  finish_pose(scene, pose);
  return pose;
}

Result<Deformation> parse_deformation(const std::string& text) {
  const Error wrong{"--deform",
                    "expects bend:ANGLE[,along[,towards]] or twist:ANGLE[,along], axes as x, y, z, not \"" +
                        text.substr(0, 80) + "\"",
                    true};
  Deformation d;
  size_t at = 0;
  if (text.starts_with("bend:")) at = 5;
  else if (text.starts_with("twist:")) at = 6, d.kind = DeformKind::twist;
  else return wrong;
  const auto [end, status] = std::from_chars(text.data() + at, text.data() + text.size(), d.degrees);
  if (status != std::errc() || !std::isfinite(d.degrees)) return wrong;
  at = size_t(end - text.data());
  for (int* axis : {&d.along, &d.towards}) {
    if (at == text.size()) break;
    if (at + 2 > text.size() || text[at] != ',' || text[at + 1] < 'x' || text[at + 1] > 'z' ||
        (axis == &d.towards && d.kind == DeformKind::twist))
      return wrong;
    *axis = text[at + 1] - 'x';
    at += 2;
  }
  if (at != text.size() || (d.along >= 0 && d.along == d.towards)) return wrong;
  if (d.kind == DeformKind::bend && !(std::abs(d.degrees) < 360))
    return Error{"--deform", "bends by less than 360 degrees", true};
  if (!(std::abs(d.degrees) <= 36000)) return Error{"--deform", "twists by at most 36000 degrees", true};
  return d;
}

Pose deform_scene(const Scene& scene, const Deformation& deformation) {
  const Bounds box = bounds(scene);
  const Vec3d centre(box.centre()), size(box.max - box.min);
  int along = deformation.along;
  if (along < 0) along = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  if (along == deformation.towards) along = (along + 1) % 3;
  const int towards = deformation.towards >= 0 ? deformation.towards : (along + 1) % 3, across = 3 - along - towards;
  const double length = std::max(size[along], 1e-30),
               turn = radians(double(deformation.degrees)) / length;  // radians a metre
  auto map = [&](Vec3d p) {
    p -= centre;
    const double h = p[along], angle = turn * h, c = std::cos(angle), s = std::sin(angle);
    Vec3d q = p;
    if (deformation.kind == DeformKind::twist) {
      // Right-handed about the axis.
      const int u = (along + 1) % 3, v = (along + 2) % 3;
      q[u] = c * p[u] - s * p[v], q[v] = s * p[u] + c * p[v];
    } else {
      // The middle line becomes an arc that keeps its length; sin(x)/x and (1 - cos x)/x are taken for x = angle.
      const double sinc = std::abs(angle) > 1e-8 ? s / angle : 1,
                   versine = std::abs(angle) > 1e-8 ? (1 - c) / angle : 0.5 * angle;
      q[along] = h * sinc - p[towards] * s, q[towards] = h * versine + p[towards] * c, q[across] = p[across];
    }
    return q + centre;
  };
  Pose pose;
  const size_t n = scene.positions.size();
  pose.positions.resize(n), pose.normals.resize(n), pose.rotations.resize(n),
      pose.mirrored.assign(scene.parts.size(), 0);
  const double step = 1e-6 * std::max({size.x, size.y, size.z, 1e-30});
  parallel_for(n, 4096, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      const Vec3d p(scene.positions[v]);
      Mat3d F;
      for (int k = 0; k < 3; ++k) {
        Vec3d h(0.0);
        h[k] = step;
        F[k] = (map(p + h) - map(p - h)) / (2 * step);
      }
      pose.positions[v] = Vec3(map(p));
      pose.normals[v] = carried_normal(F, scene.normals[v]);
      pose.rotations[v] = pose_rotation(F, scene.normals[v], pose.normals[v]);
    }
  });
  return pose;
}

Scene posed(const Scene& scene, const Pose& pose) {
  Scene s = scene;
  s.positions = pose.positions, s.normals = pose.normals;
  s.tangents.clear();  // they were the rest pose's: texture coordinates tell them anew
  for (Triangle& t : s.triangles)
    if (pose.mirrored[t.part]) std::swap(t.v[1], t.v[2]);
  return s;
}

}  // namespace lambent
