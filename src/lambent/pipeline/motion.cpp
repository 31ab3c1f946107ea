#include <lambent/pipeline/motion.h>
#include <lambent/pipeline/parse.h>
#include <lambent/scene/scene.h>

namespace lambent {

Result<std::vector<std::optional<Pose>>> make_poses(const Motion& motion, const Scene& scene) {
  std::vector<std::optional<Pose>> poses;
  if (!motion.deform.empty()) {
    auto deformation = parse_deformation(motion.deform);
    if (!deformation) return deformation.error();
    poses.push_back(deform_scene(scene, *deformation));
  } else if (!motion.animation.empty()) {
    std::vector<double> times{motion.time};
    if (!motion.frames.empty()) {
      auto given = parse_frames(motion.frames);
      if (!given) return given.error();
      times = *given;
    }
    auto animation = find_animation(scene, motion.animation);
    if (!animation) return animation.error();
    for (double t : times) {
      auto pose = pose_scene(scene, *animation, t);
      if (!pose) return pose.error();
      poses.push_back(std::move(*pose));
    }
  } else {
    poses.emplace_back();
  }
  return poses;
}

namespace {

// What each receiver at vertices takes from the first of them, its front before its back.
template <class T>
std::vector<T> of_first_vertex(const std::vector<T>& of_vertex, const Placement& where, size_t receivers, T nothing) {
  std::vector<T> out(receivers, nothing);
  if (const auto* at = std::get_if<VertexPlacement>(&where))
    for (const auto* side : {&at->back, &at->front})
      for (size_t v = side->size(); v-- > 0;)
        if ((*side)[v] != no_receiver) out[(*side)[v]] = of_vertex[v];
  return out;
}

}  // namespace

std::vector<Mat3> receiver_rotations(const Pose& pose, const Placement& where, size_t receivers) {
  return of_first_vertex(pose.rotations, where, receivers, Mat3(1.0f));
}

std::vector<Vec3> receiver_positions(const std::vector<Vec3>& vertices, const Placement& where, size_t receivers) {
  return of_first_vertex(vertices, where, receivers, Vec3(0.0f));
}

}  // namespace lambent
