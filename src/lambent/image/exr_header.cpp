#include <lambent/image/exr_header.h>

#include <algorithm>
#include <cstring>

namespace lambent {
namespace {

struct ByteReader {
  std::span<const uint8_t> bytes;
  size_t at = 0;

  size_t left() const { return bytes.size() - at; }
  bool u32(uint32_t& value) {  // little-endian
    if (left() < 4) return false;
    const uint8_t* p = bytes.data() + at;
    value = uint32_t(p[0]) | uint32_t(p[1]) << 8 | uint32_t(p[2]) << 16 | uint32_t(p[3]) << 24;
    at += 4;
    return true;
  }
  bool text(std::string& value) {  // null-terminated, at most 255 characters
    const void* end = left() ? std::memchr(bytes.data() + at, 0, std::min<size_t>(left(), 256)) : nullptr;
    if (!end) return false;
    value.assign(reinterpret_cast<const char*>(bytes.data()) + at,
                 size_t(static_cast<const uint8_t*>(end) - bytes.data()) - at);
    at += value.size() + 1;
    return true;
  }
};

bool read_channels(std::span<const uint8_t> bytes, ExrPart& part) {
  part.channels.clear(), part.bytes_a_pixel = 0;
  ByteReader in{bytes};
  for (;;) {
    ExrChannel channel;
    if (!in.text(channel.name)) return false;
    if (channel.name.empty()) return in.left() == 0;
    uint32_t type, linear, x_step, y_step;
    if (!in.u32(type) || !in.u32(linear) || !in.u32(x_step) || !in.u32(y_step) || type > 2) return false;
    // The library divides by the steps, as signed numbers.
    if (x_step == 0 || y_step == 0 || x_step > 0x7fffffff || y_step > 0x7fffffff) return false;
    channel.type = int(type), channel.x_step = int(x_step), channel.y_step = int(y_step);
    part.bytes_a_pixel += type == 1 ? 2 : 4;
    part.channels.push_back(std::move(channel));
  }
}

bool read_window(std::span<const uint8_t> bytes, int64_t& x0, int64_t& y0, int64_t& width, int64_t& height) {
  constexpr int64_t reach = int64_t{1} << 29;  // keeps the library's int arithmetic from overflowing
  ByteReader in{bytes};
  int64_t window[4];
  for (int64_t& edge : window) {
    uint32_t value;
    if (!in.u32(value)) return false;
    edge = int32_t(value);
    if (edge < -reach || edge > reach) return false;
  }
  x0 = window[0], y0 = window[1], width = window[2] - x0 + 1, height = window[3] - y0 + 1;
  return in.left() == 0 && width > 0 && height > 0;
}

bool read_tiles(std::span<const uint8_t> value, ExrPart& part) {
  ByteReader in{value};
  uint32_t w, h;
  if (value.size() != 9 || !in.u32(w) || !in.u32(h) || w == 0 || h == 0) return false;
  part.tile_width = w, part.tile_height = h;
  return true;
}

// What a header has beside what ExrPart keeps.
struct Seen {
  bool tiles = false, part_attribute = false;
  std::string type;
};

// False where the attribute is damaged.
bool read_attribute(const std::string& name, const std::string& type, std::span<const uint8_t> value, ExrPart& part,
                    Seen& seen) {
  const auto text = [&] { return std::string(reinterpret_cast<const char*>(value.data()), value.size()); };
  if (name == "channels") return type == "chlist" && read_channels(value, part);
  if (name == "dataWindow") return type == "box2i" && read_window(value, part.x0, part.y0, part.width, part.height);
  if (name == "displayWindow")
    return type == "box2i" && read_window(value, part.shown_x0, part.shown_y0, part.shown_width, part.shown_height);
  if (name == "tiles") return seen.tiles = true, type == "tiledesc" && read_tiles(value, part);
  if (name == "compression") {
    if (type != "compression" || value.size() != 1 || value[0] > 9) return false;
    part.compression = value[0];
  } else if (name == "envmap") {  // another value of it is none of ours
    if (type != "envmap" || value.size() != 1) return false;
    part.envmap = value[0] == 0 ? Envmap::latlong : value[0] == 1 ? Envmap::cube : Envmap::unsaid;
  } else if (name == "name" && type == "string") {
    part.name = text(), seen.part_attribute = true;
  } else if (name == "type") {
    seen.type = text(), seen.part_attribute = true;
  } else if (name == "chunkCount") {
    seen.part_attribute = true;
  } else if (type == "preview") {
    ByteReader preview{value};
    uint32_t w, h;
    return preview.u32(w) && preview.u32(h) && preview.left() == uint64_t(w) * h * 4;
  } else if (type == "idmanifest") {
    return false;  // belongs to deep images, and states a size of its own that would be allocated
  }
  return true;
}

// Attributes up to the empty name that ends them; the empty name was read already where `first` has one.
Result<void> read_part(ByteReader& in, std::string name, const std::string& path, ExrPart& part, Seen& seen) {
  const Error truncated{path, "truncated header"};
  for (; !name.empty();) {
    std::string type;
    uint32_t size;
    if (!in.text(type) || !in.u32(size) || size > in.left()) return truncated;
    if (!read_attribute(name, type, in.bytes.subspan(in.at, size), part, seen))
      return Error{path, "bad attribute \"" + name + "\" in the header"};
    in.at += size;
    if (!in.text(name)) return truncated;
  }
  if (part.width == 0) return Error{path, "header has no data window"};
  if (part.channels.empty()) return Error{path, "header has no channels"};
  if (part.shown_width == 0)
    part.shown_x0 = part.x0, part.shown_y0 = part.y0, part.shown_width = part.width, part.shown_height = part.height;
  return {};
}

// Whether the part is tiled or deep, and whether its header says so as the library will take it.
Result<void> read_kind(const ExrHeader& header, uint32_t version, const Seen& seen, const std::string& path,
                       ExrPart& part) {
  bool tiled = version & 0x200;
  if (header.several) {
    if (seen.type != "scanlineimage" && seen.type != "tiledimage" && seen.type != "deepscanline" &&
        seen.type != "deeptile")
      return Error{path, "part \"" + part.name + "\" is of no known type"};
    tiled = seen.type == "tiledimage" || seen.type == "deeptile";
    part.deep = seen.type.starts_with("deep");
  } else if (!seen.type.empty()) {
    if (seen.type.find("deep") != seen.type.npos) return Error{path, "deep pixels are not read"};
    // The library lets this attribute overrule the version's flags, which were relied on above.
    if (seen.type != (tiled ? "tiledimage" : "scanlineimage"))
      return Error{path, "bad attribute \"type\" in the header"};
  }
  if (tiled != seen.tiles) return Error{path, "header does not say clearly whether the image is tiled"};
  return {};
}

// How many pieces the part's pixels come in, each with eight bytes in a table that the library reads whole.
uint64_t chunks_of(const ExrPart& part) {
  constexpr uint64_t rows[] = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};  // by compression
  if (part.tile_width == 0) return (uint64_t(part.height) - 1) / rows[part.compression] + 1;
  return ((uint64_t(part.width) - 1) / part.tile_width + 1) * ((uint64_t(part.height) - 1) / part.tile_height + 1);
}

Result<void> check_part(const ExrPart& part, size_t bytes, const std::string& path) {
  const uint64_t width = uint64_t(part.width), height = uint64_t(part.height), pixels = width * height;
  if (auto ok = check_image_size(width, height, bytes, path); !ok) return ok.error();
  // The library holds whole blocks of rows of all channels, or tiles, in memory.
  constexpr uint64_t free_bytes = uint64_t{1} << 26, bytes_a_byte = 65536, free_tile = uint64_t{1} << 20;
  if (pixels * part.bytes_a_pixel / bytes_a_byte > free_bytes / bytes_a_byte + bytes)
    return Error{path, "channels do not fit the file's few bytes"};
  if (part.tile_width > 0 && part.tile_width > std::max(free_tile, pixels) / part.tile_height)
    return Error{path, "tiles are larger than the image"};
  return {};
}

}  // namespace

