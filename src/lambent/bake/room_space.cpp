#include <lambent/bake/room_space.h>

#include <lambent/core/sampling.h>

#include <algorithm>
#include <cmath>

namespace lambent {

RoomSpace::RoomSpace(const Scene& scene, const std::vector<Room>& given, int places, int directions)
    : rooms(given),
      nodes_of(given.size()),
      bounds_(room_bounds(scene)),
      tolerance_(1e-5f * bounds_.diagonal()),
      directions_(directions),
      openings_of_(given.size()),
      kept_(given.size(), 1) {
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
          o.node.assign(size_t(o.across[0]) * size_t(o.across[1]) * size_t(directions * directions), none);
          openings_of_[i].push_back(uint32_t(openings.size()));
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
  RoomGeometry out{std::make_unique<Scene>(), {}, {}};
  Scene& own = *out.scene;
  std::vector<uint32_t> place(scene.positions.size(), none);
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    Bounds reach;
    for (uint32_t v : t.v) reach.extend(scene.positions[v]);
    if (!is_reached(room, reach)) continue;
    Triangle copy = t;
    for (uint32_t& v : copy.v) {
      if (place[v] == none) place[v] = uint32_t(own.positions.size()), own.positions.push_back(scene.positions[v]);
      v = place[v];
    }
    own.triangles.push_back(copy), out.triangles.push_back(i);
  }
  own.parts = scene.parts, own.materials = scene.materials;
  for (Material& m : own.materials) m.base_color_texture = -1;  // textures stay with the scene
  auto tracer = Tracer::build(own);
  if (!tracer) return tracer.error();
  out.tracer = std::move(*tracer);
  return out;
}

uint32_t RoomSpace::cell_of(const Opening& o, Vec3 at, Vec3 direction) const {
  const int u = (o.axis + 1) % 3, v = (o.axis + 2) % 3;
  const auto cell = [](float x, int n) { return std::clamp(int(x * float(n)), 0, n - 1); };
  const Vec3 extent = o.face.max - o.face.min;
  const int i = cell((at[u] - o.face.min[u]) / extent[u], o.across[0]),
            j = cell((at[v] - o.face.min[v]) / extent[v], o.across[1]);
  const Vec2 square = disk_to_square({direction[u], direction[v]});
  const int k = cell(square.x, directions_), l = cell(square.y, directions_);
  return uint32_t(((l * directions_ + k) * o.across[1] + j) * o.across[0] + i);
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

void RoomSpace::clear_nodes(std::vector<uint8_t> kept) {
  kept_ = std::move(kept);
  for (Opening& o : openings) o.node.assign(o.handed ? 0 : o.node.size(), none), o.node.shrink_to_fit();
  nodes_of.assign(rooms.size(), {});
  slot_ = {}, rays_ = {}, counts_ = {}, number_ = {};
}

void RoomSpace::take(const Crossing& crossing, std::vector<std::vector<uint32_t>>& fresh) {
  Opening& o = openings[crossing.exit.opening];
  uint32_t& node = o.node[crossing.exit.cell];
  if (node == none) {
    node = uint32_t(slot_.size());
    slot_.push_back(kept_[o.beyond] ? uint32_t(counts_.size()) : none);
    if (kept_[o.beyond]) counts_.push_back(0), rays_.resize(counts_.size() * size_t(most_node_rays));
    fresh[o.beyond].push_back(node);
  }
  const uint32_t slot = slot_[node];
  if (slot == none) return;
  const NodeRay ray{crossing.exit.at, crossing.exit.direction, crossing.key};
  NodeRay* const own = rays_.data() + size_t(slot) * most_node_rays;
  if (counts_[slot] < most_node_rays) {
    own[counts_[slot]++] = ray;
    return;
  }
  NodeRay* const greatest =
      std::max_element(own, own + most_node_rays, [](const NodeRay& a, const NodeRay& b) { return a.key < b.key; });
  if (ray.key < greatest->key) *greatest = ray;
}

void RoomSpace::number_nodes() {
  number_.assign(slot_.size(), none);
  for (const Opening& o : openings)
    for (const uint32_t node : o.node)
      if (node != none) number_[node] = uint32_t(nodes_of[o.beyond].size()), nodes_of[o.beyond].push_back(node);
}

uint32_t RoomSpace::find_node(const Exit& exit) const {
  const Opening& o = openings[exit.opening];
  if (const uint32_t node = o.node[exit.cell]; node != none) return number_[node];
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
          const uint32_t node = o.node[size_t(((p[3] * n[2] + p[2]) * n[1] + p[1]) * n[0] + p[0])];
          if (node != none) best = number_[node], least = steps;
        }
  return best;
}

size_t RoomSpace::bytes() const {
  size_t sum = rays_.size() * sizeof(NodeRay) + counts_.size() + 12 * slot_.size();
  for (const Opening& o : openings) sum += 4 * o.node.size();
  return sum;
}

}  // namespace lambent
