// Bradford adaptation: Lam 1985; matrices from primaries: SMPTE RP 177.
#include <lambent/image/image.h>

namespace lambent {
namespace {

Vec3d xyz_of(Vec2 c) { return {c.x, c.y, 1.0 - double(c.x) - double(c.y)}; }

// RGB -> XYZ with the white's Y = 1.
Result<Mat3d> xyz_from_rgb(Vec2 red, Vec2 green, Vec2 blue, Vec2 white) {
  Mat3d primaries(xyz_of(red), xyz_of(green), xyz_of(blue));
  double determinant = lambent::determinant(primaries);
  if (!(std::abs(determinant) > 1e-6) || !(std::abs(white.y) > 1e-6f) || !std::isfinite(determinant))
    return Error{"", "chromaticities do not span a colour space"};
  Vec3d scale = inverse(primaries) * (xyz_of(white) / double(white.y));
  return Mat3d(primaries[0] * scale[0], primaries[1] * scale[1], primaries[2] * scale[2]);
}

constexpr Vec2 rec709_red{0.64f, 0.33f}, rec709_green{0.30f, 0.60f}, rec709_blue{0.15f, 0.06f}, d65{0.3127f, 0.3290f};

// XYZ as seen under `white` (its XYZ) -> Rec. 709.
Result<Mat3d> rec709_from_white(Vec3d white) {
  auto target = xyz_from_rgb(rec709_red, rec709_green, rec709_blue, d65);
  const Mat3d cone = transpose(Mat3d(0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296));
  const Vec3d from = cone * white, to = cone * (*target * Vec3d(1));
  for (int i = 0; i < 3; ++i)
    if (!(from[i] > 1e-6)) return Error{"", "white point is not a colour"};
  const Mat3d adapt = inverse(cone) * Mat3d(to.x / from.x, 0, 0, 0, to.y / from.y, 0, 0, 0, to.z / from.z) * cone;
  return inverse(*target) * adapt;
}

}  // namespace

Result<Mat3> rec709_from_primaries(Vec2 red, Vec2 green, Vec2 blue, Vec2 white) {
  auto source = xyz_from_rgb(red, green, blue, white);
  if (!source) return source.error();
  auto matrix = rec709_from_white(*source * Vec3d(1));
  if (!matrix) return matrix.error();
  return Mat3(*matrix * *source);
}

Result<Mat3> rec709_from_xyz(Vec2 white) {
  if (!(std::abs(white.y) > 1e-6f)) return Error{"", "white point is not a colour"};
  auto matrix = rec709_from_white(xyz_of(white) / double(white.y));
  if (!matrix) return matrix.error();
  return Mat3(*matrix);
}

void convert_color(std::vector<Vec3>& pixels, const Mat3& m) {
  // Files print chromaticities with few digits, or print Rec. 709 as adapted to another white.
  constexpr float rounding = 5e-4f;
  bool identity = true;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) identity &= std::abs(m[column][row] - (row == column ? 1.0f : 0.0f)) <= rounding;
  if (identity) return;
  for (Vec3& v : pixels) v = m * v;
}

}  // namespace lambent
