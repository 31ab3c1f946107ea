#include <lambent/pipeline/draw.h>

#include <lambent/bake/materials.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/draw_columns.h>
#include <lambent/pipeline/draw_indirect.h>
#include <lambent/pipeline/draw_moving.h>
#include <lambent/pipeline/draw_texture.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <algorithm>
#include <map>

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

Result<View> view_of(const ColumnDrawing& d, const std::optional<Pose>& first) {
  if (const auto* fixed = std::get_if<FixedView>(&d.where())) return View{fixed->camera, fixed->width, fixed->height};
  return parse_view(d.request.camera, d.request.size, first ? posed(d.scene(), *first) : d.scene());
}

// What the columns have of a light with lamps of its own, and what of it lamps lose that have moved.
void tell_lamps(const ColumnLight& light, double time, Summary& summary) {
  nlohmann::json lamps = nlohmann::json::array();
  std::string line;
  for (const auto& m : light.moved) {
    lamps.push_back({{"lamp", m.lamp + 1}, {"degrees", m.degrees}, {"held", m.held}});
    line += fmt::format("{}lamp {} by {:.1f} degrees, {:.1f} % of its energy held", line.empty() ? "" : "; ",
                        m.lamp + 1, m.degrees, 100 * m.held);
  }
  summary.json["moved"].push_back({{"time", time}, {"lamps", lamps}, {"lost", light.lost}});
  summary.lines.emplace_back("moved", fmt::format("{}: {:.1f} % of the light is lost (relative L2)",
                                                  line.empty() ? "nothing" : line, 100 * light.lost));
}

// Below this share of a lamp's energy, what is shown of it is no longer that lamp.
constexpr double least_held = 0.5;

// Lamps that went where the file holds little of them, by how little at the worst of all times.
void warn_of_lost_lamps(const std::map<size_t, double>& least, const std::string& baked, const Job& job) {
  for (const auto& [lamp, held] : least)
    if (held < least_held)
      job.warn(
          fmt::format("{}: lamp {} is moved to where {:.1f} % of its energy is held, and is as much darker; a bake "
                      "with lamps along its way holds it (another +lamps:COUNT@ENV for each place)",
                      baked, lamp + 1, 100 * held));
}

// When, of --frames without an animation.
Result<std::vector<double>> times_of(const DrawRequest& request) {
  if (request.frames.empty() || !request.animation.empty()) return std::vector<double>{request.time};
  return parse_frames(request.frames);
}

// What of the light the bands of the file are too few for.
void tell_sharp_light(const ColumnLight& light, Summary& summary) {
  summary.json["sharp_light"] = light.sharp;
  if (!light.peaks.empty() && light.held >= 0)
    summary.lines.emplace_back(
        "sharp",
        fmt::format("{:.0f} % of the light is sharper than {} bands where no lobe stands, and kept from ringing",
                    100 * light.sharp, light.projection.window.size()));
  else if (!light.peaks.empty())
    summary.lines.emplace_back(
        "sharp", fmt::format("{:.0f} % of the light is sharper than {} bands, and kept from ringing: its shadows are "
                             "sharp with `lambent bake --light sh:{}+lamps:{}@ENV` or `--transfer blocks`",
                             100 * light.sharp, light.projection.window.size(), light.projection.window.size(),
                             std::max(1, light.lamps_found)));
}

Result<Drawing> draw_columns(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto begun = begin_columns(baked, request, job);
  if (!begun) return begun.error();
  ColumnDrawing& d = *begun;
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
  auto times = times_of(request);
  if (!times) return times.error();
  Drawing drawing;
  std::map<size_t, double> least_of;
  for (size_t k = 0; k < std::max(poses->size(), times->size()); ++k) {
    const std::optional<Pose>& pose = (*poses)[poses->size() > 1 ? k : 0];
    if (times->size() > 1) {
      if (auto ok = choose_time(d, (*times)[k]); !ok) return ok.error();
      if (auto ok = set_lights(d); !ok) return ok.error();
    }
    Relit relit, peaks;
    if (auto ok = relight(d, pose, relit, peaks); !ok) return ok.error();
    auto image = shade(d, pose, std::move(relit), peaks, *view);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
    if (!d.light.still.light.empty()) tell_lamps(d.light, d.time, drawing.summary);
    for (const auto& m : d.light.moved) {
      double& held = least_of.emplace(m.lamp, 1).first->second;
      held = std::min(held, m.held);
    }
  }
  warn_of_lost_lamps(least_of, request.baked, job);
  const LightProjection& light = d.light.projection;
  drawing.summary.json.update({{"receivers", d.receivers()},
                               {"frames", drawing.frames.size()},
                               {"order", light.window.size()},
                               {"lobes", light_of(baked.surface.store).lobes.size()},
                               {"window", light.window},
                               {"relight_seconds", d.relight_seconds}});
  drawing.summary.lines.emplace_back(
      "relit", fmt::format("{} receivers in {:.2f} ms", human_count(d.receivers()), 1e3 * d.relight_seconds));
  if (d.light.held >= 0 && d.light.still.light.empty()) {
    drawing.summary.json["held"] = d.light.held;
    drawing.summary.lines.emplace_back(
        "held", fmt::format("{:.1f} % of the light's energy (squared radiance) by the file's harmonics and lobes",
                            100 * d.light.held));
    if (d.light.held < least_held)
      job.warn(
          fmt::format("{}: holds {:.1f} % of the light's energy: its lobes stand where they were baked, and what is "
                      "sharper between them rings; a bake with lamps where this light has its own holds them",
                      request.baked, 100 * d.light.held));
  }
  if (d.light.cube.size) {
    drawing.summary.json.update({{"terms", d.reading.terms}, {"bytes_read", d.reading.bytes}});
    drawing.summary.lines.emplace_back(
        "read", fmt::format("{} wavelets of the light, {} of {}", human_count(d.reading.terms),
                            human_bytes(double(d.reading.bytes)), human_bytes(double(bytes_of(baked.surface.store)))));
  }
  tell_sharp_light(d.light, drawing.summary);
  return drawing;
}

}  // namespace

Result<Drawing> draw(const Baked& baked, const DrawRequest& request, const Job& job) {
  if (!request.transfer_texture.empty()) return draw_texture(request, job);
  if (auto ok = check_draw(request, baked); !ok) return ok.error();
  if (std::holds_alternative<IndirectTransfer>(baked.surface.store)) return draw_indirect(baked, request, job);
  if (!request.place.empty()) return draw_moving(baked, request, job);
  if (!std::holds_alternative<SightRows>(baked.surface.rows)) return draw_columns(baked, request, job);
  return draw_blocks(baked, request, job);
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
