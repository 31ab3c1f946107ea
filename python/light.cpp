// Environments and spherical harmonics.
#include "bind.h"

#include <lambent/basis/sh.h>
#include <lambent/basis/sh_convert.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/parallel.h>
#include <lambent/light/project.h>
#include <lambent/pipeline/parse.h>

namespace lambent::python {
namespace {

using Floats = py::array_t<float>;
using Doubles = py::array_t<double, py::array::c_style>;

int checked_order(int order) {
  if (order < 1 || order > max_sh_order)
    throw Failure{
        {"order", "must lie between 1 and " + std::to_string(max_sh_order) + ", not " + std::to_string(order), true}};
  return order;
}

int order_of(size_t coefficients, const char* name) {
  for (int n = 1; n <= max_sh_order; ++n)
    if (size_t(sh_count(n)) == coefficients) return n;
  throw Failure{{name, "has " + std::to_string(coefficients) + " coefficients, which is no square up to 256", true}};
}

Floats array_of(const std::vector<Vec3>& values) {
  Floats out = make_floats({ssize_t(values.size()), 3});
  std::copy_n(reinterpret_cast<const float*>(values.data()), 3 * values.size(), out.mutable_data());
  return out;
}

Mat3 matrix_of(const py::handle& value) {
  const Doubles a = numbers(value, "rotation", 3);
  if (a.shape(0) != 3) throw Failure{{"rotation", "must have the shape (3, 3)", true}};
  Mat3 R;
  double worst = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      R[size_t(j)][size_t(i)] = float(a.at(i, j));  // columns
      double dot = 0;
      for (int k = 0; k < 3; ++k) dot += a.at(i, k) * a.at(j, k);
      worst = std::max(worst, std::abs(dot - (i == j)));
    }
  if (!(worst < 1e-4)) throw Failure{{"rotation", "is no rotation: its rows are not orthonormal", true}};
  return R;
}

Floats evaluate(int order, const py::object& directions) {
  checked_order(order);
  const std::vector<Vec3> d = vectors(directions, "directions");
  Floats out = make_floats({ssize_t(d.size()), sh_count(order)});
  float* values = out.mutable_data();
  const Released released;
  parallel_for(d.size(), 1024, [&](size_t begin, size_t end) {
    const size_t n = size_t(sh_count(order));
    for (size_t i = begin; i < end; ++i) evaluate_sh(order, normalize(d[i]), {values + i * n, n});
  });
  return out;
}

// The function is asked once, for all directions.
Doubles project(int order, const py::function& function, int exact_order) {
  checked_order(order);
  if (exact_order < order || exact_order > 256)
    throw Failure{{"exact_order", "must lie between the order and 256", true}};
  std::vector<Vec3d> directions;
  project_sh(
      order, [&](Vec3d d) { return directions.push_back(d), 0.0; }, exact_order);
  Doubles asked({ssize_t(directions.size()), ssize_t(3)});
  std::copy_n(reinterpret_cast<const double*>(directions.data()), asked.size(), asked.mutable_data());
  const Doubles values = numbers(function(asked), "the function's values", 0);
  if (size_t(values.size()) != directions.size())
    throw Failure{{"the function's values", "must be one a direction", true}};
  size_t next = 0;
  const std::vector<double> c = project_sh(
      order, [&](Vec3d) { return values.data()[next++]; }, exact_order);
  return Doubles(ssize_t(c.size()), c.data());
}

// f of [n^2] or [n^2, k], column by column.
template <class F>
Floats by_column(const py::object& coefficients, F f) {
  const py::array given = py::array::ensure(coefficients);
  if (!given || given.ndim() < 1 || given.ndim() > 2)
    throw Failure{{"coefficients", "must have the shape (n,) or (n, channels)", true}};
  const bool flat = given.ndim() == 1;
  const ssize_t columns = flat ? 1 : given.shape(1);
  const Doubles a =
      numbers(flat ? py::object(given.attr("reshape")(-1, 1)) : py::object(given), "coefficients", columns);
  const size_t n = size_t(a.shape(0));
  std::vector<std::vector<float>> out;
  for (ssize_t c = 0; c < columns; ++c) {
    std::vector<float> column(n);
    for (size_t i = 0; i < n; ++i) column[i] = float(a.at(ssize_t(i), c));
    out.push_back(f(column));
  }
  const ssize_t rows = out.empty() ? 0 : ssize_t(out[0].size());
  Floats result = flat ? make_floats({rows}) : make_floats({rows, columns});
  for (ssize_t i = 0; i < rows; ++i)
    for (ssize_t c = 0; c < columns; ++c) result.mutable_data()[i * columns + c] = out[size_t(c)][size_t(i)];
  return result;
}

Floats rotate(const py::object& coefficients, const py::object& rotation) {
  const Mat3 R = matrix_of(rotation);
  return by_column(coefficients, [&](const std::vector<float>& c) {
    std::vector<float> out(c.size());
    rotate_sh(make_sh_rotation(order_of(c.size(), "coefficients"), R), c, out);
    return out;
  });
}

Floats convert(const py::object& coefficients, const std::string& to, bool transfer) {
  const auto convention = parse_sh_convention(to);
  if (!convention)
    throw Failure{
        {"convention",
         "must be one of lambent, filament, directx, three, pifu, icon, unity, godot, gltf-ibl, not \"" + to + "\"",
         true}};
  return by_column(coefficients, [&](const std::vector<float>& c) {
    std::vector<float> out;
    for (size_t i = 0; i < c.size(); ++i)
      if (const double scale = sh_scale(*convention, int(i)); scale != 0)
        out.push_back(c[i] * float(transfer ? 1 / scale : scale));
    return out;
  });
}

Floats multiply(const py::object& a, const py::object& b, int order) {
  const Doubles x = numbers(a, "a", 0), y = numbers(b, "b", 0);
  const int most = std::max(order_of(size_t(x.size()), "a"), order_of(size_t(y.size()), "b"));
  const int n = checked_order(order == 0 ? most : order);
  const std::vector<float> p(x.data(), x.data() + x.size()), q(y.data(), y.data() + y.size());
  Floats out = make_floats({sh_count(n)});
  multiply_sh(p, q, {out.mutable_data(), size_t(sh_count(n))});
  return out;
}

EnvironmentObject environment(const std::string& spec) {
  std::optional<Result<Environment>> env;
  {
    const Released released;
    env.emplace(load_environment(spec));
  }
  auto loaded = std::make_shared<Environment>(take(std::move(*env)));
  for (const std::string& line : loaded->warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, line.c_str(), 1) != 0) throw py::error_already_set();
  return {loaded};
}

