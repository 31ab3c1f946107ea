#include "panel.h"

#include <lambent/light/sky.h>
#include <lambent/pipeline/place.h>

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <filesystem>

namespace lambent::tool {

void tell(PanelState& panel, const Result<void>& result) {
  panel.notice = result ? "" : result.error().text(), panel.notice_until = 1e300;
}

namespace {

bool choose(const char* label, const std::vector<std::string>& names, const std::string& current, std::string& chosen) {
  bool changed = false;
  if (!ImGui::BeginCombo(label, current.c_str())) return false;
  for (const std::string& name : names)
    if (ImGui::Selectable(name.c_str(), name == current)) chosen = name, changed = true;
  ImGui::EndCombo();
  return changed;
}

std::string short_name(const std::string& path) {
  return path.find(':') == std::string::npos ? std::filesystem::path(path).filename().string() : path;
}

// An analytic sky: that of --env, as it is, or one to begin with.
void sky_controls(PanelState& panel, Session& s) {
  const std::string& env = s.live->request().env;
  SkyOptions sky;
  if (env.starts_with("sky:"))
    if (auto said = parse_sky(env.substr(4))) sky = *said;
  bool changed = ImGui::SliderFloat("sun's height", &sky.elevation, -2, 90, "%.1f");
  changed |= ImGui::SliderFloat("azimuth", &sky.azimuth, -180, 180, "%.1f");
  changed |= ImGui::SliderFloat("turbidity", &sky.turbidity, 1.7f, 10, "%.1f");
  if (env.starts_with("sky:")) changed |= ImGui::Checkbox("sun", &sky.sun);
  if (changed) tell(panel, s.set("env", sky_text(sky)));
}

void light_controls(PanelState& panel, Session& s) {
  const DrawRequest& request = s.live->request();
  const LightBasis basis = light_of(s.bakes[s.shown_bake]->surface.store);
  if (!request.env.empty() || kind_of(s.bakes[s.shown_bake]->surface) == DrawKind::indirect) {
    std::string chosen;
    if (!s.options.env.empty() && choose("environment", s.options.env, short_name(request.env), chosen))
      tell(panel, s.set("env", chosen));
    if (ImGui::InputTextWithHint("##env", "file or sky:... and Enter", panel.env, sizeof panel.env,
                                 ImGuiInputTextFlags_EnterReturnsTrue))
      tell(panel, s.set("env", panel.env));
    sky_controls(panel, s);
    ImGui::Checkbox("level: light turns about +Y alone", &s.level);
    if (ImGui::Button("light as it came")) tell(panel, s.set("env-rotate", ""));
    if (basis.order > 1) {
      int bands = request.light_order ? request.light_order : basis.order;
      if (ImGui::SliderInt("bands", &bands, 1, basis.order))
        tell(panel, s.set("light-order", std::to_string(bands == basis.order ? 0 : bands)));
    }
  }
  lamp_controls(panel, s);
}

void display_controls(PanelState& panel, Session& s) {
  const DrawRequest& request = s.live->request();
  bool automatic = request.exposure == "auto";
  if (ImGui::Checkbox("exposure by itself", &automatic))
    tell(panel, s.set("exposure", automatic ? "auto" : fmt::format("{:.2f}", s.display.exposure)));
  float stops = s.display.exposure;
  if (ImGui::SliderFloat("stops", &stops, -10, 10, "%.2f"))
    tell(panel, s.set("exposure", fmt::format("{:.2f}", stops)));
  std::string chosen;
  if (choose("tone", choices_of(tone_names), request.tone, chosen)) tell(panel, s.set("tone", chosen));
}

void material_controls(PanelState& panel, Session& s) {
  const Baked& baked = *s.bakes[s.shown_bake];
  const Outgoing* outgoing = outgoing_of(baked.surface);
  const bool blocks = kind_of(baked.surface) == DrawKind::blocks;
  paint_controls(panel, s);
  if (!blocks && !(outgoing && outgoing->kind == OutgoingKind::map)) return;
  if (ImGui::InputTextWithHint("material", "diffuse, ggx:roughness=0.3 and Enter", panel.brdf, sizeof panel.brdf,
                               ImGuiInputTextFlags_EnterReturnsTrue))
    tell(panel, s.set("brdf", panel.brdf));
  model_controls(panel, s);
}

// Where a transfer texture lies, and how deep its grooves are.
void texture_controls(PanelState& panel, Session& s) {
  const DrawRequest& request = s.live->request();
  if (request.transfer_texture.empty()) return;
  ImGui::TextWrapped("%s", short_name(request.transfer_texture).c_str());
  float tile[2] = {1, 1};
  if (auto said = parse_numbers(request.tile, 2, "--tile")) tile[0] = (*said)[0], tile[1] = (*said)[1];
  if (ImGui::DragFloat2("repetitions", tile, 0.05f, 0, 0, "%.3g"))
    tell(panel, s.set("tile", fmt::format("{:.5g},{:.5g}", tile[0], tile[1])));
  float depth = request.groove_depth, width = request.groove_width;
  if (ImGui::SliderFloat("grooves' depth", &depth, 0.01f, 2, "%.3f"))
    tell(panel, s.set("groove-depth", fmt::format("{:.4g}", depth)));
  if (ImGui::SliderFloat("grooves' width", &width, 0.01f, 1, "%.3f"))
    tell(panel, s.set("groove-width", fmt::format("{:.4g}", width)));
}

// Where objects are, and when: of --place, and of what moves by paths or animations.
void object_controls(PanelState& panel, Session& s) {
  const DrawRequest& request = s.live->request();
  for (const std::string& text : request.place) {
    auto object = parse_place(text);
    if (!object) continue;
    float at[3] = {float(object->at.position.x), float(object->at.position.y), float(object->at.position.z)};
    if (!ImGui::DragFloat3(object->name.c_str(), at, 0.01f, 0, 0, "%.2f")) continue;
    object->at.position = Vec3d(at[0], at[1], at[2]);
    tell(panel, s.set("place", place_text(*object)));
    return;  // the list is another one
  }
  if (request.move.empty() && request.animation.empty()) return;
  float time = float(request.time);
  if (ImGui::DragFloat("time, s", &time, 0.02f, 0, 0, "%.2f")) tell(panel, s.set("time", fmt::format("{:.3f}", time)));
}

void look_controls(PanelState& panel, Session& s) {
  const DrawKind kind = kind_of(s.bakes[s.shown_bake]->surface);
  std::vector<std::string> shown{"product", "radiosity", "albedo"};
  const char* of_terms[] = {"emission", "bounce:0", "bounce:1", "bounce:2", "sum:0", "sum:1"};
  if (kind == DrawKind::indirect) shown.insert(shown.end(), {"direct", "indirect"});
  else if (s.live->request().transfer_texture.empty())
    shown.insert(shown.end(), std::begin(of_terms), std::end(of_terms));
  std::string chosen;
  if (kind != DrawKind::blocks && kind != DrawKind::fixed_view && choose("show", shown, s.live->request().show, chosen))
    tell(panel, s.set("show", chosen));
  static const std::vector<std::string> looks = choices_of(look_names);
  if (choose("look", looks, looks[size_t(s.look)], chosen)) {
    const size_t index = size_t(std::find(looks.begin(), looks.end(), chosen) - looks.begin());
    panel.number = 0, tell(panel, s.look_as(Look(index), panel.number));
  }
  const bool numbered = s.look == Look::coefficient || s.look == Look::rows || s.look == Look::balls ||
                        s.look == Look::lobes;
  if (numbered && ImGui::InputInt(s.look == Look::coefficient ? "coefficient" : "row", &panel.number))
    tell(panel, s.look_as(s.look, panel.number));
}

void comparison_controls(PanelState& panel, Session& s) {
  if (ImGui::RadioButton("picture alone", s.against == Against::nothing)) tell(panel, s.compare_with(Against::nothing));
  if (ImGui::RadioButton("path tracer", s.against == Against::reference))
    tell(panel, s.compare_with(Against::reference));
  if (!s.options.reference.empty() &&
      ImGui::RadioButton(short_name(s.options.reference).c_str(), s.against == Against::file))
    tell(panel, s.compare_with(Against::file));
  for (size_t i = 0; i < s.bakes.size(); ++i)
    if (i != s.shown_bake &&
        ImGui::RadioButton(short_name(s.names[i]).c_str(), s.against == Against::bake && s.other_bake == i))
      tell(panel, s.compare_with(Against::bake, i));
  if (s.against == Against::nothing) return;
  bool difference = s.difference;
  if (ImGui::Checkbox("difference, white at 0.1", &difference)) s.show_difference(difference);
  if (s.against == Against::reference) {
    if (ImGui::Checkbox("under the bake's bands", &s.same_bands)) tell(panel, s.compare_with(Against::reference));
    ImGui::Text("%d paths a pixel", s.reference.paths());
  }
  if (s.distance.known) ImGui::Text("PSNR %.1f dB, FLIP %.3f", s.distance.psnr, s.distance.flip);
}

void statistics(const PanelState& panel, Session& s) {
  const LiveTimes& t = s.times;
  ImGui::Text("ms: light %.1f, product %.1f,", t.project, t.relight);
  ImGui::Text("    rays %.1f, draw %.1f, screen %.1f", t.trace, t.shade, panel.screen.all);
  ImGui::Text("    of that %s %.2f", panel.screen.mapped ? "mapped buffer" : "copied", panel.screen.upload);
  if (const Breakdown* b = s.live->breakdown()) {
    const double all = double(std::max<size_t>(1, b->blocked + b->light_visibility + b->light_brdf + b->triple));
    ImGui::Text("blocks: %.0f %% dark, light x visibility %.0f,", 100 * double(b->blocked) / all,
                100 * double(b->light_visibility) / all);
    ImGui::Text("    light x BRDF %.0f, all three %.0f", 100 * double(b->light_brdf) / all,
                100 * double(b->triple) / all);
    if (const StageTimes& each = b->times; each.receivers > 0) {
      const double n = 1e3 * double(each.receivers);
      ImGui::Text("us a receiver: visibility %.2f,", each.visibility / n);
      ImGui::Text("    BRDF %.2f, integral %.2f", each.brdf / n, each.integral / n);
    }
    if (b->squares > 0) ImGui::Text("16 samples a block: %.2g %% off", 100 * b->error());
  }
  ImGui::Text("%zu receivers, %d of %d samples", t.shaded, s.live->samples(), s.live->request().spp);
  if (s.dropped_pixels > 1) ImGui::Text("in a hurry: 1 pixel of %d", s.dropped_pixels * s.dropped_pixels);
  else if (!s.settled()) ImGui::TextUnformatted(s.is_measuring() ? "measuring" : "refining");
  else ImGui::TextUnformatted("whole: as `lambent render`");
  if (!s.frames.empty())
    ImGui::PlotLines("##frames", s.frames.data(), int(s.frames.size()), 0, "ms a piece of work", 0,
                     *std::max_element(s.frames.begin(), s.frames.end()), ImVec2(-1, 50));
}

}  // namespace

Result<void> PanelState::save(Session& session) {
  std::string path;
  do path = fmt::format("lambent_{:03}.png", saved++);
  while (std::filesystem::exists(path));
  if (auto ok = session.save(path); !ok) return ok;
  notice = path + " is written", notice_until = -1;
  return {};
}

void draw_panel(PanelState& panel, Session& s, float x, float width, float height) {
  ImGui::SetNextWindowPos(ImVec2(x, 0));
  ImGui::SetNextWindowSize(ImVec2(width, height));
  ImGui::Begin(
      "lambent", nullptr,
      ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoCollapse);
  ImGui::PushItemWidth(0.55f * width);
  ImGui::TextWrapped("%s", short_name(s.names[s.shown_bake]).c_str());
  ImGui::TextDisabled("%s", draw_kind_names[size_t(kind_of(s.bakes[s.shown_bake]->surface))]);
  if (ImGui::CollapsingHeader("Light", ImGuiTreeNodeFlags_DefaultOpen)) light_controls(panel, s);
  if (ImGui::CollapsingHeader("Display", ImGuiTreeNodeFlags_DefaultOpen)) display_controls(panel, s);
  if (ImGui::CollapsingHeader("Materials and looks", ImGuiTreeNodeFlags_DefaultOpen))
    material_controls(panel, s), texture_controls(panel, s), object_controls(panel, s), look_controls(panel, s);
  if (ImGui::CollapsingHeader("Beside it", ImGuiTreeNodeFlags_DefaultOpen)) comparison_controls(panel, s);
  if (ImGui::CollapsingHeader("Frame", ImGuiTreeNodeFlags_DefaultOpen)) statistics(panel, s);
  if (ImGui::Button("save picture (S)"))
    if (auto ok = panel.save(s); !ok) tell(panel, ok);
  ImGui::SameLine();
  if (ImGui::Button("copy command")) ImGui::SetClipboardText(s.command().c_str());
  ImGui::SameLine();
  if (ImGui::Button("?")) panel.help = !panel.help;
  ImGui::PopItemWidth();
  ImGui::End();
}

void draw_notices(PanelState& panel, double now) {
  if (panel.notice_until < 0) panel.notice_until = now + 6;
  if (!panel.notice.empty() && now < panel.notice_until) {
    ImGui::SetNextWindowPos(ImVec2(12, 12));
    ImGui::Begin("notice", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoInputs);
    ImGui::TextUnformatted(panel.notice.c_str());
    ImGui::End();
  }
  if (!panel.help) return;
  ImGui::SetNextWindowPos(ImVec2(12, 50));
  ImGui::Begin("Keys", &panel.help, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoCollapse);
  ImGui::TextUnformatted(
      "drag              look around\n"
      "Shift or right    turn the light\n"
      "Alt or middle     shift the view\n"
      "Ctrl              carry a lamp or an object; with Shift, up and down\n"
      "double click      edit the material that is there (blocks)\n"
      "wheel, + and -    nearer, farther\n"
      "arrows            look; with Shift, the light\n"
      "R                 against the path tracer\n"
      "D                 difference\n"
      "S                 save the picture\n"
      "F5                read the file again\n"
      "Space             play what moves, and stop it\n"
      "Tab               panel on and off\n"
      "Ctrl-Q            close\n"
      "drop a file       a bake takes the scene's place,\n"
      "                  an environment lights it");
  ImGui::End();
}

}  // namespace lambent::tool
