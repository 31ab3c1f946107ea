#include <lambent/scene/named_file.h>

#include <lambent/core/uri.h>
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/textures.h>

#include <fmt/format.h>

#include <filesystem>

namespace lambent {
namespace {

namespace fs = std::filesystem;

// Steps of a path after its last "..", without drives and what says "here"; at most the last 16.
std::vector<std::string> last_steps(std::string_view name) {
  constexpr size_t most = 16;
  std::vector<std::string> steps;
  for (size_t at = 0; at <= name.size();) {
    size_t end = std::min(name.find_first_of("/\\", at), name.size());
    std::string_view step = name.substr(at, end - at);
    at = end + 1;
    if (step == "..") {
      steps.clear();
    } else if (!step.empty() && step != "." && step.find('\0') == step.npos && !(step.size() == 2 && step[1] == ':')) {
      steps.emplace_back(step);
    }
  }
  if (steps.size() > most) steps.erase(steps.begin(), steps.end() - most);
  return steps;
}

bool is_same_but_for_case(std::string_view a, std::string_view b) {
  auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; };
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [&](char x, char y) { return lower(x) == lower(y); });
}

// The path below `folder` that the steps lead to, in forward slashes; empty if there is none.
std::string follow(const std::string& folder, std::span<const std::string> steps) {
  std::string path;
  std::error_code failed;
  for (const std::string& step : steps) {
    const fs::path here = fs::path(folder) / path;
    std::string found = fs::exists(here / step, failed) ? step : "";
    if (found.empty()) {
      // The first by name, for folders are listed in no order.
      for (fs::directory_iterator entry(here, failed), end; !failed && entry != end; entry.increment(failed)) {
        std::string other = entry->path().filename().string();
        if (is_same_but_for_case(other, step) && (found.empty() || other < found)) found = other;
      }
    }
    if (found.empty()) return {};
    path += (path.empty() ? "" : "/") + found;
  }
  return path;
}

}  // namespace

Result<std::vector<uint8_t>> read_named_file(std::string_view name, const std::string& folder,
                                             const std::string& referrer) {
  const std::vector<std::string> steps = last_steps(trimmed(name));
  if (steps.empty()) return Error{referrer, "names no file"};
  if (folder.empty()) return read_external_file(steps.back(), folder, referrer);
  for (size_t first = 0; first < steps.size(); ++first) {
    std::string uri;  // which escapes "%"
    for (char c : follow(folder, std::span(steps).subspan(first))) uri += c == '%' ? "%25" : std::string(1, c);
    if (!uri.empty()) return read_external_file(uri, folder, referrer);
  }
  return Error{referrer, in_quotes(std::string(name)) + " was not found in the scene's folder"};
}

Result<Texture> read_named_picture(std::string_view name, const std::string& folder, const std::string& referrer) {
  auto bytes = read_named_file(name, folder, referrer);
  if (!bytes) return bytes.error();
  auto texture = decode_texture(std::move(*bytes), short_name(name));
  if (!texture) return Error{referrer, texture.error().text()};
  return texture;
}

void LostPictures::add(const Error& error) {
  if (count++ == 0) first = error.text();
}

void LostPictures::tell(Scene& scene) const {
  if (count == 0) return;
  std::string more = count > 1 ? fmt::format(" (and {} more)", count - 1) : "";
  scene.warnings.push_back(first + more + "; the surface does without");
}

}  // namespace lambent
