// Formats: PNG (ISO/IEC 15948), JPEG (ITU-T T.81), and TGA, BMP, PSD and PNM as PNG, by way of stb_image; WebP (RFC
// 9649), by way of libwebp.
#include <lambent/scene/textures.h>

#include <stb_image.h>
#include <stb_image_write.h>
#include <webp/decode.h>

#include <algorithm>
#include <climits>
#include <cstring>

namespace lambent {
namespace {

Error too_large(const std::string& where, int width, int height) {
  return {where, "measures " + std::to_string(width) + " x " + std::to_string(height) + " pixels; the limit is " +
                     std::to_string(max_texture_side) + " a side"};
}
Error too_short(const std::string& where) { return {where, "is broken: too few bytes for its size"}; }

// The most pixels that this many encoded bytes can hold, so that a few bytes cannot ask for gigabytes. Deflate expands
// at most 1032 times; a PNG pixel has at least `bits` bits. A JPEG block of 64 pixels takes at least one bit.
uint64_t most_pixels(std::span<const uint8_t> encoded, bool png) {
  uint64_t size = encoded.size();
  if (!png) return size * 8 * 64;
  constexpr size_t depth_at = 24, colour_type_at = 25;  // in the IHDR chunk, which comes first
  if (size <= colour_type_at) return 0;
  int type = encoded[colour_type_at], channels = type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1;
  uint64_t bits = uint64_t(channels) * std::max<uint64_t>(encoded[depth_at], 1);
  return size * 1032 * 8 / bits;
}

bool encode_png(const uint8_t* pixels, int width, int height, int channels, std::vector<uint8_t>& png) {
  auto append = [](void* to, void* bytes, int n) {
    auto& encoded = *static_cast<std::vector<uint8_t>*>(to);
    encoded.insert(encoded.end(), static_cast<uint8_t*>(bytes), static_cast<uint8_t*>(bytes) + n);
  };
  return stbi_write_png_to_func(append, &png, width, height, channels, pixels, 0);
}

bool begins(std::span<const uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

// The same for the formats that are decoded to become PNG: a byte a pixel or more; a BMP a bit, runs up to 128 pixels.
uint64_t most_plain_pixels(std::span<const uint8_t> encoded) {
  uint64_t size = encoded.size();
  if (begins(encoded, "BM")) return size * 8;
  if (begins(encoded, "8BPS")) return size * 128;
  if (begins(encoded, "P5")) return size;
  if (begins(encoded, "P6")) return size / 3;
  constexpr size_t header = 18, kind_at = 2, bits_at = 16;
  if (size <= header) return 0;
  bool runs = encoded[kind_at] >= 8;
  return runs ? size * 128 : (size - header) / std::max(1, (encoded[bits_at] + 7) / 8);
}

// A TGA, BMP, PSD (flattened, 8 or 16 bits) or binary PNM as the PNG that glTF takes in its place.
Result<std::vector<uint8_t>> png_from(std::span<const uint8_t> encoded, const std::string& where) {
  for (std::string_view other : {"GIF8", "DDS ", "RIFF", "II*", "MM", "#?", "v/1\x01", "<svg", "\xabKTX"}) {
    if (begins(encoded, other)) return Error{where, "is no PNG, JPEG, WebP, TGA, BMP, PSD or PNM"};
  }
  int width = 0, height = 0, channels = 0;
  if (encoded.size() > INT_MAX) return Error{where, "is larger than 2 GiB"};
  const int size = int(encoded.size());
  if (!stbi_info_from_memory(encoded.data(), size, &width, &height, &channels) || width <= 0 || height <= 0)
    return Error{where, "is no PNG, JPEG, WebP, TGA, BMP, PSD or PNM"};
  if (width > max_texture_side || height > max_texture_side) return too_large(where, width, height);
  if (uint64_t(width) * uint64_t(height) > most_plain_pixels(encoded)) return too_short(where);
  // The decoder takes rows that are missing for whatever memory held: give it black.
  std::vector<uint8_t> padded(encoded.begin(), encoded.end());
  constexpr size_t widest = 8;  // four channels of 16 bits
  padded.resize(std::min<size_t>(padded.size() + widest * size_t(width) * size_t(height), INT_MAX));
  const int wanted = channels == 2 || channels == 4 ? 4 : 3;
  stbi_uc* pixels = stbi_load_from_memory(padded.data(), int(padded.size()), &width, &height, &channels, wanted);
  if (!pixels) return Error{where, std::string("cannot be decoded: ") + stbi_failure_reason()};
  std::vector<uint8_t> result;
  bool written = encode_png(pixels, width, height, wanted, result);
  stbi_image_free(pixels);
  if (!written) return Error{where, "cannot be encoded"};
  return result;
}

Result<void> check_size(int width, int height, size_t bytes, const std::string& where) {
  if (width <= 0 || height <= 0) return Error{where, "is empty"};
  const std::string measures = "measures " + std::to_string(width) + " x " + std::to_string(height) + " pixels; ";
  if (width > max_texture_side || height > max_texture_side)
    return Error{where, measures + "the limit is " + std::to_string(max_texture_side) + " a side"};
  if (uint64_t(width) * uint64_t(height) > free_texture_pixels + texture_pixels_a_byte * bytes)
    return Error{where, measures + "its few bytes may not expand so far"};
  return {};
}

// Pixels of three or four bytes.
void keep_pixels(const uint8_t* pixels, int channels, Texture& texture) {
  const size_t count = size_t(texture.width) * size_t(texture.height);
  texture.alpha.clear();
  if (channels == 3) {
    texture.rgb.assign(pixels, pixels + count * 3);
    return;
  }
  texture.rgb.resize(count * 3), texture.alpha.resize(count);
  bool solid = true;
  for (size_t i = 0; i < count; ++i) {
    std::copy_n(pixels + 4 * i, 3, texture.rgb.data() + 3 * i);
    texture.alpha[i] = pixels[4 * i + 3], solid &= texture.alpha[i] == 255;
  }
  if (solid) texture.alpha = {};
}

Result<void> decode_stb(std::span<const uint8_t> encoded, bool png, const std::string& where, Texture& texture) {
  const int size = int(encoded.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(encoded.data(), size, &width, &height, &channels)) return Error{where, "is broken"};
  if (auto fits = check_size(width, height, encoded.size(), where); !fits) return fits;
  if (uint64_t(width) * uint64_t(height) > most_pixels(encoded, png))
    return Error{where, "is broken: too few bytes for its size"};
  const int kept = channels == 2 || channels == 4 ? 4 : 3;
  stbi_uc* pixels = stbi_load_from_memory(encoded.data(), size, &width, &height, &channels, kept);
  if (!pixels) return Error{where, std::string("cannot be decoded: ") + stbi_failure_reason()};
  texture.width = width, texture.height = height;
  keep_pixels(pixels, kept, texture);
  stbi_image_free(pixels);
  return {};
}

Result<void> decode_webp(std::span<const uint8_t> encoded, const std::string& where, Texture& texture) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(encoded.data(), encoded.size(), &features) != VP8_STATUS_OK) return Error{where, "is broken"};
  if (features.has_animation) return Error{where, "is an animation"};
  if (auto fits = check_size(features.width, features.height, encoded.size(), where); !fits) return fits;
  int width = 0, height = 0;
  uint8_t* pixels =
      (features.has_alpha ? WebPDecodeRGBA : WebPDecodeRGB)(encoded.data(), encoded.size(), &width, &height);
  if (!pixels) return Error{where, "cannot be decoded"};
  texture.width = width, texture.height = height;
  keep_pixels(pixels, features.has_alpha ? 4 : 3, texture);
  WebPFree(pixels);
  return {};
}

}  // namespace

