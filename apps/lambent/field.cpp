// `lambent field`: what an object does to the light around it.
#include "commands.h"
#include "table.h"

#include <lambent/pipeline/field_request.h>

#include <fmt/format.h>

namespace lambent::tool {

void add_field(CLI::App& app, Run& run) {
  auto o = std::make_shared<FieldRequest>();
  CLI::App* c = app.add_subcommand(
      "field", "Store how an object hides light around it, for objects that move over a scene (render --place)");
  c->add_option("object", o->object, "The object: .gltf, .glb, .obj or .ply; or a baked file of it")->required();
  add_table(*c, field_options(), *o, o->given, [](const std::string& name) { return name != "object"; });
  c->callback([o, &run] {
    run = [o](Context& context) {
      if (o->output.empty()) return fail({"--output", "is needed: the field to write", true});
      auto summary = field_to_file(*o, {&context.progress, [](const std::string& message) { warn(message); }});
      if (!summary) return fail(summary.error());
      if (!context.json) fmt::print("{}\n", o->output);
      print_summary(context, *summary);
      return success;
    };
  });
}

}  // namespace lambent::tool
