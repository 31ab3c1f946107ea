// glTF 2.0 specification (ISO/IEC 12113), section 3.11 (animations) and appendix C (interpolation).
#include <lambent/scene/gltf_animation.h>

namespace lambent {

using Json = nlohmann::json;

namespace {

enum class Interpolation { linear, step, cubic };

struct Channel {
  size_t node = 0;
  std::string path;
  Interpolation interpolation = Interpolation::linear;
  GltfAccessor input, output;
  size_t width = 0;  // numbers a key
};

// nullopt: broken (the check has failed) or to be ignored (it has not).
std::optional<Channel> read_channel(GltfCheck& check, const GltfDocument& document, const Json& animation,
                                    const Json& channel, const GltfWhere& where) {
  if (!channel.is_object()) return check.fail(where, "a channel is not an object"), std::nullopt;
  const Json* samplers = check.array(animation, "samplers", where);
  const Json* target = check.object(channel, "target", where);
  if (!check.ok()) return std::nullopt;
  if (!samplers || !target) return check.fail(where, "has no samplers, or a channel without a target"), std::nullopt;
  Channel c;
  auto sampler_index = check.index(channel, "sampler", samplers->size(), where);
  if (!check.ok()) return std::nullopt;
  if (!sampler_index) return check.fail(where, "a channel has no sampler"), std::nullopt;
  auto node = check.index(*target, "node", gltf_count(document.json, "nodes"), where);
  c.path = check.text(*target, "path", where);
  if (!check.ok()) return std::nullopt;
  const bool known = c.path == "translation" || c.path == "rotation" || c.path == "scale" || c.path == "weights";
  if (!node || !known) return std::nullopt;
  c.node = *node;

  const Json& sampler = (*samplers)[*sampler_index];
  if (!sampler.is_object()) return check.fail(where, "a sampler is not an object"), std::nullopt;
  const std::string how = check.text(sampler, "interpolation", where);
  if (how == "STEP") c.interpolation = Interpolation::step;
  else if (how == "CUBICSPLINE") c.interpolation = Interpolation::cubic;
  else if (!how.empty() && how != "LINEAR")
    return check.fail(where, "a sampler's interpolation is not known"), std::nullopt;
  auto input = check.index(sampler, "input", gltf_count(document.json, "accessors"), where);
  auto output = check.index(sampler, "output", gltf_count(document.json, "accessors"), where);
  if (!check.ok()) return std::nullopt;
  if (!input || !output) return check.fail(where, "a sampler has no input or no output"), std::nullopt;
  c.input = read_accessor(check, document, *input), c.output = read_accessor(check, document, *output);
  if (!check.ok()) return std::nullopt;
  if (c.input.components != 1 || c.input.type != GltfType::f32 || c.input.count == 0)
    return check.fail(where, "a sampler's times are not floats, or none"), std::nullopt;
  // Accessors without bytes are all zeros, as many as they like to say.
  if ((c.input.data.empty() || c.output.data.empty()) && std::max(c.input.count, c.output.count) > 4096)
    return check.fail(where, "a sampler's accessor has no bytes"), std::nullopt;
  const size_t keys = c.input.count * (c.interpolation == Interpolation::cubic ? 3 : 1);
  const bool weights = c.path == "weights";
  c.width = weights ? c.output.count / keys : c.path == "rotation" ? 4 : 3;
  if (c.output.is_matrix || c.output.components != (weights ? 1 : int(c.width)) ||
      c.output.count != keys * (weights ? c.width : 1) || c.width == 0 || c.width > 4096)
    return check.fail(where, "a sampler's values do not fit its times"), std::nullopt;
  return c;
}

// The number-th value: key * width + component, or for cubic splines (3 key + part) * width + component.
double value_at(const Channel& c, size_t key, size_t component) {
  double v[4] = {};
  if (c.path == "weights") {
    c.output.read(key * c.width + component, v);
    return v[0];
  }
  c.output.read(key, std::span(v, c.width));
  return v[component];
}

double key_time(const Channel& c, size_t key) {
  double t[1] = {};
  c.input.read(key, t);
  return t[0];
}

bool check_keys(GltfCheck& check, const Channel& c, const GltfWhere& where) {
  for (size_t k = 0; k < c.input.count; ++k) {
    const double t = key_time(c, k);
    if (!std::isfinite(t) || (k > 0 && t < key_time(c, k - 1)))
      return check.fail(where, "a sampler's times fall or are not finite");
  }
  for (size_t k = 0; k < c.input.count * (c.interpolation == Interpolation::cubic ? 3 : 1); ++k)
    for (size_t i = 0; i < c.width; ++i)
      if (!std::isfinite(value_at(c, k, i))) return check.fail(where, "a sampler's value is not a finite number");
  return true;
}

void normalize_rotation(std::vector<double>& q) {
  double length = 0;
  for (double x : q) length += x * x;
  length = std::sqrt(length);
  if (length > 0)
    for (double& x : q) x /= length;
  else q = {0, 0, 0, 1};
}

std::vector<double> evaluate(const Channel& c, double time) {
  size_t low = 0, high = c.input.count - 1;
  const bool before = time < key_time(c, 0), after = time >= key_time(c, high);
  if (before) high = 0;
  if (after) low = high;
  while (high > low + 1) {
    const size_t middle = (low + high) / 2;
    (key_time(c, middle) <= time ? low : high) = middle;
  }
  const bool cubic = c.interpolation == Interpolation::cubic, rotation = c.path == "rotation";
  auto key = [&](size_t k, size_t part) {  // of a cubic spline: in-tangent, value, out-tangent
    std::vector<double> v(c.width);
    for (size_t i = 0; i < c.width; ++i) v[i] = value_at(c, cubic ? 3 * k + part : k, i);
    return v;
  };
  std::vector<double> a = key(low, 1);
  if (low != high && c.interpolation != Interpolation::step) {
    std::vector<double> b = key(high, 1);
    const double span = key_time(c, high) - key_time(c, low), u = (time - key_time(c, low)) / span;
    if (cubic) {
      const std::vector<double> out = key(low, 2), in = key(high, 0);
      const double u2 = u * u, u3 = u2 * u;
      for (size_t i = 0; i < c.width; ++i)
        a[i] = (2 * u3 - 3 * u2 + 1) * a[i] + span * (u3 - 2 * u2 + u) * out[i] + (3 * u2 - 2 * u3) * b[i] +
               span * (u3 - u2) * in[i];
    } else if (rotation) {
      normalize_rotation(a), normalize_rotation(b);
      double cosine = 0;
      for (size_t i = 0; i < 4; ++i) cosine += a[i] * b[i];
      const double sign = cosine < 0 ? -1 : 1, angle = std::acos(std::min(1.0, std::abs(cosine))),
                   sine = std::sin(angle);
      // Nearly equal rotations: the chord is the arc.
      const double wa = sine > 1e-6 ? std::sin((1 - u) * angle) / sine : 1 - u,
                   wb = sine > 1e-6 ? std::sin(u * angle) / sine : u;
      for (size_t i = 0; i < 4; ++i) a[i] = wa * a[i] + sign * wb * b[i];
    } else {
      for (size_t i = 0; i < c.width; ++i) a[i] += u * (b[i] - a[i]);
    }
  }
  if (rotation) normalize_rotation(a);
  return a;
}

template <class F>
bool for_channels(GltfCheck& check, const GltfDocument& document, size_t animation, F&& use) {
  const GltfWhere where{"animation", animation};
  const Json& json = gltf_item(document.json, "animations", animation);
  const Json* channels = check.array(json, "channels", where);
  if (!check.ok()) return false;
  if (!channels) return check.fail(where, "has no channels");
  for (const Json& channel : *channels) {
    auto c = read_channel(check, document, json, channel, where);
    if (!check.ok() || (c && !check_keys(check, *c, where))) return false;
    if (c) use(*c);
  }
  return true;
}

}  // namespace

std::string animation_name(const GltfDocument& document, size_t animation) {
  GltfCheck check("");
  return check.text(gltf_item(document.json, "animations", animation), "name", {});
}

bool read_times(GltfCheck& check, const GltfDocument& document, size_t animation, double& from, double& to) {
  from = INFINITY, to = -INFINITY;
  if (!for_channels(check, document, animation, [&](const Channel& c) {
        from = std::min(from, key_time(c, 0)), to = std::max(to, key_time(c, c.input.count - 1));
      }))
    return false;
  if (from > to) from = to = 0;
  return true;
}

bool animate_nodes(GltfCheck& check, const GltfDocument& document, size_t animation, double time, Json& nodes) {
  nodes = document.json.contains("nodes") ? document.json["nodes"] : Json::array();
  return for_channels(check, document, animation, [&](const Channel& c) {
    nodes[c.node].erase("matrix");  // of a node that is animated there should be none
    nodes[c.node][c.path] = evaluate(c, time);
  });
}

}  // namespace lambent
