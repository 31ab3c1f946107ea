#pragma once
// Scenes in other poses: glTF animations, and bending and twisting of anything. What lights a surface locally turns
// with it, so each vertex gets a rotation too. Source: local-deformable-prt, section 5.
#include <lambent/scene/scene.h>

namespace lambent {

// The rest scene's vertices, elsewhere.
struct Pose {
  std::vector<Vec3> positions, normals;  // of each vertex of the scene; normals are unit
  // Orthogonal matrices from the rest pose to this one: the orthogonal part of the deformation's gradient about the
  // vertex, turned by the least angle that takes the rest normal to this one. Continuous wherever the gradient is.
  // Where the deformation mirrors, so do they (lobes may be mirrored as well as turned); where it is flat, it is the
  // least rotation between the normals.
  std::vector<Mat3> rotations;
  std::vector<uint8_t> mirrored;  // of each part: its triangles change their winding
};

struct AnimationInfo {
  std::string name;
  double from = 0, to = 0;  // seconds
  std::string problem;      // why it cannot be played; "" where it can
};
// Errors: not a glTF.
Result<std::vector<AnimationInfo>> list_animations(const Scene& scene);
// By name, or by number where the text is one and no name. Errors: none there; a static scene.
Result<size_t> find_animation(const Scene& scene, const std::string& name_or_index);

// Nodes, skins and morph targets at a time in seconds, clamped to the animation's range. Errors: a static scene; parts
// that were refined (their vertices have no bones); broken animations; a part that is not shown in that pose's file.
Result<Pose> pose_scene(const Scene& scene, size_t animation, double time);

enum class DeformKind { bend, twist };
struct Deformation {
  DeformKind kind = DeformKind::bend;
  float degrees = 0;             // over the whole length of the scene along `along`; bend: below 360 in size
  int along = -1, towards = -1;  // axes 0 to 2; -1: the longest, and for bends the next in cyclic order
};
// "bend:ANGLE[,along[,towards]]", "twist:ANGLE[,along]", axes as x, y, z. Errors: anything else.
Result<Deformation> parse_deformation(const std::string& text);
// About the middle of the scene's bounds.
Pose deform_scene(const Scene& scene, const Deformation& deformation);

// The scene in that pose.
Scene posed(const Scene& scene, const Pose& pose);

// The rotation described at Pose::rotations, from the gradient F and unit normals before and after.
Mat3 pose_rotation(const Mat3d& F, Vec3 rest_normal, Vec3 normal);

}  // namespace lambent
