#include <lambent/baked/baked_file.h>
#include <lambent/baked/extension.h>
#include <lambent/baked/viewer_look.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/scene/gltf.h>

#include <algorithm>
#include <functional>

namespace lambent {
namespace {

using nlohmann::json;

template <class T>
std::span<const uint8_t> bytes_of(std::span<const T> values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size_bytes()};
}

void write_light(json& object, const LightBasis& light) {
  object["basis"] = "sh";
  object["order"] = light.order;
  if (!light.lobes.empty()) {
    json lobes = json::array();
    for (const Lobe& l : light.lobes) lobes.push_back({l.axis.x, l.axis.y, l.axis.z, l.sharpness});
    object["lobeKind"] = std::find_if(lobe_names.begin(), lobe_names.end(), [&](const auto& k) {
                           return k.first == light.lobe_kind;
                         })->second;
    object["lobes"] = std::move(lobes);
  }
  if (!light.groups.empty()) object["groups"] = light.groups;
}

// The last reflection as bulk data: view maps as halves [map][y][x][row][a.r, a.g, a.b, b]; by receiver, the map and a
// frame's tangent and normal.
struct OutgoingBlobs {
  std::vector<uint16_t> maps, map_of;
  std::vector<Vec3> frames;
};

OutgoingBlobs outgoing_blobs(const Outgoing& o) {
  OutgoingBlobs b;
  for (const ViewMap& map : o.maps)
    for (const ViewWeights& w : map.values)
      for (int c = 0; c < 4; ++c) b.maps.push_back(float_to_half(w[c]));
  b.map_of = o.map_of;
  for (const Mat3& f : o.frames) b.frames.push_back(f[0]), b.frames.push_back(f[2]);
  return b;
}

// The bytes of one side of every part; none where the whole side has no receivers.
std::vector<std::vector<uint8_t>> side_bytes(const Scene& scene, const Receivers& receivers, bool back) {
  std::vector<std::vector<uint8_t>> out;
  auto copy = [&](auto values) {
    const auto bytes = bytes_of(values);
    out.emplace_back(bytes.begin(), bytes.end());
  };
  if (const auto* texels = std::get_if<TexelReceivers>(&receivers.basis)) {
    const auto& side = back ? texels->back : texels->front;
    if (side.empty()) return out;
    std::vector<Vec2> at(scene.positions.size(), Vec2(0));
    for (size_t i = 0; i < side.size(); ++i)
      if (side[i].part != none)
        for (size_t k = 0; k < 3; ++k) at[scene.triangles[i].v[k]] = side[i].at[k];
    for (const Part& part : scene.parts) copy(std::span<const Vec2>(at).subspan(part.first_vertex, part.vertex_count));
  } else if (const auto* patches = std::get_if<PatchReceivers>(&receivers.basis)) {
    const auto& side = back ? patches->back : patches->front;
    if (side.empty()) return out;
    std::vector<uint32_t> map(side.size());
    for (size_t i = 0; i < side.size(); ++i) map[i] = side[i].receiver;
    for (const Part& part : scene.parts)
      copy(std::span<const uint32_t>(map).subspan(part.first_triangle, part.triangle_count));
  } else {
    const auto& map = back ? receivers.back : receivers.front;
    if (map.empty()) return out;
    for (const Part& part : scene.parts)
      copy(std::span<const uint32_t>(map).subspan(part.first_vertex, part.vertex_count));
  }
  return out;
}

// What all kinds share: bulk data first, then the maps of receivers, then `more`. `describe` makes the kind's header,
// the extension's "transfer", and what else the extension has; it is given the first of `more`'s views.
Result<void> save(const std::string& path, const Scene& scene, const Receivers& receivers,
                  std::span<const uint8_t> data, const std::vector<GltfBlob>& more, const ViewerLook* look,
                  const std::string& provenance, const std::function<void(json& extension, int first_more)>& describe) {
  const auto front = side_bytes(scene, receivers, false), back = side_bytes(scene, receivers, true);
  const auto* texels = std::get_if<TexelReceivers>(&receivers.basis);
  std::vector<GltfBlob> blobs{{data, 64}};
  for (const auto* side : {&front, &back})
    for (const auto& bytes : *side) blobs.push_back({bytes, 4});
  const size_t texels_blob = blobs.size();
  if (texels) blobs.push_back({bytes_of(std::span<const uint32_t>(texels->texels)), 4});
  const int more_view = int(blobs.size());
  blobs.insert(blobs.end(), more.begin(), more.end());
  LookWriter look_writer(scene, receivers, look);
  look_writer.add_blobs(blobs);
  return save_glb(path, scene, blobs, [&](json& document, const GltfPlaces& places) {
    json extension;
    extension["version"] = baked_file_version;
    describe(extension, places.first_view + more_view);
    extension["transfer"]["bufferView"] = places.first_view;
    json parts = json::array();
    for (size_t i = 0; i < front.size(); ++i) {
      json part{{"node", places.part_nodes[i]},
                {"primitive", places.part_primitives[i]},
                {"front", places.first_view + 1 + int(i)}};
      if (!back.empty()) part["back"] = places.first_view + 1 + int(front.size() + i);
      parts.push_back(std::move(part));
    }
    extension["parts"] = std::move(parts);
    if (texels) {
      extension["surface"] = {{"kind", "texels"},
                              {"width", texels->width},
                              {"height", texels->height},
                              {"texels", places.first_view + int(texels_blob)}};
    } else if (std::holds_alternative<PatchReceivers>(receivers.basis)) {
      extension["surface"] = {{"kind", "patches"}};
    }
    look_writer.write(document, places);
    extension["provenance"] = json::parse(provenance, nullptr, false);
    LAMBENT_CHECK(!extension["provenance"].is_discarded());
    document["extensions"][extension_name] = std::move(extension);
    json& used = document["extensionsUsed"];
    if (!used.is_array()) used = json::array();
    if (std::find(used.begin(), used.end(), extension_name) == used.end()) used.push_back(extension_name);
  });
}

json header(const char* kind, int channels, Precision precision, size_t receivers) {
  return {{"kind", kind},
          {"channels", channels},
          {"precision", precision == Precision::half ? "half" : "single"},
          {"receivers", receivers}};
}

// What the extras hold, as bulk data, and where it is told of in the extension.
class ExtrasWriter {
 public:
  explicit ExtrasWriter(const BakedExtras& extras) : extras_(extras) {
    if (const Outgoing* o = extras.outgoing) {
      last_ = outgoing_blobs(*o);
      blobs.push_back({bytes_of(std::span<const Vec3>(last_.frames)), 4});
      if (!last_.maps.empty())
        blobs.push_back({bytes_of(std::span<const uint16_t>(last_.maps)), 4}),
            blobs.push_back({bytes_of(std::span<const uint16_t>(last_.map_of)), 4});
    }
    lattice_at_ = int(blobs.size());
    if (extras.lattice)
      blobs.push_back({extras.lattice->transfer.data, 64}), blobs.push_back({extras.lattice->valid, 4});
    view_at_ = int(blobs.size());
    if (extras.view) blobs.push_back({bytes_of(std::span<const float>(extras.view->coverage)), 4});
  }
  const char* kind() const { return extras_.factors ? "factors" : extras_.outgoing ? "matrix" : "diffuse"; }

