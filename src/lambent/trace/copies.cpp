#include <lambent/trace/copies.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <array>
#include <map>
#include <optional>

namespace lambent {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Of the largest coordinate: a float rounds by 6e-8, once in the shape and once in the copy. What is left to the lift
// of receivers off their surfaces (4e-7, receivers.cpp) is for the rounding of rays.
constexpr double rounding = 1.5e-7;
// Shapes of one number of triangles that a part is held against: the latest, so that time stays bounded.
constexpr size_t most_tried = 16;
// Triangles that tell most parts apart, before all are looked at.
constexpr uint32_t probed = 32;
// Squared thickness over squared length, below which a part is flat.
constexpr double flat = 1e-10;

Vector3d eigen(Vec3d v) { return {v.x, v.y, v.z}; }
Vec3d vec(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// Corners of a part, each `step`th triangle of it.
class Corners {
 public:
  Corners(const Scene& scene, uint32_t part, uint32_t step) : scene_(scene), part_(scene.parts[part]), step_(step) {}
  // f(corner's position in double, its number)
  template <class F>
  void each(F f) const {
    for (uint32_t t = 0; t < part_.triangle_count; t += step_)
      for (uint32_t k = 0; k < 3; ++k) f(at(t, k), 3 * t + k);
  }
  Vec3d at(uint32_t triangle, uint32_t corner) const {
    return scene_.positions[scene_.triangles[part_.first_triangle + triangle].v[corner]];
  }
  uint32_t count() const { return 3 * ((part_.triangle_count + step_ - 1) / step_); }

 private:
  const Scene& scene_;
  const Part& part_;
  uint32_t step_;
};

// What fits need of a shape's corners.
struct Moments {
  Vector3d mean = Vector3d::Zero(), sizes = Vector3d::Zero();  // squared, along the axes, ascending
  Matrix3d axes = Matrix3d::Identity();
};

struct Model {
  Shape shape;
  uint32_t step;       // of the probe
  Moments all, probe;  // about the middle
};

Moments moments(const Corners& corners, Vec3d middle) {
  Moments m;
  Matrix3d spread = Matrix3d::Zero();
  corners.each([&](Vec3d p, uint32_t) { m.mean += eigen(p - middle); });
  m.mean /= corners.count();
  corners.each([&](Vec3d p, uint32_t) {
    const Vector3d x = eigen(p - middle) - m.mean;
    spread += x * x.transpose();
  });
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(spread);
  m.sizes = solver.eigenvalues(), m.axes = solver.eigenvectors();
  return m;
}

struct Box {
  Vec3d low{INFINITY}, high{-INFINITY};
  double reach() const {
    const Vec3d a = max(abs(low), abs(high));
    return std::max({a.x, a.y, a.z});
  }
};
Box box_of(const Corners& corners) {
  Box box;
  corners.each([&](Vec3d p, uint32_t) { box.low = min(box.low, p), box.high = max(box.high, p); });
  return box;
}

struct Affine {
  Mat3 turn;
  Vec3 at;
};

// The corner of a part that is the image of corner `number` of its shape.
Vec3d image_corner(const Corners& part, uint32_t number, bool flipped) {
  const uint32_t k = number % 3;
  return part.at(number / 3, flipped && k > 0 ? 3 - k : k);
}

// The map from the shape to the part with the least squares of errors; none where it would be singular.
std::optional<Affine> fit(const Model& model, const Moments& m, const Corners& from, const Corners& to, bool flipped) {
  Vector3d mean = Vector3d::Zero();
  to.each([&](Vec3d p, uint32_t) { mean += eigen(p); });
  mean /= to.count();
  Matrix3d both = Matrix3d::Zero();
  from.each([&](Vec3d p, uint32_t number) {
    both += (eigen(image_corner(to, number, flipped)) - mean) * (eigen(p - model.shape.middle) - m.mean).transpose();
  });
  // Column k: where the axis goes.
  Matrix3d images = both * m.axes;
  for (int k = 2; k > 0; --k) images.col(k) /= m.sizes[k];
  Matrix3d axes = m.axes;
  if (m.sizes[0] > flat * m.sizes[2]) {
    images.col(0) /= m.sizes[0];
  } else {  // nothing lies off the plane, so that any axis will do
    axes.col(0) = axes.col(1).cross(axes.col(2));
    const Vector3d across = images.col(1).cross(images.col(2));
    const double area = across.norm();
    if (!(area > 0)) return std::nullopt;
    images.col(0) = across / std::sqrt(area);
  }
  const Matrix3d turn = images * axes.transpose();
  // Rays are turned back by the inverse, in floats: what is squeezed flat would lose their digits.
  constexpr double most_squeezed = 30;
  const double volume = std::abs(turn.determinant());
  if (!(volume > 0) || !(turn.norm() * turn.inverse().norm() <= most_squeezed)) return std::nullopt;
  const Vector3d at = mean - turn * m.mean;
  Affine out{{}, Vec3(vec(at))};
  for (int c = 0; c < 3; ++c) out.turn[size_t(c)] = Vec3(vec(turn.col(c)));
  return out;
}

// Whether each corner lies where the map puts it, in the floats that rays will see.
bool holds(const Model& model, const Affine& map, const Corners& from, const Corners& to, bool flipped, double error) {
  const Mat3d turn(map.turn);
  const Vec3d at(map.at);
  bool all = true;
  from.each([&](Vec3d p, uint32_t number) {
    if (!all) return;
    const Vec3d x = Vec3(p - model.shape.middle);
    all = all_at_most(abs(turn * x + at - image_corner(to, number, flipped)), Vec3d(error));
  });
  return all;
}

std::optional<Copy> match(const Scene& scene, const Model& model, uint32_t part, double reach) {
  // An error in the shape grows as the shape does; what is larger than its copy need not be as exact as that.
  const double error = rounding * reach;
  for (bool flipped : {false, true}) {
    const Corners probe(scene, model.shape.part, model.step), all(scene, model.shape.part, 1);
    const Corners probe_to(scene, part, model.step), all_to(scene, part, 1);
    const auto rough = fit(model, model.probe, probe, probe_to, flipped);
    if (!rough || !holds(model, *rough, probe, probe_to, flipped, 4 * error)) continue;
    const auto map = fit(model, model.all, all, all_to, flipped);
    if (map && holds(model, *map, all, all_to, flipped, error)) return Copy{part, map->turn, map->at, flipped};
  }
  return std::nullopt;
}

std::optional<Model> make_model(const Scene& scene, uint32_t part, const Box& box) {
  Model m;
  m.shape = {part, Vec3d(Vec3((box.low + box.high) * 0.5)), {}};
  m.step = std::max(1u, scene.parts[part].triangle_count / probed);
  m.all = moments(Corners(scene, part, 1), m.shape.middle);
  m.probe = m.step > 1 ? moments(Corners(scene, part, m.step), m.shape.middle) : m.all;
  if (!(m.all.sizes[1] > flat * m.all.sizes[2]) || !(m.probe.sizes[1] > flat * m.probe.sizes[2])) return std::nullopt;
  m.shape.copies.push_back({part, Mat3(1.0f), Vec3(m.shape.middle), false});
  return m;
}

}  // namespace

std::vector<Shape> find_shapes(const Scene& scene, uint32_t least_triangles) {
  std::map<uint32_t, std::vector<uint32_t>> by_size;
  for (uint32_t p = 0; p < scene.parts.size(); ++p)
    if (scene.parts[p].triangle_count >= std::max(least_triangles, 1u))
      by_size[scene.parts[p].triangle_count].push_back(p);
  std::vector<Shape> shapes;
  for (const auto& [triangles, parts] : by_size) {
    if (parts.size() < 2) continue;
    std::vector<Model> models;
    for (const uint32_t part : parts) {
      const Box box = box_of(Corners(scene, part, 1));
      bool found = false;
      for (size_t i = models.size(); i > 0 && models.size() - i < most_tried && !found; --i) {
        auto copy = match(scene, models[i - 1], part, std::max(box.reach(), 1e-30));
        if (copy) models[i - 1].shape.copies.push_back(*copy);
        found = copy.has_value();
      }
      if (found) continue;
      if (auto model = make_model(scene, part, box)) models.push_back(std::move(*model));
    }
    for (Model& model : models)
      if (model.shape.copies.size() > 1) shapes.push_back(std::move(model.shape));
  }
  return shapes;
}

}  // namespace lambent
