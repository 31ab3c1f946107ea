// Light in free space as engines keep it. Godot's tree and tetrahedra: LightmapGIData's probe_data, and how
// lightmap_tap_sh_light walks them (servers/rendering/renderer_rd/storage_rd/light_storage.cpp). Cells are cut into six
// tetrahedra by the order of their coordinates (Freudenthal 1942, Kuhn 1960), so that neighbours share faces.
#include "lightmap_writer.h"

#include <lambent/basis/sh_convert.h>
#include <lambent/light/project.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relighter.h>

#include <bit>

namespace lambent::tool {
namespace {

// An axis with one layer gets a second one, of the same light.
Probes thickened(const Probes& given) {
  Probes out;
  out.lattice = given.lattice;
  out.lattice.nx = std::max(2, given.lattice.nx), out.lattice.ny = std::max(2, given.lattice.ny);
  out.lattice.nz = std::max(2, given.lattice.nz);
  for (int k = 0; k < 3; ++k) {  // a flat box has no inside
    const float thick = 1e-3f * std::max({out.lattice.max.x - out.lattice.min.x, out.lattice.max.y - out.lattice.min.y,
                                          out.lattice.max.z - out.lattice.min.z, 1e-3f});
    if (out.lattice.max[k] - out.lattice.min[k] < thick) out.lattice.max[k] = out.lattice.min[k] + thick;
  }
  for (size_t i = 0; i < out.lattice.count(); ++i) {
    const auto at = out.lattice.place(i);
    out.points.push_back(out.lattice.position(i));
    out.sh.push_back(
        given.sh[given.lattice.index(std::min(at[0], given.lattice.nx - 1), std::min(at[1], given.lattice.ny - 1),
                                     std::min(at[2], given.lattice.nz - 1))]);
  }
  return out;
}

struct TreeBuilder {
  const Lattice& lattice;
  std::vector<int32_t> tree;

