#include <lambent/bake/room_space.h>

#include <lambent/core/checkpoint.h>
#include <lambent/core/ranks.h>
#include <lambent/core/sampling.h>

#include <algorithm>
#include <cmath>

namespace lambent {

RoomSpace::RoomSpace(const Scene& scene, const std::vector<Room>& given, int places, int directions)
    : rooms(given),
      nodes_in(given.size(), 0),
      bounds_(room_bounds(scene)),
      tolerance_(1e-5f * bounds_.diagonal()),
      directions_(directions),
      openings_of_(given.size()),
      leading_to_(given.size()),
      triangles_of_(given.size()) {
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    Bounds reach;
    for (const uint32_t v : scene.triangles[i].v) reach.extend(scene.positions[v]);
    for (size_t room = 0; room < rooms.size(); ++room)
      if (is_reached(room, reach)) triangles_of_[room].push_back(i);
  }
  for (uint32_t i = 0; i < rooms.size(); ++i)
    for (uint32_t j = 0; j < rooms.size(); ++j)
      for (int axis = 0; axis < 3 && i != j; ++axis)
        for (const bool upper : {false, true}) {
          const Bounds &a = rooms[i].box, &b = rooms[j].box;
          if (upper ? a.max[axis] != b.min[axis] : a.min[axis] != b.max[axis]) continue;
          Opening o;
          o.room = i, o.beyond = j, o.axis = axis, o.upper = upper;
          o.face = {max(a.min, b.min), min(a.max, b.max)};
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          const Vec3 extent = o.face.max - o.face.min;
          if (!(extent[u] > 0 && extent[v] > 0)) continue;
          const float longer = std::max(extent[u], extent[v]);
          o.across[0] = std::max(1, int(std::lround(float(places) * extent[u] / longer)));
          o.across[1] = std::max(1, int(std::lround(float(places) * extent[v] / longer)));
          openings_of_[i].push_back(uint32_t(openings.size())), leading_to_[j].push_back(uint32_t(openings.size()));
          openings.push_back(std::move(o));
        }
}

uint32_t RoomSpace::room_at(Vec3 p) const {
  uint32_t nearest = 0;
  float least = INFINITY;
  for (uint32_t i = 0; i < rooms.size(); ++i) {
    const Vec3 out = max(max(rooms[i].box.min - p, p - rooms[i].box.max), Vec3(0));
    if (const float away = dot(out, out); away < least) least = away, nearest = i;
  }
  return nearest;
}

bool RoomSpace::is_reached(size_t room, const Bounds& reach) const {
  const Bounds& box = rooms[room].box;
  for (int a = 0; a < 3; ++a)
    if (!(reach.min[a] <= box.max[a] + tolerance_ && reach.max[a] >= box.min[a] - tolerance_)) return false;
  return true;
}

Result<RoomGeometry> RoomSpace::geometry(size_t room, const Scene& scene) const {
  RoomGeometry out{std::make_unique<Scene>(), {}, triangles_of_[room]};
  Scene& own = *out.scene;
  std::vector<uint32_t> vertices;  // of the whole scene, in the order of what they are there
  vertices.reserve(3 * out.triangles.size());
  for (const uint32_t i : out.triangles)
    vertices.insert(vertices.end(), scene.triangles[i].v, scene.triangles[i].v + 3);
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  own.positions.reserve(vertices.size()), own.triangles.reserve(out.triangles.size());
  for (const uint32_t v : vertices) own.positions.push_back(scene.positions[v]);
  for (const uint32_t i : out.triangles) {
    Triangle copy = scene.triangles[i];
    for (uint32_t& v : copy.v) v = uint32_t(std::lower_bound(vertices.begin(), vertices.end(), v) - vertices.begin());
    own.triangles.push_back(copy);
  }
  own.parts = scene.parts, own.materials = scene.materials;
  for (Material& m : own.materials) m.base_color_texture = -1;  // textures stay with the scene
  auto tracer = Tracer::build(own);
  if (!tracer) return tracer.error();
  out.tracer = std::move(*tracer);
  return out;
}

