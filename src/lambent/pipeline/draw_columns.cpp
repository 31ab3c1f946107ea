#include <lambent/pipeline/draw_columns.h>

#include <lambent/core/clock.h>
#include <lambent/core/overloaded.h>
#include <lambent/relight/block_runs.h>
#include <lambent/relight/dering.h>

#include <algorithm>

namespace lambent {
namespace {

Result<void> sum_relit(std::vector<Relighter>& relighters, const RelightFrame& frame, Relit& out) {
  Relit part;
  for (size_t i = 0; i < relighters.size(); ++i) {
    if (auto ok = relighters[i].relight(frame, i == 0 ? out : part); !ok) return ok;
    if (i > 0)
      std::transform(part.values.begin(), part.values.end(), out.values.begin(), out.values.begin(), std::plus());
  }
  return {};
}

// Whether every number of T . light is of what cannot be negative; else that is seen at the pixel.
bool each_is_light(const Rows& rows) {
  const auto* directional = std::get_if<DirectionalRows>(&rows);
  return !std::holds_alternative<Outgoing>(rows) &&
         (!directional || directional->kind == DirectionalKind::none || directional->kind == DirectionalKind::hl2);
}

// dering() of every number, on all cores.
void hold_above_zero(Relit& whole, const Relit& peaks, const BlockRuns* only) {
  const size_t each = size_t(whole.rows) * 3 * transfer_block;
  parallel_blocks(whole.values.size() / each, 1024, only, [&](size_t begin, size_t end) {
    for (size_t i = begin * each; i < end * each; ++i) whole.values[i] = dering(whole.values[i], peaks.values[i]);
  });
}

}  // namespace

Result<ColumnDrawing> begin_columns(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto show = parse_show(request.show);
  if (!show) return show.error();
  ColumnDrawing d{baked, request, job, *show};
  for (const std::string& text : request.insert) {
    auto insertion = parse_insertion(text, baked.scene.origin);
    if (!insertion) return insertion.error();
    d.insertions.push_back(std::move(*insertion));
  }
  d.rows = baked.surface.rows;
  if (!request.brdf.empty()) {
    auto reflection = parse_reflection(request.brdf);
    if (!reflection) return reflection.error();
    auto changed = change_materials(baked, *reflection);
    if (!changed) return Error{request.baked, changed.error().message};
    d.rows = std::move(*changed);
  }
  return d;
}

Result<void> choose_light(ColumnDrawing& d) {
  const LightBasis basis = light_of(d.baked.surface.store);
  auto light = column_light(d.request, d.around, basis, d.scene().origin);
  if (!light) return light.error();
  d.light = std::move(*light);
  if (auto ok = choose_time(d, d.time); !ok) return ok;
  if (const int size = cube_of(d.baked.surface.store)) {
    const bool dark = !d.around.env || d.show.part == Show::Part::emission;
    const Environment none{"", Image(2, 1), {}};
    d.light.cube = cube_light(dark ? none : *d.around.env, size, d.around.rotation);
  }
  if (std::holds_alternative<Outgoing>(d.rows) && d.light.still.light.empty()) soften_peaks(d.light);
  if (d.show.part != Show::Part::bounce) d.emission = seen_emission(d.scene(), basis, d.light.lamps);
  if (d.show.part == Show::Part::emission)
    std::fill(d.light.projection.light.begin(), d.light.projection.light.end(), Vec3(0.0f)), d.light.peaks.clear();
  if (!d.request.env.empty() && basis.order == 0 && basis.lobes.empty() && d.light.cube.size == 0 && !d.around.seen)
    d.job.warn(d.request.baked + ": holds lamps alone, so that --env neither lights it nor, unseen, shows");
  return {};
}

Result<void> choose_time(ColumnDrawing& d, double time) {
  d.time = time;
  const LightBasis basis = light_of(d.baked.surface.store);
  if (!d.around.env || d.show.part == Show::Part::emission || !moves_lobes(d.request, basis)) return {};
  if (auto ok = move_lamps(d.request, d.around.rotation, basis, time, d.light); !ok) return ok;
  if (std::holds_alternative<Outgoing>(d.rows)) soften_peaks(d.light);
  return {};
}

Result<void> set_lights(ColumnDrawing& d) {
  for (Relighter& relighter : d.relighters)
    if (auto ok = d.light.cube.size ? relighter.set_light(d.light.cube) : relighter.set_light(d.light.projection.light);
        !ok)
      return Error{d.request.baked, ok.error().message};
  if (d.light.peaks.empty()) return {};
  for (Relighter& relighter : d.of_peaks)
    if (auto ok = relighter.set_light(d.light.peaks); !ok) return Error{d.request.baked, ok.error().message};
  return {};
}

Result<void> make_relighters(ColumnDrawing& d) {
  std::vector<const Field*> summed;
  const int first = d.show.part == Show::Part::bounce ? d.show.term : 0;
  if (d.show.part == Show::Part::bounce || d.show.part == Show::Part::sum)
    for (int k = first; k <= d.show.term; ++k)
      summed.push_back(&d.terms.emplace_back(Field{d.where(), d.baked.terms[size_t(k)], d.baked.surface.rows}));
  else summed.push_back(&d.baked.surface);
  for (const Field* field : summed) {
    for (std::vector<Relighter>* relighters : {&d.relighters, &d.of_peaks}) {
      auto relighter = Relighter::make(*field, {.terms = size_t(d.request.terms)});
      if (!relighter) return Error{d.request.baked, relighter.error().message};
      relighters->push_back(std::move(*relighter));
    }
  }
  return set_lights(d);
}

bool relights_in_part(const ColumnDrawing& d) {
  const Store& store = d.baked.surface.store;
  const bool can = std::holds_alternative<Transfer>(store) || std::holds_alternative<CpcaTransfer>(store) ||
                   std::holds_alternative<ZonalTransfer>(store);
  return can && d.relighters.size() == 1 && d.light.near.empty();
}

Result<void> relight(ColumnDrawing& d, const std::optional<Pose>& pose, Relit& out, Relit& peaks,
                     const std::vector<uint32_t>* seen) {
  RelightFrame frame;
  if (seen) frame.keep = true, frame.seen = *seen;
  ReceiverFrames frames;
  LightField field;
  if (d.turns() && pose) {
    frames = make_receiver_frames(receiver_rotations(*pose, d.where(), d.receivers()));
    frame.frames = &frames;
  }
  if (!d.light.near.empty()) {
    const std::vector<Vec3>& vertices = pose ? pose->positions : d.scene().positions;
    field = make_light_field(d.light.local(), receiver_positions(vertices, d.where(), d.receivers()));
    frame.light = &field;
  }
  frame.reading = &d.reading;
  const auto start = Clock::now();
  if (auto ok = sum_relit(d.relighters, frame, out); !ok) return Error{d.request.baked, ok.error().message};
  if (d.light.cube.size)  // few terms ring
    for (float& v : out.values) v = std::max(v, 0.0f);
  if (d.light.peaks.empty()) peaks = {};
  else {
    frame.light = nullptr;  // near lamps are in none of the peaks
    const bool held_here = each_is_light(d.rows);
    Relit& relit = held_here ? d.peaks : peaks;
    if (auto ok = sum_relit(d.of_peaks, frame, relit); !ok) return Error{d.request.baked, ok.error().message};
    if (held_here) {
      const BlockRuns runs = seen ? block_runs(*seen, d.receivers()) : BlockRuns();
      hold_above_zero(out, relit, seen ? &runs : nullptr), peaks = {};
    }
  }
  d.relight_seconds = std::min(d.relight_seconds, seconds_since(start));
  return {};
}

Rows posed_rows(const ColumnDrawing& d, const std::optional<Pose>& pose) {
  Rows rows = d.rows;
  if (auto* outgoing = std::get_if<Outgoing>(&rows); outgoing && pose && d.turns())
    *outgoing = turn_outgoing(*outgoing, receiver_rotations(*pose, d.where(), d.receivers()));
  return rows;
}

Result<void> make_insertions(ColumnDrawing& d, std::span<const std::shared_ptr<const InsertedObject>> known) {
  d.inserted.clear();
  if (d.insertions.empty()) return {};
  if (const auto* outgoing = std::get_if<Outgoing>(&d.rows))
    if (auto ok = check_insertion(*outgoing, d.scene().path); !ok) return ok;
  const Field& field = *lattice_of(d.baked);
  for (const Insertion& insertion : d.insertions) {
    const auto same = std::find_if(known.begin(), known.end(), [&](const auto& o) { return o->of == insertion; });
    if (same != known.end()) {
      d.inserted.push_back(*same);
      continue;
    }
    auto made = make_inserted(insertion, std::get<LatticePlacement>(field.where).lattice,
                              std::get<IncidentRows>(field.rows).order, d.job);
    if (!made) return made.error();
    d.inserted.push_back(std::move(*made));
  }
  return {};
}

Result<RelitScene> with_insertions(const ColumnDrawing& d, Relit relit) {
  const VertexPlacement& at = *vertices_of(d.baked);
  const Outgoing* outgoing = std::get_if<Outgoing>(&d.rows);
  RelitScene drawn{d.scene(),     at.front,         at.back,
                   d.receivers(), std::move(relit), outgoing ? std::optional(*outgoing) : std::nullopt};
  const Field& field = *lattice_of(d.baked);
  auto relighter = Relighter::make(field);
  if (!relighter) return Error{d.request.baked, relighter.error().message};
  if (auto ok = relighter->set_light(d.light.projection.light); !ok) return Error{d.request.baked, ok.error().message};
  Relit free_space;
  if (auto ok = relighter->relight({}, free_space); !ok) return ok.error();
  const Lattice& lattice = std::get<LatticePlacement>(field.where).lattice;
  for (const auto& object : d.inserted)
    if (auto ok = insert_object(drawn, object->scene, object->receivers, object->transfer, lattice, free_space); !ok)
      return ok.error();
  return drawn;
}

// O(view): what the rows mean says how.
Result<Image> shade(ColumnDrawing& d, const std::optional<Pose>& pose, Relit relit, const Relit& peaks,
                    const View& view) {
  RenderOptions options{view.width, view.height, d.request.spp, d.around.background(), d.show.colour};
  options.emission = d.emission;
  if (!peaks.values.empty() && d.insertions.empty()) options.peaks = &peaks;
  const Rows rows = posed_rows(d, pose);
  auto draw_surfaces = [&]() -> Result<Image> {
    const Scene moved = pose ? posed(d.scene(), *pose) : Scene();
    const Scene& scene = pose ? moved : d.scene();
    if (d.insertions.empty()) {
      auto tracer = Tracer::build(scene);
      if (!tracer) return tracer.error();
      return render(scene, *tracer, d.baked.basis, relit, view.camera, options, d.job.progress);
    }
    if (auto ok = make_insertions(d); !ok) return ok.error();
    auto drawn = with_insertions(d, std::move(relit));
    if (!drawn) return drawn.error();
    options.outgoing = drawn->outgoing ? &*drawn->outgoing : nullptr;
    if (!options.emission.empty()) options.emission.resize(drawn->scene.materials.size(), Vec3(0.0f));
    auto tracer = Tracer::build(drawn->scene);
    if (!tracer) return tracer.error();
    return render(drawn->scene, *tracer, corner_receivers(drawn->scene, drawn->front, drawn->back), drawn->relit,
                  view.camera, options, d.job.progress);
  };
  return std::visit(
      Overloaded{[&](const DiffuseRows&) { return draw_surfaces(); },
                 [&](const DirectionalRows& r) { return options.directional = r.kind, draw_surfaces(); },
                 [&](const Outgoing& o) { return options.outgoing = &o, draw_surfaces(); },
                 [&](const PixelRows&) -> Result<Image> {
                   const auto& fixed = std::get<FixedView>(d.where());
                   return pixels_image(relit, fixed.coverage, view.camera, view.width, view.height, options.background);
                 },
                 [&](const IncidentRows&) -> Result<Image> {
                   return Error{d.request.baked, "holds light that arrives at its surface, which no picture shows"};
                 },
                 [&](const SightRows&) -> Result<Image> {
                   return Error{d.request.baked, "is of visibility in blocks"};
                 },
                 [&](const HiddenRows&) -> Result<Image> {
                   return Error{d.request.baked, "holds what an object hides, which no picture shows"};
                 }},
      rows);
}

}  // namespace lambent