  int32_t add(Vec3d normal, Vec3d through) {
    normal /= length(normal);
    const int32_t node = int32_t(tree.size() / 6);
    for (double x : {normal.x, normal.y, normal.z, dot(normal, through)})
      tree.push_back(std::bit_cast<int32_t>(float(x)));
    tree.push_back(INT32_MIN), tree.push_back(INT32_MIN);
    return node;
  }
  void set(int32_t node, int32_t over, int32_t under) {
    tree[size_t(node) * 6 + 4] = over, tree[size_t(node) * 6 + 5] = under;
  }
  // Cells [low, high) an axis.
  int32_t split(std::array<int, 3> low, std::array<int, 3> high) {
    size_t axis = 0;
    for (size_t k = 1; k < 3; ++k)
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    if (high[axis] - low[axis] == 1) return cell(low);
    const int middle = (low[axis] + high[axis]) / 2;
    std::array<int, 3> corner = low, upper = low, lower = high;
    corner[axis] = upper[axis] = lower[axis] = middle;
    Vec3d normal(0);
    normal[int(axis)] = 1;
    const int32_t node = add(normal, Vec3d(lattice.position(lattice.index(corner[0], corner[1], corner[2]))));
    const int32_t over = split(upper, high), under = split(low, lower);
    set(node, over, under);
    return node;
  }
  // Which of a cell's coordinates, in [0, 1], is larger: three planes, five nodes.
  int32_t cell(std::array<int, 3> at) {
    const Vec3d origin(lattice.position(lattice.index(at[0], at[1], at[2])));
    const Vec3d size = Vec3d(lattice.position(lattice.index(at[0] + 1, at[1] + 1, at[2] + 1))) - origin;
    const int32_t first =
        6 * ((at[2] * (lattice.ny - 1) + at[1]) * (lattice.nx - 1) + at[0]);  // in the order of kuhn_orders
    auto leaf = [&](int k) { return -(first + k + 1); };
    auto larger = [&](int a, int b) {
      Vec3d normal(0);
      normal[a] = 1 / size[a], normal[b] = -1 / size[b];
      return add(normal, origin);
    };
    const int32_t xy = larger(0, 1), yz = larger(1, 2), xz = larger(0, 2), xz2 = larger(0, 2), yz2 = larger(1, 2);
    set(xy, yz, xz2);
    set(yz, leaf(0), xz), set(xz, leaf(1), leaf(2));     // x > y: xyz; xzy, zxy
    set(xz2, leaf(3), yz2), set(yz2, leaf(4), leaf(5));  // y > x: yxz; yzx, zyx
    return xy;
  }
};

constexpr std::array<std::array<int, 3>, 6> kuhn_orders{
    {{0, 1, 2}, {0, 2, 1}, {2, 0, 1}, {1, 0, 2}, {1, 2, 0}, {2, 1, 0}}};

}  // namespace

Result<Probes> load_probes(const LightmapExport& o) {
  auto baked = load_baked(o.probes);
  if (!baked) return baked.error();
  const Field* field = lattice_of(*baked);
  if (!field) return Error{o.probes, "holds no light in free space: bake it with --lattice NX,NY,NZ"};
  auto env = load_light(o.light);
  if (!env) return env.error();
  auto rotation = light_rotation(o.light);
  if (!rotation) return rotation.error();
  auto relighter = Relighter::make(*field);
  if (!relighter) return relighter.error();
  if (auto ok = relighter->set_light(project_light(*env, relighter->light(), *rotation).light); !ok) return ok.error();
  Relit relit;
  if (auto ok = relighter->relight({}, relit); !ok) return ok.error();
  Probes probes;
  probes.lattice = std::get<LatticePlacement>(field->where).lattice;
  for (size_t i = 0; i < probes.lattice.count(); ++i) {
    std::vector<Vec3> sh(9, Vec3(0));
    for (int row = 0; row < std::min(9, relit.rows); ++row) sh[size_t(row)] = relit.at(i, row);
    probes.sh.push_back(std::move(sh));
  }
  return thickened(probes);
}

nlohmann::json probes_json(const Probes& probes, const std::string& convention, bool mirror_x) {
  using Json = nlohmann::json;
  const float side = mirror_x ? -1.0f : 1.0f;
  Json positions = Json::array(), sh = Json::array();
  for (size_t i = 0; i < probes.points.size(); ++i) {
    for (float x : {side * probes.points[i].x, probes.points[i].y, probes.points[i].z}) positions.push_back(x);
    for (const Vec3& c :
         convert_sh(mirror_x ? mirror_sh_x(probes.sh[i]) : probes.sh[i], *parse_sh_convention(convention)))
      for (float x : {c.x, c.y, c.z}) sh.push_back(x);
  }
  const Lattice& l = probes.lattice;
  const float x0 = side * l.min.x, x1 = side * l.max.x;
  return {{"convention", convention},
          {"counts", Json::array({l.nx, l.ny, l.nz})},
          {"min", Json::array({std::min(x0, x1), l.min.y, l.min.z})},
          {"max", Json::array({std::max(x0, x1), l.max.y, l.max.z})},
          {"positions", positions},
          {"sh", sh}};
}

GodotProbes godot_probes(const Lattice& lattice) {
  GodotProbes out;
  for (int z = 0; z + 1 < lattice.nz; ++z)
    for (int y = 0; y + 1 < lattice.ny; ++y)
      for (int x = 0; x + 1 < lattice.nx; ++x)
        for (const auto& order : kuhn_orders) {
          std::array<int, 3> at{x, y, z};
          out.tetrahedra.push_back(int32_t(lattice.index(at[0], at[1], at[2])));
          for (int axis : order) {
            ++at[size_t(axis)];
            out.tetrahedra.push_back(int32_t(lattice.index(at[0], at[1], at[2])));
          }
        }
  TreeBuilder builder{lattice, {}};
  builder.split({0, 0, 0}, {lattice.nx - 1, lattice.ny - 1, lattice.nz - 1});
  out.tree = std::move(builder.tree);
  return out;
}

}  // namespace lambent::tool
