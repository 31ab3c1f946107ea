#include "commands.h"
#include "options.h"

#include <lambent/basis/sh_convert.h>
#include <lambent/light/project.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct EnvCommand {
  LightOptions light;
  int order = 6;
  ShWindow window = ShWindow::none;
  std::string convention = "lambent", output;
  DisplayOptions display;
};

// The environment beside its reconstruction, both 512 wide, labelled.
Image side_by_side(const Environment& env, std::span<const Vec3> light) {
  const Environment smooth = reconstruct_environment(light, 512);
  Environment small = make_environment(env.name, 512, 256, [&](Vec3 d) { return radiance_bilinear(env, d); });
  const Image pictures[] = {small.image, smooth.image};
  Image both = beside(pictures);
  draw_text(both, 8, 8, env.name, Vec3(1), 1);
  draw_text(both, 8 + 512, 8, "order " + std::to_string(sh_order(light.size())), Vec3(1), 1);
  return both;
}

int run_env(Context& context, const EnvCommand& o, const CLI::App& command) {
  if (auto ok = check_display_options(o.display, command, o.output); !ok) return fail(ok.error());
  if (!o.output.empty())
    if (auto ok = check_output(o.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto env = load_light(o.light);
  if (!env) return fail(env.error());
  std::vector<Vec3> light = rotate_sh(make_sh_rotation(o.order, *rotation), project_environment(*env, o.order));
  const auto window = apply_sh_window(o.window, light);

  // How much of the environment's power lies within the bands: |projection|^2 / |environment|^2.
  const double all = squared_radiance(*env);
  double kept = 0;
  for (Vec3 c : light) kept += double(dot(c, c));
  const auto converted = convert_sh(light, *parse_sh_convention(o.convention));
  if (context.json) {
    nlohmann::json coefficients = nlohmann::json::array();
    for (Vec3 c : converted) coefficients.push_back({c.x, c.y, c.z});
    print_json({{"environment", env->name},
                {"width", env->image.width},
                {"height", env->image.height},
                {"order", o.order},
                {"convention", o.convention},
                {"window", window},
                {"energy_kept", all > 0 ? kept / all : 1.0},
                {"coefficients", coefficients}});
  } else {
    fmt::print(
        "# {}: {} x {}, order {}, {:.1f}% of the squared radiance within it\n#  l   m           red         green      "
        "    blue\n",
        env->name, env->image.width, env->image.height, o.order, all > 0 ? 100 * kept / all : 100.0);
    for (size_t i = 0; i < converted.size(); ++i) {
      const int l = sh_band(int(i));
      fmt::print("{:4d} {:3d} {:13.6g} {:13.6g} {:13.6g}\n", l, int(i) - l * (l + 1), converted[i].x, converted[i].y,
                 converted[i].z);
    }
  }
  if (!o.output.empty()) {
    if (!o.light.rotate.empty()) *env = rotated(*env, *rotation);
    if (auto ok = save_shown(o.output, side_by_side(*env, light), o.display); !ok) return fail(ok.error());
    if (!context.json) fmt::print("# {}\n", o.output);
  }
  return success;
}

}  // namespace

void add_env(CLI::App& app, Run& run) {
  auto o = std::make_shared<EnvCommand>();
  CLI::App* c = app.add_subcommand("env", "Project an environment onto spherical harmonics");
  c->add_option("env", o->light.env, "Environment: a .hdr or .exr file, uniform:R,G,B, or sky:…")->required();
  c->add_option("--env-rotate", o->light.rotate, "YAW,PITCH,ROLL: turn the environment, degrees about +Y, +X, +Z");
  c->add_option("--order", o->order, "Bands")->check(CLI::Range(1, max_sh_order))->capture_default_str();
  c->add_option("--window", o->window, "Against ringing")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_option("--convention", o->convention, "Whose coefficients to print")
      ->check(CLI::IsMember({"lambent", "three", "unity", "godot", "gltf-ibl"}))
      ->capture_default_str();
  c->add_option("-o,--output", o->output, "Picture to write: the environment beside its reconstruction");
  o->display.add_to(*c);
  c->callback([o, c, &run] { run = [o, c](Context& context) { return run_env(context, *o, *c); }; });
}

}  // namespace lambent::tool
