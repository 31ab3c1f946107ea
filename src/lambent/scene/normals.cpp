// Angle-weighted vertex normals: Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets".
#include <lambent/core/check.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/clean_parts.h>

#include <algorithm>
#include <array>
#include <cfloat>
#include <numbers>

namespace lambent {
namespace {

using DVec3 = Vec3d;

// Unit normal, or zero for a triangle without an area.
DVec3 face_normal(const Scene& s, const Triangle& t) {
  DVec3 n = wide_area_normal(s, t);
  double length = lambent::length(n);
  return length > 0 ? n / length : DVec3(0);
}

// Angle of the direction (cosine, sine), not of unit length, whose sine is not negative; to 2e-7, without a branch, so
// that compilers do four at once. Polynomial: Abramowitz and Stegun 1964, 4.4.49.
inline float angle_of(float sine, float cosine) {
  constexpr float half_pi = std::numbers::pi_v<float> / 2;
  const float c = std::abs(cosine), low = sine < c ? sine : c, high = sine < c ? c : sine;
  const float x = low / (high > FLT_MIN ? high : FLT_MIN), q = x * x;
  float angle = x * (1 + q * (-0.3333314528f +
                              q * (0.1999355085f +
                                   q * (-0.1420889944f +
                                        q * (0.1065626393f +
                                             q * (-0.0752896400f +
                                                  q * (0.0429096138f + q * (-0.0161657367f + q * 0.0028662257f))))))));
  angle = sine > c ? half_pi - angle : angle;
  return cosine < 0 ? 2 * half_pi - angle : angle;
}

// A triangle with an area: its unit normal and the angles of its corners, radians.
struct Face {
  DVec3 normal{0.0};                    // zero without an area
  float area = 0, cosines[2] = {0, 0};  // twice the area; times the tangents of the first two angles
  Face() = default;
  Face(const Scene& s, const Triangle& t) {
    const DVec3 a(s.positions[t.v[0]]), ab = DVec3(s.positions[t.v[1]]) - a, ac = DVec3(s.positions[t.v[2]]) - a,
                                        across = cross(ab, ac);
    const double twice = length(across);
    if (!(twice > 0)) return;
    // Floats hold the shape at any scale about the longer of the two edges.
    const double scale = 1 / std::max(dot(ab, ab), dot(ac, ac));
    normal = across * (1 / twice);
    area = float(twice * scale), cosines[0] = float(dot(ab, ac) * scale), cosines[1] = float(dot(ab, ab - ac) * scale);
  }
  // Of its corners, radians; of none without an area.
  std::array<float, 3> angles() const {
    const float a = angle_of(area, cosines[0]), b = angle_of(area, cosines[1]);
    return {a, b, std::max(0.0f, std::numbers::pi_v<float> - a - b)};
  }
};

// Below this a sum of unit normals, weighted by angles of order one, has cancelled out.
constexpr double cancelled = 1e-9;

Vec3 unit_or(DVec3 sum, DVec3 fallback) {
  double length = lambent::length(sum);
  DVec3 n = length > cancelled ? sum / length : fallback;
  return n == DVec3(0) ? Vec3(0, 1, 0) : Vec3(n);
}

// One end of an edge at a position.
struct EdgeEnd {
  uint64_t key;     // the position at the other end, then the corner that the edge starts from
  uint32_t member;  // the corner here, by its place among those looked at
  bool operator<(const EdgeEnd& o) const { return key < o.key; }
  uint32_t other() const { return uint32_t(key >> 32); }
  uint32_t face() const { return uint32_t(key) / 3; }
};

// The corners at one position, in groups that are connected over smooth edges: each group has one normal. One object
// does position after position, so that its memory is taken once.
class CornerGroups {
 public:
  CornerGroups(const Scene& scene, const CornerFans& fans, double cos_crease)
      : scene_(scene), fans_(fans), cos_crease_(cos_crease) {}

  // Corners of one part, ascending, whose triangles have an area. A group's number is the place of its first corner.
  void group(std::span<const uint32_t> corners) {
    sets_.parent.resize(corners.size());
    std::iota(sets_.parent.begin(), sets_.parent.end(), 0u);
    ends_.clear();
    for (uint32_t i = 0; i < corners.size(); ++i) {
      uint32_t c = corners[i], previous = previous_corner(c);
      ends_.push_back({uint64_t(fans_.ids[next_corner(c)]) << 32 | c, i});
      ends_.push_back({uint64_t(fans_.ids[previous]) << 32 | previous, i});
    }
    std::sort(ends_.begin(), ends_.end());
    for (size_t begin = 0, end = 0; begin < ends_.size(); begin = end) {
      while (end < ends_.size() && ends_[end].other() == ends_[begin].other()) ++end;
      join_over_edge({ends_.data() + begin, end - begin});
    }
    sums_.assign(corners.size(), DVec3(0));
    for (uint32_t i = 0; i < corners.size(); ++i) {
      const Face face(scene_, scene_.triangles[corners[i] / 3]);
      sums_[sets_.find(i)] += double(face.angles()[corners[i] % 3]) * face.normal;
    }
  }
  uint32_t group_of(uint32_t member) { return sets_.find(member); }
  Vec3 normal(uint32_t group, uint32_t corner) const { return unit_or(sums_[group], face(corner / 3)); }

