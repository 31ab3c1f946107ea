#include <lambent/pipeline/draw.h>

#include <lambent/bake/materials.h>
#include <lambent/core/overloaded.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/draw_indirect.h>
#include <lambent/pipeline/draw_insert.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/draw_texture.h>
#include <lambent/pipeline/motion.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/relighter.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>

namespace lambent {

Result<Outgoing> change_materials(const Baked& baked, const Reflection& reflection) {
  const Outgoing* old = outgoing_of(baked.surface);
  const VertexPlacement* at = vertices_of(baked);
  if (!old || old->kind != OutgoingKind::map || !at)
    return Error{"", "other materials need a bake that kept incident light"};
  Receivers receivers;
  receivers.origins.resize(old->frames.size()), receivers.front = at->front, receivers.back = at->back;
  for (const Mat3& frame : old->frames) receivers.normals.push_back(frame[2]);
  Outgoing changed = make_map_outgoing(make_receiver_materials(baked.scene, receivers, reflection), old->order);
  changed.frames = old->frames;
  return changed;
}

namespace {

// A drawing by columns of light under way.
struct ColumnDrawing {
  const Baked& baked;
  const DrawRequest& request;
  const Job& job;
  Show show;
  std::vector<Insertion> insertions;
  Surroundings around;
  ColumnLight light;
  Rows rows = {};                          // the surface's, or those of other materials
  std::deque<Field> terms = {};            // of the Neumann series, where they are drawn one by one
  std::vector<Relighter> relighters = {};  // what they give is summed
  std::vector<Relighter> of_peaks = {};    // the same of the light's peaks; none where nothing rings
  std::vector<Vec3> emission = {};
  double relight_seconds = 1e9;

  const Placement& where() const { return baked.surface.where; }
  const Scene& scene() const { return baked.scene; }
  size_t receivers() const { return receivers_of(baked.surface.store); }
  // Only lobes turn with the surface, and have a light of each receiver's own.
  bool turns() const { return std::holds_alternative<ZonalTransfer>(baked.surface.store); }
};

Result<void> choose_light(ColumnDrawing& d) {
  const LightBasis basis = light_of(d.baked.surface.store);
  auto light = column_light(d.request, d.around, basis, d.scene().origin);
  if (!light) return light.error();
  d.light = std::move(*light);
  if (std::holds_alternative<Outgoing>(d.rows)) soften_peaks(d.light);
  if (d.show.part != Show::Part::bounce) d.emission = seen_emission(d.scene(), basis, d.light.lamps);
  if (d.show.part == Show::Part::emission)
    std::fill(d.light.projection.light.begin(), d.light.projection.light.end(), Vec3(0.0f)), d.light.peaks.clear();
  if (!d.request.env.empty() && basis.order == 0 && basis.lobes.empty() && !d.around.seen)
    d.job.warn(d.request.baked + ": holds lamps alone, so that --env neither lights it nor, unseen, shows");
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
    auto relighter = Relighter::make(*field);
    if (!relighter) return Error{d.request.baked, relighter.error().message};
    if (auto ok = relighter->set_light(d.light.projection.light); !ok) return ok;
    d.relighters.push_back(std::move(*relighter));
    if (d.light.peaks.empty()) continue;
    d.of_peaks.push_back(*Relighter::make(*field));
    if (auto ok = d.of_peaks.back().set_light(d.light.peaks); !ok) return ok;
  }
  return {};
}

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

// T . light, in that pose; `peaks` is of light's peaks, where rows have still to be held above 0, else without rows.
Result<void> relight(ColumnDrawing& d, const std::optional<Pose>& pose, Relit& out, Relit& peaks) {
  RelightFrame frame;
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
  const auto start = std::chrono::steady_clock::now();
  if (auto ok = sum_relit(d.relighters, frame, out); !ok) return Error{d.request.baked, ok.error().message};
  if (!d.of_peaks.empty()) {
    frame.light = nullptr;  // near lamps are in none of the peaks
    if (auto ok = sum_relit(d.of_peaks, frame, peaks); !ok) return Error{d.request.baked, ok.error().message};
    if (each_is_light(d.rows)) dering(out, peaks), peaks = {};
  }
  d.relight_seconds =
      std::min(d.relight_seconds, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  return {};
}

// The scene with what is inserted, all of it relit.
Result<RelitScene> with_insertions(ColumnDrawing& d, Relit relit) {
  const VertexPlacement& at = *vertices_of(d.baked);
  const Outgoing* outgoing = std::get_if<Outgoing>(&d.rows);
  RelitScene drawn{d.scene(),     at.front,         at.back,
                   d.receivers(), std::move(relit), outgoing ? std::optional(*outgoing) : std::nullopt};
  const Field& lattice = *lattice_of(d.baked);
  auto relighter = Relighter::make(lattice);
  if (!relighter) return Error{d.request.baked, relighter.error().message};
  if (auto ok = relighter->set_light(d.light.projection.light); !ok) return Error{d.request.baked, ok.error().message};
  Relit free_space;
  if (auto ok = relighter->relight({}, free_space); !ok) return ok.error();
  for (const Insertion& insertion : d.insertions)
    if (auto ok = add_insertion(insertion, std::get<LatticePlacement>(lattice.where).lattice,
                                std::get<IncidentRows>(lattice.rows).order, free_space, drawn, d.job);
        !ok)
      return ok.error();
  return drawn;
}

// O(view): what the rows mean says how.
Result<Image> shade(ColumnDrawing& d, const std::optional<Pose>& pose, Relit relit, const Relit& peaks,
                    const View& view) {
  RenderOptions options{view.width, view.height, d.request.spp, d.around.background(), d.show.colour};
  options.emission = d.emission;
  if (!peaks.values.empty() && d.insertions.empty()) options.peaks = &peaks;
  Rows rows = d.rows;
  if (auto* outgoing = std::get_if<Outgoing>(&rows); outgoing && pose && d.turns())
    *outgoing = turn_outgoing(*outgoing, receiver_rotations(*pose, d.where(), d.receivers()));
  auto draw_surfaces = [&]() -> Result<Image> {
    const Scene moved = pose ? posed(d.scene(), *pose) : Scene();
    const Scene& scene = pose ? moved : d.scene();
    if (d.insertions.empty()) {
      auto tracer = Tracer::build(scene);
      if (!tracer) return tracer.error();
      return render(scene, *tracer, d.baked.basis, relit, view.camera, options, d.job.progress);
    }
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
                 }},
      rows);
}

