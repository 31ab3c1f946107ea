#include <lambent/scene/exclude.h>

#include <algorithm>

namespace lambent {
namespace {

// Moves a run towards the front; values that the scene does not have stay none.
template <class T>
void move_run(std::vector<T>& values, size_t from, size_t count, size_t to) {
  if (values.empty()) return;
  const auto first = values.begin() + ptrdiff_t(from);
  std::move(first, first + ptrdiff_t(count), values.begin() + ptrdiff_t(to));
}

template <class T>
void shorten(std::vector<T>& values, size_t count) {
  values.erase(values.begin() + ptrdiff_t(std::min(count, values.size())), values.end());
}

void remove_parts(Scene& scene, const std::vector<uint8_t>& out) {
  size_t parts = 0, vertices = 0, triangles = 0;
  auto each_attribute = [&](auto f) {
    f(scene.positions), f(scene.normals), f(scene.colors), f(scene.tangents), f(scene.input);
    for (auto& set : scene.texcoords) f(set);
  };
  for (size_t p = 0; p < scene.parts.size(); ++p) {
    if (out[p]) continue;
    Part part = std::move(scene.parts[p]);
    const uint32_t fewer = part.first_vertex - uint32_t(vertices);
    each_attribute([&](auto& values) { move_run(values, part.first_vertex, part.vertex_count, vertices); });
    move_run(scene.triangles, part.first_triangle, part.triangle_count, triangles);
    for (size_t t = triangles; t < triangles + part.triangle_count; ++t) {
      scene.triangles[t].part = uint32_t(parts);
      for (uint32_t& v : scene.triangles[t].v) v -= fewer;
    }
    part.first_vertex = uint32_t(vertices), part.first_triangle = uint32_t(triangles);
    vertices += part.vertex_count, triangles += part.triangle_count;
    scene.parts[parts++] = std::move(part);
  }
  each_attribute([&](auto& values) { shorten(values, vertices); });
  shorten(scene.triangles, triangles), shorten(scene.parts, parts);
}

}  // namespace

std::vector<std::string> exclude_parts(Scene& scene, std::span<const std::string> words) {
  std::vector<std::string> unknown;
  std::vector<uint8_t> out(scene.parts.size(), 0);
  for (const std::string& word : words) {
    bool any = false;
    for (size_t p = 0; p < scene.parts.size(); ++p) {
      const Material& m = scene.materials[scene.parts[p].material];
      if (scene.parts[p].name != word && m.name != word && !(word == unlit_word && m.unlit)) continue;
      out[p] = 1, any = true;
    }
    (any ? scene.excluded : unknown).push_back(word);
  }
  remove_parts(scene, out);
  return unknown;
}

}  // namespace lambent
