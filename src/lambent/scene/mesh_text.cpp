#include <lambent/scene/mesh_text.h>

#include <charconv>
#include <cstring>

namespace lambent {
namespace {

// Bytes of the UTF-8 sequence at the front, 0 if it is none (RFC 3629: no overlong forms, no surrogates).
size_t utf8_length(std::string_view s) {
  auto byte = [&](size_t i) { return i < s.size() ? uint8_t(s[i]) : 0u; };
  auto follows = [&](size_t i, unsigned low = 0x80, unsigned high = 0xbf) { return byte(i) >= low && byte(i) <= high; };
  unsigned b = byte(0);
  if (b < 0x80) return 1;
  if (b >= 0xc2 && b <= 0xdf) return follows(1) ? 2 : 0;
  if (b >= 0xe0 && b <= 0xef) return follows(1, b == 0xe0 ? 0xa0 : 0x80, b == 0xed ? 0x9f : 0xbf) && follows(2) ? 3 : 0;
  if (b >= 0xf0 && b <= 0xf4) {
    return follows(1, b == 0xf0 ? 0x90 : 0x80, b == 0xf4 ? 0x8f : 0xbf) && follows(2) && follows(3) ? 4 : 0;
  }
  return 0;
}

}  // namespace

void skip_blanks(std::string_view& text) {
  while (!text.empty() && is_blank(text[0])) text.remove_prefix(1);
}

std::string_view trimmed(std::string_view text) {
  skip_blanks(text);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view take_word(std::string_view& text) {
  skip_blanks(text);
  size_t length = 0;
  while (length < text.size() && !is_blank(text[length])) ++length;
  std::string_view word = text.substr(0, length);
  text.remove_prefix(length);
  return word;
}

bool take_number(std::string_view& text, double& value) {
  const char *begin = text.data(), *end = begin + text.size();
  if (begin != end && *begin == '+') ++begin;
  auto [stop, code] = std::from_chars(begin, end, value);
  if (code == std::errc::result_out_of_range) {
    // Told apart by the exponent's sign, or by the leading digit where there is no exponent.
    std::string_view number(begin, size_t(stop - begin));
    size_t e = number.find_first_of("eE"), first = number.find_first_not_of('-');
    bool tiny = e != number.npos ? e + 1 < number.size() && number[e + 1] == '-'
                                 : number[first] == '0' || number[first] == '.';
    value = tiny ? 0.0 : INFINITY;
  } else if (code != std::errc()) {
    return false;
  }
  text.remove_prefix(size_t(stop - text.data()));
  // Microsoft's C library once wrote 1.#INF, -1.#IND, 1.#QNAN000000.
  if (text.starts_with('#')) {
    value = text.starts_with("#INF") ? std::copysign(double(INFINITY), value) : double(NAN);
    while (!text.empty() && !is_blank(text[0]) && text[0] != '\n') text.remove_prefix(1);
  }
  return true;
}

std::string short_name(std::string_view text) {
  constexpr size_t longest = 256;
  std::string name;
  for (text = trimmed(text); !text.empty();) {
    size_t length = utf8_length(text);
    std::string piece(text.substr(0, std::max<size_t>(length, 1)));
    uint8_t byte = uint8_t(piece[0]);
    if (length == 0) piece = {char(0xc0 | byte >> 6), char(0x80 | (byte & 0x3f))};
    if (byte < 0x20 || byte == 0x7f) piece = "?";
    if (name.size() + piece.size() > longest) break;
    name += piece;
    text.remove_prefix(std::max<size_t>(length, 1));
  }
  return name;
}

std::string file_stem(const std::string& path) {
  size_t begin = path.find_last_of("/\\"), end = path.find_last_of('.');
  begin = begin == path.npos ? 0 : begin + 1;
  return short_name(end == path.npos || end <= begin ? path.substr(begin) : path.substr(begin, end - begin));
}

Vec2 texcoord_from_below(double u, double v) {
  Vec2 uv{float(u), float(1 - v)};
  return {std::isfinite(uv.x) ? uv.x : 0.0f, std::isfinite(uv.y) ? uv.y : 0.0f};
}

Vec3 clamp_color(double r, double g, double b) {
  auto channel = [](double x) { return std::isnan(x) ? 1.0f : float(std::clamp(x, 0.0, 1.0)); };
  return {channel(r), channel(g), channel(b)};
}

Result<void> check_not_utf16(std::span<const uint8_t> bytes, const std::string& path) {
  if (bytes.size() < 2) return {};
  const bool marked = (bytes[0] == 0xff && bytes[1] == 0xfe) || (bytes[0] == 0xfe && bytes[1] == 0xff);
  if (!marked && (bytes[0] == 0) == (bytes[1] == 0)) return {};
  return Error{path, "is text in UTF-16, which is not read: save it as UTF-8"};
}

LineReader::LineReader(std::span<const uint8_t> bytes)
    : rest_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {
  if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
  if (rest_.find('\n') == rest_.npos) separator_ = '\r';
}

std::string_view LineReader::take() {
  size_t end = std::min(rest_.find(separator_), rest_.size());
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(std::min(end + 1, rest_.size()));
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  ++taken_;
  return line;
}

bool LineReader::next(std::string_view& line) {
  if (rest_.empty()) return false;
  line = take();
  number_ = taken_;
  if (line.empty() || line.back() != '\\') return true;
  joined_.clear();
  while (!line.empty() && line.back() == '\\') {
    joined_ += line.substr(0, line.size() - 1);
    joined_ += ' ';
    line = rest_.empty() ? std::string_view() : take();
  }
  joined_ += line;
  line = joined_;
  return true;
}

}  // namespace lambent
