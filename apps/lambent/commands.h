#pragma once
#include "terminal.h"

#include <CLI/CLI.hpp>

#include <functional>

namespace lambent::tool {

// Each adds its subcommand and says, by `run`, what to do if it is chosen; that returns the exit code.
using Run = std::function<int(Context&)>;
void add_bake(CLI::App& app, Run& run);
void add_batch(CLI::App& app, Run& run);
void add_checkpoints(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_relight(CLI::App& app, Run& run);
void add_reference(CLI::App& app, Run& run);
void add_compare(CLI::App& app, Run& run);
void add_check(CLI::App& app, Run& run);
void add_compress(CLI::App& app, Run& run);
void add_patch(CLI::App& app, Run& run);
void add_inspect(CLI::App& app, Run& run);
void add_field(CLI::App& app, Run& run);
void add_env(CLI::App& app, Run& run);
void add_demo(CLI::App& app, Run& run);
void add_view(CLI::App& app, Run& run);
void add_export(CLI::App& app, Run& run);
void add_bench(CLI::App& app, Run& run);
void add_options(CLI::App& app, Run& run);

}  // namespace lambent::tool
