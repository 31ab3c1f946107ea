// `lambent bake`: fills in a request and says what came of it.
#include "commands.h"
#include "table.h"

#include <lambent/core/ranks.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/draw_request.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct BakeCommand {
  BakeRequest request;
  std::string from_json, again;
  bool plan = false;
};

// What is said on the command line goes over what the file says.
Result<BakeRequest> asked(const BakeCommand& o) {
  if (o.from_json.empty() && o.again.empty()) return o.request;
  auto base = o.again.empty() ? load_bake_request(o.from_json) : request_of_baked_file(o.again, o.request.scene);
  if (!base) return base;
  say_over(bake_options(), o.request, *base);
  return base;
}

int run_bake(Context& context, const BakeCommand& o) {
  auto request = asked(o);
  if (!request) return fail(request.error());
  if (request->scene.empty()) return fail({"scene", "is needed: a .gltf, .glb, .obj or .ply", true});
  if (request->output.empty() && !o.plan) return fail({"--output", "is needed: the baked file to write", true});
  const Job job{&context.progress, [](const std::string& message) { warn(message); }};
  if (o.plan && is_quiet()) return success;
  Ranks alone;
  const WithRanks by(o.plan ? alone : this_ranks());
  auto summary = o.plan ? plan_bake(*request, job) : bake_to_file(*request, job);
  if (!summary) return fail(summary.error());
  if (is_quiet()) return success;
  if (!context.json) {
    if (!o.plan) fmt::print("{}\n", request->output);
    if (const auto pictures = summary->json.find("pictures"); pictures != summary->json.end())
      for (const auto& picture : *pictures) fmt::print("{}\n", picture.get<std::string>());
  }
  print_summary(context, *summary);
  return success;
}

}  // namespace

void add_bake(CLI::App& app, Run& run) {
  auto o = std::make_shared<BakeCommand>();
  CLI::App* c = app.add_subcommand("bake", "Bake a scene's light transport");
  c->add_option("scene", o->request.scene, "Scene: .gltf, .glb, .obj or .ply")->each([o](const std::string&) {
    o->request.given.insert("scene");
  });
  auto* from = c->add_option("--request", o->from_json, "The options below as a JSON file; options here go over it");
  c->add_option("--again", o->again, "Bake as this baked file was: the same bytes")->excludes(from);
  c->add_flag("--dry-run", o->plan, "Say the request, receivers, bytes and the time it would take, and bake nothing");
  add_table(*c, bake_options(), o->request, o->request.given, [](const std::string& name) { return name != "scene"; });
  c->callback([o, &run] { run = [o](Context& context) { return run_bake(context, *o); }; });
}

void add_options(CLI::App& app, Run& run) {
  CLI::App* c = app.add_subcommand("options", "Print the table of options and kinds, as docs/options.md has it");
  c->group("");
  c->callback([&run] {
    run = [](Context&) {
      fmt::print(
          "# Options and kinds\n\nMade by `lambent options`. An option that a kind would leave aside is refused by "
          "name, and a test says every\noption to every kind.\n\n## bake\n\n{}\n## render\n\n{}",
          options_markdown(bake_options(), bake_kind_names), options_markdown(draw_options(), draw_kind_names));
      return success;
    };
  });
}

}  // namespace lambent::tool
