#pragma once
// Drawing a scene in other poses.
#include "options.h"

#include <lambent/scene/pose.h>

namespace lambent::tool {

struct MotionOptions {
  std::string animation, frames, deform;
  double time = 0;
  void add_to(CLI::App& command, bool with_frames);
  bool any() const { return !animation.empty() || !deform.empty(); }
};

// The poses to draw, one after another; one that is empty where nothing moves.
Result<std::vector<std::optional<Pose>>> make_poses(const MotionOptions& options, const Scene& scene);

// Of each receiver, the rotation of (the first of) its vertices.
std::vector<Mat3> receiver_rotations(const Pose& pose, const std::vector<uint32_t>& front,
                                     const std::vector<uint32_t>& back, size_t receivers);

}  // namespace lambent::tool
