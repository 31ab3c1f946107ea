// `lambent render` and `lambent relight`: fill in a request and say what came of it.
#include "commands.h"
#include "table.h"

#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/relight_loop.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

Job job_of(Context& context) {
  return {&context.progress, [](const std::string& message) { warn(message); }};
}

int say(const Context& context, const std::string& of, const Result<Summary>& summary) {
  if (!summary) return fail(summary.error());
  if (!context.json) fmt::print("{}\n", of);
  print_summary(context, *summary);
  return success;
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
  auto o = std::make_shared<DrawRequest>();
  CLI::App* c = app.add_subcommand("render", "Relight a baked scene and draw it");
  c->add_option("baked", o->baked, "Baked file, from `lambent bake`; with --transfer-texture, any scene")->required();
  add_table(*c, draw_options(), *o, o->given, [](const std::string& name) { return name != "baked"; });
  c->get_option("--output")->required();
  c->callback([o, &run] {
    run = [o](Context& context) { return say(context, o->output, draw_to_file(*o, job_of(context))); };
  });
}

void add_relight(CLI::App& app, Run& run) {
  auto o = std::make_shared<LoopRequest>();
  CLI::App* c = app.add_subcommand(
      "relight", "Run the interactive loop over visibility in blocks without a window, and say what it takes");
  c->add_option("baked", o->draw.baked, "Baked file, from `lambent bake --transfer blocks`")->required();
  const auto table = loop_options();
  add_table(*c, std::span<const Option<DrawRequest>>(table), o->draw, o->draw.given,
            [](const std::string& name) { return name != "baked"; });
  c->add_flag("--turntable", o->turntable, "The eye goes once around its target");
  c->add_flag("--spin-light", o->spin_light, "The light goes once around, rebuilt for each frame");
  c->add_option("--frames", o->frames, "How many")->check(CLI::Range(1, 100000))->capture_default_str();
  c->callback([o, &run] {
    run = [o](Context& context) { return say(context, o->draw.baked, relight_loop(*o, job_of(context))); };
  });
}

}  // namespace lambent::tool