const ExrChannel* ExrPart::find(std::string_view channel) const {
  for (const ExrChannel& c : channels)
    if (c.name == channel) return &c;
  return nullptr;
}

Result<ExrHeader> read_exr_header(std::span<const uint8_t> bytes, const std::string& path) {
  ByteReader in{bytes, 4};
  uint32_t version;
  if (bytes.size() < 4 || !in.u32(version)) return Error{path, "truncated header"};
  if ((version & 0xff) != 2) return Error{path, "OpenEXR version is not 2"};
  if ((version & 0x1800) == 0x800) return Error{path, "deep pixels are not read"};
  if (version & ~uint32_t{0x1eff}) return Error{path, "unknown OpenEXR features"};

  ExrHeader header;
  header.several = version & 0x1000;
  constexpr size_t max_parts = 1024;
  uint64_t chunks = 0;
  for (std::string name;;) {
    if (!in.text(name)) return Error{path, "truncated header"};
    if (name.empty()) break;
    ExrPart part;
    Seen seen;
    if (auto ok = read_part(in, name, path, part, seen); !ok) return ok.error();
    if (header.several && !seen.part_attribute && header.parts.empty()) header.several = false, header.flagged = true;
    if (auto ok = read_kind(header, version, seen, path, part); !ok) return ok.error();
    if (auto ok = check_part(part, bytes.size(), path); !ok) return ok.error();
    chunks += chunks_of(part);
    header.parts.push_back(std::move(part));
    if (header.parts.size() > max_parts) return Error{path, "has more than 1024 parts"};
    if (!header.several) break;
  }
  if (header.parts.empty()) return Error{path, "header has no data window"};
  if (chunks > in.left() / 8)
    return Error{path, std::string("truncated: fewer bytes than the table of ") +
                           (header.parts[0].tile_width > 0 ? "tiles" : "rows") + " needs"};
  if (std::all_of(header.parts.begin(), header.parts.end(), [](const ExrPart& p) { return p.deep; }))
    return Error{path, "deep pixels are not read"};
  return header;
}

namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? char(c + 32) : c;
  return out;
}

std::string_view after_dot(std::string_view name) { return name.substr(name.rfind('.') + 1); }

// A layer as it is found: with whether its channels are spelt as OpenEXR has them (R, and not r or red).
struct Candidate {
  ExrLayer layer;
  bool plain = false, vector = false;
};

void add_channel(const std::string& name, Candidate& c) {
  const std::string_view last = after_dot(name);
  const std::string l = lower(last);
  const auto set = [&](std::string& slot) {
    if (slot.empty() || last.size() == 1) slot = name;
  };
  if (l == "r" || l == "red") set(c.layer.red), c.plain |= last == "R";
  if (l == "g" || l == "green") set(c.layer.green), c.plain |= last == "G";
  if (l == "b" || l == "blue") set(c.layer.blue), c.plain |= last == "B";
  if (l == "a" || l == "alpha") set(c.layer.alpha);
  if (last == "Y") c.layer.y = name, c.plain = true;
  if (last == "RY") c.layer.ry = name;
  if (last == "BY") c.layer.by = name;
  c.vector |= last == "X";
}

// Those of colour or luminance. The Y of X, Y and Z is a coordinate.
std::vector<Candidate> candidates_of(const ExrHeader& header) {
  std::vector<Candidate> out;
  for (size_t p = 0; p < header.parts.size(); ++p) {
    if (header.parts[p].deep) continue;
    std::vector<Candidate> found;
    for (const ExrChannel& channel : header.parts[p].channels) {
      const size_t dot = channel.name.rfind('.');
      const std::string name = dot == channel.name.npos ? "" : channel.name.substr(0, dot);
      auto at = std::find_if(found.begin(), found.end(), [&](const Candidate& c) { return c.layer.name == name; });
      if (at == found.end()) at = found.insert(found.end(), Candidate{{.part = p, .name = name}});
      add_channel(channel.name, *at);
    }
    for (Candidate& c : found) {
      if (c.layer.has_color() || c.vector) c.layer.y = c.layer.ry = c.layer.by = "";
      if (c.layer.has_color() || !c.layer.y.empty()) out.push_back(std::move(c));
    }
  }
  // Masks of identities spell theirs r, g, b: they are no pictures beside others.
  if (std::any_of(out.begin(), out.end(), [](const Candidate& c) { return c.plain; }))
    std::erase_if(out, [](const Candidate& c) { return !c.plain; });
  return out;
}