 private:
  // Joins an edge's faces, all pairs that meet at less than the crease angle. Normals of faces on one edge lie on a
  // circle, so joining neighbours on that circle joins all pairs, however many faces there are.
  void join_over_edge(std::span<const EdgeEnd> edge) {
    auto try_join = [&](const EdgeEnd& a, const EdgeEnd& b) {
      if (dot(face(a.face()), face(b.face())) > cos_crease_) sets_.join(a.member, b.member);
    };
    if (edge.size() < 2) return;
    if (edge.size() == 2) return try_join(edge[0], edge[1]);
    DVec3 x = face(edge[0].face()), y(0);
    for (const EdgeEnd& e : edge) {  // the face most nearly at a right angle to the first spans the circle's plane best
      DVec3 n = face(e.face()), aside = n - x * dot(n, x);
      if (dot(aside, aside) > dot(y, y)) y = aside;
    }
    around_.clear();
    for (const EdgeEnd& e : edge) {
      DVec3 n = face(e.face());
      around_.push_back({std::atan2(dot(n, y) / std::max(length(y), 1e-300), dot(n, x)), e});
    }
    std::sort(around_.begin(), around_.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first < b.first : a.second < b.second;
    });
    for (size_t i = 0; i < around_.size(); ++i) try_join(around_[i].second, around_[(i + 1) % around_.size()].second);
  }

  DVec3 face(uint32_t t) const { return face_normal(scene_, scene_.triangles[t]); }

  const Scene& scene_;
  const CornerFans& fans_;
  double cos_crease_;
  UnionFind sets_{0};
  std::vector<EdgeEnd> ends_;
  std::vector<std::pair<double, EdgeEnd>> around_;
  std::vector<DVec3> sums_;
};

// A vertex's further normal, for which it is copied.
struct Copy {
  uint32_t vertex;
  uint32_t first, count;  // of NormalMaker::moved: the corners that go over to it
  Vec3 normal;
};

// Makes the normals of parts; the first of each vertex goes to the scene, the others are listed.
class NormalMaker {
 public:
  NormalMaker(Scene& scene, const CornerFans& fans, const std::vector<bool>& wanted, double cos_crease)
      : scene_(scene), fans_(fans), wanted_(wanted), cos_crease_(cos_crease), groups_(scene, fans, cos_crease) {}

  std::vector<Copy> copies;  // by vertex
  std::vector<uint32_t> moved;

  void make() {
    sum_faces();
    for (size_t p = 0; p + 1 < fans_.first.size(); ++p) {
      const std::span<const uint32_t> all(fans_.corners.data() + fans_.first[p],
                                          fans_.corners.data() + fans_.first[p + 1]);
      if (fans_.is_ring[p] && is_smooth_vertex(all)) {
        const uint32_t v = vertex_of(all[0]);
        scene_.normals[v] = unit_or(sums_[v], faces_[all[0] / 3]);
      } else {
        add_groups(p, all);
      }
    }
    auto before = [](const Copy& a, const Copy& b) { return a.vertex < b.vertex; };
    if (!std::is_sorted(copies.begin(), copies.end(), before)) std::stable_sort(copies.begin(), copies.end(), before);
  }

 private:
  uint32_t part_of(uint32_t corner) const { return scene_.triangles[corner / 3].part; }
  uint32_t vertex_of(uint32_t corner) const { return scene_.triangles[corner / 3].v[corner % 3]; }

  // Each face's normal, and the sums of them all at the vertices, which do where nothing is split.
  void sum_faces() {
    faces_.resize(scene_.triangles.size());
    sums_.assign(scene_.positions.size(), DVec3(0));
    // In batches, so that their angles are found together.
    constexpr size_t batch = 64;
    Face faces[batch];
    float a[batch], b[batch];
    for (size_t begin = 0; begin < faces_.size(); begin += batch) {
      const size_t count = std::min(batch, faces_.size() - begin);
      for (size_t i = 0; i < count; ++i) {
        const Triangle& triangle = scene_.triangles[begin + i];
        faces[i] = wanted_[triangle.part] ? Face(scene_, triangle) : Face();
      }
      for (size_t i = 0; i < batch; ++i) a[i] = angle_of(faces[i].area, faces[i].cosines[0]);
      for (size_t i = 0; i < batch; ++i) b[i] = angle_of(faces[i].area, faces[i].cosines[1]);
      for (size_t i = 0; i < count; ++i) {
        const Triangle& triangle = scene_.triangles[begin + i];
        if (!wanted_[triangle.part]) continue;
        faces_[begin + i] = Vec3(faces[i].normal);
        const float c = std::max(0.0f, std::numbers::pi_v<float> - a[i] - b[i]);
        sums_[triangle.v[0]] += double(a[i]) * faces[i].normal;
        sums_[triangle.v[1]] += double(b[i]) * faces[i].normal;
        sums_[triangle.v[2]] += double(c) * faces[i].normal;
      }
    }
  }

