#include <lambent/pipeline/draw_moving.h>

#include <lambent/pipeline/lamp_sight.h>
#include <lambent/pipeline/place.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/lattice.h>
#include <lambent/relight/moving.h>
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

// All that does not move, and its light: of the whole, and of the light's peaks where it has any.
struct MovingScene {
  MovingReceivers receivers;
  int order = 0;  // bands of the light straight from the sky
  Relit all = {}, peaks = {};
  FreeSpace space = {};
  int light_order = 0;
  std::optional<Tracer> tracer = std::nullopt;  // of the scene alone, where lamps move
  float diagonal = 0;
};

bool has_peaks(const ColumnDrawing& d) { return !d.light.peaks.empty(); }

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

Result<MovingScene> make_moving_scene(const Baked& baked, const DrawRequest& request, const Job& job) {
  const auto* whole = std::get_if<Transfer>(&baked.surface.store);
  if (!whole) return Error{request.baked, "is no dense transfer, over which objects could move"};
  // Light straight from the sky alone, where it was kept apart.
  const Transfer& direct = baked.terms.empty() ? *whole : baked.terms.front();
  if (baked.terms.empty() && whole->channels == 3)
    job.warn(request.baked +
             ": holds light that has bounced together with the sky's, so that objects shadow both "
             "alike; `lambent bake --terms` keeps them apart");
  const size_t receivers = receivers_of(baked.surface.store);
  return MovingScene{moving_receivers(direct, receiver_positions(baked.scene.positions, baked.surface.where, receivers),
                                      receiver_normals(baked.scene, *vertices_of(baked), receivers)),
                     direct.light.order};
}

Result<void> light_scene(MovingScene& s, ColumnDrawing& d) {
  const std::string& path = d.request.baked;
  s.light_order = d.request.light_order ? std::min(s.order, d.request.light_order) : s.order;
  if (auto ok = d.relighters.front().relight({}, s.all); !ok) return Error{path, ok.error().message};
  if (has_peaks(d))
    if (auto ok = d.of_peaks.front().relight({}, s.peaks); !ok) return Error{path, ok.error().message};
  auto space = relight_lattice(d);
  if (!space) return Error{path, space.error().message};
  s.space = std::move(*space);
  return {};
}