  // `first`: the buffer view of the first of `blobs`.
  void write(json& extension, int rows, int first) const {
    json& t = extension["transfer"];
    if (extras_.directional != DirectionalKind::none) t["directional"] = directional_name(extras_.directional);
    if (const Outgoing* outgoing = extras_.outgoing) {
      if (!extras_.factors) t["rows"] = rows;
      json& o = t["outgoing"];
      o = {{"kind", outgoing_names[int(outgoing->kind)]}, {"order", outgoing->order}, {"frames", first}};
      if (outgoing->maps.empty()) {
        o["hasB"] = outgoing->has_b;
      } else {
        o["grid"] = outgoing->maps[0].grid, o["mapCount"] = outgoing->maps.size(), o["maps"] = first + 1,
        o["mapOf"] = first + 2;
      }
    }
    if (const LatticeTransfer* lattice = extras_.lattice) {
      const Lattice& l = lattice->lattice;
      extension["lattice"] = {{"min", {l.min.x, l.min.y, l.min.z}},
                              {"max", {l.max.x, l.max.y, l.max.z}},
                              {"points", {l.nx, l.ny, l.nz}},
                              {"order", lattice->order},
                              {"channels", lattice->transfer.channels},
                              {"precision", lattice->transfer.precision == Precision::half ? "half" : "single"},
                              {"bufferView", first + lattice_at_},
                              {"valid", first + lattice_at_ + 1}};
    }
    if (const FixedView* v = extras_.view) {
      const Vec3 e = v->camera.eye, at = v->camera.target;
      extension["view"] = {{"width", v->width},      {"height", v->height},
                           {"eye", {e.x, e.y, e.z}}, {"target", {at.x, at.y, at.z}},
                           {"fov", v->camera.fov},   {"coverage", first + view_at_}};
    }
  }

