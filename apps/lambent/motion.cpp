#include "motion.h"

namespace lambent::tool {
void MotionOptions::add_to(CLI::App& c, bool with_frames) {
  auto* named = c.add_option("--animation", animation, "Pose the scene by this glTF animation, by name or number");
  auto* at = c.add_option("--time", time, "At this time, seconds")->needs(named);
  if (with_frames)
    c.add_option("--frames", frames, "FROM:TO[:STEP]: at these times, seconds, as a strip of pictures")
        ->needs(named)
        ->excludes(at);
  c.add_option("--deform", deform,
               "bend:ANGLE[,along[,towards]] or twist:ANGLE[,along]: degrees from end to end, axes x, y or z")
      ->excludes(named);
}

Result<std::vector<std::optional<Pose>>> make_poses(const MotionOptions& o, const Scene& scene) {
  std::vector<std::optional<Pose>> poses;
  if (!o.deform.empty()) {
    auto deformation = parse_deformation(o.deform);
    if (!deformation) return deformation.error();
    poses.push_back(deform_scene(scene, *deformation));
  } else if (!o.animation.empty()) {
    std::vector<double> times{o.time};
    if (!o.frames.empty()) {
      auto given = parse_frames(o.frames);
      if (!given) return given.error();
      times = *given;
    }
    auto animation = find_animation(scene, o.animation);
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

std::vector<Mat3> receiver_rotations(const Pose& pose, const std::vector<uint32_t>& front,
                                     const std::vector<uint32_t>& back, size_t receivers) {
  std::vector<Mat3> rotations(receivers, Mat3(1.0f));
  std::vector<bool> known(receivers);
  for (const auto* map : {&front, &back})
    for (size_t v = 0; v < map->size(); ++v)
      if (const uint32_t r = (*map)[v]; r != none && !known[r]) rotations[r] = pose.rotations[v], known[r] = true;
  return rotations;
}

}  // namespace lambent::tool
