#pragma once
// What the reader and the writer of LAMBENT_transfer share (docs/file-format.md): the JSON of the extension with its
// bulk data, and a codec for each store, meaning and placement.
#include <lambent/baked/fields.h>
#include <lambent/baked/gltf_buffers.h>

#include <bit>
#include <cstring>
#include <deque>
#include <optional>
#include <vector>

namespace lambent {

static_assert(std::endian::native == std::endian::little, "the file and its in-place reader are little-endian");

inline constexpr const char* extension_name = "LAMBENT_transfer";

// Of values that outlive what reads them.
template <class T>
std::span<const uint8_t> bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)};
}

// Bulk data on its way into a file. add() gives what stands for the data's buffer view in JSON until the views have
// their numbers, which resolve_views() puts in: of data that were written in pieces, a list of them.
class BlobWriter {
 public:
  struct Blob {
    std::span<const uint8_t> bytes;
    size_t alignment;
  };
  nlohmann::json add(std::span<const uint8_t> bytes, size_t alignment = 4);  // bytes must outlive the write
  template <class T>
  nlohmann::json add_copy(const std::vector<T>& values) {
    kept_.emplace_back(values.size() * sizeof(T));
    if (!values.empty()) std::memcpy(kept_.back().data(), values.data(), kept_.back().size());
    return add(kept_.back());
  }
  std::vector<Blob> blobs;

 private:
  std::deque<std::vector<uint8_t>> kept_;
};
// views[i]: those of blob i.
void resolve_views(nlohmann::json& value, std::span<const std::vector<int>> views);

// A stranger's JSON and bulk data. All errors name `where`.
struct BlobReader {
  const GltfBuffers& buffers;
};

// A non-negative integer member, at most `limit`.
Result<size_t> read_count(const nlohmann::json& object, const char* key, size_t limit, const std::string& where);
// Exactly so many numbers, all within 1e9.
Result<std::vector<float>> read_numbers(const nlohmann::json& object, const char* key, size_t count,
                                        const std::string& where);
// The bytes of the buffer view, or of the list of views, that member `key` names.
Result<ViewBytes> read_view(const BlobReader& in, const nlohmann::json& object, const char* key,
                            const std::string& where);
// The same as values of type T.
template <class T>
Result<std::vector<T>> read_all_values(const BlobReader& in, const nlohmann::json& object, const char* key,
                                       const std::string& where) {
  auto view = read_view(in, object, key, where);
  if (!view) return view.error();
  const std::span<const uint8_t> bytes = view->bytes;
  if (bytes.size() % sizeof(T))
    return Error{where, std::string("\"") + key + "\" holds " + std::to_string(bytes.size()) +
                            " bytes, which is no whole number of values"};
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), bytes.data(), bytes.size());
  return values;
}
// Exactly `count` of them.
template <class T>
Result<std::vector<T>> read_values(const BlobReader& in, const nlohmann::json& object, const char* key, size_t count,
                                   const std::string& where) {
  auto values = read_all_values<T>(in, object, key, where);
  if (values && values->size() != count)
    return Error{where, std::string("\"") + key + "\" holds " + std::to_string(values->size() * sizeof(T)) +
                            " bytes where " + std::to_string(count * sizeof(T)) + " are due"};
  return values;
}

// Store and meaning, the extension's "transfer". The kind is named by both: diffuse, matrix, zonal, factors, blocks,
// indirect, wavelets.
nlohmann::json encode_transfer(const Field& field, BlobWriter& out);
Result<Field> decode_transfer(const BlobReader& in, const nlohmann::json& transfer, const std::string& where);

// A dense store's data and header, whose light, rows and receivers are known from elsewhere.
nlohmann::json encode_dense(const Transfer& t, BlobWriter& out);
Result<void> decode_dense(const BlobReader& in, const nlohmann::json& object, Transfer& t, const std::string& where);

// Haar wavelets by column, but for the kind and the number of receivers.
nlohmann::json encode_wavelets(const HaarTransfer& t, BlobWriter& out);
Result<HaarTransfer> decode_wavelets(const BlobReader& in, const nlohmann::json& object, size_t receivers,
                                     const std::string& where);

// Direct-to-indirect transport, but for the kind and the number of receivers.
nlohmann::json encode_indirect(const IndirectTransfer& t, BlobWriter& out);
Result<Field> decode_indirect(const BlobReader& in, const nlohmann::json& object, size_t receivers,
                              const std::string& where);

// The transfer's "directional"; none where there is no such member.
Result<DirectionalKind> decode_directional(const nlohmann::json& transfer, const std::string& where);

nlohmann::json encode_outgoing(const Outgoing& o, BlobWriter& out);
// The list "lobes" of an object, `most` at most.
Result<std::vector<Lobe>> decode_lobes(const nlohmann::json& object, LobeKind kind, size_t most,
                                       const std::string& where);
Result<Outgoing> decode_outgoing(const BlobReader& in, const nlohmann::json& object, int rows, size_t receivers,
                                 const std::string& where);

// The extension's "parts" (without their node and primitive), "surface" and "view".
void encode_placement(const Placement& where, std::span<const BakedPart> parts, nlohmann::json& extension,
                      BlobWriter& out);
Result<Placement> decode_placement(const BlobReader& in, const nlohmann::json& extension, size_t receivers,
                                   std::vector<BakedPart>& parts, const std::string& where);

// Light in free space, the extension's "lattice"; the place of its points alone, with an order.
nlohmann::json encode_points(const Lattice& lattice, int order, const std::vector<uint8_t>& valid, BlobWriter& out);
Result<Lattice> decode_points(const nlohmann::json& object, int& order, const std::string& where);
nlohmann::json encode_lattice(const Field& field, BlobWriter& out);
Result<Field> decode_lattice(const BlobReader& in, const nlohmann::json& object, const LightBasis& light,
                             const std::string& where);

// What an object does to light around it, the extension's "shells": where, what it hides, what it shines with, and how
// it reflects; the last two may be null.
nlohmann::json encode_shells(const Field& hidden, const Field* shining, const Field* reflecting, BlobWriter& out);
Result<std::vector<Field>> decode_shells(const BlobReader& in, const nlohmann::json& object, const std::string& where);

// The extension's JSON, with references to `out`'s blobs for bulk data; parts are to get their nodes and primitives.
nlohmann::json encode_fields(const BakedFields& fields, BlobWriter& out);
Result<BakedFields> read_fields(const GltfBuffers& buffers, const std::string& path);

// Whether JSON is of a glTF with our extension.
bool has_extension(const nlohmann::json& document);

// How the document was written, to be told from how it is found: the extension's "written" ({generator, bufferViews,
// byteLength}: asset.generator, how many buffer views there are, and bytes in the first buffer), for a document that is
// whole but for it.
nlohmann::json written_state(const nlohmann::json& document);
// Whether another program has written the file anew without knowing the extension, whose bulk data then are gone or
// elsewhere: the document lists the extension as used and has it no more, or "written" says another number of buffer
// views or of bytes. The error that says so, with asset.generator where it has changed; nullopt where all is as it was,
// or the file is of a build that wrote no "written".
std::optional<Error> find_rewritten(const nlohmann::json& document, const std::string& path);

}  // namespace lambent
