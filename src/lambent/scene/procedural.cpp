#include <lambent/core/check.h>
#include <lambent/scene/index_table.h>
#include <lambent/scene/procedural.h>

namespace lambent {
namespace {

struct Mesh {
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
};

void append_quad(Mesh& mesh, Vec3 origin, Vec3 a, Vec3 b, int na, int nb) {
  LAMBENT_CHECK(na >= 1 && nb >= 1);
  uint32_t first = uint32_t(mesh.positions.size()), row = uint32_t(na) + 1;
  Vec3 normal = normalize_or(cross(a, b), {0, 1, 0});
  for (int j = 0; j <= nb; ++j) {
    for (int i = 0; i <= na; ++i) {
      mesh.positions.push_back(origin + (float(i) / float(na)) * a + (float(j) / float(nb)) * b);
      mesh.normals.push_back(normal);
      if (i == na || j == nb) continue;
      uint32_t v = first + uint32_t(j) * row + uint32_t(i);
      mesh.indices.insert(mesh.indices.end(), {v, v + 1, v + row + 1, v, v + row + 1, v + row});
    }
  }
}

// Unit icosahedron, each triangle split in four `levels` times, corners on the sphere.
Mesh icosphere(int levels) {
  const float g = std::numbers::phi_v<float>;
  Mesh mesh;
  for (Vec3 p : {Vec3(-1, g, 0), Vec3(1, g, 0), Vec3(-1, -g, 0), Vec3(1, -g, 0), Vec3(0, -1, g), Vec3(0, 1, g),
                 Vec3(0, -1, -g), Vec3(0, 1, -g), Vec3(g, 0, -1), Vec3(g, 0, 1), Vec3(-g, 0, -1), Vec3(-g, 0, 1)})
    mesh.normals.push_back(normalize(p));
  mesh.indices = {0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4,  11, 10, 2,  10, 7, 6, 7, 1, 8,
                  3, 9,  4, 3, 4, 2, 3, 2, 6, 3, 6, 8,  3, 8,  9,  4, 9, 5, 2, 4,  11, 6,  2,  10, 8,  6, 7, 9, 8, 1};
  for (int level = 0; level < levels; ++level) {
    IndexTable table(mesh.indices.size());
    std::vector<uint64_t> edges;
    uint32_t first = uint32_t(mesh.normals.size());
    auto middle = [&](uint32_t a, uint32_t b) {
      uint64_t edge = uint64_t(std::min(a, b)) << 32 | std::max(a, b);
      uint32_t m =
          table.find_or_insert(hash64(edge), uint32_t(edges.size()), [&](uint32_t k) { return edges[k] == edge; });
      if (m == edges.size())
        edges.push_back(edge), mesh.normals.push_back(normalize(mesh.normals[a] + mesh.normals[b]));
      return first + m;
    };
    std::vector<uint32_t> finer;
    finer.reserve(4 * mesh.indices.size());
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      uint32_t a = mesh.indices[i], b = mesh.indices[i + 1], c = mesh.indices[i + 2];
      uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca});
    }
    mesh.indices = std::move(finer);
  }
  return mesh;
}

void turn_inside_out(Mesh& mesh) {
  for (Vec3& n : mesh.normals) n = -n;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) std::swap(mesh.indices[i + 1], mesh.indices[i + 2]);
}

void add(Scene& scene, uint32_t material, std::string name, const Mesh& mesh) {
  add_mesh(scene, material, std::move(name), mesh.positions, mesh.normals, mesh.indices);
}

}  // namespace

uint32_t add_material(Scene& scene, std::string name, Vec3 albedo) {
  Material material;
  material.name = std::move(name), material.base_color = albedo;
  material.metallic = 0, material.roughness = 1, material.double_sided = false;
  scene.materials.push_back(std::move(material));
  return uint32_t(scene.materials.size() - 1);
}

void add_mesh(Scene& scene, uint32_t material, std::string name, std::span<const Vec3> positions,
              std::span<const Vec3> normals, std::span<const uint32_t> indices) {
  LAMBENT_CHECK(normals.size() == positions.size() && indices.size() % 3 == 0 && material < scene.materials.size());
  LAMBENT_CHECK(scene.positions.size() + positions.size() < none && scene.triangles.size() + indices.size() / 3 < none);
  Part part;
  part.name = std::move(name), part.material = material;
  part.first_vertex = uint32_t(scene.positions.size()), part.vertex_count = uint32_t(positions.size());
  part.first_triangle = uint32_t(scene.triangles.size()), part.triangle_count = uint32_t(indices.size() / 3);
  scene.positions.insert(scene.positions.end(), positions.begin(), positions.end());
  scene.normals.insert(scene.normals.end(), normals.begin(), normals.end());
  // What the rest of the scene has and these vertices lack.
  for (auto& uv : scene.texcoords)
    if (!uv.empty()) uv.resize(scene.positions.size(), Vec2(0));
  if (!scene.colors.empty()) scene.colors.resize(scene.positions.size(), Vec3(1));
  if (!scene.input.empty()) scene.input.resize(scene.positions.size(), none);
  for (size_t i = 0; i < indices.size(); i += 3) {
    Triangle t{{}, uint32_t(scene.parts.size()), false};
    for (size_t k = 0; k < 3; ++k) {
      LAMBENT_CHECK(indices[i + k] < positions.size());
      t.v[k] = part.first_vertex + indices[i + k];
    }
    scene.triangles.push_back(t);
  }
  scene.parts.push_back(std::move(part));
}

void add_quad(Scene& scene, uint32_t material, std::string name, Vec3 origin, Vec3 a, Vec3 b, int na, int nb) {
  Mesh mesh;
  append_quad(mesh, origin, a, b, na, nb);
  add(scene, material, std::move(name), mesh);
}

void add_box(Scene& scene, uint32_t material, std::string name, Vec3 min, Vec3 max, int n, bool inward) {
  Vec3 x(max.x - min.x, 0, 0), y(0, max.y - min.y, 0), z(0, 0, max.z - min.z);
  Mesh mesh;
  append_quad(mesh, min, z, y, n, n);
  append_quad(mesh, min + x, y, z, n, n);
  append_quad(mesh, min, x, z, n, n);
  append_quad(mesh, min + y, z, x, n, n);
  append_quad(mesh, min, y, x, n, n);
  append_quad(mesh, min + z, x, y, n, n);
  if (inward) turn_inside_out(mesh);
  add(scene, material, std::move(name), mesh);
}

void add_sphere(Scene& scene, uint32_t material, std::string name, Vec3 centre, float radius, int levels, bool inward) {
  LAMBENT_CHECK(levels >= 0 && levels <= 12);
  Mesh mesh = icosphere(levels);
  for (Vec3 n : mesh.normals) mesh.positions.push_back(centre + radius * n);
  if (inward) turn_inside_out(mesh);
  add(scene, material, std::move(name), mesh);
}

Scene make_sphere(float radius, int levels, Vec3 albedo, bool inward) {
  Scene scene;
  add_sphere(scene, add_material(scene, "sphere", albedo), "sphere", Vec3(0), radius, levels, inward);
  return scene;
}

Scene make_quad(Vec3 origin, Vec3 a, Vec3 b, int na, int nb, Vec3 albedo) {
  Scene scene;
  add_quad(scene, add_material(scene, "quad", albedo), "quad", origin, a, b, na, nb);
  return scene;
}

}  // namespace lambent
