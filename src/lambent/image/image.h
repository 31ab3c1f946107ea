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

// What OpenEXR's `envmap` attribute says a picture of the whole sphere is.
enum class Envmap { unsaid, latlong, cube };

// A picture with what its file says beside its pixels.
struct ImageFile {
  Image image;  // as stored; of an EXR the data window
  ImageFormat format = ImageFormat::unknown;
  // EXR: where the data window's first pixel lies in the display window, and how large that is.
  int left = 0, top = 0, width = 0, height = 0;
  Envmap envmap = Envmap::unsaid;
  float largest = 0;  // the largest finite number of the type it was stored in, where that is why values are infinite
  std::vector<std::string> warnings;  // one line each
};

// Reads .exr (any compression that OpenEXR has; half, float or whole; R, G, B, or luminance with or without chroma;
// other chromaticities converted to Rec. 709; of layers and parts the one that alone can be meant), Radiance's .hdr and
// .pic (RGBE and XYZE, rows and columns from any corner; EXPOSURE and COLORCORR divided out, PRIMARIES converted to
// Rec. 709), or an 8- or 16-bit .png/.jpg (decoded from sRGB to linear). The format is told from the content, not from
// the name. Values come as stored: negatives, infinities and NaNs kept. Errors: missing, truncated, zero size, more
// than 2^28 pixels, fewer bytes than such a size takes (check_image_size), not an image; EXR: deep, subsampled colour,
// several layers or parts any of which may be meant.
Result<ImageFile> load_image_file(std::span<const uint8_t> bytes, const std::string& path);
// What of it lies in its display window, whole; black, and transparent where it has alpha, where nothing was stored.
// Errors: nothing lies there.
Result<Image> in_display_window(ImageFile file, const std::string& path);

// Both. Warnings are added to `warnings`, where that is not null.
Result<Image> load_image(const std::string& path, std::vector<std::string>* warnings = nullptr);
Result<Image> load_image(std::span<const uint8_t> bytes, const std::string& path,
                         std::vector<std::string>* warnings = nullptr);

// .exr: linear half floats, or single ones where light goes beyond +-65504, ZIP, with alpha where the image has it;
// `display` is not applied. .png: 8-bit sRGB of what is shown(), opaque unless the image has alpha.
// Written whole or not at all. Errors: another extension; the disk's; too large for the format.
Result<void> save_image(const std::string& path, const Image& image, const Display& display = {});

// Whether a file of so many bytes may claim a picture of this size: at most 2^28 pixels, and beyond the first 4 million
// no more than `pixels_a_byte`. No honest compressor of OpenEXR's reaches 8192; a byte of .hdr, .png or .jpg makes more
// than 64 where all is of one colour. Asked before memory is taken.
inline constexpr uint64_t exr_pixels_a_byte = 8192, other_pixels_a_byte = 64;
Result<void> check_image_size(uint64_t width, uint64_t height, size_t bytes, const std::string& path,
                              uint64_t pixels_a_byte = exr_pixels_a_byte);

// Two of load_image_file's readers.
Result<ImageFile> load_hdr(std::span<const uint8_t> bytes, const std::string& path);
Result<ImageFile> load_exr(std::span<const uint8_t> bytes, const std::string& path);

// An .exr's bytes. Single floats are for light: the sun is brighter than half floats go. Half floats clamp what is
// finite to +-65504.
enum class ExrPrecision { half, single };
Result<std::vector<uint8_t>> encode_exr(const Image& image, const std::string& path,
                                        ExrPrecision precision = ExrPrecision::half);

// The bytes of a .png as save_image writes it; `path` names it in errors.
Result<std::vector<uint8_t>> encode_png(const Image& image, const Display& display, const std::string& path);

// Matrix from linear RGB of other primaries and white (CIE x, y) to linear Rec. 709: through XYZ, with Bradford
// adaptation of that white to D65. Errors: a y of 0, collinear primaries.
Result<Mat3> rec709_from_primaries(Vec2 red, Vec2 green, Vec2 blue, Vec2 white);
// And from CIE XYZ, with that white adapted to D65. Errors: no colour.
Result<Mat3> rec709_from_xyz(Vec2 white);
// By such a matrix; one that is the identity but for rounding changes no bit.
void convert_color(std::vector<Vec3>& pixels, const Mat3& m);

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
