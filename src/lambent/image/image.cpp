// sRGB: IEC 61966-2-1. CIELAB: CIE 15.
#include <lambent/core/check.h>
#include <lambent/core/file.h>
#include <lambent/image/image.h>
#include <lambent/image/picture_name.h>

#include <stb_image.h>
#include <stb_image_write.h>

#include <climits>
#include <cstring>
#include <limits>
#include <memory>
#include <string_view>

namespace lambent {
namespace {

// --- PNG and JPEG

struct FreeStb {
  void operator()(void* p) const { stbi_image_free(p); }
};

// stb fills the rest of a truncated JPEG with grey: walk its markers to the end of the image instead of trusting it.
bool jpeg_is_whole(std::span<const uint8_t> bytes) {
  size_t i = 2;
  while (i + 1 < bytes.size()) {
    if (bytes[i] != 0xff) {
      ++i;
      continue;
    }
    uint8_t marker = bytes[i + 1];
    if (marker == 0xff) {
      ++i;
      continue;
    }
    i += 2;
    if (marker == 0xd9) return true;
    if (marker == 0 || marker == 1 || (marker >= 0xd0 && marker <= 0xd8))
      continue;  // stuffing, or markers without a length
    if (i + 2 > bytes.size()) return false;
    i += size_t(bytes[i]) << 8 | bytes[i + 1];
  }
  return false;
}

template <class T>
Image decode_channels(const T* p, int width, int height, int channels) {
  constexpr float full = float(std::numeric_limits<T>::max());
  std::vector<float> linear(size_t(std::numeric_limits<T>::max()) + 1);
  for (size_t i = 0; i < linear.size(); ++i) linear[i] = srgb_decode(float(i) / full);
  Image image(width, height);
  bool has_alpha = channels == 2 || channels == 4;
  if (has_alpha) image.alpha.resize(image.rgb.size());
  for (size_t i = 0; i < image.rgb.size(); ++i, p += channels) {
    image.rgb[i] = channels < 3 ? Vec3(linear[p[0]]) : Vec3(linear[p[0]], linear[p[1]], linear[p[2]]);
    if (has_alpha) image.alpha[i] = float(p[channels - 1]) / full, image.rgb[i] *= image.alpha[i];
  }
  return image;
}

Result<Image> load_stb(std::span<const uint8_t> bytes, ImageFormat format, const std::string& path) {
  if (bytes.size() > INT_MAX) return Error{path, "file is larger than 2 GiB"};
  int size = int(bytes.size()), width = 0, height = 0, channels = 0;
  auto failure = [&] {
    const char* why = stbi_failure_reason();
    return Error{path,
                 std::string(format == ImageFormat::png ? "bad PNG: " : "bad JPEG: ") + (why ? why : "unreadable")};
  };
  if (!stbi_info_from_memory(bytes.data(), size, &width, &height, &channels)) return failure();
  if (auto ok = check_image_size(uint64_t(width), uint64_t(height), bytes.size(), path, other_pixels_a_byte); !ok)
    return ok.error();
  if (format == ImageFormat::jpeg && !jpeg_is_whole(bytes)) return Error{path, "truncated"};
  if (stbi_is_16_bit_from_memory(bytes.data(), size)) {
    std::unique_ptr<stbi_us, FreeStb> p(stbi_load_16_from_memory(bytes.data(), size, &width, &height, &channels, 0));
    return p ? Result<Image>(decode_channels(p.get(), width, height, channels)) : failure();
  }
  std::unique_ptr<stbi_uc, FreeStb> p(stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, 0));
  return p ? Result<Image>(decode_channels(p.get(), width, height, channels)) : failure();
}

}  // namespace

Result<std::vector<uint8_t>> encode_png(const Image& image, const Display& display, const std::string& path) {
  size_t channels = image.alpha.empty() ? 3 : 4;
  // stb counts bytes in int, with a filter byte a row and room for incompressible data.
  if (image.rgb.size() > size_t(INT_MAX) / 8) return Error{path, "image is too large for a PNG"};
  std::vector<uint8_t> pixels(image.rgb.size() * channels), encoded;
  for (size_t i = 0; i < image.rgb.size(); ++i) {
    float alpha = image.alpha.empty() ? 1.0f : std::fmin(std::fmax(image.alpha[i], 0.0f), 1.0f);
    const Vec3 straight = shown(alpha > 0 ? image.rgb[i] / alpha : Vec3(0), display);
    uint8_t* p = &pixels[i * channels];
    for (int c = 0; c < 3; ++c) p[c] = uint8_t(srgb_encode(straight[c]) * 255 + 0.5f);
    if (channels == 4) p[3] = uint8_t(alpha * 255 + 0.5f);
  }
  auto append = [](void* context, void* data, int size) {
    auto* out = static_cast<std::vector<uint8_t>*>(context);
    out->insert(out->end(), static_cast<uint8_t*>(data), static_cast<uint8_t*>(data) + size);
  };
  if (!stbi_write_png_to_func(append, &encoded, image.width, image.height, int(channels), pixels.data(), 0))
    return Error{path, "PNG could not be encoded"};
  return encoded;
}

