#pragma once
// What the web page draws. web/src/kinds.ts holds the same table and limits, and a test compares the two.
#include <lambent/core/result.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/field.h>

#include <span>

namespace lambent {

// By name_of() of store, rows and placement.
struct DrawnKind {
  const char *store, *rows, *where;
};
std::span<const DrawnKind> drawn_kinds();

// Columns of light, harmonics, lobes and groups; lobes of all rows of a receiver; of a matrix, texels a receiver; lamps
// that move; lights and glowing materials of the scene's own beside them; bytes that clusters and factors are unfolded
// to.
inline constexpr size_t max_drawn_columns = 256, max_drawn_lobes = 64, max_drawn_texels = 2048, max_drawn_lamps = 8,
                        max_drawn_own_lamps = 64, max_drawn_unfolded = 536'870'912;

// Why the page would refuse the surface's field; nothing where it draws it. The error names `path`.
Result<void> check_for_browser(const Field& surface, const std::string& path);
// The same with what of its scene the page does not draw.
Result<void> check_for_browser(const Field& surface, const Scene& scene, const std::string& path);

}  // namespace lambent
