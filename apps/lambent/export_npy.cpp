// NumPy's format: "numpy.lib.format", version 1.0.
#include "export_npy.h"

#include <lambent/baked/baked_file.h>
#include <lambent/basis/sh_convert.h>

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <numbers>

namespace lambent::tool {
namespace {

namespace fs = std::filesystem;

template <class T>
Result<void> write_npy(const std::string& path, const char* type, size_t columns, const std::vector<T>& values) {
  std::string header = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}, {}), }}", type,
                                   values.size() / columns, columns);
  constexpr size_t start = 10, alignment = 64;
  header.append(alignment - 1 - (start + header.size()) % alignment, ' ');
  header += '\n';
  const std::string head = std::string("\x93NUMPY\x01\x00", 8) + char(header.size() % 256) + char(header.size() / 256) +
                           header;
  const std::span<const uint8_t> pieces[] = {
      {reinterpret_cast<const uint8_t*>(head.data()), head.size()},
      {reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)}};
  return write_file_atomically(path, pieces);
}

// As numpy.savetxt(fmt="%.8f") writes it.
Result<void> write_text(const std::string& path, size_t columns, const std::vector<float>& values) {
  std::string text;
  for (size_t i = 0; i < values.size(); ++i) text += fmt::format("{:.8f}{}", values[i], (i + 1) % columns ? ' ' : '\n');
  return write_file_atomically(path, text);
}

struct Features {
  size_t vertices = 0, columns = 0;
  std::vector<float> values;   // [vertex of the input][column]; 0 where it has no receiver
  std::vector<int64_t> faces;  // of the input's vertices
};

int known_corners(const VertexPlacement& at, const uint32_t* v) {
  return int(at.input[v[0]] != no_receiver) + int(at.input[v[1]] != no_receiver) + int(at.input[v[2]] != no_receiver);
}

// What of a bake such pipelines can take.
Result<const Transfer*> transfer_of(const Baked& baked, const std::string& path) {
  const auto* t = std::get_if<Transfer>(&baked.surface.store);
  const VertexPlacement* at = vertices_of(baked);
  if (!t || !at || !std::holds_alternative<DiffuseRows>(baked.surface.rows) || t->columns() == 0 ||
      t->columns() != size_t(sh_count(t->light.order)))
    return Error{path, "--npy takes diffuse transfer of harmonics at vertices"};
  if (t->channels != 1)
    return Error{path, "has coloured bounces, and --npy one channel: bake with --bounces 0, or grey surfaces"};
  if (at->input.empty()) return Error{path, "does not know the vertices of its input: bake again"};
  for (const Triangle& triangle : baked.scene.triangles)
    if (const int known = known_corners(*at, triangle.v); known != 0 && known != 3)
      return Error{path,
                   "its mesh was split where light changes, so its faces are not the input's: bake with --adapt "
                   "off, and without --max-edge"};
  return t;
}

Features features_of(const Baked& baked, const Transfer& t, ShConvention convention) {
  const VertexPlacement& at = *vertices_of(baked);
  Features out{at.input_count, 0, {}, {}};
  std::vector<double> scales;
  for (size_t i = 0; i < t.columns(); ++i)
    if (const double scale = sh_scale(convention, int(i)); scale != 0) scales.push_back(std::numbers::pi / scale);
  out.columns = scales.size();
  std::vector<double> sums(out.vertices * out.columns);
  std::vector<uint32_t> count(out.vertices);
  for (const auto& [vertex, receiver] : input_receivers(at)) {
    const std::vector<float> row = load_receiver(t, receiver);
    for (size_t k = 0; k < out.columns; ++k) sums[vertex * out.columns + k] += row[k] * scales[k];
    ++count[vertex];
  }
  for (size_t i = 0; i < sums.size(); ++i)
    out.values.push_back(float(sums[i] / std::max(1u, count[i / std::max<size_t>(1, out.columns)])));
  for (const Triangle& triangle : baked.scene.triangles) {
    const uint32_t* v = triangle.v;
    if (known_corners(at, v) < 3) continue;  // of the ground
    for (int k = 0; k < 3; ++k) out.faces.push_back(at.input[v[k]]);
  }
  return out;
}

}  // namespace

int export_npy(Context& context, const std::string& path, const std::string& folder, const std::string& convention) {
  const auto sh = parse_sh_convention(convention);
  if (!sh)
    return fail({"--convention",
                 "must be one of pifu, icon, lambent, three, unity, godot, gltf-ibl, filament, directx, not \"" +
                     convention + "\"",
                 true});
  auto baked = load_baked(path);
  if (!baked) return fail(baked.error());
  auto transfer = transfer_of(*baked, path);
  if (!transfer) return fail(transfer.error());
  const bool pifu = convention == "pifu", icon = convention == "icon";
  const Features f = features_of(*baked, **transfer, *sh);
  const fs::path into = fs::path(folder) / (pifu ? "bounce" : "");
  const std::string values = (into / (pifu   ? "bounce0.txt"
                                      : icon ? "bounce.npy"
                                             : "prt.npy"))
                                 .string(),
                    faces = (into / (pifu || icon ? "face.npy" : "faces.npy")).string();
  std::error_code status;
  fs::create_directories(into, status);
  if (status) return fail({folder, "cannot be written: " + status.message()});
  if (auto ok = pifu ? write_text(values, f.columns, f.values) : write_npy(values, "<f4", f.columns, f.values); !ok)
    return fail(ok.error());
  if (auto ok = write_npy(faces, "<i8", 3, f.faces); !ok) return fail(ok.error());
  if (context.json)
    print_json({{"values", values}, {"faces", faces}, {"vertices", f.vertices}, {"columns", f.columns}});
  else fmt::print("{}\n{}\n  {} vertices, {} numbers each\n", values, faces, human_count(f.vertices), f.columns);
  return success;
}

}  // namespace lambent::tool
