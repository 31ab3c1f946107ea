#pragma once
// Transfer of a small piece of relief that repeats, for use as a texture on other surfaces. Source:
// local-deformable-prt, section 6.
#include <lambent/bake/bake.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// Heights at the texels of a square that repeats, row by row from the first (v = 0); 1 is one side of the square.
struct HeightField {
  int size = 0;  // texels a side, [2, 1024]
  std::vector<float> heights;
};

// Bilinear at uv in a picture that repeats; 0 where uv is not finite.
double sample_heights(std::span<const float> values, int width, int height, Vec2d uv);

// A picture's values, box-filtered or interpolated to size x size, times depth. Errors: fewer than 2 x 2 values; values
// that are not finite; size or depth out of range.
Result<HeightField> make_height_field(std::span<const float> values, int width, int height, int size, float depth);

// How much a field jumps from its last row and column to its first, as a multiple of how much it changes from row to
// row elsewhere: about 1 for a field that tiles.
double seam_jump(const HeightField& field);

// The relief in 3 x 3 repetitions, in the frame that its transfer is given in: x along +u, y along -v, z outward.
// Receivers are the texels of the middle one, in their order; light that bounces off the outer ones comes from their
// likes in the middle.
struct PatchScene {
  Scene scene;
  Receivers receivers;
};
PatchScene make_patch(const HeightField& field, Vec3 albedo);
// Closes it from below: a plane so far under its lowest place (in sides) that faces down and receives nothing, so that
// what scatters in between comes out on either side.
void add_floor(PatchScene& patch, float thickness);

// The relief as it is seen through each texel of its plane (z = 0) from views x views directions, the nodes of a view
// map (transfer/outgoing.h): [texel][view] rows of transfer, those of where a ray along the view meets it. Near the
// horizon views are lifted, so that rays stay within the repetitions. `own` is the relief's transfer at its receivers:
// diffuse, or incident light that `outgoing` reflects; what meets nothing that receives is black.
Transfer view_patch(const PatchScene& patch, const Tracer& tracer, const Transfer& own, const Outgoing* outgoing,
                    int size, int views);

// The same of a mesh that repeats along x and y with the extents of its box, which have to be alike to 1%, seen as a
// picture from +z: u along +x, v along -y. It is scaled to a side of 1. Receivers lie where rays from above through the
// middles of size x size texels meet it; what lies below something else has no receiver of its own, and gives back what
// the texel above it does. `heights`, if asked for, are those of the receivers. Errors: no such extents; a texel that
// meets nothing or the back of a one-sided surface; too many triangles.
Result<PatchScene> make_mesh_patch(const Scene& tile, int size, HeightField* heights = nullptr);

}  // namespace lambent
