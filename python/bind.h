#pragma once
// What the sources of the Python module share.
#include <lambent/light/environment.h>
#include <lambent/pipeline/bake.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <functional>
#include <memory>

namespace lambent::python {

namespace py = pybind11;

// Becomes lambent.Error, with the error's line.
struct Failure {
  Error error;
};
template <class T>
T take(Result<T> result) {
  if (!result) throw Failure{result.error()};
  return std::move(*result);
}
inline void take(const Result<void>& result) {
  if (!result) throw Failure{result.error()};
}

// Lets other threads of Python run for as long as it lives. Not while the interpreter shuts down: a thread that asked
// it to go on then would be ended in the middle of C++.
class Released {
 public:
  Released();
  ~Released();
  Released(const Released&) = delete;
  Released& operator=(const Released&) = delete;

 private:
  PyThreadState* state_ = nullptr;
};

// Does the work on a thread of its own while the calling one looks for signals and calls report(stage, fraction), if it
// is not None; what either raises cancels the work, and is raised once that has ended. Warnings of the work become
// Python's.
void run_job(const py::object& report, const std::function<void(const Job&)>& work);
template <class T>
T run(const py::object& report, const std::function<Result<T>(const Job&)>& work) {
  std::optional<Result<T>> result;
  run_job(report, [&](const Job& job) { result.emplace(work(job)); });
  return take(std::move(*result));
}

// What may be seen from Python without a copy: read-only, and `owner` lives as long.
py::array view(const void* data, const char* dtype, std::vector<ssize_t> shape, std::vector<ssize_t> strides,
               std::shared_ptr<const void> owner);
template <class T>
py::array vectors_view(const std::vector<T>& values, const std::shared_ptr<const void>& owner) {
  constexpr ssize_t columns = sizeof(T) / 4;
  return view(values.data(), std::is_integral_v<T> ? "uint32" : "float32",
              columns == 1 ? std::vector<ssize_t>{ssize_t(values.size())}
                           : std::vector<ssize_t>{ssize_t(values.size()), columns},
              {}, owner);
}

// Arrays from Python: real numbers in `columns` columns (0: a list), in any order, type and memory. Errors name the
// array.
py::array_t<double, py::array::c_style> numbers(const py::handle& value, const char* name, ssize_t columns);
std::vector<uint32_t> indices(const py::handle& value, const char* name, ssize_t columns, size_t limit);
std::vector<Vec3> vectors(const py::handle& value, const char* name);

// float32, C order, on a cache line, not set to anything.
py::array_t<float> make_floats(std::vector<ssize_t> shape);

struct SceneObject {
  std::shared_ptr<const Scene> scene;
};
struct EnvironmentObject {
  std::shared_ptr<const Environment> environment;
};
struct ImageObject {
  std::shared_ptr<const Image> image;
};

void bind_scene(py::module_& m);
void bind_image(py::module_& m);
void bind_light(py::module_& m);
void bind_baked(py::module_& m);

}  // namespace lambent::python
