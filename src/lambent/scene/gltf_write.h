#pragma once
// Building and writing of a glTF: JSON, and binary data that is gathered by reference.
#include <lambent/scene/gltf_read.h>

#include <map>

namespace lambent {

class GltfWriter {
 public:
  using Json = nlohmann::json;
  Json json = Json::object();

  // A top-level array, made where absent; and the number of an item appended to it.
  Json& list(const char* key);
  size_t push(const char* key, Json item);
  void use_extension(const char* name, bool required = false);

  // Places bytes, which must outlive write(), in the binary chunk, at a multiple of `alignment` in the file; gives
  // their offset.
  size_t append(std::span<const uint8_t> bytes, size_t alignment);
  // The same for bytes that the writer keeps.
  std::span<const uint8_t> keep(std::vector<uint8_t> bytes);
  size_t add_view(std::span<const uint8_t> bytes, size_t alignment);
  // Where `most` is not 0 and there are more bytes: views one after another, all but the last of `most`.
  std::vector<int> add_views(std::span<const uint8_t> bytes, size_t alignment, size_t most);

  // Accessors of fresh vertex data and indices; the same data in the same form are one accessor.
  size_t add_vectors(std::span<const float> values, int components, bool with_bounds);
  size_t add_indices(std::span<const uint32_t> indices);
  // Elements source[0], source[1], ... of an accessor, in its own type.
  size_t add_copy(const GltfAccessor& from, std::span<const uint32_t> source, bool with_bounds);

  // Leaves out accessors and buffer views that nothing refers to and bytes that no view has; what stays keeps its order
  // and its alignment, up to 64 bytes. Does nothing where an extension is in use whose references are not known, or a
  // reference is none.
  void compact();

  // Once all data are in: the JSON's buffers, and where in them its views are. Of a .gltf (`path`) each is a file of at
  // most bin_limit bytes, but for views that are longer.
  void place_buffers(const std::string& path, size_t bin_limit);
  // To the same path.
  Result<void> write(const std::string& path) const;

 private:
  struct Piece {
    size_t offset;
    std::span<const uint8_t> bytes;
    size_t alignment = 4;
  };
  // A file of binary data.
  struct Bin {
    std::vector<Piece> pieces;
    size_t size = 0;
  };
  struct Range {
    size_t begin = 0, end = 0;
  };
  struct Move {
    size_t from, to;  // of bytes from here on, up to the next
  };
  size_t add_accessor(Json accessor, std::vector<uint8_t> bytes, int target, size_t stride);
  static constexpr size_t run_alignment = 64;
  // Lays the ranges closer together; gives where they went, rising.
  std::vector<Move> keep_bytes(std::vector<Range> ranges);

  // Bytes that have to stay together: what views have in common with one another.
  struct Unit {
    size_t begin = 0, end = 0, alignment = 64;
  };
  std::vector<Unit> make_units();
  Result<void> write_glb(const std::string& path) const;
  Result<void> write_bins(const std::string& path) const;
  Result<std::string> text(const std::string& path) const;

  std::vector<Piece> pieces_;
  std::vector<Bin> bins_;
  bool compacted_ = true;  // no bytes but those of views
  std::deque<std::vector<uint8_t>> kept_;
  std::map<std::string, size_t> known_;  // accessors by what they say and hold
  size_t size_ = 0, alignment_ = 64;
};

}  // namespace lambent
