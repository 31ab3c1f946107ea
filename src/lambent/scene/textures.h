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

// Fills width, height, rgb and mime_type from a PNG (8 or 16 bits) or JPEG; alpha is dropped. `where` names the image
// in errors: another format, broken, larger than max_texture_side, or of a size that its bytes cannot hold.
Result<void> decode_texture(std::span<const uint8_t> encoded, const std::string& where, Texture& texture);

// The same for a texture that keeps its encoded bytes; `name` becomes its name and names it in errors. TGA, BMP, PSD and
// binary PNM are read too, and kept as PNG.
Result<Texture> decode_texture(std::vector<uint8_t> encoded, const std::string& name);

}  // namespace lambent