// "part/layer", of what there is.
std::string label(const ExrHeader& header, const ExrLayer& layer) {
  std::string out = header.several ? header.parts[layer.part].name : "";
  if (!layer.name.empty()) out += (out.empty() ? "" : "/") + layer.name;
  return out.empty() ? "R, G, B" : out;
}

template <class Range, class Name>
std::string listed(const Range& range, Name name) {
  constexpr size_t most = 24;
  std::string out;
  size_t count = 0;
  for (const auto& item : range)
    if (count++ < most) out += (out.empty() ? "" : ", ") + name(item);
  return count > most ? out + " and " + std::to_string(count - most) + " more" : out;
}

// By its label, else by its own name or its part's, as far as that says one.
Result<ExrLayer> layer_called(const std::string& wanted, const std::vector<Candidate>& all, const ExrHeader& header,
                              const std::string& path) {
  const auto say = [&](const Candidate& c) { return label(header, c.layer); };
  const ExrLayer* found = nullptr;
  size_t count = 0;
  for (const Candidate& c : all) {
    if (say(c) == wanted) return c.layer;
    if (c.layer.name != wanted && header.parts[c.layer.part].name != wanted) continue;
    found = &c.layer, ++count;
  }
  if (count == 1) return *found;
  return Error{path, std::string(count > 1 ? "more than one picture is called that" : "no picture is called that") +
                         "; it has " + listed(all, say)};
}

}  // namespace

Result<ExrLayer> choose_exr_layer(const ExrHeader& header, const std::string& wanted, const std::string& path,
                                  std::vector<std::string>& warnings) {
  std::vector<Candidate> all = candidates_of(header);
  if (all.empty()) {
    std::vector<std::string> names;
    for (const ExrPart& part : header.parts)
      for (const ExrChannel& c : part.channels) names.push_back((header.several ? part.name + "/" : "") + c.name);
    return Error{
        path, "no channel named R, G, B or Y; it has " + listed(names, [](const std::string& name) { return name; })};
  }
  const auto say = [&](const Candidate& c) { return label(header, c.layer); };
  if (!wanted.empty()) return layer_called(wanted, all, header, path);
  std::vector<Candidate> pool = all;
  std::erase_if(pool, [](const Candidate& c) { return !c.layer.name.empty(); });
  if (all.size() == 1) return all[0].layer;
  if (pool.size() == 1) return pool[0].layer;
  if (pool.empty()) pool = all;
  const auto name_of = [&](const Candidate& c) {
    return lower(c.layer.name.empty() ? header.parts[c.layer.part].name : c.layer.name);
  };
  std::erase_if(pool, [&](const Candidate& c) {
    const std::string name = name_of(c);
    const std::string_view last = after_dot(name);
    return last != "combined" && last != "beauty" && last != "rgba" && last != "rgb";
  });
  // Of several renders, what was composed of them.
  if (pool.size() > 1 &&
      std::any_of(pool.begin(), pool.end(), [&](const Candidate& c) { return name_of(c).starts_with("composite."); }))
    std::erase_if(pool, [&](const Candidate& c) { return !name_of(c).starts_with("composite."); });
  if (pool.size() != 1)
    return Error{path, "has several pictures, and none that alone can be meant: " + listed(all, say) +
                           "; FILE.exr#NAME takes one"};
  std::erase_if(all, [&](const Candidate& c) { return say(c) == say(pool[0]); });
  warnings.push_back(path + ": of its pictures " + say(pool[0]) + " is taken, and left aside " + listed(all, say));
  return pool[0].layer;
}

}  // namespace lambent