Result<void> check_image_size(uint64_t width, uint64_t height, size_t bytes, const std::string& path,
                              uint64_t pixels_a_byte) {
  constexpr uint64_t free_pixels = uint64_t{1} << 22;
  if (width == 0 || height == 0) return Error{path, "image has no pixels"};
  const std::string image = "image of " + std::to_string(width) + " x " + std::to_string(height);
  if (width > max_image_pixels || height > max_image_pixels / width)
    return Error{path, image + " is larger than 2^28 pixels"};
  uint64_t beyond = width * height > free_pixels ? width * height - free_pixels : 0;
  if (beyond / pixels_a_byte > bytes)
    return Error{path, image + " does not fit its few bytes: at most " + std::to_string(pixels_a_byte) +
                           " pixels a byte beyond 2^22"};
  return {};
}

namespace {

bool starts(std::span<const uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

// What Debian has no small reader of, by its first bytes.
constexpr std::pair<std::string_view, std::string_view> other_formats[] = {
    {"\xabKTX 20\xbb", "KTX2"}, {"\xabKTX 11\xbb", "KTX"}, {"DDS ", "DDS"},
    {{"II*\0", 4}, "TIFF"},     {{"MM\0*", 4}, "TIFF"},    {"PF\n", "PFM"}};

}  // namespace

ImageFormat image_format(std::span<const uint8_t> bytes) {
  if (starts(bytes, "\x76\x2f\x31\x01")) return ImageFormat::exr;
  if (starts(bytes, "#?")) return ImageFormat::hdr;
  if (starts(bytes, "\x89PNG\r\n\x1a\n")) return ImageFormat::png;
  if (starts(bytes, "\xff\xd8\xff")) return ImageFormat::jpeg;
  return ImageFormat::unknown;
}

Result<ImageFile> load_image_file(std::span<const uint8_t> bytes, const std::string& path) {
  if (bytes.empty()) return Error{path, "empty file"};
  ImageFormat format = image_format(bytes);
  if (format != ImageFormat::exr && !picture_name(path).layer.empty())
    return Error{path, "only OpenEXR files have layers"};
  switch (format) {
    case ImageFormat::exr: return load_exr(bytes, path);
    case ImageFormat::hdr: return load_hdr(bytes, path);
    case ImageFormat::png:
    case ImageFormat::jpeg: {
      auto image = load_stb(bytes, format, path);
      if (!image) return image.error();
      ImageFile file{.image = std::move(*image), .format = format};
      file.width = file.image.width, file.height = file.image.height;
      return file;
    }
    case ImageFormat::unknown: break;
  }
  for (const auto& [magic, name] : other_formats)
    if (starts(bytes, magic)) return Error{path, std::string(name) + " is not read: convert it to .exr, .hdr or .png"};
  std::string extension = file_extension(path);
  for (const char* known : {"exr", "hdr", "png", "jpg", "jpeg"})
    if (extension == known) return Error{path, "does not begin as an ." + extension + " file does"};
  return Error{path, "not an image that can be read (.exr, .hdr, .png, .jpg)"};
}

Result<Image> in_display_window(ImageFile file, const std::string& path) {
  Image& image = file.image;
  if (file.left == 0 && file.top == 0 && file.width == image.width && file.height == image.height)
    return std::move(image);
  const int x0 = std::max(0, file.left), x1 = std::min(file.width, file.left + image.width);
  const int y0 = std::max(0, file.top), y1 = std::min(file.height, file.top + image.height);
  if (x0 >= x1 || y0 >= y1) return Error{path, "its pixels lie outside its display window"};
  Image out(file.width, file.height);
  if (!image.alpha.empty()) out.alpha.resize(out.rgb.size());
  for (int y = y0; y < y1; ++y) {
    const auto from = ptrdiff_t(y - file.top) * image.width + (x0 - file.left), to = ptrdiff_t(y) * out.width + x0;
    std::copy_n(image.rgb.begin() + from, x1 - x0, out.rgb.begin() + to);
    if (!image.alpha.empty()) std::copy_n(image.alpha.begin() + from, x1 - x0, out.alpha.begin() + to);
  }
  return out;
}

Result<Image> load_image(std::span<const uint8_t> bytes, const std::string& path, std::vector<std::string>* warnings) {
  auto file = load_image_file(bytes, path);
  if (!file) return file.error();
  if (warnings) warnings->insert(warnings->end(), file->warnings.begin(), file->warnings.end());
  return in_display_window(std::move(*file), path);
}

Result<Image> load_image(const std::string& path, std::vector<std::string>* warnings) {
  auto file = MappedFile::open(picture_name(path).file);
  if (!file) return file.error();
  return load_image(file->bytes(), path, warnings);
}

Result<void> save_image(const std::string& path, const Image& image, const Display& display) {
  LAMBENT_CHECK(image.width > 0 && image.height > 0 && image.rgb.size() == size_t(image.width) * size_t(image.height));
  LAMBENT_CHECK(image.alpha.empty() || image.alpha.size() == image.rgb.size());
  std::string extension = file_extension(path);
  if (extension != "exr" && extension != "png") return Error{path, "pictures are written as .exr or .png"};
  const bool beyond_half = std::any_of(image.rgb.begin(), image.rgb.end(), [](Vec3 c) {
    return std::max({std::abs(c.x), std::abs(c.y), std::abs(c.z)}) > 65504 && is_finite(c);
  });
  auto encoded = extension == "exr" ? encode_exr(image, path, beyond_half ? ExrPrecision::single : ExrPrecision::half)
                                    : encode_png(image, display, path);
  if (!encoded) return encoded.error();
  std::span<const uint8_t> piece(*encoded);
  return write_file_atomically(path, {&piece, 1});
}

float srgb_encode(float linear) {
  linear = std::fmin(std::fmax(linear, 0.0f), 1.0f);  // NaN becomes 0
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float srgb_decode(float encoded) {
  encoded = std::fmin(std::fmax(encoded, 0.0f), 1.0f);
  return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

Image displayed(const Image& image, const Display& display) {
  Image out(image.width, image.height);
  for (size_t i = 0; i < out.rgb.size(); ++i) {
    const Vec3 c = shown(image.rgb[i], display);
    out.rgb[i] = {srgb_encode(c.x), srgb_encode(c.y), srgb_encode(c.z)};
  }
  return out;
}

Image mean_of(Image a, const Image& b) {
  LAMBENT_CHECK(a.width == b.width && a.height == b.height && a.alpha.size() == b.alpha.size());
  for (size_t i = 0; i < a.rgb.size(); ++i) a.rgb[i] = 0.5f * (a.rgb[i] + b.rgb[i]);
  for (size_t i = 0; i < a.alpha.size(); ++i) a.alpha[i] = 0.5f * (a.alpha[i] + b.alpha[i]);
  if (a.coverage.size() != b.coverage.size()) a.coverage.clear();
  for (size_t i = 0; i < a.coverage.size(); ++i) a.coverage[i] = 0.5f * (a.coverage[i] + b.coverage[i]);
  return a;
}

Image beside(std::span<const Image> images) {
  int width = 0;
  bool any_alpha = false;
  for (const Image& image : images) {
    LAMBENT_CHECK(image.height == images[0].height);
    width += image.width, any_alpha |= !image.alpha.empty();
  }
  Image out(width, images.empty() ? 0 : images[0].height);
  if (any_alpha) out.alpha.assign(out.rgb.size(), 1.0f);
  int left = 0;
  for (const Image& image : images) {
    for (int y = 0; y < image.height; ++y) {
      size_t from = size_t(y) * size_t(image.width), to = size_t(y) * size_t(width) + size_t(left);
      std::copy_n(image.rgb.begin() + ptrdiff_t(from), image.width, out.rgb.begin() + ptrdiff_t(to));
      if (!image.alpha.empty())
        std::copy_n(image.alpha.begin() + ptrdiff_t(from), image.width, out.alpha.begin() + ptrdiff_t(to));
    }
    left += image.width;
  }
  return out;
}

Vec3 false_color(float x) {
  x = std::fmin(std::fmax(x, 0.0f), 1.0f);
  // A path through CIELAB, L* = 100 x. a* and b* were fitted to purple, rose, orange and yellow at lightness 18, 36,
  // 54, 70 and 86; the path stays inside the Rec. 709 gamut.
  float ends = x * (1 - x);
  float L = 100 * x;
  float a = ends * (6 + x * (1176 + x * (-2564 + x * (2547 - x * 1375))));
  float b = ends * (-46 + x * (-2024 + x * (9217 + x * (-12050 + x * 5407))));
  auto inverse = [](float t) { return t > 6 / 29.0f ? t * t * t : 3 * (6 / 29.0f) * (6 / 29.0f) * (t - 4 / 29.0f); };
  float fy = (L + 16) / 116;
  float X = 0.95047f * inverse(fy + a / 500), Y = inverse(fy), Z = 1.08883f * inverse(fy - b / 200);
  Vec3 rgb(3.2404542f * X - 1.5371385f * Y - 0.4985314f * Z, -0.9692660f * X + 1.8760108f * Y + 0.0415560f * Z,
           0.0556434f * X - 0.2040259f * Y + 1.0572252f * Z);
  return clamp(rgb, Vec3(0), Vec3(1));
}

}  // namespace lambent
