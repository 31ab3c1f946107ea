#pragma once
// How pictures hold the whole sphere, and what makes an Environment's lat-long map of them.
//
// A picture without OpenEXR's `envmap` attribute is told by its shape: twice as wide as high, a lat-long map as an
// Environment's; 4:3, 3:4, 6:1 or 1:6, a cube map:
//
//        +Y                  +Y
//     -X +Z +X -Z         -X +Z +X          +X -X +Y -Y +Z -Z, side by side or downwards
//        -Y                  -Y
//                            -Z (on its head)
//
// with faces named and turned as OpenGL's (its specification, "Cube Map Texture Selection"). OpenGL's names are those
// of a left-handed frame: a panorama cut into these faces is not mirrored when +Z is the way ahead and +X to the right.
// So that it is not mirrored here either, its +Z is our -Z: ahead -Z, right +X, up +Y.
//
// With the attribute the axes are OpenEXR's (ImfEnvmap.h): a lat-long map's middle shows +Z and its left quarter +X, a
// quarter turn from ours; a cube's faces stand in a column, +X -X +Y -Y +Z -Z, as seen from within. Pixels are areas
// here; OpenEXR has the outermost pixels' centres on the poles and edges, at most half a pixel away.
#include <lambent/core/result.h>
#include <lambent/image/image.h>

namespace lambent {

enum class SphereMap { latlong, exr_latlong, exr_cube, horizontal_cross, vertical_cross, row, column };

// Off by one pixel is still a lat-long map. Errors: any other shape, with those that are wanted.
Result<SphereMap> sphere_map_of(int width, int height, Envmap envmap, const std::string& path);

// The lat-long map. A cube's texels are cut along the map's, by area: energies are kept to a thousandth. Four of its
// texels to a face's width, at least 128 x 64 and at most 16384 x 8192.
Image latlong_of(Image image, SphereMap map);

}  // namespace lambent
