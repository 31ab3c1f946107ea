// Visibility in blocks through lambent.h.
#include <lambent/c/handles.h>
#include <lambent/transfer/directional.h>

using namespace lambent;
using namespace lambent::c;

namespace {

bool is_share(float v) { return v >= 0 && v <= 1; }

Result<Brdf> brdf_of(const lambent_material& m, size_t index) {
  const Error no{"", "material " + std::to_string(index) + " is of no model, or out of range"};
  const Vec3 color = color_at(m.base_color, 0);
  if (!is_share(color.x) || !is_share(color.y) || !is_share(color.z)) return no;
  if (m.model == LAMBENT_LAMBERT) return Brdf(Lambert{color});
  if (m.model != LAMBENT_METALLIC_ROUGHNESS || !is_share(m.metallic) || !is_share(m.roughness)) return no;
  return Brdf(MetallicRoughness{.base_color = color, .metallic = m.metallic, .roughness = m.roughness});
}

}  // namespace

extern "C" {

lambent_code lambent_relighter_new_blocks(const lambent_file* file, size_t index, const float* positions,
                                          const float* normals, size_t receivers, const lambent_material* materials,
                                          size_t material_count, const uint32_t* material_of,
                                          lambent_relighter** relighter) {
  return guarded_with(
      [&] {
        *relighter = nullptr;
        if (index >= file->open->count()) return wrong("field " + std::to_string(index) + " is not there");
        const Field& field = file->open->field(index);
        const auto* visibility = std::get_if<Visibility>(&field.store);
        if (!visibility) return fail(LAMBENT_UNSUPPORTED, "this transfer needs no materials: lambent_relighter_new()");
        if (receivers != visibility->receivers)
          return wrong("there are " + std::to_string(visibility->receivers) + " receivers, not " +
                       std::to_string(receivers));
        if (!finite(positions, 3 * receivers)) return wrong("a position is not finite");
        RelighterOptions options;
        const Cube cube = make_cube(visibility->size);
        for (size_t m = 0; m < material_count; ++m) {
          auto brdf = brdf_of(materials[m], m);
          if (!brdf) return wrong(brdf.error().message);
          options.receivers.materials.push_back(make_product_material(*brdf, cube, {}));
        }
        for (size_t r = 0; r < receivers; ++r) {
          const Vec3 normal = color_at(normals, r);
          if (!(std::abs(length(normal) - 1) < 1e-3f)) return wrong("normal " + std::to_string(r) + " is not unit");
          const uint32_t material = material_of ? material_of[r] : 0;
          if (material >= material_count) return wrong("material " + std::to_string(material) + " is not there");
          options.receivers.positions.push_back(color_at(positions, r));
          options.receivers.frames.push_back(receiver_frame(normal));
          options.receivers.material_of.push_back(material);
        }
        return new_relighter(*file, field, std::move(options), relighter);
      },
      file, positions, normals, materials, relighter);
}

lambent_code lambent_set_eye(lambent_relighter* relighter, const float* eye) {
  return guarded_with(
      [&] {
        if (!relighter->blocks()) return fail(LAMBENT_UNSUPPORTED, "this transfer is the same for every eye");
        if (!finite(eye, 3)) return wrong("the eye is not finite");
        return relighter->eye = color_at(eye, 0), LAMBENT_OK;
      },
      relighter, eye);
}

}  // extern "C"
