// Scenes, and features of bare meshes.
#include "bind.h"

#include <lambent/bake/features.h>
#include <lambent/core/parallel.h>
#include <lambent/pipeline/bake_parse.h>
#include <lambent/pipeline/parse.h>
#include <lambent/light/project.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/light.h>
#include <lambent/scene/arrays.h>
#include <lambent/scene/load.h>
#include <lambent/trace/tracer.h>

#include <atomic>
#include <cstring>
#include <mutex>

namespace lambent::python {
namespace {

SceneObject scene_of_arrays(const py::object& vertices, const py::object& faces, const py::object& colors,
                            const py::object& normals, const py::object& texcoords) {
  const auto wide = numbers(vertices, "vertices", 3);
  const std::vector<uint32_t> corners = indices(faces, "faces", 3, size_t(wide.shape(0)));
  const auto optional_vectors = [](const py::object& value, const char* name) {
    return value.is_none() ? std::vector<Vec3>() : vectors(value, name);
  };
  const std::vector<Vec3> n = optional_vectors(normals, "normals"), c = optional_vectors(colors, "colors");
  std::vector<Vec2> uv;
  if (!texcoords.is_none()) {
    const auto t = numbers(texcoords, "texcoords", 2);
    for (ssize_t i = 0; i < t.shape(0); ++i) uv.push_back(Vec2(t.data()[2 * i], t.data()[2 * i + 1]));
  }
  const std::span<const Vec3d> places(reinterpret_cast<const Vec3d*>(wide.data()), size_t(wide.shape(0)));
  const Released released;
  return {std::make_shared<Scene>(take(scene_from_arrays({places, corners, n, c, uv})))};
}

SceneObject load(const std::filesystem::path& path) {
  const Released released;
  return {std::make_shared<Scene>(take(load_scene(path.string())))};
}

// As a bake with these options would have it.
SceneObject prepared(const SceneObject& o, const std::string& options) {
  BakeRequest request = take(bake_request(options));
  request.loaded = o.scene;
  std::vector<std::string> warnings;
  const Job job{nullptr, [&](const std::string& line) { warnings.push_back(line); }};
  std::optional<Result<Scene>> scene;
  {
    const Released released;
    scene.emplace(load_scene_of(request, job));
  }
  for (const std::string& line : warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, line.c_str(), 1) != 0) throw py::error_already_set();
  auto made = std::make_shared<Scene>(take(std::move(*scene)));
  made->warnings.clear();  // told
  return {made};
}

ImageObject reference(const SceneObject& o, const std::optional<EnvironmentObject>& light, const std::string& camera,
                      const std::string& size, const std::string& brdf, const std::string& window, int light_order,
                      const std::string& background, const ReferenceOptions& asked, const py::object& report) {
  if (!light && !asked.lamps) throw Failure{{"env", "is needed, or lamps=True", true}};
  if (background != "env" && background != "none")
    throw Failure{{"background", "must be one of env, none, not \"" + background + "\"", true}};
  if (light_order < 0 || light_order > max_sh_order)
    throw Failure{{"light_order", "must lie between 0 and " + std::to_string(max_sh_order), true}};
  ReferenceOptions options = asked;
  options.reflection = take(parse_reflection(brdf));
  const View view = take(parse_view(camera, size, *o.scene));
  const ShWindow ringing = take(parse_window(window));
  options.width = view.width, options.height = view.height, options.background = background == "env";
  return {std::make_shared<Image>(run<Image>(report, [&](const Job& job) -> Result<Image> {
    Environment env = light ? *light->environment : make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
    if (light_order > 0) {
      const LightProjection p = project_light(env, LightBasis{.order = light_order}, Mat3(1.0f), light_order, ringing);
      env = reconstruct_environment(p.basis, p.light);
    }
    auto traced = path_trace(*o.scene, env, view.camera, options, job.progress);
    if (!traced) return traced.error();
    return std::move(traced->image);
  }))};
}

py::tuple features(const py::object& vertices, const py::object& faces, const py::object& normals, int order,
                   int samples, uint32_t seed, double offset, const py::object& report) {
  const std::vector<Vec3> places = vectors(vertices, "vertices");
  const std::vector<uint32_t> corners = indices(faces, "faces", 3, places.size());
  std::vector<Vec3> n = normals.is_none() ? angle_normals(places, corners) : vectors(normals, "normals");
  if (n.size() != places.size())
    throw Failure{
        {"normals",
         "has " + std::to_string(n.size()) + " rows where there are " + std::to_string(places.size()) + " vertices",
         true}};
  const FeatureOptions options{order, samples, seed, float(offset)};
  auto values = std::make_shared<std::vector<float>>(run<std::vector<float>>(
      report, [&](const Job& job) { return prt_features(places, corners, n, options, job.progress); }));
  py::array_t<float> out(std::vector<ssize_t>{ssize_t(places.size()), order * order});
  std::copy(values->begin(), values->end(), out.mutable_data());
  return py::make_tuple(out, vectors_view(n, std::make_shared<std::vector<Vec3>>()).attr("copy")());
}

// For scripts/bench python: whether single rays, one after another, meet anything.
py::array_t<bool> single_rays(const SceneObject& o, const py::object& origins, const py::object& directions) {
  const std::vector<Vec3> from = vectors(origins, "origins"), along = vectors(directions, "directions");
  if (from.size() != along.size()) throw Failure{{"directions", "must be as many as origins", true}};
  py::array_t<bool> out(ssize_t(from.size()));
  bool* hits = out.mutable_data();
  const Released released;
  static std::mutex mutex;  // of the tracer that is kept from call to call
  static std::pair<std::shared_ptr<const Scene>, Tracer> kept;
  const std::lock_guard lock(mutex);
  if (kept.first != o.scene) kept = {o.scene, take(Tracer::build(*o.scene))};
  for (size_t i = 0; i < from.size(); ++i) hits[i] = kept.second.closest(from[i], along[i]).triangle != none;
  return out;
}

// And how fast memory is read: a plain sum over it, on all cores.
uint64_t sum_of_words(const py::array& a) {
  const auto* data = static_cast<const uint8_t*>(a.data());
  const size_t lines = size_t(a.nbytes()) / 128;
  std::atomic<uint64_t> total{0};
  const Released released;
  parallel_for(lines, size_t{1} << 13, [&](size_t begin, size_t end) {
    uint64_t sums[16] = {};
    for (size_t i = begin; i < end; ++i) {
      uint64_t words[16];
      std::memcpy(words, data + i * 128, 128);
      for (int k = 0; k < 16; ++k) sums[k] += words[k];
    }
    for (uint64_t s : sums) total += s;
  });
  return total;
}

}  // namespace

