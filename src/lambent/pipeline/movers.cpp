#include <lambent/pipeline/movers.h>

#include <lambent/basis/sh.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/scene/append.h>

#include <algorithm>

namespace lambent {
namespace {

// Points of a lamp, and of what reflects, towards which a receiver looks past the scene.
constexpr int lamp_sight_points = 32, reflection_sight_points = 8;

Result<std::unique_ptr<MoverModel>> load_model(const std::string& path) {
  auto object = load_baked(path);
  if (!object) return object.error();
  const Field* hidden = hiding_of(*object);
  if (!hidden) return Error{path, "does not say what it hides around it: `lambent field` makes files that do"};
  if (auto ok = check_mover(*object, path); !ok) return ok.error();
  HiddenLight light = hidden_light(*hidden, max_sh_order);
  auto model =
      std::make_unique<MoverModel>(MoverModel{std::move(*object), std::move(light), {}, {}, {}, {}, {}, {}, {}});
  if (const Field* shining = shining_of(model->baked)) {
    model->shining = shining_light(*shining, max_sh_order);
    model->shining_points = shining_points(model->baked.scene, lamp_sight_points);
    if (model->shining_points.empty()) return Error{path, "shines, and has no material that does"};
  }
  if (const Field* reflecting = reflecting_of(model->baked)) {
    model->reflecting = reflecting_light(*reflecting);
    model->reflecting_points = surface_points(model->baked.scene, reflection_sight_points);
  }
  const auto& where = std::get<VertexPlacement>(model->baked.surface.where);
  const size_t count = receivers_of(model->baked.surface.store);
  model->positions = receiver_positions(model->baked.scene.positions, where, count);
  model->normals = receiver_normals(model->baked.scene.normals, where, count);
  if (!std::holds_alternative<Transfer>(model->baked.surface.store) || outgoing_of(model->baked.surface))
    model->no_transfer = make_transfer({.order = 1}, 1, 1, count, Precision::half).transfer;
  return model;
}

}  // namespace

Result<void> check_mover(const Baked& object, const std::string& path) {
  const Field& surface = object.surface;
  const auto* dense = std::get_if<Transfer>(&surface.store);
  const bool lobes = std::holds_alternative<ZonalTransfer>(surface.store);
  const Outgoing* o = outgoing_of(surface);
  const bool by_view = o && (o->kind == OutgoingKind::map || o->kind == OutgoingKind::svd);
  const bool harmonics = dense && dense->columns() == size_t(sh_count(dense->light.order));
  if (vertices_of(object) && (harmonics || lobes) && (by_view || std::holds_alternative<DiffuseRows>(surface.rows)))
    return {};
  return Error{
      path,
      "is no bake at vertices by harmonics alone, diffuse, of lobes, or a matrix with --outgoing map or svd, as "
      "an object that moves is"};
}

std::vector<Vec3> receiver_normals(std::span<const Vec3> of, const VertexPlacement& at, size_t receivers) {
  std::vector<Vec3> normals(receivers, Vec3(0, 1, 0));
  for (size_t v = 0; v < at.back.size(); ++v)
    if (at.back[v] != no_receiver) normals[at.back[v]] = -of[v];
  for (size_t v = 0; v < at.front.size(); ++v)
    if (at.front[v] != no_receiver) normals[at.front[v]] = of[v];
  return normals;
}

Result<std::vector<Mover>> load_movers(const DrawRequest& request, MoverModels& models) {
  auto files = parse_places(request.place, request.move, request.pose);
  if (!files) return files.error();
  std::vector<Mover> movers;
  size_t maps = 0;
  for (PlacedFile& file : *files) {
    auto& model = models[file.path];
    if (!model) {
      auto loaded = load_model(file.path);
      if (!loaded) return loaded.error();
      model = std::move(*loaded);
    }
    std::optional<size_t> animation;
    if (!file.animation.empty()) {
      if (!std::holds_alternative<ZonalTransfer>(model->baked.surface.store))
        return Error{"--pose", file.path + ": only lobes follow a pose (`lambent compress --zonal` makes them)", true};
      auto found = find_animation(model->baked.scene, file.animation);
      if (!found) return Error{file.path, found.error().message};
      animation = *found;
    }
    if (const Outgoing* o = outgoing_of(model->baked.surface)) maps += o->maps.size();
    movers.push_back({std::move(file), model.get(), animation});
  }
  if (maps > 65000) return Error{"--place", "the objects have more materials than can be told apart", true};
  return movers;
}

Result<void> move_to(Mover& m, double time, Vec3d origin) {
  const MoverModel& model = *m.model;
  m.placed = place_object(model.hidden, place_at(m.file, time, origin));
  const auto place = [&](std::span<const Vec3> positions, std::span<const Vec3> normals) {
    m.receivers = moving_receivers(model.transfer(), positions, normals, model.hidden.shells.center, m.placed.place);
  };
  if (m.animation) {
    auto pose = pose_scene(model.baked.scene, *m.animation, time);
    if (!pose) return Error{m.file.path, pose.error().message};
    m.pose = std::move(*pose);
    const auto& at = std::get<VertexPlacement>(model.baked.surface.where);
    const size_t count = receivers_of(model.baked.surface.store);
    place(receiver_positions(m.pose->positions, at, count), receiver_normals(m.pose->normals, at, count));
  } else {
    place(model.positions, model.normals);
  }
  if (model.shining) m.lamp = place_lamp(*model.shining, m.placed.place);
  return {};
}

namespace {

// How each receiver has turned since it was baked.
std::vector<Mat3> rotations_of(const Mover& m) {
  const size_t count = m.receivers.count;
  if (!m.pose) return std::vector<Mat3>(count, m.placed.place.rotation);
  std::vector<Mat3> out = receiver_rotations(*m.pose, m.model->baked.surface.where, count);
  for (Mat3& r : out) r = m.placed.place.rotation * r;
  return out;
}

Relit relight_lobes(const Mover& m, std::span<const Vec3> light) {
  const auto& lobes = std::get<ZonalTransfer>(m.model->baked.surface.store);
  const size_t n = size_t(sh_count(lobes.order)), blocks = (lobes.receivers + transfer_block - 1) / transfer_block;
  LightField field{lobes.receivers, lobes.order, {}};
  field.values.resize(blocks * n * 3 * transfer_block);
  for (size_t r = 0; r < lobes.receivers; ++r)
    for (size_t k = 0; k < n; ++k)
      for (size_t c = 0; c < 3; ++c)
        field.values[((r / transfer_block * n + k) * 3 + c) * transfer_block + r % transfer_block] =
            light[r * n + k][int(c)];
  const ReceiverFrames frames = make_receiver_frames(rotations_of(m));
  Relit out;
  relight_zonal(lobes, &frames, field, out);
  return out;
}

// The reflection of a diffuse surface, in the first of so many rows.
ViewMap lambert_map(int rows) {
  ViewMap map{2, rows, std::vector<ViewWeights>(4 * size_t(rows), ViewWeights(0.0f))};
  for (size_t node = 0; node < 4; ++node) map.values[node * size_t(rows)] = ViewWeights(0, 0, 0, 1);
  return map;
}

ViewMap widened(const ViewMap& map, int rows) {
  if (map.rows == rows) return map;
  ViewMap out{map.grid, rows, std::vector<ViewWeights>(map.values.size() / size_t(map.rows) * size_t(rows))};
  for (size_t node = 0; node < map.values.size() / size_t(map.rows); ++node)
    std::copy_n(map.values.begin() + ptrdiff_t(node * size_t(map.rows)), map.rows,
                out.values.begin() + ptrdiff_t(node * size_t(rows)));
  return out;
}

size_t blocks_of(size_t receivers) { return (receivers + transfer_block - 1) / transfer_block; }

Relit black(size_t receivers, int rows) {
  Relit out;
  out.rows = rows, out.values.assign(blocks_of(receivers) * size_t(rows) * 3 * transfer_block, 0.0f);
  return out;
}

// Makes room for that many rows.
void widen(RelitScene& s, int rows) {
  if (s.outgoing)
    for (ViewMap& map : s.outgoing->maps) map = widened(map, rows);
  for (Relit* relit : {&s.relit, &s.peaks}) {
    if (relit->values.empty() || relit->rows == rows) continue;
    Relit wide = black(s.receivers, rows);
    for (size_t r = 0; r < s.receivers; ++r)
      for (int row = 0; row < relit->rows; ++row) wide.set(r, row, relit->at(r, row));
    *relit = std::move(wide);
  }
}

// Behind `receivers` that are there.
void append_relit(Relit& into, size_t receivers, const Relit& relit, size_t count) {
  into.values.resize(blocks_of(receivers + count) * size_t(into.rows) * 3 * transfer_block, 0.0f);
  for (size_t r = 0; r < count; ++r)
    for (int row = 0; row < into.rows; ++row)
      into.set(receivers + r, row, row < relit.rows && !relit.values.empty() ? relit.at(r, row) : Vec3(0.0f));
}

// The last reflection of a diffuse scene, and of an object in it, as one; `own` is null where that is diffuse too.
void join_reflection(RelitScene& into, const Mover& m, const Outgoing* own) {
  const int rows = std::max(into.relit.rows, own ? own->rows() : 1);
  if (!into.outgoing) {
    into.outgoing = Outgoing{OutgoingKind::map, 1, true, {lambert_map(rows)}, {}, {}};
    into.outgoing->map_of.assign(into.receivers, 0), into.outgoing->frames.assign(into.receivers, Mat3(1.0f));
  }
  widen(into, rows);
  Outgoing& o = *into.outgoing;
  const size_t first = o.maps.size(), all = into.receivers + m.receivers.count;
  if (own) {
    for (const ViewMap& map : own->maps) o.maps.push_back(widened(map, rows));
    for (uint16_t k : own->map_of) o.map_of.push_back(uint16_t(first + k));
    const Outgoing turned = turn_outgoing(*own, rotations_of(m));
    o.frames.insert(o.frames.end(), turned.frames.begin(), turned.frames.end());
  }
  o.map_of.resize(all, 0), o.frames.resize(all, Mat3(1.0f));
}

}  // namespace

Relit relight_each(const Mover& m, std::span<const Vec3> light) {
  const Store& store = m.model->baked.surface.store;
  LAMBENT_CHECK(light.size() == m.receivers.count * size_t(sh_count(m.model->light_order())));
  if (std::holds_alternative<ZonalTransfer>(store)) return relight_lobes(m, light);
  const Transfer& t = std::get<Transfer>(store);
  const size_t n = t.columns(), channels = size_t(t.channels);
  const Mat3 back = transpose(m.placed.place.rotation);
  Relit out;
  out.rows = t.rows, out.values.assign(t.blocks() * size_t(t.rows) * 3 * transfer_block, 0.0f);
  parallel_for(t.receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<Vec3> own(n);
    for (size_t r = begin; r < end; ++r) {
      rotate_sh_zyz(back, light.subspan(r * n, n), std::span<Vec3>(own));
      const std::vector<float> values = load_receiver(t, r);
      for (size_t row = 0; row < size_t(t.rows); ++row) {
        Vec3 sum(0.0f);
        for (size_t c = 0; c < 3; ++c) {
          const float* of = values.data() + (row * channels + std::min(c, channels - 1)) * n;
          for (size_t k = 0; k < n; ++k) sum[int(c)] += of[k] * own[k][int(c)];
        }
        out.set(r, int(row), sum);
      }
    }
  });
  return out;
}

