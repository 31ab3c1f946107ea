#include <lambent/core/file.h>
#include <lambent/light/environment.h>
#include <lambent/light/sky.h>

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
  auto file = MappedFile::open(spec);
  if (!file) return file.error();
  ImageFormat format = image_format(file->bytes());
  if (format == ImageFormat::png || format == ImageFormat::jpeg)
    return Error{spec, "an environment needs high dynamic range: .hdr or .exr"};
  auto image = load_image(file->bytes(), spec);
  if (!image) return image.error();
  return environment_from_image(std::filesystem::path(spec).stem().string(), std::move(*image));
}

}  // namespace lambent
