#pragma once
// What the reader and the writer of LAMBENT_transfer share (docs/file-format.md).
#include <lambent/basis/directional.h>

#include <array>
#include <bit>
#include <string>
#include <utility>

namespace lambent {

static_assert(std::endian::native == std::endian::little, "the file and its in-place reader are little-endian");

inline constexpr const char* extension_name = "LAMBENT_transfer";
inline const std::array<std::pair<LobeKind, std::string>, 2> lobe_names{
    {{LobeKind::cosine_power, "cosine_power"}, {LobeKind::von_mises_fisher, "von_mises_fisher"}}};

// What parts hold, by the kind of receivers: vertices, a receiver a vertex; patches, a receiver a triangle; texels, a
// place in the atlas a vertex, two floats.
enum class SurfaceKind { vertices, texels, patches };
inline constexpr const char* surface_kind_names[] = {"vertices", "texels", "patches"};

}  // namespace lambent
