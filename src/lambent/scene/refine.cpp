#include <lambent/core/check.h>
#include <lambent/scene/index_table.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <bit>

namespace lambent {
namespace {

double length2(Vec3 a, Vec3 b) {
  Vec3d d = Vec3d(a) - Vec3d(b);
  return dot(d, d);
}

bool precedes(Vec3 a, Vec3 b) { return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z; }

// One pass of splitting. Whether and where an edge is split depends on the positions of its ends alone, and not on
// their order, so that all triangles on it agree bit for bit, whichever part they are of.
class EdgeSplitter {
 public:
  explicit EdgeSplitter(Scene& scene) : scene_(scene) {}

  // Marks the edges that are wanted, by their ends in one order; the number of triangles, and a bound of the number of
  // vertices, that splitting would give.
  void mark(const std::function<bool(Vec3, Vec3)>& wants) {
    marks_.assign(scene_.triangles.size(), 0);
    triangles_ = scene_.triangles.size(), midpoints_ = 0;
    for (size_t t = 0; t < marks_.size(); ++t) {
      const uint32_t* v = scene_.triangles[t].v;
      for (int k = 0; k < 3; ++k) {
        const Vec3 a = scene_.positions[v[k]], b = scene_.positions[v[(k + 1) % 3]];
        if (!(precedes(a, b) ? wants(a, b) : wants(b, a))) continue;
        marks_[t] |= uint8_t(1 << k), ++triangles_, ++midpoints_;
      }
    }
  }
  size_t triangles() const { return triangles_; }
  size_t vertices() const { return scene_.positions.size() + midpoints_; }
  size_t marked() const { return midpoints_; }

  void split() {
    out_.triangles.reserve(triangles_);
    for (size_t p = 0; p < scene_.parts.size(); ++p) split_part(uint32_t(p));
    scene_.positions = std::move(out_.positions), scene_.normals = std::move(out_.normals);
    scene_.texcoords = std::move(out_.texcoords), scene_.colors = std::move(out_.colors);
    scene_.tangents = std::move(out_.tangents), scene_.input = std::move(out_.input);
    scene_.triangles = std::move(out_.triangles);
    out_ = Scene();
  }

 private:
  void split_part(uint32_t p) {
    Part& part = scene_.parts[p];
    uint32_t old_first = part.first_vertex, first = uint32_t(out_.positions.size());
    uint32_t first_triangle = uint32_t(out_.triangles.size());
    copy_run(part);
    size_t marked = 0, end = size_t(part.first_triangle) + part.triangle_count;
    for (size_t t = part.first_triangle; t < end; ++t) marked += size_t(std::popcount(marks_[t]));
    IndexTable table(marked);
    edges_.clear();
    uint32_t first_middle = uint32_t(out_.positions.size());
    auto middle = [&](uint32_t a, uint32_t b) {
      uint64_t edge = uint64_t(std::min(a, b)) << 32 | std::max(a, b);
      uint32_t m =
          table.find_or_insert(hash64(edge), uint32_t(edges_.size()), [&](uint32_t k) { return edges_[k] == edge; });
      if (m == edges_.size()) edges_.push_back(edge), add_middle(std::min(a, b), std::max(a, b));
      return first_middle + m;
    };
    for (size_t t = part.first_triangle; t < end; ++t) {
      Triangle triangle = scene_.triangles[t];
      for (uint32_t& v : triangle.v) v = v - old_first + first;
      uint32_t m[3];
      for (int k = 0; k < 3; ++k) m[k] = marks_[t] >> k & 1 ? middle(triangle.v[k], triangle.v[(k + 1) % 3]) : none;
      add_pieces(triangle, m);
    }
    if (marked > 0) part.changed = true, part.source.clear();
    part.first_vertex = first, part.vertex_count = uint32_t(out_.positions.size()) - first;
    part.first_triangle = first_triangle, part.triangle_count = uint32_t(out_.triangles.size()) - first_triangle;
  }