void bind_scene(py::module_& m) {
  py::class_<SceneObject>(m, "Scene", "A scene: triangles, materials, lamps. It does not change.")
      .def(py::init(&scene_of_arrays), py::arg("vertices"), py::arg("faces"), py::arg("colors") = py::none(),
           py::arg("normals") = py::none(), py::arg("texcoords") = py::none(),
           "From arrays: vertices (n, 3), faces (m, 3) of whole numbers, and a value a vertex of colors (linear "
           "albedo, 0 "
           "to 1), normals and texcoords (v down). All are copied.")
      .def_property_readonly("path", [](const SceneObject& o) { return o.scene->path; })
      .def_property_readonly("warnings", [](const SceneObject& o) { return o.scene->warnings; })
      .def_property_readonly(
          "vertices", [](const SceneObject& o) { return vectors_view(o.scene->positions, o.scene); },
          "float32 (n, 3), metres from `origin`, in the order of the scene (see `input`).")
      .def_property_readonly("normals", [](const SceneObject& o) { return vectors_view(o.scene->normals, o.scene); })
      .def_property_readonly("colors", [](const SceneObject& o) { return vectors_view(o.scene->colors, o.scene); })
      .def_property_readonly(
          "faces",
          [](const SceneObject& o) {
            const auto& t = o.scene->triangles;
            return view(t.empty() ? nullptr : &t[0].v, "uint32", {ssize_t(t.size()), 3}, {sizeof(Triangle), 4},
                        o.scene);
          },
          "uint32 (m, 3)")
      .def_property_readonly(
          "input", [](const SceneObject& o) { return vectors_view(o.scene->input, o.scene); },
          "uint32 (n,): which vertex of the input each one is; 4294967295 for those that were made.")
      .def_property_readonly("input_count", [](const SceneObject& o) { return o.scene->input_count; })
      .def_property_readonly("origin",
                             [](const SceneObject& o) {
                               const Vec3d p = o.scene->origin;
                               return py::make_tuple(p.x, p.y, p.z);
                             })
      .def_property_readonly("bounds",
                             [](const SceneObject& o) {
                               const Bounds b = bounds(*o.scene);
                               return py::make_tuple(py::make_tuple(b.min.x, b.min.y, b.min.z),
                                                     py::make_tuple(b.max.x, b.max.y, b.max.z));
                             })
      .def("_prepared", &prepared);
  m.def("load", &load, py::arg("path"), "Loads a scene: .gltf, .glb, .obj or .ply.");
  m.def(
      "reference",
      [](const SceneObject& o, const std::optional<EnvironmentObject>& env, const std::string& camera,
         const std::string& size, const std::string& brdf, const std::string& window, int light_order,
         const std::string& background, int spp, int bounces, uint32_t seed, bool lamps, const py::object& report) {
        ReferenceOptions options;
        options.spp = spp, options.bounces = bounces, options.seed = seed, options.lamps = lamps;
        return reference(o, env, camera, size, brdf, window, light_order, background, options, report);
      },
      py::arg("scene"), py::arg("env"), py::kw_only(), py::arg("camera"), py::arg("size"), py::arg("brdf"),
      py::arg("window"), py::arg("light_order"), py::arg("background"), py::arg("spp"), py::arg("bounces"),
      py::arg("seed"), py::arg("lamps"), py::arg("report"));
  m.def("single_rays", &single_rays), m.def("sum_of_words", &sum_of_words);
  m.def("features", &features, py::arg("vertices"), py::arg("faces"), py::arg("normals"), py::arg("order"),
        py::arg("samples"), py::arg("seed"), py::arg("offset"), py::arg("report"));
}

}  // namespace lambent::python
