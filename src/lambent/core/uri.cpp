// RFC 3986 (percent-encoding); RFC 2397 and 4648 (data URIs,
// base64).
#include <lambent/core/uri.h>

#include <lambent/core/file.h>

#include <algorithm>
#include <filesystem>

namespace lambent {

namespace {

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// A "%" that starts no escape stands for itself.
std::string percent_decode(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    int high = -1, low = -1;
    if (text[i] == '%' && i + 2 < text.size()) high = hex_digit(text[i + 1]), low = hex_digit(text[i + 2]);
    if (high >= 0 && low >= 0) {
      out += char(high * 16 + low), i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

// "http:", "file:", "C:" and the like.
bool has_scheme(const std::string& uri) {
  size_t colon = uri.find(':');
  if (colon == std::string::npos || colon == 0) return false;
  return uri.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-.") == colon;
}

int base64_digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// False for characters outside the alphabet, wrong lengths, and padding elsewhere than at the end.
bool base64_decode(std::string_view text, std::vector<uint8_t>& out) {
  size_t padding = 0;
  while (padding < 2 && !text.empty() && text.back() == '=') text.remove_suffix(1), ++padding;
  if (text.size() % 4 == 1 || (padding && (text.size() + padding) % 4 != 0)) return false;
  out.reserve(text.size() / 4 * 3 + 2);
  uint32_t bits = 0;
  int held = 0;
  for (char c : text) {
    int digit = base64_digit(c);
    if (digit < 0) return false;
    bits = bits << 6 | uint32_t(digit), held += 6;
    if (held >= 8) held -= 8, out.push_back(uint8_t(bits >> held));
  }
  return true;
}

}  // namespace

std::string in_quotes(const std::string& text) {
  constexpr size_t longest = 120;
  std::string out = "\"" + text.substr(0, longest);
  std::replace_if(
      out.begin(), out.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return out + (text.size() > longest ? "...\"" : "\"");
}

bool is_data_uri(const std::string& uri) { return uri.starts_with("data:"); }

Result<std::vector<uint8_t>> decode_data_uri(const std::string& uri, const std::string& where, std::string* mime_type) {
  constexpr size_t scheme_size = 5;  // "data:"
  constexpr std::string_view marker = ";base64";
  size_t comma = uri.find(',');
  if (comma == std::string::npos) return Error{where, "data URI has no comma"};
  std::string_view head = std::string_view(uri).substr(scheme_size, comma - scheme_size);
  if (!head.ends_with(marker)) return Error{where, "data URI is not base64"};
  if (mime_type) *mime_type = std::string(head.substr(0, head.find(';')));
  std::vector<uint8_t> bytes;
  if (!base64_decode(std::string_view(uri).substr(comma + 1), bytes))
    return Error{where, "data URI holds broken base64"};
  return bytes;
}

std::string encode_uri(const std::string& name) {
  constexpr const char* digits = "0123456789ABCDEF";
  std::string out;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
                       c == '.' || c == '_' || c == '~';
    if (plain) out += c;
    else out += '%', out += digits[byte >> 4], out += digits[byte & 15];
  }
  return out;
}

Result<std::string> find_external_file(const std::string& uri, const std::string& folder, const std::string& referrer) {
  namespace fs = std::filesystem;
  auto refuse = [&](const std::string& why) { return Error{referrer, in_quotes(uri) + " " + why}; };
  if (folder.empty()) return refuse("is an external file, which is not allowed here");
  if (has_scheme(uri)) return refuse("is not a relative path");
  std::string name = percent_decode(uri);
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.empty() || name.find('\0') != std::string::npos) return refuse("is not a file name");
  if (name.front() == '/' || has_scheme(name)) return refuse("is not a relative path");
  for (const fs::path& step : fs::path(name)) {
    if (step == "..") return refuse("lies outside the scene's folder");
  }
  std::error_code failed;
  fs::path inside = fs::canonical(folder, failed);
  if (failed) return refuse("cannot be read: " + failed.message());
  fs::path file = fs::canonical(fs::path(folder) / name, failed);
  if (failed == std::errc::no_such_file_or_directory) return refuse("was not found");
  if (failed) return refuse("cannot be read: " + failed.message());
  // Both are free of links now: the file is inside if its path begins with all steps of the folder's.
  if (std::mismatch(inside.begin(), inside.end(), file.begin(), file.end()).first != inside.end()) {
    return refuse("leads outside the scene's folder");
  }
  return file.string();
}

Result<std::vector<uint8_t>> read_external_file(const std::string& uri, const std::string& folder,
                                                const std::string& referrer) {
  auto file = find_external_file(uri, folder, referrer);
  if (!file) return file.error();
  auto bytes = read_file(*file);
  if (!bytes) return Error{referrer, in_quotes(uri) + " cannot be read: " + bytes.error().message};
  return bytes;
}

}  // namespace lambent
