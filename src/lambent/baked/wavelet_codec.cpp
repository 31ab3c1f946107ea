#include <lambent/baked/extension.h>
#include <lambent/transfer/visibility.h>

#include <cmath>

namespace lambent {

using nlohmann::json;

json encode_wavelets(const HaarTransfer& t, BlobWriter& out) {
  const size_t columns = t.columns();
  std::vector<uint8_t> lengths;
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (size_t c = 0; c < columns; ++c) append_varint(lengths, t.column(chunk, c).size());
  json object{{"cube", t.size},
              {"error", t.error},
              {"bufferView", out.add(t.data, 64)},
              {"lengths", out.add_copy(lengths)},
              {"steps", out.add_copy(t.steps)}};
  if (t.channels != 1) object["channels"] = t.channels;
  return object;
}

Result<HaarTransfer> decode_wavelets(const BlobReader& in, const json& object, size_t receivers,
                                     const std::string& where) {
  auto size = read_count(object, "cube", size_t(max_cube_size), where);
  if (!size) return size.error();
  if (!is_cube_size(int(*size)) || !std::has_single_bit(*size))
    return Error{where, "\"cube\" must be 16, 32, 64, 128 or 256"};
  HaarTransfer t;
  t.size = int(*size), t.receivers = receivers;
  if (object.contains("channels")) {
    auto channels = read_count(object, "channels", 3, where);
    if (!channels) return channels.error();
    if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" must be 1 or 3"};
    t.channels = int(*channels);
  }
  const size_t columns = t.columns(), chunks = t.chunks();
  auto steps = read_values<float>(in, object, "steps", columns, where);
  if (!steps) return steps.error();
  t.steps = std::move(*steps);
  auto data = read_view(in, object, "bufferView", where), lengths = read_view(in, object, "lengths", where);
  for (const auto* view : {&data, &lengths})
    if (!*view) return view->error();
  const std::span<const uint8_t> numbers = lengths->bytes;
  if (chunks > numbers.size() / columns) return Error{where, "there are fewer lengths than columns"};
  t.data = data->bytes;
  t.starts.reserve(chunks + 1), t.begin.reserve(chunks * (columns + 1));
  size_t at = 0;
  uint64_t start = 0;
  for (size_t chunk = 0; chunk < chunks; ++chunk) {
    uint64_t end = 0;
    t.starts.push_back(start), t.begin.push_back(0);
    for (size_t c = 0; c < columns; ++c) {
      uint64_t length = 0;
      if (!read_varint(numbers, at, length) || length > t.data.size() - start - end || end + length > UINT32_MAX)
        return Error{where, "the length of column " + std::to_string(c) + " is broken"};
      end += length, t.begin.push_back(uint32_t(end));
    }
    start += end;
  }
  t.starts.push_back(start);
  if (at != numbers.size()) return Error{where, "there are more lengths than columns"};
  if (auto ok = check_haar(t, where); !ok) return ok.error();
  if (const auto error = object.find("error"); error != object.end() && error->is_number())
    t.error = error->get<double>();
  t.storage = std::make_shared<MappedFile>(std::move(data->file));
  return t;
}

}  // namespace lambent
