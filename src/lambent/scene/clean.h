#pragma once
// Steps that turn what files hold into what light transport needs. Each keeps Scene's invariants.
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

// Faces that meet at a sharper angle than this get separate normals (and vertices) where a file brings none.
inline constexpr float crease_angle_degrees = 70.0f;

// Numbers of exactly equal positions (-0 equals 0), counted from 0 in order of first appearance.
struct PositionIds {
  std::vector<uint32_t> ids;  // one a position
  uint32_t count = 0;         // distinct positions
};
PositionIds number_positions(std::span<const Vec3> positions);

// A scene's corners by position, for steps that look at what meets at one; corner k of triangle t is number 3 t + k. It
// holds as long as triangles keep their number and vertices their places, and copies of vertices do no harm.
struct CornerFans {
  std::vector<uint32_t> ids;             // the position of each corner
  std::vector<uint32_t> first, corners;  // those at position p: corners[first[p]] to before corners[first[p + 1]]
  // By position: whether its corners make one closed ring, in which each edge lies between two faces that run along it
  // in opposite directions. Corners of a ring are in its order, from the smallest on, others ascending.
  std::vector<uint8_t> is_ring;
};
CornerFans corner_fans(const Scene& scene);

// The steps below make the fans themselves where they are not given.

// Computes normals of a part that has none (`flat`: one a face, shared by coplanar neighbours, as glTF asks; else
// smooth over vertices that share a position, weighted by corner angle, split at creases). Vertices that need several
// normals are duplicated: vertices of later parts move up, and Part::source records the copies. Triangles without an
// area count for nothing; vertices that no other triangle uses get +Y.
void make_normals(Scene& scene, size_t part, bool flat);

// As above for several parts at once (ascending, none twice); the arrays are rebuilt only once, which matters for files
// of many parts.
void make_normals(Scene& scene, std::span<const size_t> parts, bool flat);
void make_normals(Scene& scene, std::span<const size_t> parts, bool flat, const CornerFans& fans);

// Replaces zero, NaN or denormal normals by the angle-weighted normal of the vertex's faces (or +Y), which marks the
// part changed; normalises the rest.
void repair_normals(Scene& scene);

// Drops triangles with the same corner positions and winding as an earlier one, and marks their parts changed; marks
// both of an opposite pair two-sided. Triangles with a repeated corner position are left alone. Vertices stay, used or
// not, and so do parts that are left without triangles. True if any was dropped: fans then no longer hold.
bool merge_duplicate_triangles(Scene& scene);
bool merge_duplicate_triangles(Scene& scene, const CornerFans& fans);

// Sets Triangle::two_sided for a scene whose file carries no sidedness: components (connected over shared positions)
// that are closed and of positive volume are one-sided, all others two-sided.
void infer_sidedness(Scene& scene);
void infer_sidedness(Scene& scene, const CornerFans& fans);

}  // namespace lambent
