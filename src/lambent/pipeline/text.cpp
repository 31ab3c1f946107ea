#include <lambent/pipeline/text.h>

#include <fmt/format.h>

namespace lambent {

std::string human_bytes(double bytes) {
  if (bytes < 1000) return fmt::format("{:.0f} bytes", bytes);
  const char* units[] = {"kB", "MB", "GB", "TB"};
  int unit = -1;
  while (bytes >= 1000 && unit < 3) bytes /= 1000, ++unit;
  return fmt::format("{:.3g} {}", bytes, units[unit]);
}

std::string human_seconds(double s) {
  if (s < 10) return fmt::format("{:.2f} s", s);
  if (s < 120) return fmt::format("{:.0f} s", s);
  return fmt::format("{} min {} s", int(s) / 60, int(s) % 60);
}

std::string human_count(size_t count) {
  std::string digits = std::to_string(count);
  for (int i = int(digits.size()) - 3; i > 0; i -= 3) digits.insert(size_t(i), ",");
  return digits;
}

std::string describe_light(const LightBasis& light) {
  std::string text = light.order > 0 ? "order " + std::to_string(light.order) : "";
  auto add = [&](size_t count, const std::string& what) {
    if (count > 0) text += (text.empty() ? "" : " and ") + std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  };
  const bool compact = light.lobe_kind == LobeKind::compact, copies = light.lobe_kind == LobeKind::band_limited;
  add(light.lobes.size(), compact ? "compact lobe" : copies ? "steerable lobe" : "lobe");
  add(light.groups.size(), "lamp group");
  return text;
}

}  // namespace lambent
