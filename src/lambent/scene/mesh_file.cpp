// Polygon normals: Newell's method (Sutherland, Sproull and Schumacker 1974). Ear clipping: Meisters 1975, "Polygons
// have ears".
#include <lambent/scene/clean.h>
#include <lambent/scene/mesh_file.h>

namespace lambent {
namespace {

constexpr size_t max_ear_corners = 100'000;

double cross2(Vec2d a, Vec2d b) { return a.x * b.y - a.y * b.x; }

// Drops vertices that no triangle uses, and parts without triangles.
void drop_unused(Scene& scene) {
  std::vector<uint32_t> place(scene.positions.size(), none);
  for (const Triangle& t : scene.triangles)
    for (uint32_t v : t.v) place[v] = 0;
  auto is_bare = [](const Part& part) { return part.triangle_count == 0; };
  if (std::find(place.begin(), place.end(), none) == place.end() &&
      std::none_of(scene.parts.begin(), scene.parts.end(), is_bare))
    return;
  uint32_t used = 0;
  std::vector<Part> parts;
  for (Part& part : scene.parts) {
    uint32_t first = used;
    for (uint32_t v = part.first_vertex; v < part.first_vertex + part.vertex_count; ++v)
      if (place[v] != none) place[v] = used++;
    part.first_vertex = first, part.vertex_count = used - first;
    for (uint32_t t = 0; t < part.triangle_count; ++t)
      scene.triangles[part.first_triangle + t].part = uint32_t(parts.size());
    if (part.triangle_count > 0) parts.push_back(std::move(part));
  }
  scene.parts = std::move(parts);
  auto compact = [&](auto& values) {
    if (values.empty()) return;
    for (size_t v = 0; v < place.size(); ++v)
      if (place[v] != none) values[place[v]] = values[v];
    values.resize(used);
  };
  compact(scene.positions), compact(scene.normals), compact(scene.colors), compact(scene.input);
  for (auto& uv : scene.texcoords) compact(uv);
  for (Triangle& t : scene.triangles)
    for (uint32_t& v : t.v) v = place[v];
}

bool is_direction(Vec3 n) { return is_finite(n) && n != Vec3(0); }

}  // namespace

bool Triangulator::cut(std::span<const uint32_t> vertices, std::span<const Vec3> positions,
                       std::vector<std::array<uint32_t, 3>>& triangles) {
  if (vertices.size() == 3) {
    bool differ = vertices[0] != vertices[1] && vertices[1] != vertices[2] && vertices[2] != vertices[0];
    if (differ) triangles.push_back({0, 1, 2});
    return differ;
  }
  loop_.clear(), polygon_.clear(), cuts_.clear();
  for (uint32_t i = 0; i < vertices.size(); ++i)
    if (i == 0 || vertices[i] != vertices[i - 1]) loop_.push_back(i);
  while (loop_.size() > 1 && vertices[loop_.front()] == vertices[loop_.back()]) loop_.pop_back();
  for (uint32_t i : loop_) polygon_.push_back(positions[vertices[i]]);
  cut_polygon();
  size_t before = triangles.size();
  for (auto cut : cuts_) {
    std::array<uint32_t, 3> t{loop_[cut[0]], loop_[cut[1]], loop_[cut[2]]};
    uint32_t a = vertices[t[0]], b = vertices[t[1]], c = vertices[t[2]];
    if (a != b && b != c && c != a) triangles.push_back(t);
  }
  return triangles.size() > before;
}

void Triangulator::cut_polygon() {
  uint32_t n = uint32_t(polygon_.size());
  if (n < 3) return;
  if (n == 3) return cuts_.push_back({0, 1, 2});

  Vec3d normal(0);
  for (uint32_t i = 0; i < n; ++i) normal += cross(polygon_[i] - polygon_[0], polygon_[(i + 1) % n] - polygon_[0]);
  int axis = std::abs(normal.x) > std::abs(normal.y) ? 0 : 1;
  if (std::abs(normal.z) > std::abs(normal[axis])) axis = 2;
  int u = (axis + 1) % 3, v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  points_.resize(n);
  for (uint32_t i = 0; i < n; ++i) points_[i] = {polygon_[i][u], polygon_[i][v]};

  next_.resize(n), previous_.resize(n), is_reflex_.assign(n, 0), reflex_.clear();
  for (uint32_t i = 0; i < n; ++i) next_[i] = (i + 1) % n, previous_[i] = (i + n - 1) % n;
  auto turn = [&](uint32_t i) { return cross2(points_[i] - points_[previous_[i]], points_[next_[i]] - points_[i]); };
  for (uint32_t i = 0; i < n; ++i)
    if (turn(i) <= 0) is_reflex_[i] = 1, reflex_.push_back(i);

  uint32_t i = 0, left = n, tried = 0;
  bool clip_ears = !reflex_.empty() && normal[axis] != 0 && n <= max_ear_corners;
  while (clip_ears && left > 3 && budget_ > 0) {
    // After a full round without an ear (a polygon that crosses itself) any corner has to do.
    if (tried < left && !is_ear(i)) {
      i = next_[i], ++tried;
      continue;
    }
    uint32_t a = previous_[i], b = next_[i];
    cuts_.push_back({a, i, b});
    next_[a] = b, previous_[b] = a, is_reflex_[i] = 0, --left, tried = 0;
    for (uint32_t neighbour : {a, b})
      if (is_reflex_[neighbour] && turn(neighbour) > 0) is_reflex_[neighbour] = 0;
    i = next_[b];  // not b: alternate corners make fewer slivers
  }
  // The rest is a fan about corner i, which is all of it for convex polygons.
  if (!clip_ears) i = 0;
  for (uint32_t b = next_[i]; next_[b] != i; b = next_[b]) cuts_.push_back({i, b, next_[b]});
}

// A strictly convex corner whose triangle holds no reflex corner, save ones at the triangle's own corners.
bool Triangulator::is_ear(uint32_t i) {
  budget_ -= std::min<uint64_t>(budget_, 1);
  if (is_reflex_[i]) return false;
  Vec2d a = points_[previous_[i]], b = points_[i], c = points_[next_[i]];
  for (size_t k = 0; k < reflex_.size(); ++k) {
    uint32_t r = reflex_[k];
    if (!is_reflex_[r]) {
      reflex_[k--] = reflex_.back();
      reflex_.pop_back();
      continue;
    }
    budget_ -= std::min<uint64_t>(budget_, 1);
    Vec2d p = points_[r];
    if (p == a || p == b || p == c) continue;
    if (cross2(b - a, p - a) >= 0 && cross2(c - b, p - b) >= 0 && cross2(a - c, p - c) >= 0) return false;
  }
  return true;
}

Result<void> finish_mesh(Scene& scene) {
  bool usable = false;
  const bool has_normals = std::any_of(scene.normals.begin(), scene.normals.end(), is_direction);
  for (Triangle& t : scene.triangles) {
    if (usable && !has_normals) break;
    Vec3d a = scene.positions[t.v[0]], b = scene.positions[t.v[1]], c = scene.positions[t.v[2]];
    Vec3d winding = cross(b - a, c - a);
    usable = usable || winding != Vec3d(0);
    bool opposed = true;
    for (uint32_t v : t.v) {
      Vec3 n = scene.normals[v];
      opposed = opposed && is_direction(n) && dot(winding, Vec3d(n)) < 0;
    }
    if (opposed) std::swap(t.v[1], t.v[2]);
  }
  if (!usable) return Error{scene.path, scene.triangles.empty() ? "no triangles" : "no triangle has an area"};

  drop_unused(scene);
  CornerFans fans = corner_fans(scene);
  if (merge_duplicate_triangles(scene, fans)) {
    drop_unused(scene);
    fans = corner_fans(scene);
  }
  std::vector<size_t> bare;
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    auto begin = scene.normals.begin() + scene.parts[p].first_vertex;
    if (std::none_of(begin, begin + scene.parts[p].vertex_count, is_direction)) bare.push_back(p);
  }
  make_normals(scene, bare, false, fans);
  repair_normals(scene);
  infer_sidedness(scene, fans);

  for (Material& material : scene.materials) material.double_sided = false;
  for (const Triangle& t : scene.triangles)
    if (t.two_sided) scene.materials[scene.parts[t.part].material].double_sided = true;
  for (Part& part : scene.parts) part.changed = false, part.source.clear();  // there is no document to differ from
  return {};
}

}  // namespace lambent
