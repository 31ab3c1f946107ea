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

// What is said on the command line goes over what the file says.
Result<DrawRequest> asked(const DrawRequest& said, const std::string& from_json,
                          std::span<const Option<DrawRequest>> table) {
  if (from_json.empty()) return said;
  DrawRequest request;
  if (auto ok = load_request(table, from_json, request, request.given); !ok) return ok.error();
  say_over(table, said, request);
  return request;
}

// The option --request, and the baked file, which the request may name.
void add_request(CLI::App& command, DrawRequest& request, std::string& from_json, const char* help) {
  command.add_option("baked", request.baked, help)->each([&request](const std::string&) {
    request.given.insert("baked");
  });
  command.add_option("--request", from_json, "The options below as a JSON file; options here go over it");
}
const Error no_baked_file{"baked", "is needed: a baked file, from `lambent bake`", true};

int say(const Context& context, const std::string& of, const Result<Summary>& summary) {
  if (!summary) return fail(summary.error());
  if (!context.json) fmt::print("{}\n", of);
  print_summary(context, *summary);
  return success;
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
  struct RenderCommand {
    DrawRequest request;
    std::string from_json;
  };
  auto o = std::make_shared<RenderCommand>();
  CLI::App* c = app.add_subcommand("render", "Relight a baked scene and draw it");
  add_request(*c, o->request, o->from_json, "Baked file, from `lambent bake`; with --transfer-texture, any scene");
  add_table(*c, draw_options(), o->request, o->request.given, [](const std::string& name) { return name != "baked"; });
  c->callback([o, &run] {
    run = [o](Context& context) {
      auto request = asked(o->request, o->from_json, draw_options());
      if (!request) return fail(request.error());
      if (request->baked.empty()) return fail(no_baked_file);
      if (request->output.empty()) return fail({"--output", "is needed: the picture to write", true});
      return say(context, request->output, draw_to_file(*request, job_of(context)));
    };
  });
}

void add_relight(CLI::App& app, Run& run) {
  struct RelightCommand {
    LoopRequest loop;
    std::string from_json;
  };
  auto o = std::make_shared<RelightCommand>();
  CLI::App* c = app.add_subcommand(
      "relight", "Run the interactive loop over visibility in blocks without a window, and say what it takes");
  add_request(*c, o->loop.draw, o->from_json, "Baked file, from `lambent bake --transfer blocks`");
  const auto table = loop_options();
  add_table(*c, std::span<const Option<DrawRequest>>(table), o->loop.draw, o->loop.draw.given,
            [](const std::string& name) { return name != "baked"; });
  c->add_flag("--turntable", o->loop.turntable, "The eye goes once around its target");
  c->add_flag("--spin-light", o->loop.spin_light, "The light goes once around, rebuilt for each frame");
  c->add_option("--frames", o->loop.frames, "How many")->check(CLI::Range(1, 100000))->capture_default_str();
  c->callback([o, &run] {
    run = [o](Context& context) {
      const auto table = loop_options();
      auto request = asked(o->loop.draw, o->from_json, table);
      if (!request) return fail(request.error());
      if (request->baked.empty()) return fail(no_baked_file);
      LoopRequest loop = o->loop;
      loop.draw = std::move(*request);
      return say(context, loop.draw.baked, relight_loop(loop, job_of(context)));
    };
  });
}

}  // namespace lambent::tool
