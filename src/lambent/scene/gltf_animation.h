#pragma once
// glTF animations: what they do to nodes at a time. Pointers to anything but nodes' transforms and weights are left
// alone.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// The name of one of the document's animations, "" where it has none.
std::string animation_name(const GltfDocument& document, size_t animation);

// Over all channels of an animation, in seconds. Fails where it is broken: missing samplers, counts that do not fit,
// times that fall, numbers that are not finite.
bool read_times(GltfCheck& check, const GltfDocument& document, size_t animation, double& from, double& to);

// A copy of the JSON's nodes as the animation sets them at `time`, clamped to each channel's range: LINEAR (rotations
// along the shorter great circle), STEP and CUBICSPLINE. Of keys at one time the last holds from there on. Rotations
// come out of unit length, whatever is stored; zero ones as no rotation.
bool animate_nodes(GltfCheck& check, const GltfDocument& document, size_t animation, double time,
                   nlohmann::json& nodes);

}  // namespace lambent