EnvironmentObject environment_of_image(const ImageObject& image, const std::string& name) {
  auto env = std::make_shared<Environment>(take(environment_from_image(name, *image.image)));
  for (const std::string& line : env->warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, line.c_str(), 1) != 0) throw py::error_already_set();
  return {env};
}

}  // namespace

void bind_light(py::module_& m) {
  py::class_<EnvironmentObject>(m, "Environment", "Distant light: a lat-long map of radiance, +Y up.")
      .def(py::init(&environment), py::arg("spec"),
           "A picture (.exr, .hdr, .png, .jpg), \"uniform:R,G,B\", or \"sky:elevation=E,azimuth=A,turbidity=T,...\".")
      .def(py::init(&environment_of_image), py::arg("image"), py::arg("name") = "array")
      .def_property_readonly("name", [](const EnvironmentObject& o) { return o.environment->name; })
      .def_property_readonly("image",
                             [](const EnvironmentObject& o) {
                               return ImageObject{std::shared_ptr<const Image>(o.environment, &o.environment->image)};
                             })
      .def(
          "project",
          [](const EnvironmentObject& o, int order) {
            checked_order(order);
            std::vector<Vec3> light;
            {
              const Released released;
              light = project_environment(*o.environment, order);
            }
            return array_of(light);
          },
          py::arg("order"), "float32 (order^2, 3): coefficients of its radiance.")
      .def(
          "rotated",
          [](const EnvironmentObject& o, const std::string& angles) {
            const Mat3 R = take(parse_rotation(angles, "rotation"));
            const Released released;
            return EnvironmentObject{std::make_shared<Environment>(rotated(*o.environment, R))};
          },
          py::arg("angles"), "Turned by \"YAW,PITCH,ROLL\", degrees about +Y, +X, +Z.")
      .def("_repr_png_", [](const EnvironmentObject& o) {
        return py::cast(ImageObject{std::shared_ptr<const Image>(o.environment, &o.environment->image)})
            .attr("_repr_png_")();
      });
  m.def("sh_evaluate", &evaluate), m.def("sh_project", &project), m.def("sh_rotate", &rotate);
  m.def("sh_convert", &convert), m.def("sh_multiply", &multiply);
  m.def("sh_reconstruct", [](const py::object& coefficients, int width) {
    const std::vector<Vec3> light = vectors(coefficients, "coefficients");
    order_of(light.size(), "coefficients");
    if (width < 2 || width > 8192) throw Failure{{"width", "must lie between 2 and 8192", true}};
    const Released released;
    return EnvironmentObject{std::make_shared<Environment>(reconstruct_environment(light, width))};
  });
}

}  // namespace lambent::python