RoomSpace::Where RoomSpace::where(const Opening& o, Vec3 at, Vec3 direction) const {
  const int u = (o.axis + 1) % 3, v = (o.axis + 2) % 3;
  const Vec3 extent = o.face.max - o.face.min;
  const Vec2 square = disk_to_square({direction[u], direction[v]});
  const float x[4] = {(at[u] - o.face.min[u]) / extent[u], (at[v] - o.face.min[v]) / extent[v], square.x, square.y};
  const int n[4] = {o.across[0], o.across[1], directions_, directions_};
  Where out;
  for (int a = 0; a < 4; ++a) {
    out.cell[a] = std::clamp(int(x[a] * float(n[a])), 0, n[a] - 1);
    out.within[a] = std::clamp(x[a] * float(n[a]) - float(out.cell[a]), 0.0f, 1.0f);
  }
  return out;
}

uint32_t RoomSpace::cell_of(const Opening& o, Vec3 at, Vec3 direction) const {
  const Where w = where(o, at, direction);
  return uint32_t(((w.cell[3] * directions_ + w.cell[2]) * o.across[1] + w.cell[1]) * o.across[0] + w.cell[0]);
}

Crossing RoomSpace::crossing(const Exit& exit, uint64_t key) const {
  constexpr int steps = 1 << cell_ray_bits;
  const Where at = where(openings[exit.opening], exit.at, exit.direction);
  CellRay ray = key >> 48;
  for (const float x : at.within) ray = ray << cell_ray_bits | uint64_t(std::min(int(x * float(steps)), steps - 1));
  return {exit.opening, exit.cell, ray};
}

NodeRay RoomSpace::ray(const Opening& o, uint32_t cell, CellRay ray) const {
  constexpr int steps = 1 << cell_ray_bits;
  const int n[4] = {o.across[0], o.across[1], directions_, directions_};
  float x[4];
  for (int a = 0; a < 4; ++a, cell /= uint32_t(n[a - 1])) {
    const auto step = uint32_t(ray >> (cell_ray_bits * (3 - a))) % uint32_t(steps);
    x[a] = (float(cell % uint32_t(n[a])) + (float(step) + 0.5f) / float(steps)) / float(n[a]);
  }
  const int u = (o.axis + 1) % 3, v = (o.axis + 2) % 3;
  NodeRay out{o.face.min, Vec3(0)};
  out.origin[u] += x[0] * (o.face.max[u] - o.face.min[u]), out.origin[v] += x[1] * (o.face.max[v] - o.face.min[v]);
  const Vec2 d = square_to_disk({x[2], x[3]});
  const float along = std::sqrt(std::max(1 - d.x * d.x - d.y * d.y, 0.0f));
  out.direction[u] = d.x, out.direction[v] = d.y, out.direction[o.axis] = o.upper ? along : -along;
  return out;
}

Exit RoomSpace::exit(size_t room, Vec3 origin, Vec3 direction, const Hit& hit) const {
  const Bounds& box = rooms[room].box;
  float far = INFINITY;
  int axis = 0;
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) continue;
    const float t = ((direction[a] > 0 ? box.max[a] : box.min[a]) - origin[a]) / direction[a];
    if (t < far) far = t, axis = a;
  }
  far = std::max(far, 0.0f);
  Exit out;
  if (hit.triangle != none && hit.distance <= far + tolerance_) return out;
  const bool upper = direction[axis] > 0;
  out.at = origin + far * direction, out.direction = direction;
  uint32_t nearest = none;
  float least = INFINITY;
  for (const uint32_t i : openings_of_[room]) {
    const Opening& o = openings[i];
    if (o.axis != axis || o.upper != upper) continue;
    const Vec3 away = max(max(o.face.min - out.at, out.at - o.face.max), Vec3(0));
    float square = 0;
    for (int a = 0; a < 3; ++a)
      if (a != axis) square += away[a] * away[a];
    if (square < least) least = square, nearest = i;
  }
  if (nearest == none) {
    out.outside = true;
    return out;
  }
  out.opening = nearest, out.cell = cell_of(openings[nearest], out.at, direction);
  return out;
}