// Warns where an object stands where the lattice knows nothing.
void check_place(const MovingScene& s, const Mover& m, const Job& job, std::set<std::string>& warned) {
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
    job.warn(m.file.name + (outside ? ": stands outside of the lattice's box; light there is that of the box's border"
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
Relit relight_object(const MovingScene& s, bool with_peaks, const Mover& m, std::span<const PlacedObject* const> others,
                     MovingShader& shader) {
  const int order = std::min(s.space.order, m.receivers.order);
  Relit all, peaks;
  std::vector<std::vector<Vec3>> arriving;
  arriving.push_back(arriving_at(m.receivers, s.space.lattice, s.space.all, order));
  if (with_peaks) arriving.push_back(arriving_at(m.receivers, s.space.lattice, s.space.peaks, order));
  std::vector<MovingLight> lights{{arriving[0], true, &all}};
  if (with_peaks) lights.push_back({arriving[1], true, &peaks});
  for (const MovingLight& light : lights) light_receivers(m.receivers, order, light);
  shader.shade(m.receivers, others, {.light_order = order}, lights);
  if (with_peaks) dering(all, peaks);
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

struct MovingDrawing::State {
  const Baked& baked;
  const Job& job;
  MovingScene scene;
  std::map<std::string, std::unique_ptr<Model>> models = {};
  std::vector<Mover> movers = {};
  // Kept from frame to frame.
  MovingShader sky = {};
  LampShader lamps = {};
  std::set<std::string> warned = {};
  std::vector<std::pair<std::string, size_t>> parts = {};
  MovingCount done = {};
  double seconds = 0;
};

MovingDrawing::MovingDrawing(std::unique_ptr<State> state) : state_(std::move(state)) {}
MovingDrawing::MovingDrawing(MovingDrawing&&) noexcept = default;
MovingDrawing& MovingDrawing::operator=(MovingDrawing&&) noexcept = default;
MovingDrawing::~MovingDrawing() = default;
size_t MovingDrawing::objects() const { return state_->movers.size(); }
const std::vector<std::pair<std::string, size_t>>& MovingDrawing::parts() const { return state_->parts; }
size_t MovingDrawing::pairs() const { return state_->done.pairs; }
size_t MovingDrawing::tiles() const { return state_->done.tiles; }
double MovingDrawing::seconds() const { return state_->seconds; }
int MovingDrawing::light_order() const { return state_->scene.light_order; }

Result<MovingDrawing> MovingDrawing::make(const Baked& baked, const DrawRequest& request, const Job& job) {
  std::map<std::string, std::unique_ptr<Model>> models;
  auto movers = load_movers(request, models);
  if (!movers) return movers.error();
  auto scene = make_moving_scene(baked, request, job);
  if (!scene) return scene.error();
  MovingDrawing out(std::unique_ptr<State>(new State{baked, job, std::move(*scene)}));
  out.state_->models = std::move(models);
  if (auto ok = out.change(request); !ok) return ok.error();
  return out;
}

Result<void> MovingDrawing::change(const DrawRequest& request) {
  State& s = *state_;
  auto movers = load_movers(request, s.models);
  if (!movers) return movers.error();
  const bool shines = std::any_of(movers->begin(), movers->end(), [](const Mover& m) { return m.model->shining; });
  if (shines && !s.scene.tracer) {
    auto tracer = Tracer::build(s.baked.scene, s.job.progress);
    if (!tracer) return tracer.error();
    const Bounds box = bounds(s.baked.scene);
    s.scene.tracer = std::move(*tracer), s.scene.diagonal = length(box.max - box.min);
  }
  s.movers = std::move(*movers);
  return {};
}

Result<void> MovingDrawing::set_light(ColumnDrawing& d) { return light_scene(state_->scene, d); }

void MovingDrawing::move_to(double time) {
  State& s = *state_;
  const auto start = std::chrono::steady_clock::now();
  for (Mover& m : s.movers) {
    const Model& model = *m.model;
    m.placed = place_object(model.hidden, place_at(m.file, time, s.baked.scene.origin));
    m.receivers =
        moving_receivers(model.transfer(), model.positions, model.normals, model.hidden.shells.center, m.placed.place);
    if (model.shining) m.lamp = place_lamp(*model.shining, m.placed.place);
    check_place(s.scene, m, s.job, s.warned);
  }
  s.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

RelitScene MovingDrawing::lit(const ColumnDrawing& d, std::vector<Vec3>& emission) {
  State& s = *state_;
  const auto start = std::chrono::steady_clock::now();
  std::vector<const PlacedObject*> objects;
  for (const Mover& m : s.movers) objects.push_back(&m.placed);
  const VertexPlacement& at = *vertices_of(s.baked);
  RelitScene drawn{s.baked.scene, at.front, at.back, d.receivers(), s.scene.all, {}};
  Relit peaks = s.scene.peaks;
  std::vector<MovingLight> lights{{d.light.projection.light, false, &drawn.relit}};
  if (has_peaks(d)) lights.push_back({d.light.peaks, false, &peaks});
  const MovingCount done = s.sky.shade(s.scene.receivers, objects,
                                       {.light_order = s.scene.light_order, .bounced = !s.baked.terms.empty()}, lights);
  if (has_peaks(d)) dering(drawn.relit, peaks);
  add_lamp_light(s.scene, s.scene.receivers, nullptr, s.movers, s.lamps, drawn.relit);
  s.done.pairs += done.pairs, s.done.tiles += done.tiles;
  emission = d.emission;
  s.parts.clear();
  for (size_t i = 0; i < s.movers.size(); ++i) {
    std::vector<const PlacedObject*> others = objects;
    others.erase(others.begin() + ptrdiff_t(i));
    Relit relit = relight_object(s.scene, has_peaks(d), s.movers[i], others, s.sky);
    add_lamp_light(s.scene, s.movers[i].receivers, &s.movers[i], s.movers, s.lamps, relit);
    s.parts.emplace_back(s.movers[i].file.name, drawn.scene.triangles.size());
    append_object(drawn, s.movers[i], relit, emission);
  }
  if (!emission.empty()) emission.resize(drawn.scene.materials.size(), Vec3(0.0f));
  s.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return drawn;
}

Result<Drawing> draw_moving(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto begun = begin_columns(baked, request, job);
  if (!begun) return begun.error();
  ColumnDrawing& d = *begun;
  std::vector<double> times{request.time};
  if (!request.frames.empty()) {
    auto given = parse_frames(request.frames);
    if (!given) return given.error();
    times = *given;
  }
  auto moving = MovingDrawing::make(baked, request, job);
  if (!moving) return moving.error();
  auto view = parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  d.around = std::move(*around);
  if (auto ok = choose_light(d); !ok) return ok.error();
  if (auto ok = make_relighters(d); !ok) return ok.error();
  if (auto ok = moving->set_light(d); !ok) return ok.error();
  Drawing drawing;
  for (double time : times) {
    moving->move_to(time);
    RenderOptions options{view->width, view->height, request.spp, d.around.background(), d.show.colour};
    const RelitScene drawn = moving->lit(d, options.emission);
    auto tracer = Tracer::build(drawn.scene);
    if (!tracer) return tracer.error();
    auto image = render(drawn.scene, *tracer, corner_receivers(drawn.scene, drawn.front, drawn.back), drawn.relit,
                        view->camera, options, job.progress);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  const double frames = double(times.size()), ms = 1e3 * moving->seconds() / frames;
  drawing.summary.json = {{"receivers", d.receivers()},
                          {"frames", times.size()},
                          {"objects", moving->objects()},
                          {"order", moving->light_order()},
                          {"pairs", double(moving->pairs()) / frames},
                          {"tiles", double(moving->tiles()) / frames},
                          {"relight_seconds", moving->seconds() / frames}};
  drawing.summary.lines.emplace_back(
      "relit", fmt::format("{} receivers and {} objects in {:.2f} ms a frame; {} pairs of both are near each other",
                           human_count(d.receivers()), moving->objects(), ms,
                           human_count(size_t(double(moving->pairs()) / frames))));
  return drawing;
}

}  // namespace lambent
