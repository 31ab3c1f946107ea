#pragma once
#include <lambent/core/result.h>
#include <lambent/core/vec.h>
#include <lambent/image/tone.h>

#include <span>
#include <string>
#include <vector>

namespace lambent {

// Linear Rec. 709 RGB and coverage, row by row from the top. `alpha` is empty (all covered) or one value a pixel in [0,
// 1]. rgb is premultiplied by coverage: what is seen in front of black. EXR stores it as it is; PNG stores it
// un-premultiplied with straight alpha, and loading undoes that.
struct Image {
  int width = 0, height = 0;
  std::vector<Vec3> rgb;
  std::vector<float> alpha;
  std::vector<float> coverage;  // share of each pixel that surfaces cover, known to whoever drew them; not in files

  Image() = default;
  Image(int w, int h) : width(w), height(h), rgb(size_t(w) * size_t(h)) {}
  Vec3& at(int x, int y) { return rgb[size_t(y) * size_t(width) + size_t(x)]; }
  const Vec3& at(int x, int y) const { return rgb[size_t(y) * size_t(width) + size_t(x)]; }
};

inline constexpr uint64_t max_image_pixels = uint64_t{1} << 28;

enum class ImageFormat { unknown, exr, hdr, png, jpeg };

// The format that the first bytes announce.
ImageFormat image_format(std::span<const uint8_t> bytes);

// Reads .exr (any compression that OpenEXR has, half or float, luminance-only too; other chromaticities converted to
// Rec. 709), .hdr, or an 8- or 16-bit .png/.jpg (decoded from sRGB to linear). The format is told from the content, not
// from the name. Values come as stored: negatives and NaNs kept. An EXR's data window is the picture, its display
// window is ignored; an .hdr's EXPOSURE and PRIMARIES lines are ignored, as most readers do. Errors: missing,
// truncated, zero size, more than 2^28 pixels, not an image; EXR: several parts, deep, subsampled or luminance/chroma
// channels; .hdr: XYZE, rows not from the top left.
Result<Image> load_image(const std::string& path);
Result<Image> load_image(std::span<const uint8_t> bytes, const std::string& path);

// .exr: linear half floats, ZIP, with alpha where the image has it; finite values beyond +-65504 are clamped to that,
// and `display` is not applied. .png: 8-bit sRGB of what is shown(), opaque unless the image has alpha.
// Written whole or not at all. Errors: another extension; the disk's; too large for the format.
Result<void> save_image(const std::string& path, const Image& image, const Display& display = {});

// Whether a file of so many bytes may claim a picture of this size: at most 2^28 pixels, and beyond the first 4 million
// no more than 8192 a byte, which no honest compressor reaches. Asked before memory is taken.
Result<void> check_image_size(uint64_t width, uint64_t height, size_t bytes, const std::string& path);

// The OpenEXR half of the two above, on bytes. Single floats are for light: the sun is brighter than half floats go.
enum class ExrPrecision { half, single };
Result<Image> load_exr(std::span<const uint8_t> bytes, const std::string& path);
Result<std::vector<uint8_t>> encode_exr(const Image& image, const std::string& path,
                                        ExrPrecision precision = ExrPrecision::half);

// The bytes of a .png as save_image writes it; `path` names it in errors.
Result<std::vector<uint8_t>> encode_png(const Image& image, const Display& display, const std::string& path);

// Matrix from linear RGB of other primaries and white (CIE x, y) to linear Rec. 709: through XYZ, with Bradford
// adaptation of that white to D65. Errors: a y of 0, collinear primaries.
Result<Mat3> rec709_from_primaries(Vec2 red, Vec2 green, Vec2 blue, Vec2 white);

// The sRGB transfer curve (IEC 61966-2-1), clamped to [0, 1]; NaN gives 0.
float srgb_encode(float linear);
float srgb_decode(float encoded);

// Pixels as shown() in front of black, sRGB-encoded; without alpha.
Image displayed(const Image& image, const Display& display);

// Pixel by pixel: two renderings with different seeds make one of twice the samples. Sizes must agree.
Image mean_of(Image a, const Image& b);

// Pictures of equal height side by side.
Image beside(std::span<const Image> images);

// Colour of x in [0, 1] on a map from black through purple, orange and yellow to white whose CIE lightness is 100 x,
// linear RGB; values outside are clamped.
Vec3 false_color(float x);

// Text in a small built-in bitmap font (printable ASCII, others as a box), for labels in pictures; `scale` pixels a
// dot. A character is 5 x 7 dots, the advance 6, a line 9. (x, y) is the top left corner; what falls outside is cut
// off.
void draw_text(Image& image, int x, int y, const std::string& text, Vec3 color, int scale = 1);

}  // namespace lambent
