#pragma once
// How far one picture is from another.
#include <lambent/image/image.h>

namespace lambent {

struct ImageDifference {
  size_t pixels = 0;        // counted: covered (alpha > 0) in either picture; all where neither has alpha
  double rmse = 0;          // root mean square error of linear RGB
  double relative_mse = 0;  // mean of (a - b)^2 / (b^2 + 0.01), linear RGB: b is the reference
  double psnr = 0;          // decibels, of the displayed pictures (displayed() in image.h), peak 1; infinite if equal
  double flip = 0;          // mean LDR-FLIP of the displayed pictures, 67 pixels a degree
  double mean_a = 0, mean_b = 0;  // mean luminance, linear: a ratio away from 1 is a factor, not noise
  // Of the pixels that b displays lit (luminance above a twentieth of white), the part that has less than a tenth of
  // b's luminance in a: places lost in black.
  double black = 0;
};

// Every number counts the pixels that either picture covers, or `all`: an object in the one picture alone is a
// difference, the empty surroundings of both are not. Where only one picture has alpha, it decides. Pixels are compared
// in front of black; FLIP sees the whole picture, and its map is averaged over what is counted.
// Errors: sizes differ, or no pixel is covered, or a counted pixel is not finite.
Result<ImageDifference> compare_images(const Image& a, const Image& b, const Display& display = {}, bool all = false);

// What two references say of a picture, that are each as noisy as they like but independent (of different seeds).
struct UnnoisyDifference {
  // Of the displayed pictures, decibels, peak 1: -10 log10 of the mean of (a - b)(a - c), in which the noise of b and c
  // is not. Infinite where that is not above 0. Noise that a display clips or bends does stay, as a bias.
  double psnr = 0;
  double least = 0, most = 0;  // with twice the standard error of that mean added and taken off
  // The same by the display's slope at a's values instead of displayed values: of differences to their first order, and
  // whatever the noise. Where `a` shows pure black or white it has no slope, and no difference counts.
  double sloped = 0;
  double noise = 0;  // what a PSNR against the mean of b and c can reach for a perfect `a`
};
// Pixels as in compare_images(), of `b` and `c` alike. Errors: as there.
Result<UnnoisyDifference> compare_to_two(const Image& a, const Image& b, const Image& c, const Display& display = {},
                                         bool all = false);

// FLIP error of every pixel, [0, 1], of two displayed pictures of one size (sRGB-encoded values in [0, 1]) at the
// viewing resolution `pixels_per_degree`. Source: Andersson et al. 2020, "FLIP: a difference evaluator for alternating
// images".
std::vector<float> flip_map(const Image& reference, const Image& test, float pixels_per_degree = 67.0f);

// CIELAB of linear Rec. 709 RGB, against D65.
Vec3 cielab(Vec3 linear);

// The HyAB distance of two colours in CIELAB: |dL| + sqrt(da^2 + db^2).
float hyab(Vec3 lab_a, Vec3 lab_b);

// A, B and the false-coloured absolute difference of the displayed pictures (largest channel; white = `white` or more),
// with labels above and a scale below. The display is applied: save or show the result without. The sizes must
// be equal.
Image difference_picture(const Image& a, const Image& b, const Display& display = {}, float white = 0.1f);

}  // namespace lambent
