// Radiance .hdr: Ward 1991, "Real pixels" (Graphics Gems II), with the run-length codes of the Radiance distribution.
// Header variables and resolution strings: "Radiance File Formats", its picture section.
#include <lambent/image/image.h>

#include <array>
#include <charconv>
#include <cstring>
#include <optional>
#include <string_view>

namespace lambent {
namespace {

struct HdrReader {
  std::span<const uint8_t> bytes;
  size_t at = 0;
  bool truncated = false;  // set where bytes were missing

  size_t left() const { return bytes.size() - at; }
  bool has(size_t count) {
    truncated |= left() < count;
    return !truncated;
  }

  // The next line without its end; false at the end of the file.
  bool line(std::string_view& text) {
    const char* begin = reinterpret_cast<const char*>(bytes.data()) + at;
    const void* end = left() ? std::memchr(begin, '\n', left()) : nullptr;
    if (!end) return false;
    text = {begin, size_t(static_cast<const char*>(end) - begin)};
    at += text.size() + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return true;
  }
};

// m 2^(e - 136); mantissas are not rounded up by half a step, as in most readers.
Vec3 decode_rgbe(const uint8_t* p) {
  if (p[3] == 0) return Vec3(0);
  float scale = std::ldexp(1.0f, int(p[3]) - 136);
  return Vec3(p[0], p[1], p[2]) * scale;
}

// One row of the newer code: four planes of runs. False when the bytes end or a run leaves the row.
bool read_planes(HdrReader& in, size_t width, std::vector<uint8_t>& row) {
  for (size_t channel = 0; channel < 4; ++channel) {
    for (size_t x = 0; x < width;) {
      if (!in.has(2)) return false;
      size_t count = in.bytes[in.at++];
      bool run = count > 128;
      if (run) count -= 128;
      if (count == 0 || count > width - x || !in.has(run ? 1 : count)) return false;
      for (size_t i = 0; i < count; ++i) row[(x + i) * 4 + channel] = in.bytes[in.at + (run ? 0 : i)];
      in.at += run ? 1 : count;
      x += count;
    }
  }
  return true;
}

// One row flat or of the older code, where (1, 1, 1, n) repeats the pixel before it and successive ones shift n by 8
// bits.
bool read_pixels(HdrReader& in, size_t width, std::vector<Vec3>& pixels) {
  int shift = 0;
  for (size_t x = 0; x < width;) {
    if (!in.has(4)) return false;
    const uint8_t* p = in.bytes.data() + in.at;
    in.at += 4;
    if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
      if (x == 0 || shift > 24) return false;
      uint64_t count = uint64_t(p[3]) << shift;
      if (count > width - x) return false;
      pixels.insert(pixels.end(), size_t(count), Vec3(pixels.back()));
      x += size_t(count), shift += 8;
    } else {
      pixels.push_back(decode_rgbe(p));
      ++x, shift = 0;
    }
  }
  return true;
}

// How rows lie: "-Y height +X width" are lines from the top, each from the left; any sign and either axis may come
// first.
struct Resolution {
  uint64_t lines = 0, length = 0;     // of what is stored as a row: `length` pixels
  bool columns = false;               // X comes first: a stored row is a column
  bool from_end[2] = {false, false};  // from the bottom or the right: lines, pixels of a line

  uint64_t width() const { return columns ? lines : length; }
  uint64_t height() const { return columns ? length : lines; }
};

Result<Resolution> parse_resolution(std::string_view text, const std::string& path) {
  const Error bad{path, "bad resolution line"};
  std::array<std::string_view, 4> words;
  size_t count = 0;
  for (size_t i = 0; i < text.size();) {
    size_t end = std::min(text.find(' ', i), text.size());
    if (end > i) {
      if (count == 4) return bad;
      words[count++] = text.substr(i, end - i);
    }
    i = end + 1;
  }
  auto number = [](std::string_view word, uint64_t& value) {
    auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    return code == std::errc() && end == word.data() + word.size();
  };
  auto is_axis = [](std::string_view word) {
    return word.size() == 2 && (word[0] == '+' || word[0] == '-') && (word[1] == 'X' || word[1] == 'Y');
  };
  Resolution out;
  if (count != 4 || !is_axis(words[0]) || !is_axis(words[2]) || words[0][1] == words[2][1] ||
      !number(words[1], out.lines) || !number(words[3], out.length))
    return bad;
  out.columns = words[0][1] == 'X';
  // Y grows upwards.
  for (int k = 0; k < 2; ++k) out.from_end[k] = words[size_t(2 * k)] == "+Y" || words[size_t(2 * k)] == "-X";
  return out;
}

// What of the header changes the pixels.
struct HdrHeader {
  bool xyze = false;
  double exposure = 1;
  Vec3d correction{1};
  std::optional<std::array<float, 8>> primaries;  // x and y of red, green, blue, white
  std::vector<std::string> warnings;
};

// As many numbers as `out` has; false where there are fewer, others or more.
bool parse_numbers(std::string_view text, std::span<float> out) {
  const auto skip = [&] {
    while (!text.empty() && (text[0] == ' ' || text[0] == '\t' || text[0] == '+')) text.remove_prefix(1);
  };
  for (float& value : out) {
    skip();
    auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || !std::isfinite(value)) return false;
    text.remove_prefix(size_t(end - text.data()));
  }
  skip();
  return text.empty();
}

std::string trimmed(std::string_view text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  return std::string(text);
}

// ra_xyze writes this EXPOSURE when it turns watts into candelas: 179 lumens a watt. It is a change of units.
bool is_efficacy(float exposure) { return std::abs(exposure * 179 - 1) < 1e-3f; }

