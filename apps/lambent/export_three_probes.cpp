#include "export_three_probes.h"

#include <lambent/basis/sh_convert.h>
#include <lambent/core/file.h>
#include <lambent/core/half.h>

#include <fmt/format.h>

#include <array>
#include <filesystem>

namespace lambent::tool {
namespace {

constexpr size_t group_count = 7;  // 27 numbers, four a texel

}  // namespace

std::vector<uint16_t> three_probe_atlas(const Probes& probes) {
  const Lattice& l = probes.lattice;
  const size_t layer = size_t(l.nx) * size_t(l.ny), slices = size_t(l.nz) + 2;
  std::vector<uint16_t> atlas(4 * layer * slices * group_count);
  const ShConvention three = *parse_sh_convention("three");
  for (size_t z = 0; z < size_t(l.nz); ++z)
    for (size_t i = 0; i < layer; ++i) {
      const std::vector<Vec3> sh = convert_sh(probes.sh[z * layer + i], three);
      for (size_t k = 0; k < 27; ++k)
        atlas[4 * (layer * (k / 4 * slices + z + 1) + i) + k % 4] = float_to_half(sh[k / 3][int(k % 3)]);
    }
  for (size_t t = 0; t < group_count; ++t) {
    uint16_t* group = atlas.data() + 4 * layer * slices * t;
    std::copy_n(group + 4 * layer, 4 * layer, group);
    std::copy_n(group + 4 * layer * (slices - 2), 4 * layer, group + 4 * layer * (slices - 1));
  }
  return atlas;
}

int export_three_probes(Context& context, const std::string& baked, const std::string& prefix,
                        const LightOptions& light) {
  if (light.env.empty())
    return fail({"--three-probes", "needs --env: a lattice holds the light of no sky before one is named", true});
  LightmapExport request;
  request.probes = baked, request.light = light;
  auto probes = load_probes(request);
  if (!probes) return fail(probes.error());
  const Lattice& l = probes->lattice;
  const std::vector<uint16_t> atlas = three_probe_atlas(*probes);
  // Probes stand in the middles of cells.
  const Vec3 cells(float(l.nx), float(l.ny), float(l.nz)), size = (l.max - l.min) * cells / (cells - 1.0f),
                                                           middle = 0.5f * (l.min + l.max);
  const auto list = [](Vec3 v) { return nlohmann::json{v.x, v.y, v.z}; };
  const nlohmann::json json{{"size", list(size)},
                            {"position", list(middle)},
                            {"resolution", {l.nx, l.ny, l.nz}},
                            {"atlas",
                             {{"file", LightmapWriter::base(prefix) + ".probes.bin"},
                              {"width", l.nx},
                              {"height", l.ny},
                              {"depth", int(group_count) * (l.nz + 2)},
                              {"format", "RGBA"},
                              {"type", "half float"}}}};
  const std::string script = (std::filesystem::path(prefix).parent_path() / "lambent_probes.js").string();
  const std::vector<std::string> files{prefix + ".probes.json", prefix + ".probes.bin", script};
  const std::span<const uint8_t> bytes{reinterpret_cast<const uint8_t*>(atlas.data()), 2 * atlas.size()};
  for (auto& ok :
       {write_file_atomically(files[0], json.dump(1) + "\n"), write_file_atomically(files[1], std::array{bytes}),
        write_file_atomically(files[2], std::string_view(carried_file("three/lambent_probes.js")))})
    if (!ok) return fail(ok.error());
  if (context.json) print_json({{"files", files}, {"points", l.count()}});
  else fmt::print("{}\n{}\n{}\n  {} points\n", files[0], files[1], files[2], l.count());
  return success;
}

}  // namespace lambent::tool
