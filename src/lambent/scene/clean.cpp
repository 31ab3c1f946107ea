#include <lambent/core/check.h>
#include <lambent/core/random.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/clean_parts.h>

#include <algorithm>
#include <bit>

namespace lambent {
namespace {

// Triangles whose first corner by position is at one position.
struct FanTriangle {
  uint32_t low, high;  // positions of the other two
  uint32_t triangle;
  bool turned;  // runs by the higher one first
  auto operator<=>(const FanTriangle&) const = default;
};

uint64_t hash_position(Vec3 p) {
  return hash64(uint64_t(std::bit_cast<uint32_t>(p.x)) << 32 | std::bit_cast<uint32_t>(p.y),
                std::bit_cast<uint32_t>(p.z));
}

bool has_repeated_corner(const CornerFans& fans, uint32_t t) {
  const uint32_t* id = &fans.ids[3 * size_t(t)];
  return id[0] == id[1] || id[1] == id[2] || id[2] == id[0];
}

// Components connected over shared positions, in order of their first ones.
struct Components {
  std::vector<uint32_t> of_position;
  uint32_t count = 0;
};

Components connect(const CornerFans& fans) {
  UnionFind connected(fans.first.size() - 1);
  for (size_t c = 0; c < fans.ids.size(); c += 3)
    connected.join(fans.ids[c], fans.ids[c + 1]), connected.join(fans.ids[c], fans.ids[c + 2]);
  Components out;
  out.of_position.resize(connected.parent.size());
  for (uint32_t p = 0; p < out.of_position.size(); ++p) {
    const uint32_t first = connected.find(p);  // the smallest
    out.of_position[p] = first == p ? out.count++ : out.of_position[first];
  }
  return out;
}

// By component: whether each of its edges has two faces, which run along it in opposite directions.
std::vector<uint8_t> closed_components(const CornerFans& fans, const Components& components) {
  std::vector<uint8_t> closed(components.count, 1);
  std::vector<uint64_t> ends;  // of edges to higher positions: that position, and which way the face runs
  for (uint32_t p = 0; p + 1 < fans.first.size(); ++p) {
    if (fans.is_ring[p]) continue;
    ends.clear();
    for (uint32_t i = fans.first[p]; i < fans.first[p + 1]; ++i) {
      uint32_t c = fans.corners[i], next = fans.ids[next_corner(c)], previous = fans.ids[previous_corner(c)];
      if (has_repeated_corner(fans, c / 3)) continue;
      if (next > p) ends.push_back(uint64_t(next) * 2);
      if (previous > p) ends.push_back(uint64_t(previous) * 2 + 1);
    }
    std::sort(ends.begin(), ends.end());
    bool paired = ends.size() % 2 == 0;
    for (size_t i = 0; i + 1 < ends.size() && paired; i += 2)
      paired = ends[i] % 2 == 0 && ends[i + 1] == ends[i] + 1 && (i == 0 || ends[i] / 2 != ends[i - 1] / 2);
    if (!paired) closed[components.of_position[p]] = 0;
  }
  return closed;
}

// Puts the corners at one position in the order of their ring; false, and untouched, where they make none.
bool order_ring(const CornerFans& fans, std::span<uint32_t> corners) {
  constexpr size_t most = 32;
  const size_t count = corners.size();
  if (count < 3 || count > most) return false;
  uint32_t next[most], previous[most], ring[most];
  for (size_t i = 0; i < count; ++i)
    next[i] = fans.ids[next_corner(corners[i])], previous[i] = fans.ids[previous_corner(corners[i])];
  // Each face is followed by the first that begins where it ends. A walk that went round without the first corner would
  // never come to it in the end, so that one which does has seen all.
  size_t at = 0;
  ring[0] = corners[0];
  for (size_t i = 1; i < count; ++i) {
    size_t j = 0;
    while (j < count && previous[j] != next[at]) ++j;
    if (j == count || j == 0) return false;
    ring[i] = corners[j], at = j;
  }
  if (next[at] != previous[0]) return false;
  std::copy(ring, ring + count, corners.begin());
  return true;
}

}  // namespace

PositionIds number_positions(std::span<const Vec3> positions) {
  LAMBENT_CHECK(positions.size() < none);
  // By hash into buckets that fit a cache, so that time grows with the positions alone; each is searched by itself.
  constexpr size_t bucket_size = 4096;
  struct Entry {
    Vec3 p;
    uint32_t index;
  };
  const size_t count = positions.size(), buckets = std::bit_ceil(count / bucket_size + 1);
  const int shift = 64 - std::bit_width(buckets - 1);
  auto bucket_of = [&](uint64_t hash) { return buckets == 1 ? 0 : size_t(hash >> shift); };
  std::vector<uint32_t> first(buckets + 1, 0);
  for (Vec3 p : positions) ++first[bucket_of(hash_position(p + 0.0f)) + 1];  // -0 becomes 0
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Entry> entries(count);
  std::vector<uint32_t> end(first.begin(), first.end() - 1);
  for (uint32_t i = 0; i < count; ++i) {
    Vec3 p = positions[i] + 0.0f;
    entries[end[bucket_of(hash_position(p))]++] = {p, i};
  }
  PositionIds out;
  out.ids.resize(count);  // first where each position comes first
  std::vector<uint32_t> slots;
  for (size_t b = 0; b < buckets; ++b) {
    slots.assign(std::bit_ceil(std::max<size_t>(2 * (first[b + 1] - first[b]), 16)), none);
    for (uint32_t e = first[b]; e < first[b + 1]; ++e) {
      size_t slot = size_t(hash_position(entries[e].p)) & (slots.size() - 1);
      while (slots[slot] != none && !(entries[slots[slot]].p == entries[e].p)) slot = (slot + 1) & (slots.size() - 1);
      if (slots[slot] == none) slots[slot] = e;
      out.ids[entries[e].index] = entries[slots[slot]].index;
    }
  }
  for (uint32_t i = 0; i < count; ++i) out.ids[i] = out.ids[i] == i ? out.count++ : out.ids[out.ids[i]];
  return out;
}

CornerFans corner_fans(const Scene& scene) {
  LAMBENT_CHECK(scene.triangles.size() <= 0xffffffffu / 3);
  const PositionIds positions = number_positions(scene.positions);
  CornerFans fans;
  fans.ids.resize(3 * scene.triangles.size());
  fans.first.assign(positions.count + size_t{1}, 0);
  for (size_t t = 0; t < scene.triangles.size(); ++t)
    for (size_t k = 0; k < 3; ++k) ++fans.first[(fans.ids[3 * t + k] = positions.ids[scene.triangles[t].v[k]]) + 1];
  std::partial_sum(fans.first.begin(), fans.first.end(), fans.first.begin());
  fans.corners.resize(fans.ids.size());
  std::vector<uint32_t> end(fans.first.begin(), fans.first.end() - 1);
  for (uint32_t c = 0; c < fans.ids.size(); ++c) fans.corners[end[fans.ids[c]]++] = c;
  fans.is_ring.resize(positions.count);
  for (size_t p = 0; p < positions.count; ++p)
    fans.is_ring[p] = order_ring(fans, {fans.corners.data() + fans.first[p], fans.corners.data() + fans.first[p + 1]});
  return fans;
}

namespace {

// Removes triangles from their parts.
void drop_triangles(Scene& scene, const std::vector<uint8_t>& dropped) {
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

// The same for all orders of its corners.
uint64_t triangle_key(const Scene& s, const Triangle& t) {
  uint64_t sum = 0;
  for (uint32_t v : t.v) sum += hash_position(s.positions[v] + 0.0f);  // -0 becomes 0
  return hash64(sum);
}

// Keys that more than one triangle has, sorted, and a few that only seem so: each sets three of a table's marks, which
// others may have set (Bloom 1970, "Space/time trade-offs in hash coding with allowable errors").
std::vector<uint64_t> repeated_keys(const Scene& scene) {
  const size_t size = std::bit_ceil(std::max<size_t>(8 * scene.triangles.size(), 64));
  std::vector<bool> marks(size);
  std::vector<uint64_t> keys;
  for (const Triangle& t : scene.triangles) {
    const uint64_t key = triangle_key(scene, t), more = hash64(key);
    bool seen = true;
    for (uint64_t place : {key, more, more >> 32}) {
      auto mark = marks[size_t(place) & (size - 1)];
      seen = seen && mark;
      mark = true;
    }
    if (seen) keys.push_back(key);
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

using Corners = std::array<Vec3, 3>;

// A triangle's corners from its lowest on, and whether they run by the higher of the others first; false where two are
// one.
bool sorted_corners(const Scene& s, const Triangle& t, Corners& out, bool& turned) {
  auto before = [](Vec3 a, Vec3 b) { return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z; };
  int low = 0;
  for (int k = 1; k < 3; ++k)
    if (before(s.positions[t.v[k]], s.positions[t.v[low]])) low = k;
  for (int k = 0; k < 3; ++k) out[size_t(k)] = s.positions[t.v[(low + k) % 3]];
  turned = before(out[2], out[1]);
  if (turned) std::swap(out[1], out[2]);
  return !(out[0] == out[1]) && !(out[1] == out[2]);
}

}  // namespace

bool merge_duplicate_triangles(Scene& scene) {
  // Of most scenes next to nothing is left after the first look, which takes a byte or two a triangle.
  const std::vector<uint64_t> keys = repeated_keys(scene);
  if (keys.empty()) return false;
  std::vector<std::pair<uint64_t, uint32_t>> suspects;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const uint64_t key = triangle_key(scene, scene.triangles[t]);
    if (std::binary_search(keys.begin(), keys.end(), key)) suspects.push_back({key, t});
  }
  std::sort(suspects.begin(), suspects.end());
  std::vector<uint8_t> dropped;
  struct Seen {
    Corners corners;
    uint32_t kept[2];  // the first that turns either way
  };
  std::vector<Seen> seen;  // of one key; more than one where keys are equal by chance
  for (size_t i = 0; i < suspects.size(); ++i) {
    if (i == 0 || suspects[i].first != suspects[i - 1].first) seen.clear();
    const uint32_t t = suspects[i].second;
    Corners corners;
    bool turned;
    if (!sorted_corners(scene, scene.triangles[t], corners, turned)) continue;
    auto at = std::find_if(seen.begin(), seen.end(), [&](const Seen& s) { return s.corners == corners; });
    if (at == seen.end()) at = seen.insert(seen.end(), {corners, {none, none}});
    uint32_t& first = at->kept[turned];
    if (first != none) {
      if (dropped.empty()) dropped.resize(scene.triangles.size());
      dropped[t] = 1;
      continue;
    }
    first = t;
    if (at->kept[!turned] != none)
      scene.triangles[at->kept[0]].two_sided = scene.triangles[at->kept[1]].two_sided = true;
  }
  if (dropped.empty()) return false;
  drop_triangles(scene, dropped);
  return true;
}

bool merge_duplicate_triangles(Scene& scene, const CornerFans& fans) {
  std::vector<uint8_t> dropped(scene.triangles.size(), 0);
  bool any = false;
  std::vector<FanTriangle> fan;
  for (uint32_t p = 0; p + 1 < fans.first.size(); ++p) {
    if (fans.is_ring[p]) continue;  // of three faces at least, of which no two share two edges
    fan.clear();
    for (uint32_t i = fans.first[p]; i < fans.first[p + 1]; ++i) {
      uint32_t c = fans.corners[i], next = fans.ids[next_corner(c)], previous = fans.ids[previous_corner(c)];
      if (next > p && previous > p && next != previous)
        fan.push_back({std::min(next, previous), std::max(next, previous), c / 3, next > previous});
    }
    if (fan.size() < 2) continue;
    std::sort(fan.begin(), fan.end());
    for (size_t begin = 0, end = 0; begin < fan.size(); begin = end) {
      uint32_t kept[2] = {none, none};  // the first that turns either way
      for (; end < fan.size() && fan[end].low == fan[begin].low && fan[end].high == fan[begin].high; ++end) {
        uint32_t& first = kept[fan[end].turned];
        if (first == none) {
          first = fan[end].triangle;
        } else {
          dropped[fan[end].triangle] = any = true;
        }
      }
      if (kept[0] != none && kept[1] != none)
        scene.triangles[kept[0]].two_sided = scene.triangles[kept[1]].two_sided = true;
    }
  }
  if (!any) return false;
  drop_triangles(scene, dropped);
  return true;
}

void infer_sidedness(Scene& scene) { infer_sidedness(scene, corner_fans(scene)); }

void infer_sidedness(Scene& scene, const CornerFans& fans) {
  // Of the area to the power 3/2: far above the rounding of the sums, far below any solid sheet.
  constexpr double smallest_volume = 1e-11;
  const Components components = connect(fans);
  std::vector<uint8_t> one_sided = closed_components(fans, components);
  auto component_of = [&](size_t t) { return components.of_position[fans.ids[3 * t]]; };
  // The volume of what is closed is the same about any apex: one of its own corners, so that little cancels.
  struct Sums {
    uint32_t apex = none;
    double volume = 0, area = 0;
  };
  std::vector<Sums> sums(components.count);
  if (std::find(one_sided.begin(), one_sided.end(), 1) != one_sided.end()) {
    for (size_t t = 0; t < scene.triangles.size(); ++t) {
      if (!one_sided[component_of(t)]) continue;
      Sums& s = sums[component_of(t)];
      const Triangle& triangle = scene.triangles[t];
      if (s.apex == none) s.apex = triangle.v[0];
      const Vec3d normal = wide_area_normal(scene, triangle);
      s.volume += dot(Vec3d(scene.positions[triangle.v[0]]) - Vec3d(scene.positions[s.apex]), normal) / 6;
      s.area += length(normal) / 2;
    }
  }
  for (uint32_t c = 0; c < components.count; ++c)
    one_sided[c] = one_sided[c] && sums[c].volume > smallest_volume * std::pow(sums[c].area, 1.5);
  for (size_t t = 0; t < scene.triangles.size(); ++t) scene.triangles[t].two_sided = !one_sided[component_of(t)];
}

}  // namespace lambent
