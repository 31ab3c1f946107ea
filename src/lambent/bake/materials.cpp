#include <lambent/bake/materials.h>
#include <lambent/core/check.h>

#include <array>
#include <map>
#include <tuple>

namespace lambent {

ReceiverMaterials make_receiver_materials(const Scene& scene, const Receivers& receivers,
                                          const Reflection& reflection) {
  constexpr float roughness_steps = 32, metallic_steps = 8;
  ReceiverMaterials out;
  out.of_receiver.assign(receivers.count(), 0);
  out.frames.resize(receivers.count());
  out.reflection = reflection;
  std::vector<uint8_t> done(receivers.count(), 0);
  std::map<std::tuple<int, int, std::array<float, 4>>, uint16_t> palette;
  if (reflection.everywhere) out.materials.push_back({*reflection.everywhere, *reflection.everywhere});
  else if (reflection.model == Reflection::Model::diffuse)
    out.materials.push_back({Lambert{Vec3(0)}, Lambert{Vec3(1)}});
  const bool one = !out.materials.empty();
  for (const Triangle& t : scene.triangles)
    for (int k = 0; k < 3; ++k)
      for (const auto* side : {&receivers.front, &receivers.back}) {
        if (side->empty()) continue;
        const uint32_t r = (*side)[t.v[k]];
        if (r == none || done[r]) continue;
        done[r] = 1;
        out.frames[r] = shading_frame(scene, t, receivers.normals[r]);
        if (one) continue;
        const Vec2 m = metallic_roughness(scene, t, k == 1, k == 2);
        const Material& material = scene.materials[scene.parts[t.part].material];
        const Vec3 f0 = material.dielectric_f0;
        const std::tuple key(int(m.x * metallic_steps + 0.5f), int(m.y * roughness_steps + 0.5f),
                             std::array{f0.x, f0.y, f0.z, material.dielectric_f90});
        const auto [place, added] = palette.try_emplace(key, uint16_t(out.materials.size()));
        if (added) {
          MetallicRoughness black{Vec3(0), float(std::get<0>(key)) / metallic_steps,
                                  float(std::get<1>(key)) / roughness_steps, f0, material.dielectric_f90},
              white = black;
          white.base_color = Vec3(1);
          out.materials.push_back({black, white});
        }
        out.of_receiver[r] = place->second;
      }
  for (size_t r = 0; r < receivers.count(); ++r)  // receivers of no triangle at all
    if (!done[r]) out.frames[r] = frame_about(receivers.normals[r]);
  if (out.materials.empty()) out.materials.push_back({Lambert{Vec3(0)}, Lambert{Vec3(1)}});
  return out;
}

Outgoing make_map_outgoing(const ReceiverMaterials& materials, int incident_order, const MatrixOptions& options,
                           Progress* progress) {
  Outgoing o;
  o.kind = OutgoingKind::map, o.order = incident_order, o.map_of = materials.of_receiver, o.frames = materials.frames;
  auto maps = make_responses(materials.materials, make_cosine_basis(incident_order), options.grid,
                             options.response_samples, progress);
  if (maps) o.maps = std::move(*maps);
  return o;
}

}  // namespace lambent
