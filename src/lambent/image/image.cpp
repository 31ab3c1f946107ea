// Radiance .hdr: Ward 1991, "Real pixels" (Graphics Gems II), with the run-length codes of the Radiance distribution.
// sRGB: IEC 61966-2-1. CIELAB: CIE 15.
#include <lambent/core/check.h>
#include <lambent/core/file.h>
#include <lambent/image/image.h>

#include <stb_image.h>
#include <stb_image_write.h>

#include <array>
#include <charconv>
#include <climits>
#include <cstring>
#include <memory>
#include <string_view>

namespace lambent {
namespace {

// --- Radiance .hdr

struct HdrReader {
  std::span<const uint8_t> bytes;
  size_t at = 0;
  bool truncated = false;  // set where bytes were missing

  size_t left() const { return bytes.size() - at; }
  bool has(size_t count) {
    truncated |= left() < count;
    return !truncated;
  }

  // The next line without its end; false at the end of the file.
  bool line(std::string_view& text) {
    const char* begin = reinterpret_cast<const char*>(bytes.data()) + at;
    const void* end = left() ? std::memchr(begin, '\n', left()) : nullptr;
    if (!end) return false;
    text = {begin, size_t(static_cast<const char*>(end) - begin)};
    at += text.size() + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return true;
  }
};

// m 2^(e - 136); mantissas are not rounded up by half a step, as in most readers.
Vec3 decode_rgbe(const uint8_t* p) {
  if (p[3] == 0) return Vec3(0);
  float scale = std::ldexp(1.0f, int(p[3]) - 136);
  return Vec3(p[0], p[1], p[2]) * scale;
}

// "-Y height +X width"
Result<void> parse_resolution(std::string_view text, uint64_t& width, uint64_t& height, const std::string& path) {
  std::array<std::string_view, 4> words;
  size_t count = 0;
  for (size_t i = 0; i < text.size();) {
    size_t end = std::min(text.find(' ', i), text.size());
    if (end > i) {
      if (count == 4) return Error{path, "bad resolution line"};
      words[count++] = text.substr(i, end - i);
    }
    i = end + 1;
  }
  auto number = [](std::string_view word, uint64_t& value) {
    auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    return code == std::errc() && end == word.data() + word.size();
  };
  auto is_axis = [](std::string_view word) {
    return word.size() == 2 && (word[0] == '+' || word[0] == '-') && (word[1] == 'X' || word[1] == 'Y');
  };
  if (count != 4 || !is_axis(words[0]) || !is_axis(words[2]) || words[0][1] == words[2][1] ||
      !number(words[1], height) || !number(words[3], width))
    return Error{path, "bad resolution line"};
  if (words[0] != "-Y" || words[2] != "+X")
    return Error{path, "rows run " + std::string(words[0]) + " " + std::string(words[2]) + ": only -Y +X is read"};
  return {};
}

// One row of the newer code: four planes of runs. False when the bytes end or a run leaves the row.
bool read_planes(HdrReader& in, size_t width, std::vector<uint8_t>& row) {
  for (size_t channel = 0; channel < 4; ++channel) {
    for (size_t x = 0; x < width;) {
      if (!in.has(2)) return false;
      size_t count = in.bytes[in.at++];
      bool run = count > 128;
      if (run) count -= 128;
      if (count == 0 || count > width - x || !in.has(run ? 1 : count)) return false;
      for (size_t i = 0; i < count; ++i) row[(x + i) * 4 + channel] = in.bytes[in.at + (run ? 0 : i)];
      in.at += run ? 1 : count;
      x += count;
    }
  }
  return true;
}

// One row flat or of the older code, where (1, 1, 1, n) repeats the pixel before it and successive ones shift n by 8
// bits.
bool read_pixels(HdrReader& in, size_t width, std::vector<Vec3>& pixels) {
  int shift = 0;
  for (size_t x = 0; x < width;) {
    if (!in.has(4)) return false;
    const uint8_t* p = in.bytes.data() + in.at;
    in.at += 4;
    if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
      if (x == 0 || shift > 24) return false;
      uint64_t count = uint64_t(p[3]) << shift;
      if (count > width - x) return false;
      pixels.insert(pixels.end(), size_t(count), Vec3(pixels.back()));
      x += size_t(count), shift += 8;
    } else {
      pixels.push_back(decode_rgbe(p));
      ++x, shift = 0;
    }
  }
  return true;
}

Result<Image> load_hdr(std::span<const uint8_t> bytes, const std::string& path) {
  HdrReader in{bytes};
  std::string_view text;
  if (!in.line(text)) return Error{path, "truncated header"};
  for (;;) {
    if (!in.line(text)) return Error{path, "truncated header"};
    if (text.empty()) break;
    if (text.starts_with("FORMAT=") && text != "FORMAT=32-bit_rle_rgbe")
      return Error{path,
                   text == "FORMAT=32-bit_rle_xyze" ? "XYZE pixels are not read, only RGBE" : "unknown pixel format"};
  }
  if (!in.line(text)) return Error{path, "truncated header"};
  uint64_t width = 0, height = 0;
  if (auto ok = parse_resolution(text, width, height, path); !ok) return ok.error();
  if (auto ok = check_image_size(width, height, bytes.size(), path); !ok) return ok.error();
  if (height > in.left() / 4) return Error{path, "truncated: fewer bytes than rows need"};

  Image image;
  image.width = int(width), image.height = int(height);
  image.rgb.reserve(size_t(width * height));
  bool planes_possible = width >= 8 && width < 32768;
  std::vector<uint8_t> row(planes_possible ? size_t(width) * 4 : 0);
  for (size_t y = 0; y < height; ++y) {
    const uint8_t* p = bytes.data() + in.at;
    bool ok;
    if (planes_possible && in.left() >= 4 && p[0] == 2 && p[1] == 2 && (size_t(p[2]) << 8 | p[3]) == width) {
      in.at += 4;
      ok = read_planes(in, size_t(width), row);
      if (ok)
        for (size_t x = 0; x < width; ++x) image.rgb.push_back(decode_rgbe(&row[x * 4]));
    } else {
      ok = read_pixels(in, size_t(width), image.rgb);
    }
    if (!ok) return Error{path, (in.truncated ? "truncated in row " : "bad run in row ") + std::to_string(y)};
  }
  return image;
}

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
  if (auto ok = check_image_size(uint64_t(width), uint64_t(height), bytes.size(), path); !ok) return ok.error();
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

Result<void> check_image_size(uint64_t width, uint64_t height, size_t bytes, const std::string& path) {
  constexpr uint64_t free_pixels = uint64_t{1} << 22, pixels_a_byte = 8192;
  if (width == 0 || height == 0) return Error{path, "image has no pixels"};
  if (width > max_image_pixels || height > max_image_pixels / width)
    return Error{path,
                 "image of " + std::to_string(width) + " x " + std::to_string(height) + " is larger than 2^28 pixels"};
  uint64_t beyond = width * height > free_pixels ? width * height - free_pixels : 0;
  if (beyond / pixels_a_byte > bytes)
    return Error{path,
                 "image of " + std::to_string(width) + " x " + std::to_string(height) + " does not fit its few bytes"};
  return {};
}

ImageFormat image_format(std::span<const uint8_t> bytes) {
  auto starts = [&](std::string_view magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  if (starts("\x76\x2f\x31\x01")) return ImageFormat::exr;
  if (starts("#?")) return ImageFormat::hdr;
  if (starts("\x89PNG\r\n\x1a\n")) return ImageFormat::png;
  if (starts("\xff\xd8\xff")) return ImageFormat::jpeg;
  return ImageFormat::unknown;
}

Result<Image> load_image(std::span<const uint8_t> bytes, const std::string& path) {
  if (bytes.empty()) return Error{path, "empty file"};
  ImageFormat format = image_format(bytes);
  switch (format) {
    case ImageFormat::exr: return load_exr(bytes, path);
    case ImageFormat::hdr: return load_hdr(bytes, path);
    case ImageFormat::png:
    case ImageFormat::jpeg: return load_stb(bytes, format, path);
    case ImageFormat::unknown: break;
  }
  std::string extension = file_extension(path);
  for (const char* known : {"exr", "hdr", "png", "jpg", "jpeg"})
    if (extension == known) return Error{path, "does not begin as an ." + extension + " file does"};
  return Error{path, "not an image that can be read (.exr, .hdr, .png, .jpg)"};
}

Result<Image> load_image(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return load_image(file->bytes(), path);
}

Result<void> save_image(const std::string& path, const Image& image, const Display& display) {
  LAMBENT_CHECK(image.width > 0 && image.height > 0 && image.rgb.size() == size_t(image.width) * size_t(image.height));
  LAMBENT_CHECK(image.alpha.empty() || image.alpha.size() == image.rgb.size());
  std::string extension = file_extension(path);
  if (extension != "exr" && extension != "png") return Error{path, "pictures are written as .exr or .png"};
  auto encoded = extension == "exr" ? encode_exr(image, path) : encode_png(image, display, path);
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