Result<View> view_of(const ColumnDrawing& d, const std::optional<Pose>& first) {
  if (const auto* fixed = std::get_if<FixedView>(&d.where())) return View{fixed->camera, fixed->width, fixed->height};
  return parse_view(d.request.camera, d.request.size, first ? posed(d.scene(), *first) : d.scene());
}

Result<Drawing> draw_columns(const Baked& baked, const DrawRequest& request, const Job& job) {
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
  // What moves is seen by the camera that looks at its first pose.
  const Motion motion{request.animation, request.frames, request.deform, request.time};
  auto poses = make_poses(motion, baked.scene);
  if (!poses) return poses.error();
  auto view = view_of(d, poses->front());
  if (!view) return view.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  d.around = std::move(*around);
  if (auto ok = choose_light(d); !ok) return ok.error();
  if (motion.any() && !d.turns())
    job.warn(request.baked +
             ": its transfer cannot turn with the surface (`lambent compress --zonal` makes one that can); it is used "
             "as baked");
  if (auto ok = make_relighters(d); !ok) return ok.error();
  Drawing drawing;
  for (const std::optional<Pose>& pose : *poses) {
    Relit relit, peaks;
    if (auto ok = relight(d, pose, relit, peaks); !ok) return ok.error();
    auto image = shade(d, pose, std::move(relit), peaks, *view);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  const LightProjection& light = d.light.projection;
  drawing.summary.json = {{"receivers", d.receivers()},   {"frames", drawing.frames.size()},
                          {"order", light.window.size()}, {"lobes", light_of(baked.surface.store).lobes.size()},
                          {"window", light.window},       {"relight_seconds", d.relight_seconds}};
  drawing.summary.lines.emplace_back(
      "relit", fmt::format("{} receivers in {:.2f} ms", human_count(d.receivers()), 1e3 * d.relight_seconds));
  drawing.summary.json["sharp_light"] = d.light.sharp;
  if (!d.light.peaks.empty())
    drawing.summary.lines.emplace_back(
        "sharp",
        fmt::format("{:.0f} % of the light is sharper than {} bands, and kept from ringing: its shadows are "
                    "sharp with `lambent bake --light sh:{}+lamps:{}@ENV` or `--transfer blocks`",
                    100 * d.light.sharp, light.window.size(), light.window.size(), std::max(1, d.light.lamps_found)));
  return drawing;
}

}  // namespace

Result<Drawing> draw(const Baked& baked, const DrawRequest& request, const Job& job) {
  if (!request.transfer_texture.empty()) return draw_texture(request, job);
  if (auto ok = check_draw(request, baked); !ok) return ok.error();
  if (std::holds_alternative<IndirectTransfer>(baked.surface.store)) return draw_indirect(baked, request, job);
  return std::holds_alternative<SightRows>(baked.surface.rows) ? draw_blocks(baked, request, job)
                                                               : draw_columns(baked, request, job);
}

Result<Drawing> draw(const DrawRequest& request, const Job& job) {
  if (!request.transfer_texture.empty()) return draw_texture(request, job);
  auto baked = load_baked(request.baked);
  if (!baked) return baked.error();
  return draw(*baked, request, job);
}

namespace {

void describe_display(const Display& display, const std::string& tone, std::span<const Image> frames,
                      Summary& summary) {
  const Clipping clipped = clipping(frames, display);
  summary.json["display"] = {
      {"exposure", display.exposure}, {"tone", tone}, {"white", clipped.white}, {"negative", clipped.negative}};
  summary.lines.emplace_back("shown", fmt::format("{:+.2f} stops, tone {}; {:.1f} % white, {:.1f} % darker than black",
                                                  display.exposure, tone, 100 * clipped.white, 100 * clipped.negative));
}

}  // namespace

Result<Summary> draw_to_file(const DrawRequest& request, const Job& job) {
  if (auto ok = check_output(request.output, {"png", "exr"}); !ok) return ok.error();
  auto drawing = draw(request, job);
  if (!drawing) return drawing.error();
  const std::vector<Image>& frames = drawing->frames;
  const bool png = file_extension(request.output) == "png";
  // Colours are no light: they are shown as they are, unless something else was said.
  const bool is_light = request.show != "albedo" || is_given(request, "exposure") || is_given(request, "tone");
  auto display = png && is_light ? parse_display(request.exposure, request.tone, frames) : Result<Display>(Display());
  if (!display) return display.error();
  if (auto ok = save_image(request.output, frames.size() > 1 ? beside(frames) : frames.front(), *display); !ok)
    return ok.error();
  drawing->summary.json["output"] = request.output;
  if (png && is_light) describe_display(*display, request.tone, frames, drawing->summary);
  return std::move(drawing->summary);
}

}  // namespace lambent
