#include <lambent/pipeline/browser.h>

#include <lambent/pipeline/describe.h>
#include <lambent/scene/see_through.h>

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace lambent {
namespace {

constexpr DrawnKind kinds[] = {
    {"dense", "diffuse", "vertices"},    {"dense", "diffuse", "texels"},        {"dense", "directional", "texels"},
    {"dense", "outgoing", "vertices"},   {"dense", "pixels", "view"},           {"clusters", "diffuse", "vertices"},
    {"clusters", "diffuse", "texels"},   {"clusters", "directional", "texels"}, {"clusters", "outgoing", "vertices"},
    {"factors", "outgoing", "vertices"}, {"lobes", "diffuse", "vertices"},      {"lobes", "outgoing", "vertices"},
    {"blocks", "sight", "vertices"},     {"surfels", "diffuse", "vertices"},    {"surfels", "diffuse", "texels"},
    {"wavelets", "diffuse", "vertices"}, {"wavelets", "diffuse", "texels"},     {"wavelets", "pixels", "view"},
};

// What a kind that is not drawn is, for those who made it.
std::string why_not(const Field& field) {
  using std::string;
  if (std::holds_alternative<HaarTransfer>(field.store))
    return string("holds transfer in wavelets at ") + name_of(field.where);
  if (std::holds_alternative<IndirectTransfer>(field.store))
    return string("holds direct-to-indirect transport that is ") + name_of(field.rows) + ", at " + name_of(field.where);
  if (std::holds_alternative<DirectionalRows>(field.rows))
    return string("holds directional rows at ") + name_of(field.where);
  return string("holds ") + name_of(field.store) + " transfer, " + name_of(field.rows) + ", at " + name_of(field.where);
}

}  // namespace

std::span<const DrawnKind> drawn_kinds() { return kinds; }

Result<void> check_for_browser(const Field& field, const std::string& path) {
  const auto refuse = [&](const std::string& why) {
    return Error{path, why + ", which the web page does not draw: see `lambent render`"};
  };
  const std::string_view store = name_of(field.store), rows = name_of(field.rows), where = name_of(field.where);
  if (std::none_of(std::begin(kinds), std::end(kinds),
                   [&](const DrawnKind& k) { return store == k.store && rows == k.rows && where == k.where; }))
    return refuse(why_not(field));
  const LightBasis light = light_of(field.store);
  if (const Outgoing* outgoing = outgoing_of(field); outgoing && outgoing->kind == OutgoingKind::directional)
    return refuse("holds a last reflection of compact lobes");
  const bool texels = std::holds_alternative<TexelPlacement>(field.where);
  if (!light.groups.empty() && !texels)
    return refuse(std::string("holds the light of lamps at ") + name_of(field.where));
  if (light.count() > max_drawn_columns)
    return refuse(fmt::format("has {} columns of light, more than {}", light.count(), max_drawn_columns));
  if (const auto* lobes = std::get_if<ZonalTransfer>(&field.store);
      lobes && outgoing_of(field) && size_t(lobes->rows) * size_t(lobes->lobes) > max_drawn_lobes)
    return refuse(
        fmt::format("has {} rows of {} lobes, more than {} in all", lobes->rows, lobes->lobes, max_drawn_lobes));
  const size_t rows_drawn = size_t(rows_relit(field.store)), channels = size_t(channels_of(field.store)),
               columns = light.count();
  if (outgoing_of(field) && !std::holds_alternative<ZonalTransfer>(field.store) &&
      rows_drawn * channels * ((columns + 3) / 4) > max_drawn_texels)
    return refuse(fmt::format("has {} rows of {} columns, more than a texture holds", rows_drawn, columns));
  const size_t receivers = receivers_of(field.store), values = rows_drawn * channels * columns;
  if ((std::holds_alternative<CpcaTransfer>(field.store) || std::holds_alternative<FactoredTransfer>(field.store)) &&
      receivers > max_drawn_unfolded / 2 / std::max<size_t>(values, 1))
    return refuse(fmt::format("has {} receivers of {} values, more than {} MiB once unfolded", receivers, values,
                              max_drawn_unfolded >> 20));
  return {};
}

Result<void> check_for_browser(const Field& field, const Scene& scene, const std::string& path) {
  if (auto ok = check_for_browser(field, path); !ok || !std::holds_alternative<IndirectTransfer>(field.store))
    return ok;
  const auto refuse = [&](const char* why) {
    return Error{path, fmt::format("holds direct-to-indirect transport {}, which the web page does not draw: see "
                                   "`lambent render`",
                                   why)};
  };
  const auto glows = [](const Material& m) { return largest(m.emissive) > 0; };
  if (scene.lights.size() + size_t(std::count_if(scene.materials.begin(), scene.materials.end(), glows)) >
      max_drawn_own_lamps)
    return refuse("of more than 64 lamps of the scene's own");
  if (scene.origin != Vec3d(0)) return refuse("far from the origin");
  for (const Material& m : scene.materials) {
    // The page looks into no picture for what of it is solid after all.
    if (m.alpha_mode != AlphaMode::opaque || is_see_through(scene, m))
      return refuse("of surfaces that are seen through");
    if (m.emissive_texture >= 0 && glows(m)) return refuse("of lamps that glow by a picture");
  }
  return {};
}

Result<void> check_file_for_browser(const Baked& baked, const std::string& path) {
  if (hiding_of(baked))
    return Error{path,
                 "holds the shadow field of an object, which the web page does not draw: `lambent render --place` and "
                 "`lambent view --window --place` put it over a baked scene"};
  return check_for_browser(baked.surface, baked.scene, path);
}

}  // namespace lambent
