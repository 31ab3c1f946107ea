#include "commands.h"

#include <lambent/core/parallel.h>
#include <lambent/pipeline/version.h>

#include <fmt/format.h>

#include <new>

using namespace lambent;

int main(int argc, char** argv) {
  CLI::App app{"lambent: bake how a scene shadows and scatters light, once; relight it for ever.", "lambent"};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  app.fallthrough();
  tool::Context context;
  app.add_flag("--json", context.json, "Results as JSON");
  app.add_option("--threads", context.threads, "Threads to use; 0: all cores")->check(CLI::Range(0, 1024));

  tool::Run run;
  tool::add_bake(app, run);
  tool::add_render(app, run);
  tool::add_relight(app, run);
  tool::add_reference(app, run);
  tool::add_compare(app, run);
  tool::add_check(app, run);
  tool::add_compress(app, run);
  tool::add_patch(app, run);
  tool::add_inspect(app, run);
  tool::add_env(app, run);
  tool::add_demo(app, run);
  tool::add_view(app, run);
  tool::add_export(app, run);
  tool::add_bench(app, run);
  tool::add_options(app, run);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    fmt::print(stderr, "lambent: {}\n", e.what());
    return tool::bad_usage;
  }
  ThreadLimit limit(context.threads);
  try {
    return run(context);
  } catch (const std::bad_alloc&) {
    return tool::fail({"", "out of memory"});
  }
}
