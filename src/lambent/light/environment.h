#pragma once
// Distant light: a lat-long map of radiance. +Y up, first row at the zenith; the image centre shows +X and three
// quarters of the way to the right shows +Z: u = 1/2 + atan2(z, x) / 2 pi, v = acos(y) / pi. A texel's radiance is
// constant over it.
#include <lambent/core/result.h>
#include <lambent/core/vec.h>
#include <lambent/image/image.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Distant light, as above.
struct Environment {
  std::string name;                   // of a file: its stem
  Image image;                        // radiance, finite, no alpha; non-negative but for band-limited ones
  std::vector<std::string> warnings;  // e.g. how many pixels had to be clamped
};

// `spec` is a picture of the whole sphere (.exr, .hdr; .png and .jpg with a warning; lat-long or cube map, see
// sphere_map.h), or
//   uniform:R,G,B                                          the same radiance everywhere (one number: grey)
//   sky:elevation=E,azimuth=A,turbidity=T,ground=G,sun=on  an analytic sky (sky.h), any subset of the keys
// Of an EXR the display window is the sphere, black where nothing is stored; with the envmap attribute the data window,
// where it has the attribute's shape. Values that are no radiance are mended, see clamp_radiance. Errors: bad spec or
// file, zero size, a shape that no map of the sphere has.
Result<Environment> load_environment(const std::string& spec);
// A file's bytes, as load_environment reads them; `path` names it.
Result<Environment> environment_from_file(std::span<const uint8_t> bytes, const std::string& path);

// Of a lat-long map, up to a pixel twice as wide as high; mended likewise. Errors: another shape.
Result<Environment> environment_from_image(std::string name, Image image);

// Negative channels become 0, infinite ones `largest`, or where that is 0 the largest finite value of the picture; each
// kind is counted in a warning, and so is what is not a number, which fill_missing replaces: by the mean of the up to
// eight finite neighbours, of a map that closes around; where there are none, once those have theirs.
void clamp_radiance(Image& image, float largest, std::vector<std::string>& warnings);
void fill_missing(Image& image);

// Direction of the centre of texel (x, y) of a width x height map, unit; and of any (u, v) in [0, 1]^2.
Vec3 texel_direction(int x, int y, int width, int height);
Vec3 latlong_direction(Vec2 uv);
// In [0, 1]^2 for any direction, of any length; (1/2, 1/2) where it has none.
Vec2 latlong_uv(Vec3 direction);

// Exact solid angle of a texel in row y: (2 pi / width)(cos theta_top - cos theta_bottom). They sum to 4 pi.
double texel_solid_angle(int y, int width, int height);
// Integral of the unit direction over a texel, exact: its solid angle times the mean direction.
Vec3d texel_moment(int x, int y, int width, int height);

// Radiance from direction d (unit): the texel it falls in, or interpolated bilinearly between texel centres (around the
// seam; above the first and below the last row's centres that row alone).
Vec3 radiance(const Environment& env, Vec3 d);
Vec3 radiance_bilinear(const Environment& env, Vec3 d);

// The environment turned by R: radiance of the result at d is that of env at R^-1 d, resampled with `supersample`^2
// points a texel, spread evenly over its solid angle.
Environment rotated(const Environment& env, const Mat3& R, int supersample = 4);

// A map of any function of direction, sampled at texel centres.
Environment make_environment(std::string name, int width, int height, const std::function<Vec3(Vec3)>& f);

// Draws directions with density proportional to the texels' largest |channel|, so that nothing that gives light is
// missed, not even radiance whose luminance cancels. pdf is per solid angle, exact for the piecewise constant map. The
// environment must outlive the sampler.
struct EnvironmentSampler {
  const Environment* environment = nullptr;
  std::vector<double> row_cdf;    // height + 1
  std::vector<double> texel_cdf;  // height x (width + 1)
  double total = 0;               // sum of weight x solid angle
};
struct EnvironmentSample {
  Vec3 direction;
  Vec3 radiance;
  float pdf;  // 0 when nothing could be drawn (a black environment)
};
EnvironmentSampler make_environment_sampler(const Environment& env);
EnvironmentSample sample_environment(const EnvironmentSampler& sampler, Vec2 u);
float environment_pdf(const EnvironmentSampler& sampler, Vec3 direction);

// Irradiance on a plane of unit normal n, by summing all texels: pi for radiance 1. A slow closed sum, for tests and
// reports: exact but for texels that straddle the plane's horizon.
Vec3 irradiance(const Environment& env, Vec3 n);

}  // namespace lambent