Result<void> parse_variable(std::string_view text, const std::string& path, HdrHeader& header) {
  const size_t equals = text.find('=');
  if (equals == text.npos) return {};
  const std::string_view name = text.substr(0, equals), value = text.substr(equals + 1);
  std::array<float, 8> n{};
  const auto left_aside = [&](const char* why) {
    header.warnings.push_back(path + ": " + std::string(name) + " is left aside: " + why);
  };
  if (name == "FORMAT") {
    const std::string format = trimmed(value);
    if (format != "32-bit_rle_rgbe" && format != "32-bit_rle_xyze") return Error{path, "unknown pixel format"};
    header.xyze = format == "32-bit_rle_xyze";
  } else if (name == "EXPOSURE") {
    if (!parse_numbers(value, std::span(n).first(1)) || !(n[0] > 0)) left_aside("it is no positive number");
    else header.exposure *= double(n[0]);
  } else if (name == "COLORCORR") {
    if (!parse_numbers(value, std::span(n).first(3)) || !(n[0] > 0 && n[1] > 0 && n[2] > 0))
      left_aside("it is not three positive numbers");
    else header.correction *= Vec3d(n[0], n[1], n[2]);
  } else if (name == "PRIMARIES") {
    if (!parse_numbers(value, n)) left_aside("it is not eight numbers");
    else if (n != std::array<float, 8>{}) header.primaries = n;  // all zero: none said
  } else if (name == "GAMMA") {
    if (!parse_numbers(value, std::span(n).first(1)) || n[0] != 1) left_aside("pixels are taken as linear");
  }
  return {};
}

Result<HdrHeader> read_header(HdrReader& in, const std::string& path) {
  HdrHeader header;
  std::string_view text;
  for (bool first = true;; first = false) {
    if (!in.line(text)) return Error{path, "truncated header"};
    if (first) continue;
    if (text.empty()) break;
    if (auto ok = parse_variable(text, path, header); !ok) return ok.error();
  }
  return header;
}

std::string number_text(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, 4).ptr};
}

// Undoes what was done to the pixels, and makes Rec. 709 of them.
Result<void> undo(HdrHeader& header, const std::string& path, Image& image) {
  const bool efficacy = header.xyze && is_efficacy(float(header.exposure));
  if (efficacy) header.exposure = 1;
  const Vec3 scale(Vec3d(1) / (header.exposure * header.correction));
  if (!is_finite(scale)) return Error{path, "its EXPOSURE and COLORCORR are out of range"};
  if (scale != Vec3(1)) {
    const std::string correction = header.correction == Vec3d(1) ? "" : " and COLORCORR";
    header.warnings.push_back(path + ": EXPOSURE " + number_text(header.exposure) + correction +
                              " divided out of the pixels");
    for (Vec3& c : image.rgb) c *= scale;
  }
  if (!header.xyze && !header.primaries) return {};
  // Radiance's own where none are said; its white is that of equal energy.
  const std::array<float, 8> p =
      header.primaries.value_or(std::array<float, 8>{0.64f, 0.33f, 0.29f, 0.6f, 0.15f, 0.06f, 1 / 3.0f, 1 / 3.0f});
  auto matrix = header.xyze ? rec709_from_xyz({p[6], p[7]})
                            : rec709_from_primaries({p[0], p[1]}, {p[2], p[3]}, {p[4], p[5]}, {p[6], p[7]});
  if (!matrix) return Error{path, "PRIMARIES: " + matrix.error().message};
  convert_color(image.rgb, *matrix);
  return {};
}

}  // namespace

Result<ImageFile> load_hdr(std::span<const uint8_t> bytes, const std::string& path) {
  HdrReader in{bytes};
  auto header = read_header(in, path);
  if (!header) return header.error();
  std::string_view text;
  if (!in.line(text)) return Error{path, "truncated header"};
  auto resolution = parse_resolution(text, path);
  if (!resolution) return resolution.error();
  const uint64_t width = resolution->width(), height = resolution->height();
  if (auto ok = check_image_size(width, height, bytes.size(), path, other_pixels_a_byte); !ok) return ok.error();
  const size_t lines = size_t(resolution->lines), length = size_t(resolution->length);
  if (lines > in.left() / 4) return Error{path, "truncated: fewer bytes than rows need"};

  ImageFile file{.image = Image(int(width), int(height)), .format = ImageFormat::hdr};
  file.width = int(width), file.height = int(height);
  const bool planes_possible = length >= 8 && length < 32768;
  std::vector<uint8_t> planes(planes_possible ? length * 4 : 0);
  std::vector<Vec3> row;
  for (size_t y = 0; y < lines; ++y) {
    row.clear();
    const uint8_t* p = bytes.data() + in.at;
    bool ok;
    if (planes_possible && in.left() >= 4 && p[0] == 2 && p[1] == 2 && (size_t(p[2]) << 8 | p[3]) == length) {
      in.at += 4;
      ok = read_planes(in, length, planes);
      if (ok)
        for (size_t x = 0; x < length; ++x) row.push_back(decode_rgbe(&planes[x * 4]));
    } else {
      ok = read_pixels(in, length, row);
    }
    if (!ok) return Error{path, (in.truncated ? "truncated in row " : "bad run in row ") + std::to_string(y)};
    const size_t line = resolution->from_end[0] ? lines - 1 - y : y;
    for (size_t x = 0; x < length; ++x) {
      const size_t place = resolution->from_end[1] ? length - 1 - x : x;
      file.image.rgb[resolution->columns ? place * lines + line : line * length + place] = row[x];
    }
  }
  if (auto ok = undo(*header, path, file.image); !ok) return ok.error();
  file.warnings = std::move(header->warnings);
  return file;
}

}  // namespace lambent