std::string image_mime_type(std::span<const uint8_t> encoded) {
  static constexpr uint8_t png[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, jpeg[3] = {0xff, 0xd8, 0xff};
  if (encoded.size() >= sizeof png && std::memcmp(encoded.data(), png, sizeof png) == 0) return "image/png";
  if (encoded.size() >= sizeof jpeg && std::memcmp(encoded.data(), jpeg, sizeof jpeg) == 0) return "image/jpeg";
  constexpr size_t kind_at = 8;  // after "RIFF" and a size
  if (encoded.size() >= kind_at + 4 && std::memcmp(encoded.data(), "RIFF", 4) == 0 &&
      std::memcmp(encoded.data() + kind_at, "WEBP", 4) == 0)
    return "image/webp";
  return {};
}

Result<void> decode_texture(std::span<const uint8_t> encoded, const std::string& where, Texture& texture) {
  std::string type = image_mime_type(encoded);
  if (type.empty()) return Error{where, "is neither PNG, JPEG nor WebP"};
  if (encoded.size() > INT_MAX) return Error{where, "is larger than 2 GiB"};
  texture.mime_type = type;
  return type == "image/webp" ? decode_webp(encoded, where, texture)
                              : decode_stb(encoded, type == "image/png", where, texture);
}

Result<Texture> decode_texture(std::vector<uint8_t> encoded, const std::string& name) {
  Texture texture;
  if (image_mime_type(encoded).empty()) {
    auto png = png_from(encoded, name);
    if (!png) return png.error();
    encoded = std::move(*png);
  }
  if (auto decoded = decode_texture(encoded, name, texture); !decoded) return decoded.error();
  texture.name = name;
  texture.encoded = std::move(encoded);
  return texture;
}

Result<Texture> with_alpha(const Texture& color, const Texture& mask, const std::string& name) {
  const bool white = color.rgb.empty();
  Texture out;
  out.name = name, out.mime_type = "image/png", out.wrap_s = color.wrap_s, out.wrap_t = color.wrap_t;
  out.width = white ? mask.width : color.width, out.height = white ? mask.height : color.height;
  if (out.width <= 0 || out.height <= 0) return Error{name, "has no pixels"};
  const size_t count = size_t(out.width) * size_t(out.height);
  out.rgb = white ? std::vector<uint8_t>(count * 3, 255) : color.rgb;
  out.alpha.resize(count);
  std::vector<uint8_t> rgba(count * 4);
  for (size_t i = 0; i < count; ++i) {
    const Vec2 uv((float(i % size_t(out.width)) + 0.5f) / float(out.width),
                  (float(i / size_t(out.width)) + 0.5f) / float(out.height));
    const float a = mask.alpha.empty() ? sample_linear_texture(mask, uv).x : sample_alpha(mask, uv);
    out.alpha[i] = rgba[4 * i + 3] = uint8_t(a * 255 + 0.5f);
    std::copy_n(out.rgb.data() + 3 * i, 3, rgba.data() + 4 * i);
  }
  if (!encode_png(rgba.data(), out.width, out.height, 4, out.encoded)) return Error{name, "cannot be encoded"};
  return out;
}

}  // namespace lambent