  void copy_run(const Part& part) {
    auto copy = [&](const auto& from, auto& to) {
      if (from.empty()) return;
      to.insert(to.end(), from.begin() + part.first_vertex, from.begin() + part.first_vertex + part.vertex_count);
    };
    copy(scene_.positions, out_.positions), copy(scene_.normals, out_.normals), copy(scene_.colors, out_.colors);
    copy(scene_.tangents, out_.tangents), copy(scene_.input, out_.input);
    out_.texcoords.resize(scene_.texcoords.size());
    for (size_t set = 0; set < out_.texcoords.size(); ++set) copy(scene_.texcoords[set], out_.texcoords[set]);
  }

  void add_middle(uint32_t a, uint32_t b) {
    auto halve = [&](auto& values) {
      if (!values.empty()) values.push_back(0.5f * values[a] + 0.5f * values[b]);
    };
    halve(out_.positions), halve(out_.colors);
    if (!out_.input.empty()) out_.input.push_back(none);
    for (std::vector<Vec2>& uv : out_.texcoords) halve(uv);
    if (!out_.tangents.empty()) {
      const Vec4 t = out_.tangents[a], other = out_.tangents[b];
      out_.tangents.push_back(Vec4(normalize_or(Vec3(t) + Vec3(other), Vec3(t)), t.w));
    }
    if (out_.normals.empty()) return;
    Vec3 normal = out_.normals[a];
    out_.normals.push_back(normalize_or(normal + out_.normals[b], normal));
  }

  // m[k] is the new vertex on edge k, from corner k to the next, or none.
  void add_pieces(const Triangle& t, const uint32_t m[3]) {
    auto add = [&](uint32_t a, uint32_t b, uint32_t c) { out_.triangles.push_back({{a, b, c}, t.part, t.two_sided}); };
    int count = 0, first = 0;  // the first of the marked edges, in turning order
    for (int k = 0; k < 3; ++k) {
      count += m[k] != none;
      if (m[k] != none && m[(k + 2) % 3] == none) first = k;
    }
    uint32_t a = t.v[first], b = t.v[(first + 1) % 3], c = t.v[(first + 2) % 3];
    uint32_t ab = m[first], bc = m[(first + 1) % 3], ca = m[(first + 2) % 3];
    if (count == 0) return add(a, b, c);
    if (count == 1) return add(a, ab, c), add(ab, b, c);
    add(ab, b, bc);
    if (count == 3) return add(a, ab, ca), add(c, ca, bc), add(ab, bc, ca);
    // The shorter diagonal of the rest; between equal ones, positions decide, so that coincident triangles agree.
    const std::vector<Vec3>& p = out_.positions;
    double from_a = length2(p[a], p[bc]), from_c = length2(p[c], p[ab]);
    if (from_a < from_c || (from_a == from_c && precedes(p[a], p[c]))) add(a, ab, bc), add(a, bc, c);
    else add(a, ab, c), add(ab, bc, c);
  }