void RoomSpace::clear_nodes() {
  for (Opening& o : openings) o.met = {}, o.rays = {}, o.first = 0;
  nodes_in.assign(rooms.size(), 0);
}

void RoomSpace::number_nodes(const std::vector<uint8_t>& asked) {
  using checkpoint_detail::bytes_of;
  std::vector<uint8_t> mine;
  for (Opening& o : openings) checkpoint_detail::put(mine, bytes_of(o.rays.cells));
  nodes_in.assign(rooms.size(), 0);
  std::vector<std::vector<uint32_t>> cells(openings.size());
  for (const auto& theirs : this_ranks().gather(std::move(mine))) {
    std::span<const uint8_t> part;
    for (size_t i = 0, at = 0; i < openings.size() && checkpoint_detail::get(theirs, at, part); ++i) {
      if (part.empty()) continue;
      cells[i].resize(part.size() / sizeof(uint32_t));
      std::copy(part.begin(), part.end(), bytes_of(cells[i]).begin());
    }
  }
  for (size_t i = 0; i < openings.size(); ++i) {
    Opening& o = openings[i];
    o.first = uint32_t(nodes_in[o.beyond]), nodes_in[o.beyond] += cells[i].size();
    o.met = asked[i] && !cells[i].empty() ? CellSet(this->cells(o), cells[i]) : CellSet();
    cells[i] = {};
  }
}

const Opening& RoomSpace::opening_of(size_t room, size_t node) const {
  const auto& leading = leading_to_[room];
  const auto after = std::upper_bound(leading.begin(), leading.end(), node,
                                      [&](size_t at, uint32_t i) { return at < openings[i].first; });
  return openings[*(after - 1)];
}

size_t RoomSpace::ray_count(size_t room, size_t node) const {
  const Opening& o = opening_of(room, node);
  return o.rays.of(node - o.first).size();
}

std::span<const NodeRay> RoomSpace::rays_of(size_t room, size_t node, std::array<NodeRay, most_node_rays>& out) const {
  const Opening& o = opening_of(room, node);
  const size_t i = node - o.first;
  size_t count = 0;
  for (const CellRay r : o.rays.of(i)) out[count++] = ray(o, o.rays.cells[i], r);
  return {out.data(), count};
}

uint32_t RoomSpace::find_node(const Exit& exit) const {
  const Opening& o = openings[exit.opening];
  if (o.met.empty()) return none;
  if (o.met.has(exit.cell)) return o.first + o.met.number(exit.cell);
  // Around it, in directions and places; the nearest in steps of either.
  const int n[4] = {o.across[0], o.across[1], directions_, directions_};
  int at[4];
  for (uint32_t rest = exit.cell, a = 0; a < 4; ++a) at[a] = int(rest) % n[a], rest /= uint32_t(n[a]);
  constexpr int reach = 3;
  uint32_t best = none;
  int least = 4 * reach + 1;
  for (int l = -reach; l <= reach; ++l)
    for (int k = -reach; k <= reach; ++k)
      for (int j = -reach; j <= reach; ++j)
        for (int i = -reach; i <= reach; ++i) {
          const int steps = std::abs(i) + std::abs(j) + std::abs(k) + std::abs(l);
          const int p[4] = {at[0] + i, at[1] + j, at[2] + k, at[3] + l};
          bool there = steps < least;
          for (int a = 0; a < 4 && there; ++a) there = p[a] >= 0 && p[a] < n[a];
          if (!there) continue;
          const auto cell = uint32_t(((p[3] * n[2] + p[2]) * n[1] + p[1]) * n[0] + p[0]);
          if (o.met.has(cell)) best = cell, least = steps;
        }
  return best == none ? none : o.first + o.met.number(best);
}

size_t RoomSpace::bytes() const {
  size_t sum = 0;
  for (const Opening& o : openings) sum += o.met.bytes() + o.rays.bytes();
  for (const auto& own : triangles_of_) sum += sizeof(uint32_t) * own.size();
  return sum;
}

}  // namespace lambent