void append_mover(RelitScene& into, const Mover& m, const Relit& relit, const Relit& peaks,
                  std::vector<Vec3>& emission) {
  const auto& at = std::get<VertexPlacement>(m.model->baked.surface.where);
  const size_t first = into.receivers, vertices = into.scene.positions.size(), added = at.front.size();
  const Outgoing* own = outgoing_of(m.model->baked.surface);
  if (own || into.outgoing) join_reflection(into, m, own);
  Scene moved = m.pose ? posed(m.model->baked.scene, *m.pose) : m.model->baked.scene;
  const RigidPlace& place = m.placed.place;
  const Vec3 center = m.model->hidden.shells.center;
  for (Vec3& p : moved.positions) p = place.position + place.scale * (place.rotation * (p - center));
  for (Vec3& n : moved.normals) n = place.rotation * n;
  if (m.model->shining || !emission.empty()) emission.resize(into.scene.materials.size(), Vec3(0.0f));
  append_scene(into.scene, moved);
  if (m.model->shining)
    for (const Material& material : moved.materials) emission.push_back(material.emissive);
  for (const auto& [side, more] : {std::pair(&into.front, &at.front), std::pair(&into.back, &at.back)}) {
    if (side->empty() && more->empty()) continue;
    side->resize(vertices, none);
    for (uint32_t r : *more) side->push_back(r == none ? none : r + uint32_t(first));
    side->resize(vertices + added, none);
  }
  if (!peaks.values.empty() && into.peaks.values.empty()) into.peaks = black(first, into.relit.rows);
  append_relit(into.relit, first, relit, m.receivers.count);
  if (!into.peaks.values.empty()) append_relit(into.peaks, first, peaks, m.receivers.count);
  into.receivers += m.receivers.count;
}

}  // namespace lambent
