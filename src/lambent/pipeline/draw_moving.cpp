#include <lambent/pipeline/draw_moving.h>

#include <lambent/core/clock.h>
#include <lambent/pipeline/moving_light.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/lattice.h>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace lambent {
namespace {

bool has_peaks(const ColumnDrawing& d) { return !d.light.peaks.empty(); }

Result<FreeSpace> relight_lattice(const ColumnDrawing& d) {
  const Field& field = *lattice_of(d.baked);
  const auto& place = std::get<LatticePlacement>(field.where);
  FreeSpace space{place.lattice, place.valid, std::get<IncidentRows>(field.rows).order, {}, {}};
  auto relighter = Relighter::make(field);
  if (!relighter) return relighter.error();
  ColumnLight softened;
  if (has_peaks(d)) softened = d.light, soften_peaks(softened);
  const ColumnLight& soft = softened;
  for (const auto& [light, out] :
       {std::pair(&d.light.projection.light, &space.all), std::pair(&d.light.peaks, &space.peaks),
        std::pair(&soft.projection.light, &space.soft), std::pair(&soft.peaks, &space.soft_peaks)}) {
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
  MovingScene scene{moving_receivers(direct, receiver_positions(baked.scene.positions, baked.surface.where, receivers),
                                     receiver_normals(baked.scene.normals, *vertices_of(baked), receivers)),
                    direct.light.order};
  arrange_rows(scene.receivers);
  return scene;
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

// The same of one whose transfer is no factor of a product: glossy, or of lobes, or both. `peaks`, of glossy ones, are
// held above 0 at the pixel, where it is known what is seen of them.
Relit relight_rows(const MovingScene& s, bool with_peaks, const Mover& m, const LightAmongMovers& among, Relit& peaks) {
  const int order = m.model->light_order();
  const bool glossy = outgoing_of(m.model->baked.surface) != nullptr;
  const auto under = [&](const Relit& space) { return relight_each(m, among.arriving_at_each(m, space, order)); };
  Relit all = under(with_peaks && glossy ? s.space.soft : s.space.all);
  if (with_peaks && glossy) peaks = under(s.space.soft_peaks);
  else if (with_peaks) dering(all, under(s.space.peaks));
  if (!among.sends_to(m)) return all;
  const Relit sent = relight_each(m, among.sent_to_each(m, order));
  for (size_t i = 0; i < all.values.size(); ++i) all.values[i] += sent.values[i];
  return all;
}

}  // namespace

struct MovingDrawing::State {
  const Baked& baked;
  const Job& job;
  MovingScene scene;
  MoverModels models = {};
  std::vector<Mover> movers = {};
  // Kept from frame to frame.
  MovingShader sky = {};
  LampShader lamps = {};
  int lamp_bounces = 1;
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
  MoverModels models;
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
  const auto any = [&](auto has) { return std::any_of(movers->begin(), movers->end(), has); };
  const bool shines = any([](const Mover& m) { return m.model->shining.has_value(); });
  if ((shines || any([](const Mover& m) { return m.model->reflecting.has_value(); })) && !s.scene.tracer) {
    auto tracer = Tracer::build(s.baked.scene, s.job.progress);
    if (!tracer) return tracer.error();
    const Bounds box = bounds(s.baked.scene);
    s.scene.tracer = std::move(*tracer), s.scene.diagonal = length(box.max - box.min);
  }
  s.lamp_bounces = request.lamp_bounces;
  if (shines && s.lamp_bounces > 0 && !s.scene.bounces)
    if (auto ok = add_bounces(s.scene, s.baked, s.job); !ok) return ok.error();
  s.movers = std::move(*movers);
  return {};
}

Result<void> MovingDrawing::set_light(ColumnDrawing& d) { return light_scene(state_->scene, d); }

Result<void> MovingDrawing::move_to(double time) {
  State& s = *state_;
  const auto start = Clock::now();
  for (Mover& m : s.movers) {
    if (auto ok = lambent::move_to(m, time, s.baked.scene.origin); !ok) return ok;
    check_place(s.scene, m, s.job, s.warned);
  }
  s.seconds += seconds_since(start);
  return {};
}

RelitScene MovingDrawing::lit(const ColumnDrawing& d, std::vector<Vec3>& emission) {
  State& s = *state_;
  const auto start = Clock::now();
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
  LightAmongMovers among(s.scene, s.baked, s.movers, s.lamps, s.sky, s.lamp_bounces);
  among.light_scene(drawn.relit);
  s.done.pairs += done.pairs, s.done.tiles += done.tiles;
  emission = d.emission;
  s.parts.clear();
  for (size_t i = 0; i < s.movers.size(); ++i) {
    std::vector<const PlacedObject*> others = objects;
    others.erase(others.begin() + ptrdiff_t(i));
    const bool diffuse = s.movers[i].model->is_diffuse();
    Relit held;
    Relit relit = diffuse ? relight_object(s.scene, has_peaks(d), s.movers[i], others, s.sky)
                          : relight_rows(s.scene, has_peaks(d), s.movers[i], among, held);
    if (diffuse) among.light_object(s.movers[i], relit);
    s.parts.emplace_back(s.movers[i].file.name, drawn.scene.triangles.size());
    append_mover(drawn, s.movers[i], relit, held, emission);
  }
  if (!emission.empty()) emission.resize(drawn.scene.materials.size(), Vec3(0.0f));
  s.seconds += seconds_since(start);
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
    if (auto ok = moving->move_to(time); !ok) return ok.error();
    RenderOptions options{view->width, view->height, request.spp, d.around.background(), d.show.colour};
    const RelitScene drawn = moving->lit(d, options.emission);
    options.outgoing = drawn.outgoing ? &*drawn.outgoing : nullptr;
    if (!drawn.peaks.values.empty()) options.peaks = &drawn.peaks;
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
