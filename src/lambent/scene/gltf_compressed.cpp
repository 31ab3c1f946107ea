#include <lambent/scene/gltf_compressed.h>

#include <algorithm>

namespace lambent {

DecodeBudget::DecodeBudget(const GltfDocument& document) {
  constexpr uint64_t free_bytes = uint64_t{1} << 29, expansion = 256, most = uint64_t{1} << 32;
  uint64_t size = 0;
  for (std::span<const uint8_t> buffer : document.buffers) size += buffer.size();
  left_ = std::min(most, free_bytes + expansion * std::min(size, most));
}

bool DecodeBudget::take(uint64_t bytes) {
  if (bytes > left_) return false;
  left_ -= bytes;
  return true;
}

size_t add_buffer(GltfDocument& document, std::vector<uint8_t> bytes) {
  document.json["buffers"].push_back({{"byteLength", bytes.size()}});
  document.owned.push_back(std::move(bytes));
  document.buffers.push_back(document.owned.back());
  return document.buffers.size() - 1;
}

}  // namespace lambent