  Scene& scene_;
  std::vector<uint8_t> marks_;  // bit k: edge k of the triangle is to be split
  size_t triangles_ = 0, midpoints_ = 0;
  std::vector<uint64_t> edges_;  // of the part, in order of their middles
  Scene out_;
};

// At least so many triangles result: a path along the longest edge crosses one every max_edge, and no triangle without
// longer edges covers more than an equilateral one.
double fewest_triangles(const Scene& scene, const Triangle& t, double max_edge) {
  const std::vector<Vec3>& p = scene.positions;
  double longest2 =
      std::max({length2(p[t.v[0]], p[t.v[1]]), length2(p[t.v[1]], p[t.v[2]]), length2(p[t.v[2]], p[t.v[0]])});
  Vec3d a = p[t.v[0]], area2 = cross(Vec3d(p[t.v[1]]) - a, Vec3d(p[t.v[2]]) - a);
  return std::max({1.0, std::sqrt(longest2) / max_edge, length(area2) / (std::sqrt(0.75) * max_edge * max_edge)});
}

}  // namespace

void add_ground(Scene& scene) {
  constexpr int fine_cells = 90, growing_cells = 19;     // 90 + 2 * 19 = 128 cells across
  constexpr double fine_reach = 1.1, whole_reach = 3.0;  // in radii of the bounding sphere
  Bounds box = bounds(scene);
  LAMBENT_CHECK(!box.empty());
  double radius = 0.5 * double(box.diagonal());
  if (radius == 0) radius = 1;

  // Growth at which the outer cells, each `growth` times the one before, end at the whole reach.
  double cell = 2 * fine_reach / fine_cells, low = 1, high = 2;
  for (int step = 0; step < 60; ++step) {
    double growth = 0.5 * (low + high), reach = fine_reach;
    for (int i = 1; i <= growing_cells; ++i) reach += cell * std::pow(growth, i);
    (reach < whole_reach ? low : high) = growth;
  }
  std::vector<double> ticks;  // in radii, symmetric
  for (int i = 0; i <= fine_cells; ++i) ticks.push_back(-fine_reach + cell * i);
  for (int i = 1; i <= growing_cells; ++i) {
    ticks.push_back(ticks.back() + cell * std::pow(low, i));
    ticks.insert(ticks.begin(), ticks.front() - cell * std::pow(low, i));
  }

  std::vector<Vec3> positions;
  std::vector<uint32_t> indices;
  uint32_t row = uint32_t(ticks.size());
  for (uint32_t j = 0; j < row; ++j) {
    for (uint32_t i = 0; i < row; ++i) {
      positions.push_back(
          {float(box.centre().x + radius * ticks[i]), box.min.y, float(box.centre().z + radius * ticks[j])});
      uint32_t v = j * row + i;
      if (i + 1 < row && j + 1 < row) indices.insert(indices.end(), {v, v + row, v + row + 1, v, v + row + 1, v + 1});
    }
  }
  std::vector<Vec3> normals(positions.size(), Vec3(0, 1, 0));
  add_mesh(scene, add_material(scene, ground_name, Vec3(0.5f)), ground_name, positions, normals, indices);
}

Result<void> split_long_edges(Scene& scene, float max_edge, size_t max_triangles) {
  if (!(max_edge > 0)) return Error{scene.path, fmt::format("the longest edge allowed, {}, is not positive", max_edge)};
  float farthest = 0;
  double fewest = 0, longest2 = 0;
  for (const Triangle& t : scene.triangles) {
    fewest += fewest_triangles(scene, t, double(max_edge));
    for (int k = 0; k < 3; ++k) {
      Vec3 p = scene.positions[t.v[k]], size = abs(p);
      farthest = std::max({farthest, size.x, size.y, size.z});
      longest2 = std::max(longest2, length2(p, scene.positions[t.v[(k + 1) % 3]]));
    }
  }
  auto too_many = [&](double count) {
    return Error{scene.path, fmt::format("edges of at most {} need {:.3g} triangles or more, the limit is {}", max_edge,
                                         count, max_triangles)};
  };
  if (longest2 <= double(max_edge) * double(max_edge)) return {};
  if (fewest > double(max_triangles)) return too_many(fewest);
  // Below a few steps of the float grid, an edge has no middle apart from its ends.
  constexpr float grid_steps = 8 * 0x1p-23f;
  if (max_edge < grid_steps * farthest)
    return Error{scene.path,
                 fmt::format("edges of at most {} are finer than coordinates of {} can express", max_edge, farthest)};

  EdgeSplitter splitter(scene);
  const double limit2 = double(max_edge) * double(max_edge);
  auto is_long = [&](Vec3 a, Vec3 b) { return length2(a, b) > limit2; };
  for (splitter.mark(is_long); splitter.marked() > 0; splitter.mark(is_long)) {
    if (splitter.triangles() > max_triangles) return too_many(double(splitter.triangles()));
    if (splitter.triangles() >= none || splitter.vertices() >= none) return Error{scene.path, "too many vertices"};
    splitter.split();
  }
  return {};
}

size_t split_edges(Scene& scene, const std::function<bool(Vec3 a, Vec3 b)>& wants) {
  EdgeSplitter splitter(scene);
  splitter.mark(wants);
  const size_t marked = splitter.marked();
  LAMBENT_CHECK(splitter.triangles() < none && splitter.vertices() < none);
  if (marked > 0) splitter.split();
  return marked;
}

}  // namespace lambent
