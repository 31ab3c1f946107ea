#pragma once
// O(view), the last reflection: what turns the rows of T . light into radiance towards the eye. With X = T . light at a
// receiver,
//   radiance(wo) = sum over rows r of (a_r(wo) + colour * b_r(wo)) X_r,
// wo in the receiver's tangent frame, colour the base colour at the pixel. The part a does not depend on base colour (a
// dielectric's highlight), b is proportional to it (diffuse reflection, a metal's highlight); textures so stay as sharp
// as they are. Diffuse transfer is the one-row case a = 0, b = 1. Source: general-prt, "Final reflection" (a) and (b).
#include <lambent/basis/directional.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// What the rows are, and so what O is made of.
enum class OutgoingKind {
  map,  // rows: incident light in the basis of basis/cosine_basis.h; O is looked up by view. Materials can still be
        // changed
  svd,  // rows: the leading singular vectors of each material's O
  sh,   // rows: outgoing radiance in spherical harmonics, zero below the horizon
  hemisphere,   // the same, fitted by least squares on the hemisphere alone
  hsh,          // rows: outgoing radiance in hemispherical harmonics
  phong,        // rows: light convolved with Phong's lobe, in harmonics of the mirrored view; then diffuse radiance
  directional,  // rows: outgoing radiance in compact lobes over the hemisphere, of which a view meets a few
};
extern const char* const outgoing_names[7];  // by kind

// a and b as (a.r, a.g, a.b, b).
using ViewWeights = Vec4;

// A table over directions of the upper hemisphere: nodes of a grid over the unit square, mapped to the disk (Shirley
// and Chiu) and on to the hemisphere with equal areas; the border of the square is the horizon. Bilinear between nodes.
struct ViewMap {
  int grid = 0;  // nodes a side
  int rows = 0;
  std::vector<ViewWeights> values;  // [y][x][row]
};
// The direction of node (x, y); at the horizon, a hair above it.
Vec3 view_map_direction(int grid, int x, int y);
void look_up(const ViewMap& map, Vec3 wo, std::span<ViewWeights> out);

// The last reflection at every receiver: how rows become radiance towards the eye.
struct Outgoing {
  OutgoingKind kind = OutgoingKind::map;
  int order = 0;  // of the rows' basis (map, phong, directional: incident; sh, hemisphere, hsh: outgoing)
  // sh, hemisphere, hsh: order^2 rows of a, then order^2 of b; without b, those of a alone; directional: the same by
  // lobes. phong: order^2 rows of a, a diffuse one of a, and one of b.
  bool has_b = true;
  std::vector<ViewMap> maps;     // map, svd: one a material
  std::vector<uint16_t> map_of;  // map, svd: by receiver
  std::vector<Mat3> frames;      // by receiver: tangent, bitangent, normal
  std::vector<Lobe> lobes = {};  // directional: compact ones, unscaled, in the receiver's frame
  int rows() const;              // that the transfer must have
};

// Compact lobes for `count` >= 4 outgoing directions, about even ones of the upper hemisphere; a view meets some ten.
std::vector<Lobe> outgoing_lobes(int count);

// The weights of all rows at a receiver, for the unit direction `view` towards the eye in world space. Below the
// receiver's horizon it is lifted to it.
void evaluate_outgoing(const Outgoing& o, size_t receiver, Vec3 view, std::span<ViewWeights> out);

// What the square of an error in each row makes of the square of an error in the picture, on average over views and
// materials, seen as cosine-distributed: of harmonic rows, 1.
std::vector<float> row_weights(const Outgoing& o);

// The same surfaces turned, each by a rotation of its own, which may mirror.
Outgoing turn_outgoing(const Outgoing& o, std::span<const Mat3> rotations);

// Sum of weights and rows: (a + colour b) . X.
inline Vec3 reflect_rows(std::span<const ViewWeights> weights, Vec3 colour, auto&& row) {
  Vec3 a(0.0f), b(0.0f);
  for (size_t r = 0; r < weights.size(); ++r) {
    const Vec3 x = row(r);
    a += Vec3(weights[r]) * x, b += weights[r].w * x;
  }
  return a + colour * b;
}

}  // namespace lambent
