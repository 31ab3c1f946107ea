// What of the scene the panel changes: lamps, paint, materials.
#include "panel.h"

#include <lambent/pipeline/moving_lamps.h>

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>

namespace lambent::tool {
namespace {

constexpr ImGuiColorEditFlags radiance = ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR;

bool drag_places(const char* label, std::vector<double>& numbers, size_t first, float speed) {
  float at[3] = {float(numbers[first]), float(numbers[first + 1]), float(numbers[first + 2])};
  if (!ImGui::DragFloat3(label, at, speed, 0, 0, "%.4g")) return false;
  for (size_t k = 0; k < 3; ++k) numbers[first + k] = double(at[k]);
  return true;
}

bool drag_number(const char* label, double& number, float speed, float low, float high) {
  float value = float(number);
  if (!ImGui::DragFloat(label, &value, speed, low, high, "%.4g", ImGuiSliderFlags_AlwaysClamp)) return false;
  number = double(value);
  return true;
}

// The numbers of a lamp; true: one has changed.
bool edit_lamp(LampNumbers& lamp, float size) {
  using Kind = MovingLamp::Kind;
  bool changed = false;
  if (lamp.kind == Kind::sun) {
    changed |= drag_number("azimuth", lamp.numbers[0], 1, -360, 360);
    changed |= drag_number("height", lamp.numbers[1], 0.5f, -90, 90);
  } else {
    changed |= drag_places("place", lamp.numbers, 0, size / 500);
  }
  if (lamp.kind == Kind::sphere) changed |= drag_number("radius", lamp.numbers[3], size / 2000, size / 10000, size);
  if (lamp.kind == Kind::spot) {
    changed |= drag_places("towards", lamp.numbers, 3, size / 500);
    changed |= drag_number("angle", lamp.numbers[6], 0.5f, 1, 90);
  }
  // Colour apart from strength: strong lamps stay within what a picker shows.
  float strength = std::max({lamp.color.x, lamp.color.y, lamp.color.z});
  const Vec3 hue = strength > 0 ? lamp.color / strength : Vec3(1.0f);
  float rgb[3] = {hue.x, hue.y, hue.z};
  const bool hued = ImGui::ColorEdit3("colour", rgb, ImGuiColorEditFlags_Float);
  const bool strong = ImGui::DragFloat("strength", &strength, std::max(strength, 1e-3f) / 100, 0, 1e12f, "%.4g",
                                       ImGuiSliderFlags_AlwaysClamp);
  if (hued || strong) lamp.color = strength * Vec3(rgb[0], rgb[1], rgb[2]);
  return changed || hued || strong;
}

void own_lamps(PanelState& panel, Session& s) {
  for (const std::string& name : s.live->lamp_names()) {
    Vec3 color(1.0f);
    for (const std::string& text : s.live->request().lamp)
      if (auto lamp = parse_named_color(text, "--lamp"); lamp && lamp->name == name) color = lamp->color;
    float rgb[3] = {color.x, color.y, color.z};
    if (ImGui::ColorEdit3(name.c_str(), rgb, radiance))
      tell(panel, s.set("lamp", fmt::format("{}={},{},{}", name, std::max(0.0f, rgb[0]), std::max(0.0f, rgb[1]),
                                            std::max(0.0f, rgb[2]))));
  }
}

// Base colour as it is painted, or of the material.
Vec3 paint_of(const Session& s, const std::string& name) {
  for (const std::string& text : s.live->request().albedo)
    if (auto painted = parse_named_color(text, "--albedo"); painted && painted->name == name) return painted->color;
  for (const Material& m : s.live->scene().materials)
    if (m.name == name) return Vec3(m.base_color);
  return Vec3(0.5f);
}

}  // namespace

void lamp_controls(PanelState& panel, Session& s) {
  own_lamps(panel, s);
  if (kind_of(s.bakes[s.shown_bake]->surface) != DrawKind::indirect) return;
  const std::vector<std::string> lamps = s.standing_lamps();
  const float size = bounds(s.live->scene()).diagonal();
  for (size_t i = 0; i < lamps.size(); ++i) {
    auto lamp = read_lamp_numbers(lamps[i]);
    if (!lamp) continue;
    ImGui::PushID(int(i));
    const std::string title = fmt::format("lamp {}: {}###lamp", i + 1, lamps[i].substr(0, lamps[i].find('@')));
    if (ImGui::TreeNodeEx(title.c_str(), ImGuiTreeNodeFlags_DefaultOpen)) {
      if (edit_lamp(*lamp, size)) tell(panel, s.set_lamp(i, lamp_text(*lamp)));
      if (ImGui::SmallButton("take out")) tell(panel, s.set_lamp(i, ""));
      ImGui::TreePop();
    }
    ImGui::PopID();
  }
  for (const char* kind : {"sphere", "point", "spot", "sun"}) {
    if (kind != std::string("sphere")) ImGui::SameLine();
    if (ImGui::SmallButton(fmt::format("+ {}", kind).c_str())) tell(panel, s.set_lamp(lamps.size(), s.new_lamp(kind)));
  }
}

void paint_controls(PanelState& panel, Session& s) {
  const auto* indirect = std::get_if<IndirectTransfer>(&s.bakes[s.shown_bake]->surface.store);
  if (!indirect) return;
  for (const std::string& name : indirect->surfels.names) {
    const Vec3 color = paint_of(s, name);
    float rgb[3] = {color.x, color.y, color.z};
    if (ImGui::ColorEdit3(name.c_str(), rgb, ImGuiColorEditFlags_Float))
      tell(panel, s.set("albedo", fmt::format("{}={:.4g},{:.4g},{:.4g}", name, std::clamp(rgb[0], 0.0f, 1.0f),
                                              std::clamp(rgb[1], 0.0f, 1.0f), std::clamp(rgb[2], 0.0f, 1.0f))));
  }
  if (!s.live->request().albedo.empty() && ImGui::SmallButton("paint as baked")) tell(panel, s.clear("albedo"));
}

namespace {

// A model's numbers as the panel edits them.
struct ModelField {
  const char* key;
  int count;  // of numbers; 3: a colour
  float low, high;
  std::vector<float> value;
};
struct ModelForm {
  const char* name;
  std::vector<ModelField> fields;
};
const std::vector<ModelForm>& model_forms() {
  static const std::vector<ModelForm> forms{
      {"lambert", {{"albedo", 3, 0, 1, {0.8f, 0.8f, 0.8f}}}},
      {"phong",
       {{"exponent", 1, 0, 1000, {50}},
        {"diffuse", 3, 0, 1, {0.3f, 0.3f, 0.3f}},
        {"specular", 3, 0, 1, {0.6f, 0.6f, 0.6f}}}},
      {"ggx", {{"roughness", 2, 0, 1, {0.3f, 0.3f}}, {"f0", 3, 0, 1, {0.9f, 0.9f, 0.9f}}}},
      {"cook-torrance",
       {{"roughness", 1, 0, 1, {0.3f}},
        {"f0", 3, 0, 1, {0.5f, 0.5f, 0.5f}},
        {"diffuse", 3, 0, 1, {0.2f, 0.2f, 0.2f}},
        {"specular", 3, 0, 1, {0.8f, 0.8f, 0.8f}}}},
      {"ward",
       {{"ax", 1, 0, 1, {0.1f}},
        {"ay", 1, 0, 1, {0.3f}},
        {"diffuse", 3, 0, 1, {0.2f, 0.2f, 0.2f}},
        {"specular", 3, 0, 1, {0.7f, 0.7f, 0.7f}}}},
      {"metallic-roughness",
       {{"color", 3, 0, 1, {0.8f, 0.8f, 0.8f}}, {"metallic", 1, 0, 1, {0}}, {"roughness", 1, 0, 1, {0.5f}}}}};
  return forms;
}

// "key=1,2,3,key=..." into the form's values.
void read_values(const std::string& text, ModelForm& form) {
  for (ModelField& field : form.fields) {
    const std::string key = std::string(field.key) + "=";
    const size_t at = text.find(key);
    if (at == std::string::npos || (at > 0 && text[at - 1] != ',' && text[at - 1] != ':')) continue;
    size_t from = at + key.size();
    for (float& v : field.value) {
      char* end = nullptr;
      const float read = std::strtof(text.c_str() + from, &end);
      if (end == text.c_str() + from) {
        v = field.value.front();  // one for all
        continue;
      }
      v = read, from = size_t(end - text.c_str());
      if (from < text.size() && text[from] == ',') ++from;
    }
  }
}

std::string form_text(const ModelForm& form, bool textured) {
  std::string out = textured ? "textured:" : "";
  out += form.name;
  char before = ':';
  for (const ModelField& field : form.fields) {
    out += fmt::format("{}{}=", before, field.key), before = ',';
    for (size_t k = 0; k < field.value.size(); ++k) out += fmt::format("{}{:.4g}", k ? "," : "", field.value[k]);
  }
  return out;
}

bool edit_form(ModelForm& form) {
  bool changed = false;
  for (ModelField& f : form.fields)
    changed |= f.count == 3 ? ImGui::ColorEdit3(f.key, f.value.data(), ImGuiColorEditFlags_Float)
                            : ImGui::SliderScalarN(f.key, ImGuiDataType_Float, f.value.data(), f.count, &f.low, &f.high,
                                                   "%.3g", f.high > 1 ? ImGuiSliderFlags_Logarithmic : 0);
  return changed;
}

}  // namespace

// Of blocks: a model for one material at a time.
void model_controls(PanelState& panel, Session& s) {
  const Scene& scene = s.live->scene();
  if (kind_of(s.bakes[s.shown_bake]->surface) != DrawKind::blocks || scene.materials.empty()) return;
  const auto named = [&](const std::string& name) {
    return std::any_of(scene.materials.begin(), scene.materials.end(),
                       [&](const Material& m) { return m.name == name; });
  };
  if (!named(panel.material)) panel.material = scene.materials.front().name;
  if (panel.material.empty()) return;
  if (ImGui::BeginCombo("of", panel.material.c_str())) {
    for (const Material& m : scene.materials)
      if (!m.name.empty() && ImGui::Selectable(m.name.c_str(), m.name == panel.material)) panel.material = m.name;
    ImGui::EndCombo();
  }
  std::string text;
  for (const std::string& said : s.live->request().material)
    if (said.starts_with(panel.material + "=")) text = said.substr(panel.material.size() + 1);
  bool textured = text.starts_with("textured:");
  if (textured) text = text.substr(std::string("textured:").size());
  const std::string model = text.substr(0, text.find(':'));
  const auto put = [&](const ModelForm& form) {
    tell(panel, s.set("material", panel.material + "=" + form_text(form, textured)));
  };
  if (ImGui::BeginCombo("model", model.empty() ? "as all others" : model.c_str())) {
    if (ImGui::Selectable("as all others", model.empty()) && !model.empty())
      tell(panel, s.set("material", panel.material + "="));
    for (const ModelForm& form : model_forms())
      if (ImGui::Selectable(form.name, model == form.name)) put(form);
    ImGui::EndCombo();
  }
  for (ModelForm form : model_forms()) {
    if (model != form.name) continue;
    read_values(text, form);
    bool changed = edit_form(form);
    changed |= ImGui::Checkbox("times the base colour and its texture", &textured);
    if (changed) put(form);
  }
}

}  // namespace lambent::tool
