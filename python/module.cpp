// The module lambent._lambent: what the package in lambent/ is made of. Work runs without Python's lock.
#include "bind.h"

#include <lambent/core/parallel.h>
#include <lambent/pipeline/version.h>
#include <lambent/scene/mesh_file.h>

#include <fmt/format.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <new>
#include <set>
#include <thread>

namespace lambent::python {
namespace {

// Who is at work, for the end of the interpreter.
struct Running {
  std::mutex mutex;
  std::condition_variable changed;
  bool closing = false;
  size_t released = 0;
  std::set<Progress*> jobs;
};
Running& running() {
  static auto* r = new Running;  // outlives every thread
  return *r;
}

struct Entered {
  Progress* progress;
  explicit Entered(Progress* p) : progress(p) {
    std::lock_guard lock(running().mutex);
    if (running().closing) throw Failure{{"", "the interpreter is shutting down"}};
    running().jobs.insert(p);
  }
  ~Entered() {
    std::lock_guard lock(running().mutex);
    running().jobs.erase(progress), running().changed.notify_all();
  }
};

// Run by atexit: cancels all work and waits for its end.
void shut_down() {
  Running& r = running();
  PyThreadState* state = PyEval_SaveThread();
  {
    std::unique_lock lock(r.mutex);
    r.closing = true;
    for (Progress* p : r.jobs) p->cancel();
    r.changed.wait(lock, [&] { return r.jobs.empty() && r.released == 0; });
  }
  PyEval_RestoreThread(state);
}

PyObject* error_type = nullptr;

void translate(std::exception_ptr p) {
  try {
    if (p) std::rethrow_exception(p);
  } catch (const Failure& f) {
    py::object error = py::handle(error_type)(f.error.text());
    error.attr("where") = f.error.where, error.attr("usage") = f.error.usage;
    PyErr_SetObject(error_type, error.ptr());
  }
}

// What a job's thread tells the one that waits.
struct Told {
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  std::string stage;
  double fraction = 0;
  size_t count = 0;
  std::vector<std::string> warnings;
  std::exception_ptr thrown;
};

}  // namespace

Released::Released() {
  {
    std::lock_guard lock(running().mutex);
    if (running().closing) return;
    ++running().released;
  }
  state_ = PyEval_SaveThread();
}
Released::~Released() {
  if (!state_) return;
  PyEval_RestoreThread(state_);
  std::lock_guard lock(running().mutex);
  --running().released, running().changed.notify_all();
}

void run_job(const py::object& report, const std::function<void(const Job&)>& work) {
  Told told;
  Progress progress([&](const std::string& stage, double fraction) {
    std::lock_guard lock(told.mutex);
    told.stage = stage, told.fraction = fraction, ++told.count;
  });
  const Entered entered(&progress);
  const Job job{&progress, [&](const std::string& line) {
                  std::lock_guard lock(told.mutex);
                  told.warnings.push_back(line);
                }};
  std::thread worker([&] {
    try {
      work(job);
    } catch (...) {
      told.thrown = std::current_exception();
    }
    std::lock_guard lock(told.mutex);
    told.done = true, told.changed.notify_all();
  });
  std::optional<py::error_already_set> raised;
  for (size_t seen = 0; true;) {
    bool done = false;
    std::string stage;
    double fraction = 0;
    size_t count = 0;
    {
      const Released released;
      std::unique_lock lock(told.mutex);
      done = told.changed.wait_for(lock, std::chrono::milliseconds(50), [&] { return told.done; });
      stage = told.stage, fraction = told.fraction, count = told.count;
    }
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (!raised && !report.is_none() && count != seen) seen = count, report(stage, fraction);
    } catch (py::error_already_set& e) {
      if (!raised) raised.emplace(e);
      progress.cancel();
    }
    if (done) break;
  }
  worker.join();
  if (raised) throw *raised;
  if (told.thrown) std::rethrow_exception(told.thrown);
  for (const std::string& line : told.warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, line.c_str(), 1) != 0) throw py::error_already_set();
}

