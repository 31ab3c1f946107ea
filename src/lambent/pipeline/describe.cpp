#include <lambent/core/overloaded.h>
#include <lambent/pipeline/describe.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace lambent {

using nlohmann::json;

namespace {

// A piece of a description: members of the JSON, and words.
struct Said {
  json members;
  std::string words, more = {};  // `more`: lines of their own
};

json vector_json(Vec3 v) { return {v.x, v.y, v.z}; }
std::string some(size_t count, const char* what) {
  return fmt::format("{} {}{}", human_count(count), what, count == 1 ? "" : "s");
}
const char* name_of(Precision precision) { return precision == Precision::half ? "half" : "single"; }

const char* lobe_word(LobeKind kind) {
  return kind == LobeKind::compact ? "compact lobe" : kind == LobeKind::band_limited ? "turned copy" : "lobe";
}
std::string width_of(LobeKind kind, double s) {
  if (kind == LobeKind::band_limited) return fmt::format("of {} bands", s);
  const std::string sharp = fmt::format("sharpness {:.4g}: ", s);
  if (kind == LobeKind::compact)
    return sharp + fmt::format("nothing beyond {:.3g} degrees", degrees(lobe_reach(kind, s)));
  return sharp + fmt::format("{:.2g} degrees across", std::min(180.0, double(degrees(2 / std::sqrt(s)))));
}

Said say_light(const LightBasis& light) {
  json lobes = json::array();
  std::string lines;
  for (const Lobe& l : light.lobes) {
    lobes.push_back({{"axis", vector_json(l.axis)}, {"sharpness", l.sharpness}});
    lines += fmt::format("\n  {} about ({:.4f}, {:.4f}, {:.4f}), {}", lobe_word(light.lobe_kind), l.axis.x, l.axis.y,
                         l.axis.z, width_of(light.lobe_kind, l.sharpness));
  }
  json columns{{"order", light.order}, {"lobes", lobes}, {"groups", light.groups}, {"columns", light.count()}};
  if (!light.lobes.empty()) columns["lobe_kind"] = lobe_names[int(light.lobe_kind)];
  return {std::move(columns), describe_light(light) + ", " + some(light.count(), "column"), lines};
}

Said say(const Transfer& t) {
  Said s = say_light(t.light);
  s.members.update({{"rows", t.rows}, {"channels", t.channels}, {"precision", name_of(t.precision)}});
  s.words += fmt::format(", {}, {}", some(size_t(t.rows), "row"), some(size_t(t.channels), "channel"));
  return s;
}
Said say(const CpcaTransfer& t) {
  Said s = say_light(t.light);
  s.members.update({{"rows", t.rows},
                    {"channels", t.channels},
                    {"precision", "half"},
                    {"cpca", {{"clusters", t.clusters}, {"rank", t.rank}}}});
  s.words += fmt::format(", {}, {}", some(size_t(t.rows), "row"), some(size_t(t.channels), "channel"));
  s.more = fmt::format("\n  in {} clusters of rank {}", t.clusters, t.rank) + s.more;
  return s;
}
Said say(const ZonalTransfer& t) {
  return {{{"order", t.order},
           {"lobes", t.lobes},
           {"rows", t.rows},
           {"channels", t.channels},
           {"precision", name_of(t.precision)}},
          fmt::format("{} zonal lobes{}, order {}, {}", t.lobes,
                      t.rows > 1 ? fmt::format(" in each of {} rows", t.rows) : "", t.order,
                      some(size_t(t.channels), "channel"))};
}
Said say(const FactoredTransfer& t) {
  Said s = say_light({.order = t.light_order()});
  s.members.update({{"rows", 1},
                    {"channels", 1},
                    {"precision", name_of(t.visibility.precision)},
                    {"incident_order", t.incident_order},
                    {"visibility_order", t.visibility.light.order}});
  s.words += fmt::format(", visibility of order {}, 1 channel", t.visibility.light.order);
  return s;
}
Said say(const Visibility& v) {
  const VisibilityStatistics s = visibility_statistics(v);
  return {{{"cube", v.size},
           {"bits", v.bits},
           {"blocked", s.blocked},
           {"clear", s.clear},
           {"mixed", s.mixed},
           {"changes_per_mixed_block", s.changes}},
          fmt::format("visibility in blocks, cube {}, {}", v.size, some(size_t(v.bits), "bit")),
          fmt::format("\n  {:.1f} % of blocks mixed, with {:.1f} changes each", 100 * s.mixed, s.changes)};
}

Said say(const IndirectTransfer& t) {
  const Surfels& s = t.surfels;
  const double each = double(t.gather.nodes.size()) / double(std::max<size_t>(t.gathering(), 1));
  return {{{"surfels", s.count()},
           {"levels", s.counts},
           {"spacings", s.spacings},
           {"gathering", t.gathering()},
           {"entries", t.gather.nodes.size()},
           {"lattice_points", t.lattice ? t.lattice->lattice.count() : 0},
           {"compression_error", t.error}},
          fmt::format("direct to indirect light, {} in {} levels, {} with rows", some(s.count(), "surfel"), s.levels(),
                      human_count(t.gathering())),
          fmt::format("\n  rows of {:.0f} entries, to {:.2g} % RMS of what was gathered{}", each, 100 * t.error,
                      t.lattice ? fmt::format("\n  in free space at {} points, order {}",
                                              human_count(t.lattice->lattice.count()), t.lattice->order)
                                : "")};
}

// What the rows of a store are of.
const char* row_word(const Placement& where) { return std::holds_alternative<FixedView>(where) ? "pixel" : "receiver"; }

Said say(const HaarTransfer& t, const Placement& where) {
  const double each = double(t.entries()) / double(std::max<size_t>(t.receivers, 1));
  return {{{"cube", t.size},
           {"rows", t.rows},
           {"channels", t.channels},
           {fmt::format("wavelets_per_{}", row_word(where)), each},
           {"compression_error", t.error}},
          fmt::format("Haar wavelets of a cube of {} by column, {:.0f} of {} a {}, to {:.2g} % RMS, {}", t.size, each,
                      human_count(t.columns()), row_word(where), 100 * t.error, some(size_t(t.channels), "channel"))};
}

Said say(const Rows& rows) {
  return std::visit(
      Overloaded{[](const DiffuseRows&) -> Said {
                   return {json::object(), "diffuse"};
                 },
                 [](const DirectionalRows& r) -> Said {
                   const std::string name = directional_name(r.kind);
                   return {{{"directional", name}}, "directional " + name};
                 },
                 [](const Outgoing& o) -> Said {
                   const char* name = outgoing_names[int(o.kind)];
                   Said s{{{"outgoing", name}}, std::string("outgoing ") + name};
                   if (!o.lobes.empty()) s.members["outgoing_lobes"] = o.lobes.size();
                   if (!o.lobes.empty()) s.words += fmt::format(", {} lobes", o.lobes.size());
                   return s;
                 },
                 [](const IncidentRows& r) -> Said {
                   return {{{"incident_order", r.order}}, fmt::format("incident light of order {}", r.order)};
                 },
                 [](const PixelRows&) -> Said {
                   return {json::object(), "pixels"};
                 },
                 [](const SightRows&) -> Said {
                   return {json::object(), "sight"};
                 },
                 [](const HiddenRows&) -> Said {
                   return {json::object(), "what the object hides"};
                 }},
      rows);
}

Said say(const Placement& where) {
  return std::visit(
      Overloaded{
          [](const VertexPlacement&) -> Said {
            return {json::object(), "", ""};
          },
          [](const TexelPlacement& p) -> Said {
            return {{{"atlas", {p.width, p.height}}},
                    "",
                    fmt::format("\n  over an atlas of {} x {} texels", p.width, p.height)};
          },
          [](const PatchPlacement&) -> Said {
            return {json::object(), "", "\n  over patches"};
          },
          [](const LatticePlacement& p) -> Said {
            const Lattice& l = p.lattice;
            return {{{"points", {l.nx, l.ny, l.nz}},
                     {"min", vector_json(l.min)},
                     {"max", vector_json(l.max)},
                     {"invalid", std::count(p.valid.begin(), p.valid.end(), uint8_t(0))}},
                    "",
                    fmt::format("\n  in free space at {} x {} x {} points", l.nx, l.ny, l.nz)};
          },
          [](const FixedView& v) -> Said {
            return {{{"view",
                      {{"width", v.width},
                       {"height", v.height},
                       {"eye", vector_json(v.camera.eye)},
                       {"target", vector_json(v.camera.target)},
                       {"fov", v.camera.fov}}}},
                    "",
                    fmt::format("\n  a fixed view of {} x {} pixels", v.width, v.height)};
          },
          [](const ShellPlacement& p) -> Said {
            const Shells& s = p.shells;
            return {{{"center", vector_json(s.center)}, {"radius", s.radius}, {"radii", s.radii}, {"side", s.side}},
                    "",
                    fmt::format("\n  on {} shells of {} x {} points, {:.3g} to {:.3g} radii of the "
                                "object",
                                s.radii.size(), s.side, s.side, s.radii.front() / s.radius, s.radii.back() / s.radius)};
          }},
      where);
}

Said say_store(const Field& field) {
  return std::visit(
      Overloaded{[&](const HaarTransfer& t) { return say(t, field.where); }, [](const auto& s) { return say(s); }},
      field.store);
}

const char* kind_name(const Field& field) {
  return std::visit(
      Overloaded{[](const ZonalTransfer&) { return "zonal"; }, [](const FactoredTransfer&) { return "factors"; },
                 [](const Visibility&) { return "blocks"; }, [](const IndirectTransfer&) { return "indirect"; },
                 [](const HaarTransfer&) { return "wavelets"; },
                 [&](const auto&) { return outgoing_of(field) ? "matrix" : "diffuse"; }},
      field.store);
}

}  // namespace

