// Angle-weighted vertex normals: Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets".
#include <lambent/core/check.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/index_table.h>

#include <algorithm>
#include <bit>
#include <numeric>

namespace lambent {
namespace {

using DVec3 = Vec3d;

// Corner k of triangle t is number 3 t + k; its edge runs from it to the next corner of the triangle.
uint32_t next_corner(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

// An edge of a triangle, filed under the smaller of its ends' position ids.
struct Edge {
  uint32_t high;    // the larger id
  uint32_t corner;  // that the edge starts from
  bool operator<(const Edge& o) const { return high != o.high ? high < o.high : corner < o.corner; }
};

// Calls visit(edges, low id) once for each undirected edge with all edges between its two positions, in order of ids.
// `corner_ids` gives the position id of each corner; edges of triangles for which skip(triangle) holds do not take
// part.
template <class Skip, class Visit>
void visit_edges(const std::vector<uint32_t>& corner_ids, uint32_t id_count, Skip skip, Visit visit) {
  std::vector<uint32_t> first(size_t(id_count) + 1, 0);
  auto each_edge = [&](auto&& act) {
    for (uint32_t c = 0; c < corner_ids.size(); ++c) {
      uint32_t a = corner_ids[c], b = corner_ids[next_corner(c)];
      if (a != b && !skip(c / 3)) act(std::min(a, b), Edge{std::max(a, b), c});
    }
  };
  each_edge([&](uint32_t low, Edge) { ++first[low + 1]; });
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Edge> edges(first.back());
  std::vector<uint32_t> end(first.begin(), first.end() - 1);
  each_edge([&](uint32_t low, Edge edge) { edges[end[low]++] = edge; });
  for (uint32_t low = 0; low < id_count; ++low) {
    auto bucket_end = edges.begin() + first[low + 1];
    std::sort(edges.begin() + first[low], bucket_end);
    for (auto begin = edges.begin() + first[low]; begin != bucket_end;) {
      auto stop = std::find_if(begin, bucket_end, [&](const Edge& e) { return e.high != begin->high; });
      visit(std::span<const Edge>(begin, stop), low);
      begin = stop;
    }
  }
}

// Disjoint sets whose representative is the smallest member.
struct UnionFind {
  std::vector<uint32_t> parent;
  explicit UnionFind(size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

DVec3 wide_area_normal(const Scene& s, const Triangle& t) {
  DVec3 a = s.positions[t.v[0]];
  return cross(DVec3(s.positions[t.v[1]]) - a, DVec3(s.positions[t.v[2]]) - a);
}

// Unit normal, or zero for a triangle without an area.
DVec3 face_normal(const Scene& s, const Triangle& t) {
  DVec3 n = wide_area_normal(s, t);
  double length = lambent::length(n);
  return length > 0 ? n / length : DVec3(0);
}

// Angle of the triangle at corner k, radians.
double corner_angle(const Scene& s, const Triangle& t, int k) {
  DVec3 p = s.positions[t.v[k]];
  DVec3 a = DVec3(s.positions[t.v[(k + 1) % 3]]) - p, b = DVec3(s.positions[t.v[(k + 2) % 3]]) - p;
  return std::atan2(length(cross(a, b)), dot(a, b));
}

// Below this a sum of unit normals, weighted by angles of order one, has cancelled out.
constexpr double cancelled = 1e-9;

Vec3 unit_or(DVec3 sum, DVec3 fallback) {
  double length = lambent::length(sum);
  DVec3 n = length > cancelled ? sum / length : fallback;
  return n == DVec3(0) ? Vec3(0, 1, 0) : Vec3(n);
}

// Joins the corners at both ends of an edge for all pairs of its faces that meet at less than the crease angle. The
// normals of faces on one edge lie on a circle, so joining neighbours on that circle joins all pairs, however many
// faces there are.
void join_over_edge(UnionFind& groups, std::span<const Edge> edges, const std::vector<uint32_t>& corner_ids,
                    uint32_t low, const std::vector<DVec3>& faces, double cos_crease) {
  auto end_corner = [&](Edge e, bool at_low) {
    return (corner_ids[e.corner] == low) == at_low ? e.corner : next_corner(e.corner);
  };
  auto try_join = [&](Edge a, Edge b) {
    if (dot(faces[a.corner / 3], faces[b.corner / 3]) <= cos_crease) return;
    groups.join(end_corner(a, true), end_corner(b, true));
    groups.join(end_corner(a, false), end_corner(b, false));
  };
  if (edges.size() < 2) return;
  if (edges.size() == 2) return try_join(edges[0], edges[1]);
  DVec3 x = faces[edges[0].corner / 3], y(0);
  for (Edge e : edges) {  // the face most nearly at a right angle to the first spans the circle's plane best
    DVec3 n = faces[e.corner / 3], aside = n - x * dot(n, x);
    if (dot(aside, aside) > dot(y, y)) y = aside;
  }
  std::vector<std::pair<double, Edge>> around;
  for (Edge e : edges) {
    DVec3 n = faces[e.corner / 3];
    around.push_back({std::atan2(dot(n, y) / std::max(length(y), 1e-300), dot(n, x)), e});
  }
  std::sort(around.begin(), around.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.second.corner < b.second.corner;
  });
  for (size_t i = 0; i < around.size(); ++i) try_join(around[i].second, around[(i + 1) % around.size()].second);
}

// A part's new vertices, numbered from its first: old ones keep their places, copies follow.
struct PartNormals {
  std::vector<uint32_t> copied;  // the old vertex behind each copy
  std::vector<Vec3> normals;     // of old vertices, then of copies
};

// Computes a part's normals and points its triangles at the copies (first_vertex + number, not yet moved).
PartNormals part_normals(Scene& scene, const Part& part, double crease_degrees) {
  LAMBENT_CHECK(part.triangle_count <= 0xffffffffu / 3);
  std::span<Triangle> triangles(scene.triangles.data() + part.first_triangle, part.triangle_count);
  PositionIds positions = number_positions({scene.positions.data() + part.first_vertex, part.vertex_count});
  uint32_t corner_count = 3 * part.triangle_count;
  std::vector<uint32_t> vertex_of(corner_count), corner_ids(corner_count);
  std::vector<DVec3> faces(triangles.size());
  for (uint32_t c = 0; c < corner_count; ++c) {
    vertex_of[c] = triangles[c / 3].v[c % 3] - part.first_vertex;
    corner_ids[c] = positions.ids[vertex_of[c]];
  }
  for (size_t t = 0; t < triangles.size(); ++t) faces[t] = face_normal(scene, triangles[t]);
  auto no_area = [&](uint32_t t) { return faces[t] == DVec3(0); };

  // Corners at one position that are connected over smooth edges form a group with one normal.
  UnionFind groups(corner_count);
  double cos_crease = std::cos(radians(crease_degrees));
  visit_edges(corner_ids, positions.count, no_area, [&](std::span<const Edge> edges, uint32_t low) {
    join_over_edge(groups, edges, corner_ids, low, faces, cos_crease);
  });
  std::vector<DVec3> sums(corner_count, DVec3(0));
  for (uint32_t c = 0; c < corner_count; ++c)
    if (!no_area(c / 3)) sums[groups.find(c)] += corner_angle(scene, triangles[c / 3], int(c % 3)) * faces[c / 3];

  // The corners of each vertex; its first group keeps the vertex, each further one gets a copy.
  std::vector<uint32_t> first(part.vertex_count + size_t{1}, 0), corners(corner_count);
  for (uint32_t v : vertex_of) ++first[v + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<uint32_t> end(first.begin(), first.end() - 1);
  for (uint32_t c = 0; c < corner_count; ++c) corners[end[vertex_of[c]]++] = c;

  PartNormals out;
  out.normals.assign(part.vertex_count, Vec3(0, 1, 0));
  std::vector<std::pair<uint32_t, uint32_t>> around;  // (group, corner)
  for (uint32_t v = 0; v < part.vertex_count; ++v) {
    around.clear();
    for (uint32_t i = first[v]; i < first[v + 1]; ++i)
      if (!no_area(corners[i] / 3)) around.push_back({groups.find(corners[i]), corners[i]});
    std::sort(around.begin(), around.end());
    for (size_t i = 0; i < around.size(); ++i) {
      auto [group, corner] = around[i];
      bool new_group = i == 0 || group != around[i - 1].first;
      Vec3 normal = new_group ? unit_or(sums[group], faces[corner / 3]) : Vec3(0);
      if (i == 0) {
        out.normals[v] = normal;
      } else if (new_group) {
        out.copied.push_back(v);
        out.normals.push_back(normal);
      }
      bool on_copy = group != around[0].first;
      uint32_t place = on_copy ? part.vertex_count + uint32_t(out.copied.size()) - 1 : v;
      triangles[corner / 3].v[corner % 3] = part.first_vertex + place;
    }
  }
  return out;
}

// Marks a part changed whose vertices still are those of its document, if they were so far.
void mark_changed(Part& part) {
  if (part.changed) return;  // with a map or, after a change that leaves none, without
  part.changed = true;
  part.source.resize(part.vertex_count);
  std::iota(part.source.begin(), part.source.end(), 0u);
}

}  // namespace

PositionIds number_positions(std::span<const Vec3> positions) {
  LAMBENT_CHECK(positions.size() < none);
  PositionIds out;
  out.ids.resize(positions.size());
  IndexTable table(positions.size());
  for (uint32_t i = 0; i < positions.size(); ++i) {
    Vec3 p = positions[i] + 0.0f;  // -0 becomes 0
    uint64_t xy = uint64_t(std::bit_cast<uint32_t>(p.x)) << 32 | std::bit_cast<uint32_t>(p.y);
    uint64_t hash = hash64(xy, std::bit_cast<uint32_t>(p.z));
    uint32_t first = table.find_or_insert(hash, i, [&](uint32_t k) { return positions[k] == p; });
    out.ids[i] = first == i ? out.count++ : out.ids[first];
  }
  return out;
}

void make_normals(Scene& scene, size_t part, bool flat) {
  make_normals(scene, std::span<const size_t>(&part, 1), flat);
}

void make_normals(Scene& scene, std::span<const size_t> parts, bool flat) {
  // Faces of one plane differ in direction by rounding alone.
  constexpr double coplanar_degrees = 0.1;
  size_t old_count = scene.positions.size(), new_count = old_count;
  scene.normals.resize(old_count, Vec3(0));
  std::vector<PartNormals> made(parts.size());
  for (size_t i = 0; i < parts.size(); ++i) {
    LAMBENT_CHECK(parts[i] < scene.parts.size() && (i == 0 || parts[i - 1] < parts[i]));
    made[i] = part_normals(scene, scene.parts[parts[i]], flat ? coplanar_degrees : double(crease_angle_degrees));
    new_count += made[i].copied.size();
  }
  LAMBENT_CHECK(new_count < none);

  if (new_count > old_count) {
    auto insert_copies = [&](auto& values) {
      if (values.empty()) return;
      std::remove_reference_t<decltype(values)> moved;
      moved.reserve(new_count);
      size_t next = 0;
      for (size_t p = 0; p < scene.parts.size(); ++p) {
        auto run = values.begin() + scene.parts[p].first_vertex;
        moved.insert(moved.end(), run, run + scene.parts[p].vertex_count);
        if (next == parts.size() || parts[next] != p) continue;
        for (uint32_t v : made[next].copied) moved.push_back(run[v]);
        ++next;
      }
      values = std::move(moved);
    };
    insert_copies(scene.positions), insert_copies(scene.normals), insert_copies(scene.colors),
        insert_copies(scene.tangents);
    for (std::vector<Vec2>& uv : scene.texcoords) insert_copies(uv);
  }
  uint32_t shift = 0;
  size_t next = 0;
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    Part& part = scene.parts[p];
    part.first_vertex += shift;
    for (uint32_t t = 0; t < part.triangle_count && shift > 0; ++t)
      for (uint32_t& v : scene.triangles[part.first_triangle + t].v) v += shift;
    if (next == parts.size() || parts[next] != p) continue;
    const PartNormals& m = made[next++];
    mark_changed(part);
    if (!part.source.empty())
      for (uint32_t v : m.copied) part.source.push_back(uint32_t(part.source[v]));
    part.vertex_count += uint32_t(m.copied.size());
    shift += uint32_t(m.copied.size());
    std::copy(m.normals.begin(), m.normals.end(), scene.normals.begin() + part.first_vertex);
  }
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
    DVec3 face = face_normal(scene, t);
    if (face == DVec3(0)) continue;
    for (int k = 0; k < 3; ++k) {
      sums[t.v[k]] += corner_angle(scene, t, k) * face;
      if (fallbacks[t.v[k]] == DVec3(0)) fallbacks[t.v[k]] = face;
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

void merge_duplicate_triangles(Scene& scene) {
  LAMBENT_CHECK(scene.triangles.size() < none);
  const std::vector<uint32_t> ids = number_positions(scene.positions).ids;
  using Key = std::array<uint32_t, 3>;
  auto key_of = [&](const Triangle& t) {
    Key k{ids[t.v[0]], ids[t.v[1]], ids[t.v[2]]};
    std::rotate(k.begin(), std::min_element(k.begin(), k.end()), k.end());
    return k;
  };
  auto hash = [](Key k) { return hash64(uint64_t(k[0]) << 32 | k[1], k[2]); };
  IndexTable table(scene.triangles.size());
  std::vector<uint8_t> dropped(scene.triangles.size(), 0);
  bool any = false;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    Triangle& triangle = scene.triangles[t];
    Key key = key_of(triangle), opposite{key[0], key[2], key[1]};
    if (key[0] == key[1] || key[1] == key[2] || key[2] == key[0]) continue;
    auto equals = [&](Key wanted) { return [&, wanted](uint32_t i) { return key_of(scene.triangles[i]) == wanted; }; };
    dropped[t] = table.find_or_insert(hash(key), t, equals(key)) != t;
    any = any || dropped[t];
    if (dropped[t]) continue;
    uint32_t twin = table.find(hash(opposite), equals(opposite));
    if (twin != none) triangle.two_sided = scene.triangles[twin].two_sided = true;
  }
  if (!any) return;
  uint32_t kept = 0;
  for (Part& part : scene.parts) {
    uint32_t first = kept;
    for (uint32_t t = part.first_triangle; t < part.first_triangle + part.triangle_count; ++t)
      if (!dropped[t]) scene.triangles[kept++] = scene.triangles[t];
    if (kept - first != part.triangle_count) mark_changed(part);
    part.first_triangle = first, part.triangle_count = kept - first;
  }
  scene.triangles.resize(kept);
}

void infer_sidedness(Scene& scene) {
  LAMBENT_CHECK(scene.triangles.size() <= 0xffffffffu / 3);
  // Of the area to the power 3/2: far above the rounding of the sums, far below any solid sheet.
  constexpr double smallest_volume = 1e-11;
  PositionIds positions = number_positions(scene.positions);
  std::vector<uint32_t> corner_ids(3 * scene.triangles.size());
  UnionFind connected(positions.count);
  for (uint32_t c = 0; c < corner_ids.size(); ++c) corner_ids[c] = positions.ids[scene.triangles[c / 3].v[c % 3]];
  for (uint32_t c = 0; c < corner_ids.size(); ++c) connected.join(corner_ids[c], corner_ids[next_corner(c)]);
  auto component_of = [&](size_t t) { return connected.find(corner_ids[3 * t]); };
  auto has_repeated_corner = [&](uint32_t t) {
    const uint32_t* id = &corner_ids[3 * size_t(t)];
    return id[0] == id[1] || id[1] == id[2] || id[2] == id[0];
  };

  std::vector<uint8_t> closed(positions.count, 1);  // by component
  visit_edges(corner_ids, positions.count, has_repeated_corner, [&](std::span<const Edge> edges, uint32_t low) {
    bool matched = edges.size() == 2 && (corner_ids[edges[0].corner] == low) != (corner_ids[edges[1].corner] == low);
    if (!matched) closed[connected.find(low)] = 0;
  });
  std::vector<DVec3> centroid(positions.count, DVec3(0));
  std::vector<double> corners(positions.count, 0), volume(positions.count, 0), area(positions.count, 0);
  for (size_t t = 0; t < scene.triangles.size(); ++t) {
    uint32_t component = component_of(t);
    for (uint32_t v : scene.triangles[t].v) centroid[component] += DVec3(scene.positions[v]);
    corners[component] += 3;
  }
  for (size_t t = 0; t < scene.triangles.size(); ++t) {
    uint32_t component = component_of(t);
    const Triangle& triangle = scene.triangles[t];
    DVec3 normal = wide_area_normal(scene, triangle), apex = centroid[component] / corners[component];
    volume[component] += dot(DVec3(scene.positions[triangle.v[0]]) - apex, normal) / 6;
    area[component] += length(normal) / 2;
  }
  for (size_t t = 0; t < scene.triangles.size(); ++t) {
    uint32_t c = component_of(t);
    scene.triangles[t].two_sided = !(closed[c] && volume[c] > smallest_volume * std::pow(area[c], 1.5));
  }
}

}  // namespace lambent