py::array view(const void* data, const char* dtype, std::vector<ssize_t> shape, std::vector<ssize_t> strides,
               std::shared_ptr<const void> owner) {
  auto* kept = new std::shared_ptr<const void>(std::move(owner));
  const py::capsule base(kept, [](void* p) { delete static_cast<std::shared_ptr<const void>*>(p); });
  static const int nothing = 0;
  py::array array(py::dtype(dtype), std::move(shape), std::move(strides), data ? data : &nothing, base);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

namespace {

std::string shape_of(const py::array& a) { return py::str(a.attr("shape")); }

py::array checked(const py::handle& value, const char* name, ssize_t columns, const char* kinds, const char* expected) {
  py::array a = py::array::ensure(value);
  if (!a) {
    PyErr_Clear();
    throw Failure{{name, "is no array", true}};
  }
  const bool shaped = columns == 0 ? a.ndim() == 1 : a.ndim() == 2 && a.shape(1) == columns;
  if (!shaped)
    throw Failure{
        {name,
         fmt::format("must have the shape ({}), not {}", columns ? fmt::format("n, {}", columns) : "n,", shape_of(a)),
         true}};
  if (std::string(kinds).find(a.dtype().kind()) == std::string::npos)
    throw Failure{{name, fmt::format("must hold {}, not {}", expected, std::string(py::str(a.dtype()))), true}};
  if (size_t(a.shape(0)) >= max_corners)
    throw Failure{{name, fmt::format("has {} rows; at most {} are possible", a.shape(0), max_corners - 1), true}};
  return a;
}

}  // namespace

py::array_t<double, py::array::c_style> numbers(const py::handle& value, const char* name, ssize_t columns) {
  return py::array_t<double, py::array::c_style | py::array::forcecast>(
      checked(value, name, columns, "fiu", "real numbers"));
}

std::vector<uint32_t> indices(const py::handle& value, const char* name, ssize_t columns, size_t limit) {
  const py::array a = checked(value, name, columns, "iu", "whole numbers");
  const py::array_t<int64_t, py::array::c_style | py::array::forcecast> wide(a);
  std::vector<uint32_t> out(size_t(wide.size()));
  for (size_t i = 0; i < out.size(); ++i) {
    const int64_t v = wide.data()[i];
    if (v < 0 || size_t(v) >= limit)
      throw Failure{{fmt::format("{}[{}]", name, i / size_t(std::max<ssize_t>(columns, 1))),
                     fmt::format("names vertex {} of {}", v, limit), true}};
    out[i] = uint32_t(v);
  }
  return out;
}

std::vector<Vec3> vectors(const py::handle& value, const char* name) {
  const auto a = numbers(value, name, 3);
  std::vector<Vec3> out(size_t(a.shape(0)));
  for (size_t i = 0; i < out.size(); ++i) out[i] = Vec3(a.data()[3 * i], a.data()[3 * i + 1], a.data()[3 * i + 2]);
  return out;
}

py::array_t<float> make_floats(std::vector<ssize_t> shape) {
  size_t bytes = sizeof(float);
  for (ssize_t n : shape) bytes *= size_t(n);
  auto* memory = static_cast<float*>(::operator new(std::max<size_t>(bytes, 1), std::align_val_t(64)));
  const py::capsule base(memory, [](void* p) { ::operator delete(p, std::align_val_t(64)); });
  return py::array_t<float>(std::move(shape), memory, base);
}

}  // namespace lambent::python

PYBIND11_MODULE(_lambent, m) {
  using namespace lambent::python;
  error_type = PyErr_NewExceptionWithDoc("lambent.Error", "What went wrong, in the line that the command line says.",
                                         nullptr, nullptr);
  m.attr("Error") = py::reinterpret_borrow<py::object>(error_type);
  py::register_exception_translator(translate);
  py::module_::import("atexit").attr("register")(py::cpp_function(shut_down));
  m.attr("version") = lambent::version;
  m.def("threads", [] { return lambent::thread_count(); });
  bind_image(m);
  bind_light(m);
  bind_scene(m);
  bind_baked(m);
}