  // Whether the corners of a ring are those of one vertex, and its faces meet smoothly but at one edge at most: that
  // one they can be reached around. Floats decide where they are sure.
  bool is_smooth_vertex(std::span<const uint32_t> ring) const {
    constexpr float sure = 1e-6f;
    const float smooth = float(cos_crease_) + sure;
    if (!wanted_[part_of(ring[0])]) return false;
    int sharp = 0;
    for (size_t i = 0; i < ring.size() && sharp < 2; ++i) {
      const uint32_t c = ring[i], next = ring[i + 1 < ring.size() ? i + 1 : 0];
      if (vertex_of(c) != vertex_of(ring[0]) || faces_[c / 3] == Vec3(0)) return false;
      sharp += !(dot(faces_[c / 3], faces_[next / 3]) > smooth);
    }
    return sharp < 2;
  }

  void add_groups(size_t position, std::span<const uint32_t> all) {
    // Ascending corners are those of one part after the other.
    sorted_.assign(all.begin(), all.end());
    if (fans_.is_ring[position]) std::sort(sorted_.begin(), sorted_.end());
    for (size_t i = 0; i < sorted_.size();) {
      const uint32_t part = part_of(sorted_[i]);
      corners_.clear();
      for (; i < sorted_.size() && part_of(sorted_[i]) == part; ++i)
        if (wanted_[part] && faces_[sorted_[i] / 3] != Vec3(0)) corners_.push_back(sorted_[i]);
      if (!corners_.empty()) add_position();
    }
  }

  void add_position() {
    groups_.group(corners_);
    order_.clear();
    for (uint32_t i = 0; i < corners_.size(); ++i)
      order_.push_back({vertex_of(corners_[i]), groups_.group_of(i), corners_[i]});
    if (!std::is_sorted(order_.begin(), order_.end())) std::sort(order_.begin(), order_.end());
    uint32_t kept = none;  // the group that stays with the vertex
    for (size_t i = 0; i < order_.size(); ++i) {
      auto [vertex, group, corner] = order_[i];
      if (i == 0 || vertex != order_[i - 1][0]) {
        kept = group;
        scene_.normals[vertex] = groups_.normal(group, corner);
      } else if (group != kept && group != order_[i - 1][1]) {
        copies.push_back({vertex, uint32_t(moved.size()), 0, groups_.normal(group, corner)});
      }
      if (group != kept) moved.push_back(corner), ++copies.back().count;
    }
  }

  Scene& scene_;
  const CornerFans& fans_;
  const std::vector<bool>& wanted_;
  double cos_crease_;
  std::vector<Vec3> faces_;  // unit normals of wanted parts; zero without an area
  std::vector<DVec3> sums_;
  CornerGroups groups_;
  std::vector<uint32_t> sorted_, corners_;
  std::vector<std::array<uint32_t, 3>> order_;  // (vertex, group, corner)
};

// Puts the copies of vertices behind their parts and points the moved corners at them.
void insert_copies(Scene& scene, const std::vector<Copy>& copies, const std::vector<uint32_t>& moved) {
  const size_t new_count = scene.positions.size() + copies.size();
  LAMBENT_CHECK(new_count < none);
  std::vector<size_t> end_of_part;  // in `copies`
  for (const Part& part : scene.parts) {
    size_t i = end_of_part.empty() ? 0 : end_of_part.back();
    while (i < copies.size() && copies[i].vertex < part.first_vertex + part.vertex_count) ++i;
    end_of_part.push_back(i);
  }
  auto insert = [&](auto& values, auto value_of) {
    if (values.empty()) return;
    std::remove_reference_t<decltype(values)> grown;
    grown.reserve(new_count);
    for (size_t p = 0, i = 0; p < scene.parts.size(); ++p) {
      auto run = values.begin() + scene.parts[p].first_vertex;
      grown.insert(grown.end(), run, run + scene.parts[p].vertex_count);
      for (; i < end_of_part[p]; ++i) grown.push_back(value_of(values, copies[i]));
    }
    values = std::move(grown);
  };
  auto as_before = [](const auto& values, const Copy& copy) { return values[copy.vertex]; };
  insert(scene.positions, as_before), insert(scene.colors, as_before), insert(scene.tangents, as_before);
  insert(scene.input, as_before);
  for (std::vector<Vec2>& uv : scene.texcoords) insert(uv, as_before);
  insert(scene.normals, [](const auto&, const Copy& copy) { return copy.normal; });

  for (size_t p = 0, i = 0; p < scene.parts.size(); ++p) {
    Part& part = scene.parts[p];
    const uint32_t old_first = part.first_vertex, shift = uint32_t(i);
    part.first_vertex += shift;
    for (uint32_t t = 0; t < part.triangle_count && shift > 0; ++t)
      for (uint32_t& v : scene.triangles[part.first_triangle + t].v) v += shift;
    for (; i < end_of_part[p]; ++i, ++part.vertex_count) {
      for (uint32_t m = copies[i].first; m < copies[i].first + copies[i].count; ++m)
        scene.triangles[moved[m] / 3].v[moved[m] % 3] = part.first_vertex + part.vertex_count;
      if (!part.source.empty()) part.source.push_back(uint32_t(part.source[copies[i].vertex - old_first]));
    }
  }
}

}  // namespace

