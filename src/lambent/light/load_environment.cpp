#include <lambent/core/file.h>
#include <lambent/image/picture_name.h>
#include <lambent/light/environment.h>
#include <lambent/light/sky.h>
#include <lambent/light/sphere_map.h>

#include <charconv>
#include <filesystem>

namespace lambent {
namespace {

Result<Environment> parse_uniform(const std::string& spec, const std::string& values) {
  Vec3 color;
  int count = 0;
  const char *at = values.data(), *end = at + values.size();
  for (;;) {
    auto [stop, code] = std::from_chars(at, end, color[count]);
    if (code != std::errc() || !(color[count] >= 0) || !std::isfinite(color[count]))
      return Error{spec, "not a non-negative number"};
    at = stop, ++count;
    if (at == end || count == 3) break;
    if (*at++ != ',') return Error{spec, "numbers are separated by commas"};
  }
  if (at != end || count == 2) return Error{spec, "one or three numbers are wanted"};
  if (count == 1) color = Vec3(color.x);
  // Fine enough for sums over texel centres to be exact in practice.
  return make_environment("uniform", 256, 128, [color](Vec3) { return color; });
}

}  // namespace

Result<Environment> load_environment(const std::string& spec) {
  if (spec.starts_with("uniform:")) return parse_uniform(spec, spec.substr(8));
  if (spec.starts_with("sky:")) {
    auto options = parse_sky(spec.substr(4));
    if (!options) return options.error();
    return make_sky(*options);
  }
  auto file = MappedFile::open(picture_name(spec).file);
  if (!file) return file.error();
  return environment_from_file(file->bytes(), spec);
}

Result<Environment> environment_from_file(std::span<const uint8_t> bytes, const std::string& path) {
  auto file = load_image_file(bytes, path);
  if (!file) return file.error();
  std::vector<std::string> warnings = std::move(file->warnings);
  if (file->format == ImageFormat::png || file->format == ImageFormat::jpeg)
    warnings.push_back(path + ": decoded from sRGB, where radiance ends at 1: lamps and the sun are cut off");
  const Envmap envmap = file->envmap;
  const float largest = file->largest;
  const int width = file->image.width, height = file->image.height;
  Image image;
  if (envmap != Envmap::unsaid && sphere_map_of(width, height, envmap, path)) {
    if (width != file->width || height != file->height)
      warnings.push_back(path + ": its envmap attribute lays its data window over the sphere, not its display window");
    image = std::move(file->image);
  } else {
    auto shown = in_display_window(std::move(*file), path);
    if (!shown) return shown.error();
    image = std::move(*shown);
  }
  auto map = sphere_map_of(image.width, image.height, envmap, path);
  if (!map) return map.error();
  image.alpha.clear();
  std::vector<std::string> mended;
  clamp_radiance(image, largest, mended);
  for (const std::string& text : mended) warnings.push_back(path + ": " + text);
  image = latlong_of(std::move(image), *map);
  fill_missing(image);
  auto env = environment_from_image(std::filesystem::path(picture_name(path).file).stem().string(), std::move(image));
  if (env) env->warnings = std::move(warnings);
  return env;
}

}  // namespace lambent
