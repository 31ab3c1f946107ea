// Bakes: by a request's JSON, as the command line's; relit and drawn.
#include "bind.h"

#include <lambent/core/overloaded.h>
#include <lambent/pipeline/describe.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/parse.h>
#include <lambent/relight/relighter.h>

#include <chrono>
#include <mutex>

namespace lambent::python {
namespace {

using Floats = py::array_t<float>;

// Of both: name -> what it takes, for turning Python's values into JSON.
template <class R>
py::dict fields_of(std::span<const Option<R>> table) {
  py::dict out;
  for (const Option<R>& o : table) {
    const char* type = std::visit(
        [](auto member) {
          using T = std::remove_cvref_t<decltype(std::declval<R>().*member)>;
          return std::is_same_v<T, bool>                     ? "flag"
               : std::is_same_v<T, std::string>              ? "text"
               : std::is_same_v<T, std::vector<std::string>> ? "list"
                                                             : "number";
        },
        o.member);
    out[json_name(o.name).c_str()] = py::make_tuple(type, o.help);
  }
  return out;
}

struct BakedObject {
  std::string path;
  BakeOutcome outcome;
  std::mutex mutex;  // of the relighter, which works for one thread at a time
  std::optional<Relighter> relighter;
  double seconds = 0;  // that the bake took without Python