const char* name_of(const Placement& where) {
  static constexpr const char* names[] = {"vertices", "texels", "patches", "lattice", "view", "shells"};
  static_assert(std::size(names) == std::variant_size_v<Placement>);
  return names[where.index()];
}

const char* name_of(const Rows& rows) {
  static constexpr const char* names[] = {"diffuse", "directional", "outgoing", "incident",
                                          "pixels",  "sight",       "hidden"};
  static_assert(std::size(names) == std::variant_size_v<Rows>);
  return names[rows.index()];
}

json describe(const Field& field) {
  json d{{"kind", kind_name(field)},       {"store", name_of(field.store)},          {"where", name_of(field.where)},
         {"meaning", name_of(field.rows)}, {"receivers", receivers_of(field.store)}, {"bytes", bytes_of(field.store)}};
  for (const Said& said : {say_store(field), say(field.rows), say(field.where)}) d.update(said.members);
  return d;
}

std::string describe_in_words(const Field& field) {
  const Said store = say_store(field), rows = say(field.rows), where = say(field.where);
  std::vector<std::string> words;
  // The kind goes first, unless the store says it; then what rows there are beyond one diffuse.
  const std::string kind = kind_name(field);
  const bool arrives = std::holds_alternative<IncidentRows>(field.rows);
  if (kind != "zonal" && kind != "blocks" && kind != "indirect" && kind != "wavelets" && kind != rows.words && !arrives)
    words.push_back(kind);
  if (kind == "diffuse" || (kind != "factors" && outgoing_of(field))) words.push_back(rows.words);
  words.push_back(store.words);
  words.push_back(some(receivers_of(field.store), row_word(field.where)));
  const std::string precision = store.members.value("precision", std::string());
  return fmt::format("{}, {}{}{}{}", fmt::join(words, ", "), human_bytes(double(bytes_of(field.store))),
                     precision.empty() ? "" : " (" + precision + ")", where.more, store.more);
}

}  // namespace lambent
