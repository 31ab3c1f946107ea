#pragma once
// Parts that are in a file and take no part: sky domes, backdrops.
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

// The word that stands for every part of an unlit material (KHR_materials_unlit).
inline constexpr const char* unlit_word = "unlit";

// Takes the parts whose name, or whose material's name, is one of `words` out of the scene; of a glTF input they stay
// in the document. The words that fitted a part go into Scene::excluded, the others are returned.
std::vector<std::string> exclude_parts(Scene& scene, std::span<const std::string> words);

}  // namespace lambent