  const Baked& baked() const { return outcome.baked; }
  const Field& surface() const { return outcome.baked.surface; }
};
using Pointer = std::shared_ptr<BakedObject>;

Pointer bake_scene(const std::optional<SceneObject>& scene, const std::string& options, const py::object& report) {
  BakeRequest request = take(bake_request(options));
  if (scene) request.loaded = scene->scene, request.scene = scene->scene->hash.empty() ? "" : scene->scene->path;
  auto out = std::make_shared<BakedObject>();
  out->outcome = run<BakeOutcome>(report, [&](const Job& job) {
    const auto start = std::chrono::steady_clock::now();
    auto outcome = bake_with_summary(request, job);
    out->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return outcome;
  });
  return out;
}

std::string plan(const std::optional<SceneObject>& scene, const std::string& options, const py::object& report) {
  BakeRequest request = take(bake_request(options));
  if (scene) request.loaded = scene->scene, request.scene = scene->scene->path;
  return run<Summary>(report, [&](const Job& job) { return plan_bake(request, job); }).json.dump();
}

Pointer open(const std::string& path) {
  const Released released;
  auto file = take(MappedFile::open(path));
  auto out = std::make_shared<BakedObject>();
  out->path = path, out->outcome.baked = take(load_baked(file, path)), out->outcome.look = load_look(file, path);
  return out;
}

std::vector<std::string> save(const BakedObject& o, const std::string& path) {
  const Released released;
  take(check_output(path, {"glb", "gltf"}));
  return take(save_outcome(path, o.outcome)).get<std::vector<std::string>>();
}

const Transfer& dense(const BakedObject& o) {
  const auto* t = std::get_if<Transfer>(&o.surface().store);
  if (!t) throw Failure{{"transfer", std::string("is of ") + name_of(o.surface().store) + ", and no dense array"}};
  return *t;
}

py::array transfer_view(const Transfer& t, const std::shared_ptr<const void>& owner) {
  return view(t.data.data(), t.precision == Precision::half ? "float16" : "float32",
              {ssize_t(t.blocks()), t.rows, t.channels, ssize_t(t.columns()), ssize_t(transfer_block)}, {}, owner);
}

const VertexPlacement& vertices(const BakedObject& o) {
  const VertexPlacement* p = vertices_of(o.baked());
  if (!p) throw Failure{{"receivers", std::string("are at ") + name_of(o.surface().where) + ", not at vertices"}};
  return *p;
}

py::array pairs_of(const BakedObject& o) {
  const auto pairs = std::make_shared<std::vector<std::array<uint32_t, 2>>>(input_receivers(vertices(o)));
  return view(pairs->data(), "uint32", {ssize_t(pairs->size()), 2}, {}, pairs);
}

DrawRequest draw_request(const BakedObject& o, const std::string& options,
                         const std::optional<EnvironmentObject>& env) {
  DrawRequest request;
  take(read_request(draw_options(), nlohmann::json::parse(options), request, request.given));
  request.baked = o.path.empty() ? "baked" : o.path;
  if (env) request.environment = env->environment, request.env = env->environment->name, request.given.insert("env");
  if (env && request.env.empty()) request.env = "environment";
  return request;
}

// Coefficients of the columns, as render() makes them.
Floats columns(const BakedObject& o, const std::string& options, const std::optional<EnvironmentObject>& env) {
  const DrawRequest request = draw_request(o, options, env);
  std::vector<Vec3> light;
  {
    const Released released;
    const Surroundings around = take(surroundings_of(request, Job()));
    light = take(column_light(request, around, light_of(o.surface().store), o.baked().scene.origin)).projection.light;
  }
  Floats out = make_floats({ssize_t(light.size()), 3});
  std::copy_n(reinterpret_cast<const float*>(light.data()), 3 * light.size(), out.mutable_data());
  return out;
}

Floats result_array(const BakedObject& o, const py::object& given) {
  const ssize_t receivers = ssize_t(receivers_of(o.surface().store)), rows = rows_relit(o.surface().store);
  const std::vector<ssize_t> shape = rows == 1 ? std::vector<ssize_t>{receivers, 3}
                                               : std::vector<ssize_t>{receivers, rows, 3};
  if (given.is_none()) return make_floats(shape);
  const bool typed = py::isinstance<py::array_t<float, py::array::c_style>>(given);
  if (!typed || !py::array(given).writeable() ||
      !std::equal(shape.begin(), shape.end(), py::array(given).shape(),
                  py::array(given).shape() + py::array(given).ndim()))
    throw Failure{{"out",
                   "must be a writable float32 array in C order of the shape " + std::string(py::str(py::cast(shape))),
                   true}};
  return py::reinterpret_borrow<Floats>(given);
}

Floats relight(BakedObject& o, const py::object& light, const py::object& given) {
  const std::vector<Vec3> coefficients = vectors(light, "light");
  Floats out = result_array(o, given);
  float* values = out.mutable_data();
  const size_t size = size_t(out.size()), stride = 3 * size_t(rows_relit(o.surface().store));
  const Released released;
  const std::lock_guard lock(o.mutex);
  if (!o.relighter) o.relighter.emplace(take(Relighter::make(o.surface())));
  take(o.relighter->set_light(coefficients));
  take(o.relighter->relight({}, {values, size}, stride));
  return out;
}

std::vector<ImageObject> render(const BakedObject& o, const std::string& options,
                                const std::optional<EnvironmentObject>& env, const py::object& report) {
  const DrawRequest request = draw_request(o, options, env);
  Drawing drawing = run<Drawing>(report, [&](const Job& job) { return draw(o.baked(), request, job); });
  std::vector<ImageObject> out;
  for (Image& frame : drawing.frames) out.push_back({std::make_shared<Image>(std::move(frame))});
  return out;
}

py::list terms(const Pointer& o) {
  py::list out;
  for (const Transfer& t : o->baked().terms) out.append(transfer_view(t, o));
  return out;
}

}  // namespace

void bind_baked(py::module_& m) {
  m.attr("bake_fields") = fields_of(bake_options()), m.attr("draw_fields") = fields_of(draw_options());
  py::class_<BakedObject, Pointer>(m, "Baked")
      .def_property_readonly("path", [](const BakedObject& o) { return o.path; })
      .def_property_readonly("scene",
                             [](const Pointer& o) {
                               return SceneObject{{o, &o->baked().scene}};
                             })
      .def("_describe", [](const BakedObject& o) { return describe(o.surface()).dump(); })
      .def("_provenance", [](const BakedObject& o) { return o.baked().provenance; })
      .def("_summary", [](const BakedObject& o) { return o.outcome.summary.json.dump(); })
      .def_property_readonly("receivers", [](const BakedObject& o) { return receivers_of(o.surface().store); })
      .def_property_readonly("order", [](const BakedObject& o) { return light_of(o.surface().store).order; })
      .def_property_readonly("channels", [](const BakedObject& o) { return channels_of(o.surface().store); })
      .def_property_readonly("rows", [](const BakedObject& o) { return rows_relit(o.surface().store); })
      .def_property_readonly("groups", [](const BakedObject& o) { return light_of(o.surface().store).groups; })
      .def_property_readonly("lobes",
                             [](const BakedObject& o) {
                               const LightBasis light = light_of(o.surface().store);
                               Floats out = make_floats({ssize_t(light.lobes.size()), 4});
                               for (size_t i = 0; i < light.lobes.size(); ++i) {
                                 const Lobe& l = light.lobes[i];
                                 const float row[4] = {l.axis.x, l.axis.y, l.axis.z, l.sharpness};
                                 std::copy_n(row, 4, out.mutable_data() + 4 * i);
                               }
                               return out;
                             })
      .def_property_readonly("transfer", [](const Pointer& o) { return transfer_view(dense(*o), o); })
      .def_property_readonly("terms", &terms)
      .def_property_readonly("front", [](const Pointer& o) { return vectors_view(vertices(*o).front, o); })
      .def_property_readonly("back", [](const Pointer& o) { return vectors_view(vertices(*o).back, o); })
      .def_property_readonly("input", [](const Pointer& o) { return vectors_view(vertices(*o).input, o); })
      .def_property_readonly("input_count", [](const BakedObject& o) { return vertices(o).input_count; })
      .def_readonly("_seconds", &BakedObject::seconds)
      .def("_pairs", &pairs_of)
      .def("_save", &save)
      .def("_columns", &columns)
      .def("_relight", &relight)
      .def("_render", &render);
  m.def("bake", &bake_scene), m.def("plan", &plan), m.def("open", &open);
}

}  // namespace lambent::python
