// glTF 2.0 specification (ISO/IEC 12113), section 3.6.1: the buffers of a .gltf, each a file.
#include <lambent/core/uri.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/gltf_write.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>

namespace lambent {

using Json = nlohmann::json;

namespace {

std::string stem_of(const std::string& path) { return path.substr(0, path.find_last_of('.')); }
std::string bin_ending(size_t number) { return "." + std::to_string(number) + ".bin"; }

// Where in the data a view is; nullopt where it does not say.
std::optional<std::pair<size_t, size_t>> range_of(const Json& view) {
  GltfCheck check("");
  const size_t at = check.integer(view, "byteOffset", 0, SIZE_MAX / 2, {});
  const auto length = check.index(view, "byteLength", SIZE_MAX / 2, {});
  if (!check.ok() || !length) return std::nullopt;
  return std::pair(at, at + *length);
}

// Numbers of the .bin files that the baked file in a place has; none where there is no such file, or another's.
std::vector<size_t> bins_there(const std::string& path) {
  std::vector<size_t> out;
  std::ifstream in(path, std::ios::binary);  // not an input of the program's
  const Json document = Json::parse(in, nullptr, false);
  if (!document.is_object() || !document.contains("buffers") || !document["buffers"].is_array()) return out;
  const auto used = document.find("extensionsUsed");
  if (used == document.end() || !used->is_array() ||
      std::find(used->begin(), used->end(), Json("LAMBENT_transfer")) == used->end())
    return out;
  const std::string begin = encode_uri(std::filesystem::path(stem_of(path)).filename().string()) + ".";
  for (const Json& buffer : document["buffers"]) {
    const Json uri = buffer.is_object() ? buffer.value("uri", Json()) : Json();
    if (!uri.is_string()) continue;
    const std::string name = uri.get<std::string>();
    size_t number = 0;
    if (!name.starts_with(begin)) continue;
    std::from_chars(name.data() + begin.size(), name.data() + name.size(), number);
    if (name == begin + bin_ending(number).substr(1)) out.push_back(number);
  }
  return out;
}

}  // namespace

std::vector<GltfWriter::Unit> GltfWriter::make_units() {
  std::vector<Unit> all;
  for (const Json& view : list("bufferViews"))
    if (const auto range = range_of(view)) all.push_back({range->first, range->second});
  if (!compacted_)  // what no view has may be an extension's
    for (const Piece& piece : pieces_) all.push_back({piece.offset, piece.offset + piece.bytes.size()});
  std::sort(all.begin(), all.end(), [](const Unit& a, const Unit& b) { return a.begin < b.begin; });
  std::vector<Unit> units;
  for (const Unit& unit : all) {
    if (!units.empty() && unit.begin < units.back().end) units.back().end = std::max(units.back().end, unit.end);
    else units.push_back(unit);
  }
  return units;
}

void GltfWriter::place_buffers(const std::string& path, size_t bin_limit) {
  // One buffer keeps what a lone original had to say about itself.
  Json lone = gltf_count(json, "buffers") == 1 ? json["buffers"][0] : Json::object();
  lone.erase("uri");
  json.erase("buffers");
  if (size_ == 0) return;
  if (file_extension(path) != "gltf") {
    lone["byteLength"] = size_;
    json["buffers"] = Json::array({std::move(lone)});
    return;
  }
  std::vector<Unit> units = make_units();
  struct Place {
    size_t bin, to;
  };
  std::vector<Place> places;
  size_t piece = 0;
  for (Unit& unit : units) {
    while (piece < pieces_.size() && pieces_[piece].offset + pieces_[piece].bytes.size() <= unit.begin) ++piece;
    for (size_t p = piece; p < pieces_.size() && pieces_[p].offset < unit.end; ++p)
      unit.alignment = std::max(unit.alignment, pieces_[p].alignment);
    // A unit keeps its place modulo its alignment, and with it the alignment of all that is in it.
    const auto fit = [&](size_t end) { return end + ((unit.begin - end) & (unit.alignment - 1)); };
    const size_t length = unit.end - unit.begin;
    if (bins_.empty() || (bins_.back().size > 0 && fit(bins_.back().size) + length > bin_limit)) bins_.emplace_back();
    Bin& bin = bins_.back();
    const size_t to = fit(bin.size);
    places.push_back({bins_.size() - 1, to});
    for (size_t p = piece; p < pieces_.size() && pieces_[p].offset < unit.end; ++p) {
      const size_t first = std::max(unit.begin, pieces_[p].offset),
                   last = std::min(unit.end, pieces_[p].offset + pieces_[p].bytes.size());
      if (first < last)
        bin.pieces.push_back(
            {to + (first - unit.begin), pieces_[p].bytes.subspan(first - pieces_[p].offset, last - first), 4});
    }
    bin.size = to + length;
  }
  for (Json& view : list("bufferViews")) {
    const auto range = range_of(view);
    if (!range) continue;
    const auto next = std::upper_bound(units.begin(), units.end(), range->first,
                                       [](size_t at, const Unit& unit) { return at < unit.begin; });
    const size_t unit = size_t(next - units.begin()) - 1;
    view["buffer"] = places[unit].bin, view["byteOffset"] = places[unit].to + (range->first - units[unit].begin);
  }
  const std::string name = std::filesystem::path(stem_of(path)).filename().string();
  for (size_t i = 0; i < bins_.size(); ++i) {
    Json buffer = bins_.size() == 1 ? lone : Json::object();
    buffer["uri"] = encode_uri(name + bin_ending(i)), buffer["byteLength"] = bins_[i].size;
    push("buffers", std::move(buffer));
  }
}

Result<void> GltfWriter::write_bins(const std::string& path) const {
  auto dumped = text(path);
  if (!dumped) return dumped.error();
  FileSet set;
  const std::vector<uint8_t> zeros(split_alignment, 0);
  for (size_t i = 0; i < bins_.size(); ++i) {
    std::vector<std::span<const uint8_t>> spans;
    size_t at = 0;
    for (const Piece& piece : bins_[i].pieces) {
      if (piece.offset > at) spans.push_back(std::span(zeros).first(piece.offset - at));
      spans.push_back(piece.bytes);
      at = piece.offset + piece.bytes.size();
    }
    if (auto ok = write_file_atomically(stem_of(path) + bin_ending(i), spans); !ok) return ok;
  }
  for (const size_t number : bins_there(path))
    if (number >= bins_.size()) set.remove(stem_of(path) + bin_ending(number));
  if (auto ok = write_file_atomically(path, *dumped); !ok) return ok;
  return set.commit();
}

}  // namespace lambent
