#pragma once
// Scenes in the poses that users ask for.
#include <lambent/relight/zonal.h>
#include <lambent/scene/pose.h>
#include <lambent/transfer/field.h>

#include <optional>
#include <string>
#include <vector>

namespace lambent {

struct Motion {
  std::string animation;  // of the glTF, by name or number
  std::string frames;     // FROM:TO[:STEP], seconds; "": one, at `time`
  std::string deform;     // as parse_deformation() reads it
  double time = 0;
  bool any() const { return !animation.empty() || !deform.empty(); }
};

// The poses, one after another; one that is empty where nothing moves. Errors: as parse_frames(), find_animation(),
// pose_scene() and parse_deformation().
Result<std::vector<std::optional<Pose>>> make_poses(const Motion& motion, const Scene& scene);

// Of each receiver at vertices, the rotation of (the first of) its vertices, and where that is. Of receivers elsewhere:
// as it was baked, and the origin.
std::vector<Mat3> receiver_rotations(const Pose& pose, const Placement& where, size_t receivers);
std::vector<Vec3> receiver_positions(const std::vector<Vec3>& vertices, const Placement& where, size_t receivers);

}  // namespace lambent
