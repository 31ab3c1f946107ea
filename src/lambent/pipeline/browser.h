#pragma once
// What the web page draws. web/src/kinds.ts holds the same table and limits, and a test compares the two.
#include <lambent/baked/baked_file.h>
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
// to; objects that are put into a scene, and vertices of one of them.
inline constexpr size_t max_drawn_columns = 256, max_drawn_lobes = 64, max_drawn_texels = 2048, max_drawn_lamps = 8,
                        max_drawn_own_lamps = 64, max_drawn_unfolded = 536'870'912, max_drawn_inserts = 8,
                        max_drawn_insert_vertices = 262'144;

// Why the page would refuse the surface's field; nothing where it draws it. The error names `path`.
Result<void> check_for_browser(const Field& surface, const std::string& path);
// The same with what of its scene the page does not draw.
Result<void> check_for_browser(const Field& surface, const Scene& scene, const std::string& path);
// The same of a whole file: one that says what an object hides around it is to be placed by another command.
Result<void> check_file_for_browser(const Baked& baked, const std::string& path);

}  // namespace lambent