  std::vector<GltfBlob> blobs;

 private:
  const BakedExtras& extras_;
  OutgoingBlobs last_;
  int lattice_at_ = 0, view_at_ = 0;
};

void check_extras(const BakedExtras& extras, const LightBasis& light, int rows) {
  const LatticeTransfer* lattice = extras.lattice;
  LAMBENT_CHECK(!lattice ||
                (lattice->transfer.columns() == light.count() && lattice->valid.size() == lattice->lattice.count()));
  LAMBENT_CHECK(!extras.factors || (rows == 1 && extras.outgoing && extras.outgoing->kind == OutgoingKind::map &&
                                    light.order >= extras.outgoing->order));
  LAMBENT_CHECK(rows ==
                (extras.outgoing && !extras.factors ? extras.outgoing->rows() : directional_rows(extras.directional)));
}

}  // namespace

Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const Transfer& transfer, const std::string& provenance, const BakedExtras& extras) {
  check_extras(extras, transfer.light, transfer.rows);
  LAMBENT_CHECK(!extras.view || (extras.view->coverage.size() == transfer.receivers && !extras.outgoing));
  const ExtrasWriter more(extras);
  return save(path, scene, receivers, transfer.data, more.blobs, extras.look, provenance,
              [&](json& extension, int first) {
                extension["transfer"] = header(more.kind(), transfer.channels, transfer.precision, transfer.receivers);
                write_light(extension["transfer"], transfer.light);
                more.write(extension, transfer.rows, first);
              });
}

Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const CpcaTransfer& transfer, const std::string& provenance, const BakedExtras& extras) {
  check_extras(extras, transfer.light, transfer.rows);
  LAMBENT_CHECK(!extras.view);
  const ExtrasWriter more(extras);
  std::vector<GltfBlob> blobs = more.blobs;
  blobs.push_back({bytes_of(std::span<const uint16_t>(transfer.cluster_of)), 4});
  blobs.push_back({bytes_of(std::span<const uint16_t>(transfer.weights)), 4});
  const int at = int(more.blobs.size());
  return save(path, scene, receivers, bytes_of(std::span<const float>(transfer.vectors)), blobs, extras.look,
              provenance, [&](json& extension, int first) {
                json& t = extension["transfer"] =
                    header(more.kind(), transfer.channels, Precision::half, transfer.receivers);
                write_light(t, transfer.light);
                more.write(extension, transfer.rows, first);
                t["cpca"] = {{"clusters", transfer.clusters},
                             {"rank", transfer.rank},
                             {"clusterOf", first + at},
                             {"weights", first + at + 1}};
              });
}

Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const ZonalTransfer& transfer, const std::string& provenance, const BakedExtras& extras) {
  check_extras(extras, {.order = transfer.order}, transfer.rows);
  LAMBENT_CHECK(!extras.view && !extras.lattice && !extras.factors && extras.directional == DirectionalKind::none);
  LAMBENT_CHECK(extras.fit_errors.empty() || extras.fit_errors.size() == transfer.receivers);
  const ExtrasWriter more(extras);
  std::vector<GltfBlob> blobs = more.blobs;
  if (!extras.fit_errors.empty()) blobs.push_back({bytes_of(extras.fit_errors), 4});
  const int errors_at = int(more.blobs.size());
  return save(path, scene, receivers, transfer.data, blobs, nullptr, provenance, [&](json& extension, int first) {
    json& t = extension["transfer"] = header("zonal", transfer.channels, transfer.precision, transfer.receivers);
    write_light(t, {.order = transfer.order});
    more.write(extension, transfer.rows, first);
    t["lobeCount"] = transfer.lobes;
    if (!extras.fit_errors.empty()) t["fitErrors"] = first + errors_at;
  });
}

Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers,
                        const Visibility& visibility, const std::string& provenance) {
  LAMBENT_CHECK(visibility.receivers == receivers.count());
  std::vector<uint8_t> lengths;
  for (size_t r = 0; r < visibility.receivers; ++r)
    append_varint(lengths, visibility.begin[r + 1] - visibility.begin[r]);
  return save(path, scene, receivers, visibility.data, {{lengths, 4}}, nullptr, provenance,
              [&](json& extension, int first) {
                extension["transfer"] = {{"kind", "blocks"},
                                         {"cube", visibility.size},
                                         {"bits", visibility.bits},
                                         {"receivers", visibility.receivers},
                                         {"lengths", first}};
              });
}

}  // namespace lambent
