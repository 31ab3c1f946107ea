#include <lambent/light/sky.h>

#include <charconv>

namespace lambent {

Result<SkyOptions> parse_sky(const std::string& spec) {
  SkyOptions options;
  for (size_t at = 0; at < spec.size();) {
    size_t end = std::min(spec.find(',', at), spec.size());
    std::string item = spec.substr(at, end - at);
    at = end + 1;
    size_t equals = item.find('=');
    if (equals == std::string::npos) return Error{"sky", "\"" + item + "\" is not of the form key=value"};
    std::string key = item.substr(0, equals), value = item.substr(equals + 1);
    if (key == "sun") {
      if (value != "on" && value != "off") return Error{"sky", "sun is on or off, not \"" + value + "\""};
      options.sun = value == "on";
      continue;
    }
    float number = 0;
    if (key != "elevation" && key != "azimuth" && key != "turbidity" && key != "ground" && key != "width")
      return Error{"sky", "unknown key \"" + key + "\": elevation, azimuth, turbidity, ground, sun or width"};
    auto [stop, code] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (code != std::errc() || stop != value.data() + value.size() || !std::isfinite(number))
      return Error{"sky", key + " is not a number: \"" + value + "\""};
    if (key == "elevation") options.elevation = number;
    if (key == "azimuth") options.azimuth = number;
    if (key == "turbidity") options.turbidity = number;
    if (key == "ground") options.ground = Vec3(number);
    if (key == "width") {
      if (!(number >= 0 && number <= 16384) || number != std::floor(number))
        return Error{"sky", "width must be even and lie in [8, 16384]"};
      options.width = int(number);
    }
  }
  return options;
}

}  // namespace lambent
