#include <lambent/brdf/parse_brdf.h>
#include <lambent/core/file.h>
#include <lambent/pipeline/parse.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

namespace lambent {

namespace {

template <class T>
Result<std::vector<T>> parse_values(const std::string& text, size_t count, const std::string& option) {
  std::vector<T> values;
  const char* p = text.data();
  const char* end = p + text.size();
  while (true) {
    T value = 0;
    auto [next, status] = std::from_chars(p, end, value);
    if (status != std::errc() || !std::isfinite(float(value))) break;
    values.push_back(value), p = next;
    if (p == end || *p != ',') break;
    ++p;
  }
  if (p != end || values.size() != count)
    return Error{option, "expects " + std::to_string(count) + " numbers separated by commas, not \"" + text + "\"",
                 true};
  return values;
}

// A place of the file's space in the scene's.
Vec3 place(const std::vector<double>& numbers, size_t first, Vec3d origin) {
  return Vec3(Vec3d(numbers[first], numbers[first + 1], numbers[first + 2]) - origin);
}

}  // namespace

Result<std::vector<float>> parse_numbers(const std::string& text, size_t count, const std::string& option) {
  return parse_values<float>(text, count, option);
}

Result<NamedColor> parse_named_color(const std::string& text, const std::string& option) {
  const size_t at = text.rfind('=');
  if (at == std::string::npos || at == 0) return Error{option, "expects NAME=R,G,B, not \"" + text + "\"", true};
  const std::string numbers = text.substr(at + 1);
  auto n = parse_numbers(numbers.find(',') == std::string::npos ? numbers + "," + numbers + "," + numbers : numbers, 3,
                         option);
  if (!n) return n.error();
  if ((*n)[0] < 0 || (*n)[1] < 0 || (*n)[2] < 0) return Error{option, "a colour may not be negative", true};
  return NamedColor{text.substr(0, at), {(*n)[0], (*n)[1], (*n)[2]}};
}

Result<std::array<int, 2>> parse_size(const std::string& text, const std::string& option) {
  std::array<int, 2> size{};
  const size_t x = text.find('x');
  auto number = [&](const std::string& digits, int& value) {
    auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return status == std::errc() && end == digits.data() + digits.size() && value >= 1 && value <= 16384;
  };
  if (x == std::string::npos || !number(text.substr(0, x), size[0]) || !number(text.substr(x + 1), size[1]))
    return Error{option, "expects WIDTHxHEIGHT, each from 1 to 16384, not \"" + text + "\"", true};
  return size;
}

Result<std::optional<Camera>> parse_camera(const std::string& text, Vec3d origin) {
  if (text == "auto") return std::optional<Camera>();
  auto n = parse_values<double>(text, 7, "--camera");
  if (!n) return n.error();
  Camera camera;
  for (double x : *n)
    if (std::abs(x) > 1e9) return Error{"--camera", "numbers must lie within 1e9", true};
  camera.eye = place(*n, 0, origin), camera.target = place(*n, 3, origin), camera.fov = float((*n)[6]);
  if (!(camera.fov > 0 && camera.fov < 180))
    return Error{"--camera", "field of view must lie between 0 and 180 degrees", true};
  if (camera.eye == camera.target) return Error{"--camera", "eye and target are the same point", true};
  return std::optional<Camera>(camera);
}

namespace {

// What there is to look at: everything but an added floor, unless there is nothing else.
std::vector<Vec3> subject(const Scene& scene) {
  for (bool with_ground : {false, true}) {
    std::vector<bool> seen(scene.positions.size());
    for (const Triangle& t : scene.triangles)
      if (with_ground || scene.parts[t.part].name != ground_name)
        for (uint32_t v : t.v) seen[v] = true;
    std::vector<Vec3> points;
    for (size_t v = 0; v < seen.size(); ++v)
      if (seen[v]) points.push_back(scene.positions[v]);
    if (!points.empty()) return points;
  }
  return {};
}

}  // namespace

Result<View> parse_view(const std::string& camera_text, const std::string& size_text, const Scene& scene) {
  View view;
  auto size = parse_size(size_text, "--size");
  if (!size) return size.error();
  view.width = (*size)[0], view.height = (*size)[1];
  auto camera = parse_camera(camera_text, scene.origin);
  if (!camera) return camera.error();
  view.camera = *camera ? **camera : camera_around(subject(scene), float(view.width) / float(view.height));
  return view;
}

Result<Mat3> parse_rotation(const std::string& text, const std::string& option) {
  if (text.empty()) return Mat3(1.0f);
  auto n = parse_numbers(text, 3, option);
  if (!n) return n.error();
  return rotation_from_yaw_pitch_roll({(*n)[0], (*n)[1], (*n)[2]});
}

const std::map<std::string, ShWindow> window_names{
    {"none", ShWindow::none}, {"hann", ShWindow::hann}, {"lanczos", ShWindow::lanczos}, {"auto", ShWindow::automatic}};

Result<ShWindow> parse_window(const std::string& text) {
  const auto found = window_names.find(text);
  if (found == window_names.end())
    return Error{"--window", "must be none, hann, lanczos or auto, not \"" + text + "\"", true};
  return found->second;
}

Result<std::vector<SphereLamp>> parse_sphere_lamps(const std::vector<std::string>& texts, Vec3d origin) {
  std::vector<SphereLamp> lamps;
  for (const std::string& text : texts) {
    auto n = parse_values<double>(text, 7, "--sphere-lamp");
    if (!n) return n.error();
    const std::vector<double>& v = *n;
    const SphereLamp lamp{place(v, 0, origin), float(v[3]), {v[4], v[5], v[6]}};
    if (!(lamp.radius > 0)) return Error{"--sphere-lamp", "the radius must be above 0", true};
    for (double x : v)
      if (std::abs(x) > 1e9) return Error{"--sphere-lamp", "numbers must lie within 1e9", true};
    lamps.push_back(lamp);
  }
  return lamps;
}

Result<std::vector<double>> parse_frames(const std::string& text) {
  constexpr size_t max_frames = 64;
  const Error wrong{
      "--frames",
      "expects FROM:TO[:STEP] in seconds, at most " + std::to_string(max_frames) + " of them, not \"" + text + "\"",
      true};
  double n[3] = {0, 0, 0};
  size_t count = 0;
  const char* p = text.data();
  const char* end = p + text.size();
  for (; count < 3; ++p) {
    const auto [next, status] = std::from_chars(p, end, n[count]);
    if (status != std::errc() || !std::isfinite(n[count])) return wrong;
    ++count, p = next;
    if (p == end || *p != ':') break;
  }
  if (p != end || count < 2 || n[1] < n[0]) return wrong;
  if (count == 2) n[2] = (n[1] - n[0]) / 5;
  if (n[1] == n[0]) return std::vector<double>{n[0]};
  if (!(n[2] > 0) || (n[1] - n[0]) / n[2] >= double(max_frames)) return wrong;
  std::vector<double> times;
  for (size_t i = 0; n[0] + double(i) * n[2] <= n[1] + 1e-9 * n[2]; ++i) times.push_back(n[0] + double(i) * n[2]);
  return times;
}

Result<Insertion> parse_insertion(const std::string& text, Vec3d origin) {
  const size_t at = text.rfind('@');
  if (at == std::string::npos || at == 0)
    return Error{"--insert", "expects FILE@X,Y,Z or FILE@X,Y,Z,SCALE, not \"" + text + "\"", true};
  const std::string numbers = text.substr(at + 1);
  const bool scaled = std::count(numbers.begin(), numbers.end(), ',') == 3;
  auto n = parse_values<double>(numbers, scaled ? 4 : 3, "--insert");
  if (!n) return n.error();
  Insertion out{text.substr(0, at), place(*n, 0, origin), scaled ? float((*n)[3]) : 1};
  if (!(out.scale > 0)) return Error{"--insert", "the scale must be above 0", true};
  if (!all_at_most(abs(out.foot), Vec3(1e9f))) return Error{"--insert", "the place lies beyond 1e9", true};
  return out;
}

Result<Reflection> parse_reflection(const std::string& text) {
  Reflection reflection;
  if (text == "diffuse") return reflection;
  if (text == "materials") {
    reflection.model = Reflection::Model::materials;
    return reflection;
  }
  auto brdf = parse_brdf(text);
  if (!brdf) return text.starts_with("measured:") ? brdf.error() : Error{"--brdf", brdf.error().text(), true};
  reflection.everywhere = std::move(*brdf);
  return reflection;
}

Result<void> parse_materials(const std::vector<std::string>& texts, const Scene& scene, Reflection& reflection) {
  for (const std::string& text : texts) {
    // A name may hold '=': the first '=' after which there is a model.
    const auto known = std::find_if(scene.materials.begin(), scene.materials.end(), [&](const Material& m) {
      return !m.name.empty() && text.starts_with(m.name + "=");
    });
    if (known == scene.materials.end())
      return Error{"--material", "expects NAME=BRDF with a material of the scene, not \"" + text + "\"", true};
    std::string model = text.substr(known->name.size() + 1);
    const std::string prefix = "textured:";
    const bool textured = model.starts_with(prefix);
    if (textured) model = model.substr(prefix.size());
    auto brdf = parse_brdf(model);
    if (!brdf) return Error{"--material", known->name + ": " + brdf.error().text(), true};
    reflection.named.push_back({known->name, std::move(*brdf), textured});
  }
  return {};
}

Result<void> parse_cpca(const std::string& text, CpcaOptions& options) {
  const std::string where = "--compress";
  if (!text.starts_with("cpca:")) return Error{where, "must be cpca:CLUSTERS,RANK, not \"" + text + "\"", true};
  auto n = parse_numbers(text.substr(5), 2, where);
  if (!n) return n.error();
  const float most[] = {float(max_cpca_clusters), float(max_cpca_rank)};
  for (size_t k = 0; k < 2; ++k)
    if ((*n)[k] != std::floor((*n)[k]) || (*n)[k] < float(1 - k) || (*n)[k] > most[k])
      return Error{where,
                   fmt::format("expects from 1 to {} clusters of rank 0 to {}, not \"{}\"", max_cpca_clusters,
                               max_cpca_rank, text),
                   true};
  options.clusters = int((*n)[0]), options.rank = int((*n)[1]);
  return {};
}

Result<void> check_output(const std::string& path, std::initializer_list<const char*> extensions) {
  const std::string extension = file_extension(path);
  std::string known;
  bool fits = false;
  for (const char* e : extensions) fits |= extension == e, known += (known.empty() ? "." : ", .") + std::string(e);
  if (!fits) return Error{path, "cannot be written: the name must end in " + known};
  std::string folder = std::filesystem::path(path).parent_path().string();
  if (folder.empty()) folder = ".";
  std::error_code status;
  if (!std::filesystem::is_directory(folder, status)) return Error{path, "cannot be written: no folder " + folder};
  if (::access(folder.c_str(), W_OK) != 0) return Error{path, "cannot be written: folder " + folder + " is read-only"};
  if (std::filesystem::is_directory(path, status)) return Error{path, "is a folder"};
  if (extension == "gltf" && std::filesystem::is_symlink(path, status))
    return Error{path, "is a link, and a .gltf has its data beside it: name the file itself"};
  return {};
}

}  // namespace lambent
