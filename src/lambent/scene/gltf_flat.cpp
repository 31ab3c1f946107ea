// glTF 2.0 specification (ISO/IEC 12113), section 3.7.2.1: "When normals are not specified, client implementations MUST
// calculate flat normals".
#include <lambent/scene/gltf_flat.h>

#include <lambent/scene/clean.h>
#include <lambent/scene/index_table.h>

#include <cstring>

namespace lambent {
namespace {

template <class F>
void each_array(Scene& a, Scene& b, F f) {
  f(a.positions, b.positions), f(a.normals, b.normals), f(a.colors, b.colors), f(a.tangents, b.tangents);
  f(a.input, b.input);
  for (size_t set = 0; set < a.texcoords.size(); ++set) f(a.texcoords[set], b.texcoords[set]);
}

// The last part as a scene of its own, so that work on it takes no memory for the others.
Scene take_last(Scene& scene) {
  Scene out;
  out.parts.push_back(std::move(scene.parts.back()));
  out.texcoords.resize(scene.texcoords.size());
  const Part& part = out.parts.back();
  const size_t vertex = part.first_vertex, triangle = part.first_triangle;
  auto take = [](auto& from, auto& to, size_t first) {
    if (first == 0) {
      to = std::move(from), from.clear();
    } else if (!from.empty()) {
      to.assign(from.begin() + ptrdiff_t(first), from.end());
      from.resize(first);
    }
  };
  each_array(scene, out, [&](auto& from, auto& to) { take(from, to, vertex); });
  take(scene.triangles, out.triangles, triangle);
  for (Triangle& t : out.triangles) {
    t.part = 0;
    for (uint32_t& v : t.v) v -= part.first_vertex;
  }
  out.parts.back().first_vertex = out.parts.back().first_triangle = 0;
  return out;
}

void put_back(Scene& scene, Scene&& last) {
  Part& part = last.parts.back();
  const size_t vertex = scene.positions.size(), triangle = scene.triangles.size();
  part.first_vertex = uint32_t(vertex), part.first_triangle = uint32_t(triangle);
  part.vertex_count = uint32_t(last.positions.size());
  const uint32_t number = uint32_t(scene.parts.size()) - 1;
  for (Triangle& t : last.triangles) {
    t.part = number;
    for (uint32_t& v : t.v) v += part.first_vertex;
  }
  auto put = [](auto& from, auto& to, size_t first) {
    if (first == 0) to = std::move(from);
    else to.insert(to.end(), from.begin(), from.end());
  };
  each_array(last, scene, [&](auto& from, auto& to) { put(from, to, vertex); });
  put(last.triangles, scene.triangles, triangle);
  scene.parts.back() = std::move(part);
}

bool alike(const GltfAccessor& a, size_t i, size_t j) {
  const uint8_t *x = a.element(i), *y = a.element(j);
  return x && y ? !std::memcmp(x, y, a.element_size) : x == y;
}

uint64_t bits(Vec3 p) {
  auto pair = [](float a, float b) { return uint64_t(std::bit_cast<uint32_t>(a)) << 32 | std::bit_cast<uint32_t>(b); };
  return hash64(pair(p.x, p.y), pair(p.z, 0));
}

// Makes alike vertices that triangles use one. The part has a map to the document's vertices.
void weld(Scene& s, std::span<const GltfAccessor> attributes) {
  std::vector<uint32_t>& source = s.parts[0].source;
  std::vector<uint32_t> place(s.positions.size(), none);
  for (const Triangle& t : s.triangles)
    for (uint32_t v : t.v) place[v] = 0;
  IndexTable table(s.positions.size());
  uint32_t kept = 0;
  for (uint32_t v = 0; v < place.size(); ++v) {
    const bool used = place[v] != none;
    place[v] = kept;
    if (used) {
      place[v] = table.find_or_insert(hash64(bits(s.positions[v]), bits(s.normals[v])), kept, [&](uint32_t k) {
        return s.positions[k] == s.positions[v] && s.normals[k] == s.normals[v] &&
               std::all_of(attributes.begin(), attributes.end(),
                           [&](const GltfAccessor& a) { return alike(a, source[k], source[v]); });
      });
    }
    if (place[v] != kept) continue;
    source[kept] = source[v];
    each_array(s, s, [&](auto& values, auto&) {
      if (!values.empty()) values[kept] = values[v];
    });
    ++kept;
  }
  each_array(s, s, [&](auto& values, auto&) {
    if (!values.empty()) values.resize(kept);
  });
  source.resize(kept);
  for (Triangle& t : s.triangles)
    for (uint32_t& v : t.v) v = place[v];
  s.parts[0].vertex_count = kept;
}

// Counts Scene::input anew, so that no number is missing.
size_t renumber(std::vector<uint32_t>& input, size_t before) {
  std::vector<uint32_t> number(before, none);
  for (uint32_t i : input) number[i] = 0;
  uint32_t left = 0;
  for (uint32_t& n : number)
    if (n != none) n = left++;
  for (uint32_t& i : input) i = number[i];
  return left;
}

}  // namespace

size_t flatten_last_part(Scene& scene, std::span<const GltfAccessor> attributes) {
  Scene last = take_last(scene);
  number_inputs(last);
  const size_t before = last.positions.size();
  make_normals(last, 0, true);
  size_t left = before;
  if (!attributes.empty()) {
    weld(last, attributes);
    left = renumber(last.input, before);
  }
  put_back(scene, std::move(last));
  return left;
}

}  // namespace lambent
