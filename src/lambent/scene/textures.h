#pragma once
// Decoding of colour textures.
#include <lambent/scene/scene.h>

#include <span>
#include <string>
#include <vector>

namespace lambent {

// Larger images are refused before they are decoded.
inline constexpr int max_texture_side = 16384;

// "image/png" or "image/jpeg" by the first bytes, else "".
std::string image_mime_type(std::span<const uint8_t> encoded);

// Fills width, height, rgb, alpha (empty where all is covered) and mime_type from a PNG (8 or 16 bits) or JPEG. `where`
// names the image in errors: another format, broken, larger than max_texture_side, or of a size that its bytes cannot
// hold.
Result<void> decode_texture(std::span<const uint8_t> encoded, const std::string& where, Texture& texture);

// The same for a texture that keeps its encoded bytes; `name` becomes its name and names it in errors.
Result<Texture> decode_texture(std::vector<uint8_t> encoded, const std::string& name);

// A PNG of `color` whose alpha is that of `mask`, or its red channel where it has none, looked up at the places of
// color's texels; of mask's size where `color` has no pixels (then white). Wraps as `color` does.
Result<Texture> with_alpha(const Texture& color, const Texture& mask, const std::string& name);

}  // namespace lambent
