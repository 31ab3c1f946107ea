// Formats: PNG (ISO/IEC 15948), JPEG (ITU-T T.81), by way of stb_image.
#include <lambent/scene/textures.h>

#include <stb_image.h>

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

}  // namespace

std::string image_mime_type(std::span<const uint8_t> encoded) {
  static constexpr uint8_t png[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, jpeg[3] = {0xff, 0xd8, 0xff};
  if (encoded.size() >= sizeof png && std::memcmp(encoded.data(), png, sizeof png) == 0) return "image/png";
  if (encoded.size() >= sizeof jpeg && std::memcmp(encoded.data(), jpeg, sizeof jpeg) == 0) return "image/jpeg";
  return {};
}

Result<void> decode_texture(std::span<const uint8_t> encoded, const std::string& where, Texture& texture) {
  std::string type = image_mime_type(encoded);
  if (type.empty()) return Error{where, "is neither PNG nor JPEG"};
  if (encoded.size() > INT_MAX) return Error{where, "is larger than 2 GiB"};
  const int size = int(encoded.size());
  int width = 0, height = 0, channels = 0;
  if (!stbi_info_from_memory(encoded.data(), size, &width, &height, &channels)) return Error{where, "is broken"};
  if (width <= 0 || height <= 0) return Error{where, "is empty"};
  if (width > max_texture_side || height > max_texture_side) {
    return Error{where, "measures " + std::to_string(width) + " x " + std::to_string(height) +
                            " pixels; the limit is " + std::to_string(max_texture_side) + " a side"};
  }
  if (uint64_t(width) * uint64_t(height) > most_pixels(encoded, type == "image/png")) {
    return Error{where, "is broken: too few bytes for its size"};
  }
  constexpr int rgb = 3;
  stbi_uc* pixels = stbi_load_from_memory(encoded.data(), size, &width, &height, &channels, rgb);
  if (!pixels) return Error{where, std::string("cannot be decoded: ") + stbi_failure_reason()};
  texture.width = width, texture.height = height, texture.mime_type = type;
  texture.rgb.assign(pixels, pixels + size_t(width) * size_t(height) * rgb);
  stbi_image_free(pixels);
  return {};
}

Result<Texture> decode_texture(std::vector<uint8_t> encoded, const std::string& name) {
  Texture texture;
  if (auto decoded = decode_texture(encoded, name, texture); !decoded) return decoded.error();
  texture.name = name;
  texture.encoded = std::move(encoded);
  return texture;
}

}  // namespace lambent
