// Formats: PNG (ISO/IEC 15948), JPEG (ITU-T T.81), by way of stb_image.
#include <lambent/scene/textures.h>

#include <stb_image.h>
#include <stb_image_write.h>

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
  const int kept = channels == 2 || channels == 4 ? 4 : 3;
  stbi_uc* pixels = stbi_load_from_memory(encoded.data(), size, &width, &height, &channels, kept);
  if (!pixels) return Error{where, std::string("cannot be decoded: ") + stbi_failure_reason()};
  texture.width = width, texture.height = height, texture.mime_type = type;
  const size_t count = size_t(width) * size_t(height);
  texture.alpha.clear();
  if (kept == 3) {
    texture.rgb.assign(pixels, pixels + count * 3);
  } else {
    texture.rgb.resize(count * 3), texture.alpha.resize(count);
    bool solid = true;
    for (size_t i = 0; i < count; ++i) {
      std::copy_n(pixels + 4 * i, 3, texture.rgb.data() + 3 * i);
      texture.alpha[i] = pixels[4 * i + 3], solid &= texture.alpha[i] == 255;
    }
    if (solid) texture.alpha = {};
  }
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
  auto append = [](void* to, void* bytes, int n) {
    auto& encoded = *static_cast<std::vector<uint8_t>*>(to);
    encoded.insert(encoded.end(), static_cast<uint8_t*>(bytes), static_cast<uint8_t*>(bytes) + n);
  };
  if (!stbi_write_png_to_func(append, &out.encoded, out.width, out.height, 4, rgba.data(), 0))
    return Error{name, "cannot be encoded"};
  return out;
}

}  // namespace lambent
