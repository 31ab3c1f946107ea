#pragma once
// Grooves where a pose presses a surface together: skin that keeps its length folds, across where it is pressed most.
// Source: local-deformable-prt, section 4.2 (wrinkle model), whose depths and directions an artist gives.
#include <lambent/scene/scene.h>

#include <span>
#include <vector>

namespace lambent {

// How long the outline -d cos^2(pi x) of a groove is from border to border, |x| <= 1/2, for a depth d of its width;
// 1 for none. d >= 0.
double groove_length(double depth);

// Directions of texture coordinates, [triangle], as TextureUse::tile has them, `repetitions` long: of each part of the
// scene that in which these poses press it most, the mean over its area and over them; `otherwise` where none presses
// it, or it has no texture coordinates. A pose is positions by vertex.
std::vector<Vec2> pressed_directions(const Scene& scene, std::span<const std::vector<Vec3>> poses, float repetitions,
                                     Vec2 otherwise);

// Depths in widths, [vertex], at most `most`: such that what lies across the direction of `tile`, [triangle], is as
// long over a repetition, of which grooves take the share `width`, as it was at rest. Means over the triangles about a
// vertex; 0 where it is stretched, or without texture coordinates.
std::vector<float> pressed_depths(const Scene& scene, const std::vector<Vec3>& pose, std::span<const Vec2> tile,
                                  float width, float most);

}  // namespace lambent
