#pragma once
// A glTF's bulk data, wherever it lies: in the GLB itself, in .bin files beside a .gltf, which are mapped, or in data
// URIs.
#include <lambent/core/file.h>
#include <lambent/core/glb.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Bytes of a buffer view, and what keeps them alive.
struct ViewBytes {
  std::span<const uint8_t> bytes;
  MappedFile file;
};

class GltfBuffers {
 public:
  // Other files are looked up in `folder`; "" refuses all. Errors: those of split_gltf(), an empty file.
  static Result<GltfBuffers> open(const MappedFile& file, const std::string& path, const std::string& folder);

  const nlohmann::json& json() const { return chunks_.json; }
  // Nothing in the buffers can be larger: the bytes that they state, in all.
  size_t room() const;
  // Of a buffer view by its number, or of several, one after another, by a list of numbers. A buffer's file is opened
  // when a view of it is first asked for. Errors name `where`: views that do not exist or overlap one another, that
  // reach out of their buffers, buffers that are missing or short. From one thread at a time.
  Result<ViewBytes> view(const nlohmann::json& view, const std::string& where) const;

 private:
  struct Buffer {
    std::span<const uint8_t> bytes;
    MappedFile file;
    std::string path;  // of a file of its own
  };
  struct Claim {
    size_t buffer = 0, offset = 0, length = 0;
  };
  Result<const Buffer*> buffer(size_t index, const std::string& where) const;
  Result<Claim> claim(const nlohmann::json& view, const std::string& where) const;
  Result<ViewBytes> joined(std::span<const Claim> claims, const std::string& where) const;

  GltfChunks chunks_;
  MappedFile file_;
  std::string folder_;
  mutable std::vector<std::optional<Buffer>> buffers_;
};

}  // namespace lambent
