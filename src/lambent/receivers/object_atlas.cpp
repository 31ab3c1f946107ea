#include <lambent/receivers/object_atlas.h>

#include <lambent/receivers/atlas.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

namespace lambent {
namespace {

constexpr int margin = 2;  // texels beyond those that bilinear look-ups reach

// A connected piece of one side of a part: its corners' box in the atlas.
struct Island {
  Vec2 low{INFINITY}, high{-INFINITY};
  std::vector<TexelTriangle*> triangles;
  int x = 0, y = 0, width = 0, height = 0;  // texels taken, the margin with them
};

uint32_t root_of(std::vector<uint32_t>& parents, uint32_t v) {
  while (parents[v] != v) v = parents[v] = parents[parents[v]];
  return v;
}

// Of one side of the whole scene, by part: triangles that share vertices.
std::vector<std::vector<Island>> islands_of(const Scene& scene, std::vector<TexelTriangle>& side) {
  std::vector<uint32_t> parents(scene.positions.size());
  std::iota(parents.begin(), parents.end(), 0u);
  for (size_t i = 0; i < side.size(); ++i) {
    if (side[i].part == none) continue;
    const uint32_t* v = scene.triangles[i].v;
    for (int k = 1; k < 3; ++k) parents[root_of(parents, v[k])] = root_of(parents, v[0]);
  }
  std::vector<std::vector<Island>> out(scene.parts.size());
  std::map<uint32_t, std::pair<uint32_t, size_t>> known;  // by root: part, island
  for (size_t i = 0; i < side.size(); ++i) {
    if (side[i].part == none) continue;
    const uint32_t part = scene.triangles[i].part, root = root_of(parents, scene.triangles[i].v[0]);
    const auto [at, fresh] = known.try_emplace(root, part, out[part].size());
    if (fresh) out[part].emplace_back();
    Island& island = out[part][at->second.second];
    island.triangles.push_back(&side[i]);
    for (const Vec2& p : side[i].at)
      island.low = Vec2(std::min(island.low.x, p.x), std::min(island.low.y, p.y)),
      island.high = Vec2(std::max(island.high.x, p.x), std::max(island.high.y, p.y));
  }
  for (std::vector<Island>& islands : out)
    for (Island& s : islands) {
      s.x = int(std::floor(s.low.x - 0.5f)) - margin, s.y = int(std::floor(s.low.y - 0.5f)) - margin;
      s.width = int(std::floor(s.high.x - 0.5f)) + 2 + margin - s.x;
      s.height = int(std::floor(s.high.y - 0.5f)) + 2 + margin - s.y;
    }
  return out;
}

void pack(ObjectAtlas& object, std::vector<Island*>& islands, const TexelReceivers& texels) {
  std::vector<std::array<int, 2>> sizes;
  double area = 0;
  int width = 1;
  for (const Island* s : islands) {
    sizes.push_back({s->width, s->height});
    area += double(s->width) * double(s->height), width = std::max(width, s->width);
  }
  const Packing packing = pack_shelves(sizes, std::max(width, int(std::ceil(std::sqrt(1.1 * area)))));
  object.height = int(packing.height);
  for (size_t k = 0; k < islands.size(); ++k) object.width = std::max(object.width, packing.places[k][0] + sizes[k][0]);
  object.source.assign(size_t(object.width) * size_t(object.height), none);
  const Vec2 scale(float(texels.width) / float(std::max(1, object.width)),
                   float(texels.height) / float(std::max(1, object.height)));
  for (size_t k = 0; k < islands.size(); ++k) {
    Island& s = *islands[k];
    const auto [left, top] = packing.places[k];
    for (int y = 0; y < s.height; ++y)
      for (int x = 0; x < s.width; ++x) {  // look-ups beyond the atlas find its border
        const int from_x = std::clamp(s.x + x, 0, texels.width - 1), from_y = std::clamp(s.y + y, 0, texels.height - 1);
        object.source[size_t(top + y) * size_t(object.width) + size_t(left + x)] =
            uint32_t(from_y) * uint32_t(texels.width) + uint32_t(from_x);
      }
    for (TexelTriangle* t : s.triangles)
      for (Vec2& p : t->at) p = (p + Vec2(float(left - s.x), float(top - s.y))) * scale;
  }
}

}  // namespace

std::vector<ObjectAtlas> split_atlas(const Scene& scene, TexelReceivers& texels) {
  std::vector<std::vector<Island>> front = islands_of(scene, texels.front), back = islands_of(scene, texels.back);
  std::vector<ObjectAtlas> objects;
  std::map<int, size_t> by_node;
  std::set<std::string> taken;
  for (uint32_t p = 0; p < scene.parts.size(); ++p) {
    const int node = scene.parts[p].node;
    const auto known = node < 0 ? by_node.end() : by_node.find(node);
    if (known != by_node.end()) {
      objects[known->second].parts.push_back(p);
      continue;
    }
    if (node >= 0) by_node[node] = objects.size();
    const std::string given = scene.parts[p].name.empty() ? "object" : scene.parts[p].name;
    std::string name = given;
    for (int i = 2; !taken.insert(name).second; ++i) name = given + "_" + std::to_string(i);
    ObjectAtlas object;
    object.name = name, object.parts = {p};
    objects.push_back(std::move(object));
  }
  for (ObjectAtlas& object : objects) {
    std::vector<Island*> islands;
    for (uint32_t p : object.parts)
      for (auto* side : {&front, &back})
        for (Island& island : (*side)[p]) islands.push_back(&island);
    if (!islands.empty()) pack(object, islands, texels);
  }
  return objects;
}

}  // namespace lambent
