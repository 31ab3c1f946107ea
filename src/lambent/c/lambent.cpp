// lambent.h over read_fields(), project_light() and Relighter.
#include <lambent/baked/extension.h>
#include <lambent/c/handles.h>
#include <lambent/basis/sh_convert.h>
#include <lambent/core/overloaded.h>
#include <lambent/core/parallel.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/sky.h>
#include <lambent/relight/light.h>

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <new>

using namespace lambent;

namespace {

thread_local char last_error[1024] = "";

}  // namespace

lambent_code lambent::c::fail(lambent_code code, std::string_view text) noexcept {
  std::snprintf(last_error, sizeof last_error, "%.*s", int(std::min(text.size(), sizeof last_error)), text.data());
  return code;
}

using namespace lambent::c;

namespace {

std::string name_of_rows(const Rows& rows) {
  return std::visit(Overloaded{[](const DirectionalRows& r) { return directional_name(r.kind); },
                               [](const Outgoing& o) { return std::string(outgoing_names[int(o.kind)]); },
                               [](const auto&) { return std::string(); }},
                    rows);
}

// A newer version is told from a broken file before anything else of it is read.
lambent_code open_bytes(const MappedFile& bytes, const std::string& path, const std::string& folder,
                        lambent_file** out) {
  auto buffers = GltfBuffers::open(bytes, path, folder);
  if (!buffers) return fail(LAMBENT_BROKEN, buffers.error().text());
  auto fields = read_fields(*buffers, path);
  if (!fields) {
    bool newer = false;
    if (has_extension(buffers->json())) {
      const auto& extension = buffers->json()["extensions"][extension_name];
      const auto version = read_count(extension, "version", 0x7fffffff, path);
      newer = version && *version > size_t(baked_file_version);
    }
    return fail(newer ? LAMBENT_NEWER : LAMBENT_BROKEN, fields.error().text());
  }
  auto open = std::make_shared<OpenFile>(OpenFile{std::move(*fields), {}, {}});
  open->light = light_of(open->fields.surface.store);
  for (size_t i = 0; i < open->count(); ++i) open->rows_are.push_back(name_of_rows(open->field(i).rows));
  *out = new lambent_file{std::move(open)};
  return LAMBENT_OK;
}

size_t values_of(const Store& store) {
  return std::visit(
      Overloaded{[](const FactoredTransfer& t) { return t.visibility.receiver_values(); },
                 [](const Visibility&) { return size_t(0); }, [](const IndirectTransfer&) { return size_t(0); },
                 [](const auto& t) { return t.receiver_values(); }},
      store);
}

void describe_placement(const Placement& where, lambent_info& info) {
  std::visit(
      Overloaded{
          [&](const VertexPlacement&) { info.placement = "vertices"; },
          [&](const TexelPlacement& p) { info.placement = "texels", info.width = p.width, info.height = p.height; },
          [&](const PatchPlacement&) { info.placement = "patches"; },
          [&](const LatticePlacement& p) {
            info.placement = "lattice";
            for (size_t k = 0; k < 3; ++k) {
              info.box_min[k] = p.lattice.min[k], info.box_max[k] = p.lattice.max[k];
            }
            info.points[0] = p.lattice.nx, info.points[1] = p.lattice.ny, info.points[2] = p.lattice.nz;
          },
          [&](const FixedView& p) { info.placement = "pixels", info.width = p.width, info.height = p.height; },
          [&](const ShellPlacement& p) {
            info.placement = "shells";
            for (size_t k = 0; k < 3; ++k) {
              info.box_min[k] = p.shells.center[k] - p.shells.radius;
              info.box_max[k] = p.shells.center[k] + p.shells.radius;
            }
            info.points[0] = info.points[1] = p.shells.side, info.points[2] = int(p.shells.radii.size());
          }},
      where);
}

const char* meaning_of(const Rows& rows) {
  return std::visit(
      Overloaded{[](const DiffuseRows&) { return "diffuse"; }, [](const DirectionalRows&) { return "directional"; },
                 [](const Outgoing&) { return "outgoing"; }, [](const IncidentRows&) { return "incident"; },
                 [](const PixelRows&) { return "pixels"; }, [](const SightRows&) { return "sight"; },
                 [](const HiddenRows&) { return "hidden"; }},
      rows);
}

// The two sides of a run of a placement.
template <class T>
void take_sides(const std::vector<T>& front, const std::vector<T>& back, size_t first, const T*& front_out,
                const T*& back_out) {
  front_out = front.empty() ? nullptr : front.data() + first;
  back_out = back.empty() ? nullptr : back.data() + first;
}

// Distant light onto the columns for it; the lamps keep theirs.
lambent_code set_distant(lambent_relighter& r, const Environment& env, const float* rotation) {
  if (rotation && !is_rotation(matrix_at(rotation))) return wrong("the matrix is no rotation");
  if (const int size = r.cube()) {
    const CubeLight cube = cube_light(env, size, rotation ? matrix_at(rotation) : Mat3(1.0f));
    if (auto ok = r.relighter.set_light(cube); !ok) return fail(LAMBENT_INTERNAL, ok.error().text());
    r.lit = true;
    return LAMBENT_OK;
  }
  if (r.distant() == 0) return fail(LAMBENT_UNSUPPORTED, "the file has no columns for distant light");
  const LightProjection p = project_light(env, r.basis, rotation ? matrix_at(rotation) : Mat3(1.0f));
  std::copy_n(p.light.begin(), r.distant(), r.columns.begin());
  r.lit = r.changed = true;
  return LAMBENT_OK;
}

std::mutex limit_mutex;
std::unique_ptr<ThreadLimit> limit;

}  // namespace

