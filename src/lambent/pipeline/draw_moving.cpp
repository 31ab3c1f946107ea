#include <lambent/pipeline/draw_moving.h>

#include <lambent/pipeline/draw_columns.h>
#include <lambent/pipeline/lamp_sight.h>
#include <lambent/pipeline/place.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/lattice.h>
#include <lambent/relight/moving.h>
#include <lambent/render/insert.h>
#include <lambent/scene/append.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>

namespace lambent {
namespace {

// What was read of a field file, once for all objects that are of it.
struct Model {
  Baked baked;
  HiddenLight hidden;
  std::optional<ShiningLight> shining;
  std::vector<ShiningPoint> points;      // of what shines
  std::vector<Vec3> positions, normals;  // of receivers
  const Transfer& transfer() const { return std::get<Transfer>(baked.surface.store); }
};

struct Mover {
  PlacedFile file;
  const Model* model = nullptr;
  PlacedObject placed = {};
  MovingReceivers receivers = {};
  PlacedLamp lamp = {};  // of a model that shines
};

// Points of a lamp towards which a receiver looks past the scene.
constexpr int lamp_sight_points = 32;

// Normals of receivers at vertices, towards their side.
std::vector<Vec3> receiver_normals(const Scene& scene, const VertexPlacement& at, size_t receivers) {
  std::vector<Vec3> normals(receivers, Vec3(0, 1, 0));
  for (size_t v = 0; v < at.back.size(); ++v)
    if (at.back[v] != no_receiver) normals[at.back[v]] = -scene.normals[v];
  for (size_t v = 0; v < at.front.size(); ++v)
    if (at.front[v] != no_receiver) normals[at.front[v]] = scene.normals[v];
  return normals;
}

Result<std::unique_ptr<Model>> load_model(const std::string& path) {
  auto object = load_baked(path);
  if (!object) return object.error();
  const Field* hidden = hiding_of(*object);
  if (!hidden) return Error{path, "does not say what it hides around it: `lambent field` makes files that do"};
  const auto* t = std::get_if<Transfer>(&object->surface.store);
  const VertexPlacement* at = vertices_of(*object);
  if (!t || !at || !std::holds_alternative<DiffuseRows>(object->surface.rows) ||
      t->columns() != size_t(sh_count(t->light.order)))
    return Error{path, "is no diffuse bake at vertices by harmonics alone, as an object that moves is"};
  HiddenLight light = hidden_light(*hidden, max_sh_order);
  auto model = std::make_unique<Model>(Model{std::move(*object), std::move(light), {}, {}, {}, {}});
  if (const Field* shining = shining_of(model->baked)) {
    model->shining = shining_light(*shining, max_sh_order);
    model->points = shining_points(model->baked.scene, lamp_sight_points);
    if (model->points.empty()) return Error{path, "shines, and has no material that does"};
  }
  const auto& where = std::get<VertexPlacement>(model->baked.surface.where);
  const size_t count = receivers_of(model->baked.surface.store);
  model->positions = receiver_positions(model->baked.scene.positions, where, count);
  model->normals = receiver_normals(model->baked.scene, where, count);
  return model;
}

// Of the lattice, relit: what arrives at an object's receivers.
struct FreeSpace {
  Lattice lattice;
  std::vector<uint8_t> valid;
  int order = 0;
  Relit all, peaks;
};

// All that does not move, and the lights: of the whole, and of its peaks where it has any.
struct MovingScene {
  ColumnDrawing& d;
  MovingReceivers receivers;
  Relit all, peaks;
  FreeSpace space;
  int light_order = 0;
  std::optional<Tracer> tracer;  // of the scene alone, where lamps move
  float diagonal = 0;
  bool has_peaks() const { return !d.light.peaks.empty(); }
};

Result<FreeSpace> relight_lattice(const ColumnDrawing& d) {
  const Field& field = *lattice_of(d.baked);
  const auto& place = std::get<LatticePlacement>(field.where);
  FreeSpace space{place.lattice, place.valid, std::get<IncidentRows>(field.rows).order, {}, {}};
  auto relighter = Relighter::make(field);
  if (!relighter) return relighter.error();
  for (const auto& [light, out] :
       {std::pair(&d.light.projection.light, &space.all), std::pair(&d.light.peaks, &space.peaks)}) {
    if (light->empty()) continue;
    if (auto ok = relighter->set_light(*light); !ok) return ok.error();
    if (auto ok = relighter->relight({}, *out); !ok) return ok.error();
  }
  return space;
}

Result<MovingScene> make_moving_scene(ColumnDrawing& d) {
  const auto* whole = std::get_if<Transfer>(&d.baked.surface.store);
  if (!whole) return Error{d.request.baked, "is no dense transfer, over which objects could move"};
  // Light straight from the sky alone, where it was kept apart.
  const Transfer& direct = d.baked.terms.empty() ? *whole : d.baked.terms.front();
  if (d.baked.terms.empty() && whole->channels == 3)
    d.job.warn(d.request.baked +
               ": holds light that has bounced together with the sky's, so that objects shadow both "
               "alike; `lambent bake --terms` keeps them apart");
  const VertexPlacement& at = *vertices_of(d.baked);
  MovingScene s{d,
                moving_receivers(direct, receiver_positions(d.scene().positions, d.where(), d.receivers()),
                                 receiver_normals(d.scene(), at, d.receivers())),
                {},
                {},
                {},
                direct.light.order,
                {},
                0};
  if (d.request.light_order) s.light_order = std::min(s.light_order, d.request.light_order);
  if (auto ok = d.relighters.front().relight({}, s.all); !ok) return Error{d.request.baked, ok.error().message};
  if (s.has_peaks())
    if (auto ok = d.of_peaks.front().relight({}, s.peaks); !ok) return Error{d.request.baked, ok.error().message};
  auto space = relight_lattice(d);
  if (!space) return Error{d.request.baked, space.error().message};
  s.space = std::move(*space);
  return s;
}

// Warns where an object stands where the lattice knows nothing.
void check_place(const MovingScene& s, const Mover& m, std::set<std::string>& warned) {
  const Lattice& l = s.space.lattice;
  const Vec3 p = m.placed.place.position, slack(0.01f * length(l.max - l.min) + m.placed.radius());
  const bool outside = !all_at_most(l.min - slack, p) || !all_at_most(p, l.max + slack);
  int at[3];
  const int n[3] = {l.nx, l.ny, l.nz};
  for (int k = 0; k < 3; ++k) {
    const float t = l.max[k] > l.min[k] ? (p[k] - l.min[k]) / (l.max[k] - l.min[k]) : 0.0f;
    at[k] = int(std::lround(std::clamp(t, 0.0f, 1.0f) * float(n[k] - 1)));
  }
  const bool buried = !outside && !s.space.valid[l.index(at[0], at[1], at[2])];
  if ((outside || buried) && warned.insert(m.file.name).second)
    s.d.job.warn(m.file.name + (outside
                                    ? ": stands outside of the lattice's box; light there is that of the box's border"
                                    : ": stands inside something; light there is that of its surroundings"));
}

// [receiver][coefficient] of what arrives at an object.
std::vector<Vec3> arriving_at(const MovingReceivers& r, const Lattice& lattice, const Relit& light, int order) {
  const size_t n = size_t(sh_count(order));
  std::vector<Vec3> out(r.count * n), incident(size_t(light.rows));
  for (size_t i = 0; i < r.count; ++i) {
    interpolate_lattice(lattice, light, r.positions[i], incident);
    std::copy_n(incident.begin(), n, out.begin() + ptrdiff_t(i * n));
  }
  return out;
}

// What the lamps among the objects add to receivers: the scene's (`self` null), or an object's, which does not light
// itself.
MovingCount add_lamp_light(const MovingScene& s, const MovingReceivers& receivers, const Mover* self,
                           const std::vector<Mover>& movers, LampShader& shader, Relit& values) {
  std::vector<std::vector<float>> open;
  std::vector<SeenLamp> lamps;
  std::vector<const PlacedObject*> objects;
  for (const Mover& m : movers)
    if (&m != self) objects.push_back(&m.placed);
  for (const Mover& m : movers) {
    if (!m.model->shining || &m == self) continue;
    open.push_back(lamp_in_sight(*s.tracer, s.diagonal, receivers, m.model->points, m.model->hidden.shells.center,
                                 m.placed.place));
    lamps.push_back({&m.lamp, &m.placed});
  }
  for (size_t i = 0; i < lamps.size(); ++i) lamps[i].open = open[i];
  if (lamps.empty()) return {};
  return shader.add(receivers, lamps, objects, self ? LampResponse::transfer : LampResponse::cosine, values);
}

// One object's receivers under the others.
Relit relight_object(const MovingScene& s, const Mover& m, std::span<const PlacedObject* const> others,
                     MovingShader& shader) {
  const int order = std::min(s.space.order, m.receivers.order);
  Relit all, peaks;
  std::vector<std::vector<Vec3>> arriving;
  arriving.push_back(arriving_at(m.receivers, s.space.lattice, s.space.all, order));
  if (s.has_peaks()) arriving.push_back(arriving_at(m.receivers, s.space.lattice, s.space.peaks, order));
  std::vector<MovingLight> lights{{arriving[0], true, &all}};
  if (s.has_peaks()) lights.push_back({arriving[1], true, &peaks});
  for (const MovingLight& light : lights) light_receivers(m.receivers, order, light);
  shader.shade(m.receivers, others, {.light_order = order}, lights);
  if (s.has_peaks()) dering(all, peaks);
  return all;
}

void append_object(RelitScene& into, const Mover& m, const Relit& relit, std::vector<Vec3>& emission) {
  const auto& at = std::get<VertexPlacement>(m.model->baked.surface.where);
  const size_t first = into.receivers, vertices = into.scene.positions.size(), added = at.front.size();
  Scene moved = m.model->baked.scene;
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
  into.receivers += m.receivers.count;
  into.relit.values.resize((into.receivers + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  for (size_t r = 0; r < m.receivers.count; ++r) into.relit.set(first + r, 0, relit.at(r));
}

// Kept from frame to frame.
struct MovingShaders {
  MovingShader sky;
  LampShader lamps;
};

// What was drawn, counted.
struct MovingTally {
  size_t pairs = 0, tiles = 0;
  double seconds = 0;
};

Result<Image> draw_frame(const MovingScene& s, std::vector<Mover>& movers, double time, const View& view,
                         MovingShaders& shaders, std::set<std::string>& warned, MovingTally& tally) {
  ColumnDrawing& d = s.d;
  const auto start = std::chrono::steady_clock::now();
  for (Mover& m : movers) {
    const Model& model = *m.model;
    m.placed = place_object(model.hidden, place_at(m.file, time, d.scene().origin));
    m.receivers =
        moving_receivers(model.transfer(), model.positions, model.normals, model.hidden.shells.center, m.placed.place);
    if (model.shining) m.lamp = place_lamp(*model.shining, m.placed.place);
    check_place(s, m, warned);
  }
  std::vector<const PlacedObject*> objects;
  for (const Mover& m : movers) objects.push_back(&m.placed);
  RelitScene drawn{d.scene(), vertices_of(d.baked)->front, vertices_of(d.baked)->back, d.receivers(), s.all, {}};
  Relit peaks = s.peaks;
  std::vector<MovingLight> lights{{d.light.projection.light, false, &drawn.relit}};
  if (s.has_peaks()) lights.push_back({d.light.peaks, false, &peaks});
  const MovingCount done = shaders.sky.shade(s.receivers, objects,
                                             {.light_order = s.light_order, .bounced = !d.baked.terms.empty()}, lights);
  if (s.has_peaks()) dering(drawn.relit, peaks);
  add_lamp_light(s, s.receivers, nullptr, movers, shaders.lamps, drawn.relit);
  tally.pairs += done.pairs, tally.tiles += done.tiles;
  std::vector<Vec3> emission = d.emission;
  for (size_t i = 0; i < movers.size(); ++i) {
    std::vector<const PlacedObject*> others = objects;
    others.erase(others.begin() + ptrdiff_t(i));
    Relit relit = relight_object(s, movers[i], others, shaders.sky);
    add_lamp_light(s, movers[i].receivers, &movers[i], movers, shaders.lamps, relit);
    append_object(drawn, movers[i], relit, emission);
  }
  tally.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  auto tracer = Tracer::build(drawn.scene);
  if (!tracer) return tracer.error();
  RenderOptions options{view.width, view.height, d.request.spp, d.around.background(), d.show.colour};
  options.emission = std::move(emission);
  if (!options.emission.empty()) options.emission.resize(drawn.scene.materials.size(), Vec3(0.0f));
  return render(drawn.scene, *tracer, corner_receivers(drawn.scene, drawn.front, drawn.back), drawn.relit, view.camera,
                options, d.job.progress);
}

Result<std::vector<Mover>> load_movers(const DrawRequest& request,
                                       std::map<std::string, std::unique_ptr<Model>>& models) {
  auto files = parse_places(request.place, request.move);
  if (!files) return files.error();
  std::vector<Mover> movers;
  for (PlacedFile& file : *files) {
    auto& model = models[file.path];
    if (!model) {
      auto loaded = load_model(file.path);
      if (!loaded) return loaded.error();
      model = std::move(*loaded);
    }
    movers.push_back({std::move(file), model.get()});
  }
  return movers;
}

}  // namespace

Result<Drawing> draw_moving(const Baked& baked, const DrawRequest& request, const Job& job) {
  std::map<std::string, std::unique_ptr<Model>> models;
  auto movers = load_movers(request, models);
  if (!movers) return movers.error();
  auto begun = begin_columns(baked, request, job);
  if (!begun) return begun.error();
  ColumnDrawing& d = *begun;
  std::vector<double> times{request.time};
  if (!request.frames.empty()) {
    auto given = parse_frames(request.frames);
    if (!given) return given.error();
    times = *given;
  }
  auto view = parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  d.around = std::move(*around);
  if (auto ok = choose_light(d); !ok) return ok.error();
  if (auto ok = make_relighters(d); !ok) return ok.error();
  auto scene = make_moving_scene(d);
  if (!scene) return scene.error();
  if (std::any_of(movers->begin(), movers->end(), [](const Mover& m) { return m.model->shining.has_value(); })) {
    auto tracer = Tracer::build(d.scene(), job.progress);
    if (!tracer) return tracer.error();
    const Bounds box = bounds(d.scene());
    scene->tracer = std::move(*tracer), scene->diagonal = length(box.max - box.min);
  }
  Drawing drawing;
  MovingShaders shaders;
  MovingTally tally;
  std::set<std::string> warned;
  for (double time : times) {
    auto image = draw_frame(*scene, *movers, time, *view, shaders, warned, tally);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  const double frames = double(times.size());
  drawing.summary.json = {{"receivers", d.receivers()},
                          {"frames", times.size()},
                          {"objects", movers->size()},
                          {"order", scene->light_order},
                          {"pairs", double(tally.pairs) / frames},
                          {"tiles", double(tally.tiles) / frames},
                          {"relight_seconds", tally.seconds / frames}};
  drawing.summary.lines.emplace_back(
      "relit", fmt::format("{} receivers and {} objects in {:.2f} ms a frame; {} pairs of both are near each other",
                           human_count(d.receivers()), movers->size(), 1e3 * tally.seconds / frames,
                           human_count(size_t(double(tally.pairs) / frames))));
  return drawing;
}

}  // namespace lambent
