#include "commands.h"
#include "together.h"

#include <lambent/core/file.h>
#include <lambent/core/parallel.h>
#include <lambent/pipeline/version.h>

#include <fcntl.h>
#include <fmt/format.h>

#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <iostream>
#include <new>
#include <thread>

using namespace lambent;

namespace {

// A standard stream that was closed: files that are opened must not get its number, and be written into.
void open_standard_streams() {
  for (int fd = 0; fd <= 2; ++fd)
    if (::fcntl(fd, F_GETFD) < 0) (void)!::open("/dev/null", fd == 2 ? O_WRONLY : O_RDONLY);
}

// Results that went nowhere are a failure.
int with_results_written(int code) {
  std::cout.flush();
  const bool well = std::fflush(stdout) == 0 && !std::ferror(stdout) && std::cout;
  if (well || code != tool::success) return code;
  return tool::fail({"stdout", std::string("cannot be written: ") + std::strerror(errno ? errno : EIO)});
}

int run_command(tool::Context& context, const tool::Run& run) {
  ThreadLimit limit(context.threads);
  const ReadLog inputs;  // none is written over
  try {
    return with_results_written(run(context));
  } catch (const std::bad_alloc&) {
    return tool::fail({"", "out of memory"});
  } catch (const std::exception& e) {  // the system's: no thread can be made, nothing can be printed
    return tool::fail({"", e.what()});
  }
}

// As one of several processes that mpirun or the like has started.
int run_as_rank(tool::Context& context, const tool::Run& run, const std::string& command, int count) {
  if (command != "bake")
    return tool::fail({"", fmt::format("{} processes were started, and only bake works by ranks", count), true});
  if (!tool::has_ranks())
    return tool::fail({"", fmt::format("{} processes were started, and this lambent is built without MPI", count)});
  const auto ranks = tool::Together::begin();
  const WithRanks together(*ranks);
  // Those of one machine share its cores, unless the launcher has done so.
  const auto cores = unsigned(std::max(1L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  if (context.threads == 0 && std::thread::hardware_concurrency() >= cores)
    context.threads = std::max(1, int(cores) / ranks->local_count());
  const int code = run_command(context, run);
  return ranks->end(code, [&] { tool::say_failure(fmt::format("rank {}", ranks->rank())); });
}

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  const tool::Launched launched = tool::launched();
  if (launched.rank > 0) tool::be_quiet();
  ::signal(SIGXFSZ, SIG_IGN);  // a limit on files is an error of the write
  CLI::App app{"lambent: bake how a scene shadows and scatters light, once; relight it for ever.", "lambent"};
  app.set_version_flag("--version", version);
  app.require_subcommand(1);
  app.fallthrough();
  tool::Context context;
  app.add_flag("--json", context.json, "Results as JSON");
  std::string progress = "text";
  app.add_option("--progress", progress,
                 "On stderr: text, or json, an object a line: {\"stage\": ..., \"fraction\": ...}")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  app.add_option("--threads", context.threads, "Threads to use; 0: all cores")->check(CLI::Range(0, 1024));

  tool::Run run;
  tool::add_bake(app, run);
  tool::add_batch(app, run);
  tool::add_checkpoints(app, run);
  tool::add_render(app, run);
  tool::add_relight(app, run);
  tool::add_reference(app, run);
  tool::add_compare(app, run);
  tool::add_check(app, run);
  tool::add_compress(app, run);
  tool::add_patch(app, run);
  tool::add_field(app, run);
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
    if (tool::is_quiet()) return e.get_exit_code() == 0 ? tool::success : tool::bad_usage;
    if (e.get_exit_code() == 0) return with_results_written(app.exit(e));  // --help, --version
    fmt::print(stderr, "lambent: {}\n", e.what());
    return tool::bad_usage;
  }
  context.json_progress = progress == "json";
  if (launched.count == 1) return run_command(context, run);
  return run_as_rank(context, run, app.get_subcommands().front()->get_name(), launched.count);
}