extern "C" {

const char* lambent_version(void) { return LAMBENT_VERSION; }
const char* lambent_error(void) { return last_error; }

lambent_code lambent_set_threads(int threads) {
  return guarded([&] {
    if (threads < 0) return wrong("the number of threads is negative");
    std::lock_guard lock(limit_mutex);
    limit.reset();
    if (threads > 0) limit = std::make_unique<ThreadLimit>(threads);
    return LAMBENT_OK;
  });
}
int lambent_threads(void) { return thread_count(); }

lambent_code lambent_open(const char* path, lambent_file** file) {
  return guarded_with(
      [&] {
        *file = nullptr;
        auto mapped = MappedFile::open(path);
        if (!mapped) return fail(LAMBENT_UNREADABLE, mapped.error().text());
        return open_bytes(*mapped, path, folder_of(path), file);
      },
      path, file);
}

lambent_code lambent_open_memory(const void* bytes, size_t size, lambent_file** file) {
  return guarded_with(
      [&] {
        *file = nullptr;
        return open_bytes(MappedFile::copy_of({static_cast<const uint8_t*>(bytes), size}), "memory", "", file);
      },
      bytes, file);
}

void lambent_close(lambent_file* file) { delete file; }

lambent_code lambent_fields(const lambent_file* file, size_t* count) {
  return guarded_with([&] { return *count = file->open->count(), LAMBENT_OK; }, file, count);
}

lambent_code lambent_describe(const lambent_file* file, size_t index, lambent_info* info) {
  return guarded_with(
      [&] {
        if (index >= file->open->count()) return wrong("field " + std::to_string(index) + " is not there");
        if (info->size < sizeof(size_t)) return wrong("the size of the description is not set");
        const Field& field = file->open->field(index);
        const LightBasis light = light_of(field.store);
        lambent_info all = {};
        all.size = info->size, all.store = name_of(field.store), all.meaning = meaning_of(field.rows);
        all.rows_are = file->open->rows_are[index].c_str();
        describe_placement(field.where, all);
        all.receivers = receivers_of(field.store), all.rows = size_t(rows_relit(field.store)),
        all.columns = light.count();
        all.values = values_of(field.store), all.parts = index == 0 ? file->open->fields.parts.size() : 0;
        all.channels = channels_of(field.store), all.sh_order = light.order;
        all.lobes = int(light.lobes.size()), all.groups = int(light.groups.size());
        std::memcpy(static_cast<void*>(info), &all, std::min(all.size, sizeof all));
        return LAMBENT_OK;
      },
      file, info);
}

lambent_code lambent_get_part(const lambent_file* file, size_t index, lambent_part* part) {
  return guarded_with(
      [&] {
        const BakedFields& fields = file->open->fields;
        if (index >= fields.parts.size()) return wrong("part " + std::to_string(index) + " is not there");
        if (part->size < sizeof(size_t)) return wrong("the size of the part is not set");
        const BakedPart& p = fields.parts[index];
        lambent_part all = {};
        all.size = part->size, all.node = p.node, all.primitive = p.primitive, all.count = p.count;
        auto receivers = [&](const auto& sides) { take_sides(sides.front, sides.back, p.first, all.front, all.back); };
        std::visit(
            Overloaded{[&](const VertexPlacement& v) { receivers(v); }, [&](const PatchPlacement& v) { receivers(v); },
                       [&](const TexelPlacement& t) {
                         const Vec2 *front = nullptr, *back = nullptr;
                         take_sides(t.front, t.back, p.first, front, back);
                         if (front) all.front_uv = &front->x;
                         if (back) all.back_uv = &back->x;
                       },
                       [](const auto&) {}},
            fields.surface.where);
        std::memcpy(static_cast<void*>(part), &all, std::min(all.size, sizeof all));
        return LAMBENT_OK;
      },
      file, part);
}

lambent_code lambent_get_texels(const lambent_file* file, const uint32_t** receivers) {
  return guarded_with(
      [&] {
        const auto* texels = std::get_if<TexelPlacement>(&file->open->fields.surface.where);
        if (!texels) return fail(LAMBENT_UNSUPPORTED, "the receivers are not texels");
        return *receivers = texels->texels.data(), LAMBENT_OK;
      },
      file, receivers);
}

lambent_code lambent_get_group(const lambent_file* file, size_t index, const char** name) {
  return guarded_with(
      [&] {
        const std::vector<std::string>& groups = file->open->light.groups;
        if (index >= groups.size()) return wrong("group " + std::to_string(index) + " is not there");
        return *name = groups[index].c_str(), LAMBENT_OK;
      },
      file, name);
}

lambent_code lambent_read(const lambent_file* file, size_t index, size_t receiver, float* values, size_t count) {
  return guarded_with(
      [&] {
        if (index >= file->open->count()) return wrong("field " + std::to_string(index) + " is not there");
        const Store& store = file->open->field(index).store;
        if (receiver >= receivers_of(store)) return wrong("receiver " + std::to_string(receiver) + " is not there");
        if (std::holds_alternative<Visibility>(store))
          return fail(LAMBENT_UNSUPPORTED, "visibility in blocks is no list of numbers");
        if (std::holds_alternative<IndirectTransfer>(store))
          return fail(LAMBENT_UNSUPPORTED, "direct-to-indirect transport is no list of numbers a receiver");
        if (count != values_of(store))
          return wrong("a receiver has " + std::to_string(values_of(store)) + " values, not " + std::to_string(count));
        const std::vector<float> all =
            std::visit(Overloaded{[](const Visibility&) { return std::vector<float>(); },
                                  [](const IndirectTransfer&) { return std::vector<float>(); },
                                  [&](const FactoredTransfer& t) { return load_receiver(t.visibility, receiver); },
                                  [&](const auto& t) { return load_receiver(t, receiver); }},
                       store);
        std::copy(all.begin(), all.end(), values);
        return LAMBENT_OK;
      },
      file, values);
}

lambent_code lambent_relighter_new(const lambent_file* file, size_t index, lambent_relighter** relighter) {
  return guarded_with(
      [&] {
        *relighter = nullptr;
        if (index >= file->open->count()) return wrong("field " + std::to_string(index) + " is not there");
        const Field& field = file->open->field(index);
        if (std::holds_alternative<Visibility>(field.store))
          return fail(LAMBENT_UNSUPPORTED, "visibility in blocks wants materials: lambent_relighter_new_blocks()");
        if (std::holds_alternative<IndirectTransfer>(field.store))
          return fail(LAMBENT_UNSUPPORTED,
                      "direct-to-indirect transport wants direct light at its surfels: relight it from C++");
        return new_relighter(*file, field, {}, relighter);
      },
      file, relighter);
}

void lambent_relighter_free(lambent_relighter* relighter) { delete relighter; }

lambent_code lambent_set_columns(lambent_relighter* relighter, const float* rgb, size_t count) {
  return guarded_with(
      [&] {
        const size_t columns = relighter->basis.count();
        if (columns == 0) return fail(LAMBENT_UNSUPPORTED, "the transfer has no columns");
        if (count != columns)
          return wrong("the transfer has " + std::to_string(columns) + " columns, not " + std::to_string(count));
        if (!finite(rgb, 3 * count)) return wrong("a coefficient is not finite");
        for (size_t k = 0; k < count; ++k) relighter->columns[k] = color_at(rgb, k);
        relighter->lit = relighter->changed = true;
        return LAMBENT_OK;
      },
      relighter, rgb);
}

lambent_code lambent_set_sh(lambent_relighter* relighter, const float* rgb, int order, int convention) {
  return guarded_with(
      [&] {
        const bool three_bands = convention == LAMBENT_SH_UNITY || convention == LAMBENT_SH_GLTF;
        if (convention < LAMBENT_SH_LAMBENT || convention > LAMBENT_SH_GLTF) return wrong("the convention is unknown");
        if (order < 1 || order > (three_bands ? 3 : max_sh_order)) return wrong("the order is out of range");
        if (relighter->basis.order == 0) return fail(LAMBENT_UNSUPPORTED, "the file has no harmonics");
        const size_t given = size_t(sh_count(order));
        if (!finite(rgb, 3 * given)) return wrong("a coefficient is not finite");
        // Conversion scales each coefficient: what it makes of ones is what to divide by.
        static constexpr ShConvention conventions[] = {ShConvention::lambent, ShConvention::three, ShConvention::unity,
                                                       ShConvention::godot, ShConvention::gltf_ibl};
        const std::vector<Vec3> scale = convert_sh(std::vector<Vec3>(given, Vec3(1)), conventions[convention]);
        std::fill_n(relighter->columns.begin(), relighter->distant(), Vec3(0));
        for (size_t k = 0; k < std::min(given, size_t(sh_count(relighter->basis.order))); ++k)
          relighter->columns[k] = color_at(rgb, k) / scale[k];
        relighter->lit = relighter->changed = true;
        return LAMBENT_OK;
      },
      relighter, rgb);
}

lambent_code lambent_set_environment(lambent_relighter* relighter, const float* rgb, int width, int height,
                                     const float* rotation) {
  return guarded_with(
      [&] {
        if (width < 1 || height < 1 || uint64_t(width) * uint64_t(height) > max_image_pixels)
          return wrong("the size of the picture is out of range");
        Image image(width, height);
        for (size_t i = 0; i < image.rgb.size(); ++i) {
          image.rgb[i] = color_at(rgb, i);
          if (!is_finite(image.rgb[i]) || !all_at_most(Vec3(0), image.rgb[i]))
            return wrong("pixel " + std::to_string(i) + " is negative or not finite");
        }
        auto env = environment_from_image("picture", std::move(image));
        if (!env) return wrong(env.error().message);
        return set_distant(*relighter, *env, rotation);
      },
      relighter, rgb);
}

lambent_code lambent_set_sky(lambent_relighter* relighter, float elevation, float azimuth, float turbidity,
                             float ground, int sun, const float* rotation) {
  return guarded_with(
      [&] {
        auto sky = make_sky({elevation, azimuth, turbidity, Vec3(ground), sun != 0});
        if (!sky) return wrong(sky.error().text());
        return set_distant(*relighter, *sky, rotation);
      },
      relighter);
}

lambent_code lambent_set_lamp(lambent_relighter* relighter, const char* group, const float* rgb) {
  return guarded_with(
      [&] {
        const std::vector<std::string>& groups = relighter->basis.groups;
        const auto at = std::find(groups.begin(), groups.end(), group);
        if (at == groups.end()) return wrong("the file has no group \"" + std::string(group) + "\"");
        if (!finite(rgb, 3)) return wrong("the colour is not finite");
        relighter->columns[relighter->distant() + size_t(at - groups.begin())] = color_at(rgb, 0);
        relighter->changed = true;
        return LAMBENT_OK;
      },
      relighter, group, rgb);
}

lambent_code lambent_set_rotations(lambent_relighter* relighter, const float* rotations, size_t receivers) {
  return guarded_with(
      [&] {
        if (!rotations && receivers == 0) return relighter->turned = false, LAMBENT_OK;
        if (!rotations) return fail(LAMBENT_NULL, "the rotations are null");
        if (!std::holds_alternative<ZonalTransfer>(relighter->relighter.field().store))
          return fail(LAMBENT_UNSUPPORTED, "this transfer cannot turn with the surface; that of lobes can");
        if (receivers != relighter->relighter.receivers())
          return wrong("there are " + std::to_string(relighter->relighter.receivers()) + " receivers, not " +
                       std::to_string(receivers));
        if (!finite(rotations, 9 * receivers)) return wrong("a rotation is not finite");
        static_assert(sizeof(Mat3) == 9 * sizeof(float));
        set_receiver_frames(relighter->frames, {reinterpret_cast<const Mat3*>(rotations), receivers});
        return relighter->turned = true, LAMBENT_OK;
      },
      relighter);
}

lambent_code lambent_relight(lambent_relighter* relighter, float* rgb, size_t floats, size_t stride) {
  return guarded_with(
      [&] {
        if (!relighter->lit) return fail(LAMBENT_NO_LIGHT, "no light was set");
        if (relighter->changed && relighter->cube() == 0)
          if (auto ok = relighter->relighter.set_light(relighter->columns); !ok)
            return fail(LAMBENT_INTERNAL, ok.error().text());
        relighter->changed = false;
        const RelightFrame frame{.frames = relighter->turned ? &relighter->frames : nullptr, .eye = relighter->eye};
        if (auto ok = relighter->relighter.relight(frame, {rgb, floats}, stride); !ok) return wrong(ok.error().message);
        return LAMBENT_OK;
      },
      relighter, rgb);
}

}  // extern "C"