// Marks a part changed whose vertices still are those of its document, if they were so far.
void mark_changed(Part& part) {
  if (part.changed) return;  // with a map or, after a change that leaves none, without
  part.changed = true;
  part.source.resize(part.vertex_count);
  std::iota(part.source.begin(), part.source.end(), 0u);
}

void make_normals(Scene& scene, size_t part, bool flat) {
  make_normals(scene, std::span<const size_t>(&part, 1), flat);
}

void make_normals(Scene& scene, std::span<const size_t> parts, bool flat) {
  if (!parts.empty()) make_normals(scene, parts, flat, corner_fans(scene));
}

void make_normals(Scene& scene, std::span<const size_t> parts, bool flat, const CornerFans& fans) {
  // Faces of one plane differ in direction by rounding alone.
  constexpr double coplanar_degrees = 0.1;
  if (parts.empty()) return;
  scene.normals.resize(scene.positions.size(), Vec3(0));
  std::vector<bool> wanted(scene.parts.size());
  for (size_t i = 0; i < parts.size(); ++i) {
    LAMBENT_CHECK(parts[i] < scene.parts.size() && (i == 0 || parts[i - 1] < parts[i]));
    Part& part = scene.parts[parts[i]];
    wanted[parts[i]] = true;
    auto first = scene.normals.begin() + part.first_vertex;
    std::fill(first, first + part.vertex_count, Vec3(0, 1, 0));
    mark_changed(part);
  }
  NormalMaker maker(scene, fans, wanted, std::cos(radians(flat ? coplanar_degrees : double(crease_angle_degrees))));
  maker.make();
  if (!maker.copies.empty()) insert_copies(scene, maker.copies, maker.moved);
}

void repair_normals(Scene& scene) {
  constexpr double shortest = 1e-30;   // shorter ones hold too few digits to be a direction
  constexpr double unit_error = 1e-6;  // of the squared length: rounding of a unit vector, left as it is
  scene.normals.resize(scene.positions.size(), Vec3(0));
  std::vector<uint8_t> broken(scene.normals.size(), 0);
  bool any = false;
  for (size_t v = 0; v < scene.normals.size(); ++v) {
    DVec3 n = scene.normals[v];
    double length2 = dot(n, n);
    broken[v] = !(length2 > shortest * shortest) || !std::isfinite(length2);
    any = any || broken[v];
    if (!broken[v] && std::abs(length2 - 1) > unit_error) scene.normals[v] = Vec3(n / std::sqrt(length2));
  }
  if (!any) return;
  std::vector<DVec3> sums(scene.normals.size(), DVec3(0)), fallbacks = sums;
  for (const Triangle& t : scene.triangles) {
    if (!broken[t.v[0]] && !broken[t.v[1]] && !broken[t.v[2]]) continue;
    const Face face(scene, t);
    if (face.normal == DVec3(0)) continue;
    const std::array<float, 3> angles = face.angles();
    for (size_t k = 0; k < 3; ++k) {
      sums[t.v[k]] += double(angles[k]) * face.normal;
      if (fallbacks[t.v[k]] == DVec3(0)) fallbacks[t.v[k]] = face.normal;
    }
  }
  for (Part& part : scene.parts) {
    for (uint32_t v = part.first_vertex; v < part.first_vertex + part.vertex_count; ++v) {
      if (!broken[v]) continue;
      scene.normals[v] = unit_or(sums[v], fallbacks[v]);
      mark_changed(part);
    }
  }
}

}  // namespace lambent
