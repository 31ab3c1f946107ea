// Formats: PNG (ISO/IEC 15948), JPEG (ITU-T T.81), by way of stb_image; WebP (RFC 9649), by way of libwebp.
#include <lambent/scene/textures.h>

#include <stb_image.h>
#include <webp/decode.h>

#include <algorithm>
#include <climits>
#include <cstring>

namespace lambent {
namespace {

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

Result<void> check_size(int width, int height, size_t bytes, const std::string& where) {
  if (width <= 0 || height <= 0) return Error{where, "is empty"};
  const std::string measures = "measures " + std::to_string(width) + " x " + std::to_string(height) + " pixels; ";
  if (width > max_texture_side || height > max_texture_side)
    return Error{where, measures + "the limit is " + std::to_string(max_texture_side) + " a side"};
  if (uint64_t(width) * uint64_t(height) > free_texture_pixels + texture_pixels_a_byte * bytes)
    return Error{where, measures + "its few bytes may not expand so far"};
  return {};
}

Result<void> decode_stb(std::span<const uint8_t> encoded, bool png, const std::string& where, Texture& texture) {
  const int size = int(encoded.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(encoded.data(), size, &width, &height, &channels)) return Error{where, "is broken"};
  if (auto fits = check_size(width, height, encoded.size(), where); !fits) return fits;
  if (uint64_t(width) * uint64_t(height) > most_pixels(encoded, png))
    return Error{where, "is broken: too few bytes for its size"};
  constexpr int rgb = 3;
  stbi_uc* pixels = stbi_load_from_memory(encoded.data(), size, &width, &height, &channels, rgb);
  if (!pixels) return Error{where, std::string("cannot be decoded: ") + stbi_failure_reason()};
  texture.width = width, texture.height = height;
  texture.rgb.assign(pixels, pixels + size_t(width) * size_t(height) * rgb);
  stbi_image_free(pixels);
  return {};
}

Result<void> decode_webp(std::span<const uint8_t> encoded, const std::string& where, Texture& texture) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(encoded.data(), encoded.size(), &features) != VP8_STATUS_OK) return Error{where, "is broken"};
  if (features.has_animation) return Error{where, "is an animation"};
  if (auto fits = check_size(features.width, features.height, encoded.size(), where); !fits) return fits;
  texture.width = features.width, texture.height = features.height;
  const int row = 3 * features.width;
  texture.rgb.resize(size_t(row) * size_t(features.height));
  if (!WebPDecodeRGBInto(encoded.data(), encoded.size(), texture.rgb.data(), texture.rgb.size(), row))
    return Error{where, "cannot be decoded"};
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
  if (auto decoded = decode_texture(encoded, name, texture); !decoded) return decoded.error();
  texture.name = name;
  texture.encoded = std::move(encoded);
  return texture;
}

}  // namespace lambent
