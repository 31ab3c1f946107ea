#include <lambent/core/file.h>

#include <xxhash.h>

#include <cstdio>

namespace lambent {

std::string content_hash(std::span<const uint8_t> bytes) {
  XXH128_canonical_t digest;
  XXH128_canonicalFromHash(&digest, XXH3_128bits(bytes.data(), bytes.size()));
  std::string text;
  char hex[3];
  for (unsigned char byte : digest.digest) std::snprintf(hex, sizeof hex, "%02x", byte), text += hex;
  return text;
}

}  // namespace lambent
