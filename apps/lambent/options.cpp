#include "options.h"

#include <lambent/brdf/parse_brdf.h>
#include <lambent/core/file.h>
#include <lambent/scene/load.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>

namespace lambent::tool {

const std::map<std::string, ShWindow> window_names{
    {"none", ShWindow::none}, {"hann", ShWindow::hann}, {"lanczos", ShWindow::lanczos}, {"auto", ShWindow::automatic}};

Result<std::vector<float>> parse_numbers(const std::string& text, size_t count, const std::string& what) {
  std::vector<float> values;
  const char* p = text.data();
  const char* end = p + text.size();
  while (true) {
    float value = 0;
    auto [next, status] = std::from_chars(p, end, value);
    if (status != std::errc() || !std::isfinite(value)) break;
    values.push_back(value), p = next;
    if (p == end || *p != ',') break;
    ++p;
  }
  if (p != end || values.size() != count)
    return Error{what, "expects " + std::to_string(count) + " numbers separated by commas, not \"" + text + "\""};
  return values;
}

Result<NamedColor> parse_named_color(const std::string& text, const std::string& option) {
  const size_t at = text.rfind('=');
  if (at == std::string::npos || at == 0) return Error{option, "expects NAME=R,G,B, not \"" + text + "\""};
  auto n = parse_numbers(text.substr(at + 1), 3, option);
  if (!n) return n.error();
  if ((*n)[0] < 0 || (*n)[1] < 0 || (*n)[2] < 0) return Error{option, "a colour may not be negative"};
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
    return Error{option, "expects WIDTHxHEIGHT, each from 1 to 16384, not \"" + text + "\""};
  return size;
}

namespace {

Result<void> change_materials(Scene& scene, const SceneOptions& options) {
  for (const std::string& text : options.emit) {
    auto lamp = parse_named_color(text, "--emit");
    if (!lamp) return lamp.error();
    bool found = false;
    for (Material& m : scene.materials)
      if (m.name == lamp->name) m.emissive = lamp->color, m.emissive_texture = -1, found = true;
    if (!found) return Error{"--emit", "the scene has no material \"" + lamp->name + "\""};
  }
  for (Material& m : scene.materials) m.base_color = min(m.base_color, Vec3(options.max_albedo));
  return {};
}

}  // namespace

void SceneOptions::add_to(CLI::App& command) {
  command.add_option("scene", path, "Scene: .gltf, .glb, .obj or .ply")->required();
  command.add_flag("--ground", ground, "Add a tessellated floor under the scene");
  command.add_option("--emit", emit, "MATERIAL=R,G,B: make a material a lamp of this radiance");
  command.add_option("--max-albedo", max_albedo, "Darken base colours to at most this, channel by channel")
      ->check(CLI::Range(0.0f, 1.0f));
  command.add_option("--max-edge", max_edge, "Split edges longer than this many scene units")
      ->check(CLI::PositiveNumber);
}

Result<Scene> load_prepared_scene(const SceneOptions& options) {
  auto scene = load_scene(options.path);
  if (!scene) return scene;
  if (auto ok = change_materials(*scene, options); !ok) return ok.error();
  if (options.ground) add_ground(*scene);
  if (options.max_edge > 0)
    if (auto ok = split_long_edges(*scene, options.max_edge); !ok) return ok.error();
  warn(scene->warnings);
  return scene;
}

void ViewOptions::add_to(CLI::App& command) {
  command.add_option("--camera", camera, "EX,EY,EZ,TX,TY,TZ,FOV: eye, target, vertical degrees; or auto")
      ->capture_default_str();
  command.add_option("--size", size, "Picture size, WIDTHxHEIGHT pixels")->capture_default_str();
  command.add_option("--exposure", exposure, "Stops that a PNG is brightened by")
      ->check(CLI::Range(-100.0f, 100.0f))
      ->capture_default_str();
  command.add_option("--background", background, "What lies behind the scene: env, or none (transparent)")
      ->check(CLI::IsMember({"env", "none"}))
      ->capture_default_str();
  command.add_option("-o,--output", output, "Picture to write: .png (8-bit sRGB) or .exr (linear)")->required();
}

namespace {

// What there is to look at: everything but an added floor, unless there is nothing else.
Bounds subject_bounds(const Scene& scene) {
  Bounds box;
  for (const Triangle& t : scene.triangles)
    if (scene.parts[t.part].name != ground_name)
      for (uint32_t v : t.v) box.extend(scene.positions[v]);
  return box.empty() ? bounds(scene) : box;
}

}  // namespace

Result<View> make_view(const ViewOptions& options, const Scene& scene) {
  View view;
  auto size = parse_size(options.size, "--size");
  if (!size) return size.error();
  view.width = (*size)[0], view.height = (*size)[1];
  auto camera = parse_camera(options.camera);
  if (!camera) return camera.error();
  view.camera = *camera ? **camera : camera_around(subject_bounds(scene));
  return view;
}

Result<std::optional<Camera>> parse_camera(const std::string& text) {
  if (text == "auto") return std::optional<Camera>();
  auto n = parse_numbers(text, 7, "--camera");
  if (!n) return n.error();
  Camera camera;
  camera.eye = {(*n)[0], (*n)[1], (*n)[2]}, camera.target = {(*n)[3], (*n)[4], (*n)[5]}, camera.fov = (*n)[6];
  if (!(camera.fov > 0 && camera.fov < 180))
    return Error{"--camera", "field of view must lie between 0 and 180 degrees"};
  if (camera.eye == camera.target) return Error{"--camera", "eye and target are the same point"};
  return std::optional<Camera>(camera);
}

Result<void> parse_cpca(const std::string& text, CpcaOptions& options) {
  const std::string where = "--compress";
  if (!text.starts_with("cpca:")) return Error{where, "must be cpca:CLUSTERS,RANK, not \"" + text + "\""};
  auto n = parse_numbers(text.substr(5), 2, where);
  if (!n) return n.error();
  const float most[] = {float(max_cpca_clusters), float(max_cpca_rank)};
  for (size_t k = 0; k < 2; ++k)
    if ((*n)[k] != std::floor((*n)[k]) || (*n)[k] < float(1 - k) || (*n)[k] > most[k])
      return Error{where, fmt::format("expects from 1 to {} clusters of rank 0 to {}, not \"{}\"", max_cpca_clusters,
                                      max_cpca_rank, text)};
  options.clusters = int((*n)[0]), options.rank = int((*n)[1]);
  return {};
}

void LightOptions::add_to(CLI::App& command, bool required) {
  command
      .add_option("--env", env,
                  "Environment: a .hdr or .exr file, uniform:R,G,B, or sky:elevation=35,azimuth=45,turbidity=3")
      ->required(required);
  command.add_option("--env-rotate", rotate, "YAW,PITCH,ROLL: turn the environment, degrees about +Y, +X, +Z");
}

Result<Environment> load_light(const LightOptions& options) {
  auto env = load_environment(options.env);
  if (env) warn(env->warnings);
  return env;
}

Result<Mat3> light_rotation(const LightOptions& options) {
  if (options.rotate.empty()) return Mat3(1.0f);
  auto n = parse_numbers(options.rotate, 3, "--env-rotate");
  if (!n) return n.error();
  return rotation_from_yaw_pitch_roll({(*n)[0], (*n)[1], (*n)[2]});
}

CLI::Option* BrdfOptions::add_to(CLI::App& command) {
  return command
      .add_option("--brdf", brdf,
                  std::string("How surfaces reflect: diffuse (by base colour), materials (glTF's metallic-roughness), "
                              "or one model for all: ") +
                      brdf_syntax)
      ->capture_default_str();
}

Result<Reflection> load_reflection(const BrdfOptions& options) {
  Reflection reflection;
  if (options.brdf == "diffuse") return reflection;
  if (options.brdf == "materials") {
    reflection.model = Reflection::Model::materials;
    return reflection;
  }
  auto brdf = parse_brdf(options.brdf);
  if (!brdf) return options.brdf.starts_with("measured:") ? brdf.error() : Error{"--brdf", brdf.error().text()};
  reflection.everywhere = std::move(*brdf);
  return reflection;
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
  return {};
}

void warn_of_lost_walks(const SubsurfaceReport& walks) {
  if (walks.lost > 0.005)
    warn(
        fmt::format("{:.1f}% of the walks through the medium were lost, and their light with them: surfaces are not "
                    "closed, or the medium is too dense",
                    100 * walks.lost));
}

}  // namespace lambent::tool
