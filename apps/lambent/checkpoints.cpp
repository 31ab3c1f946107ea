// `lambent checkpoints`: what interrupted bakes have left, and the end of it.
#include "commands.h"

#include <lambent/pipeline/durable.h>

#include <fmt/format.h>

#include <filesystem>

namespace lambent::tool {
namespace {

namespace fs = std::filesystem;

struct CheckpointsCommand {
  std::vector<std::string> folders;
  bool clean = false;
};

std::string age(double seconds) {
  return seconds < 7200 ? human_seconds(seconds) : fmt::format("{:.0f} hours", seconds / 3600);
}

// Temporaries of killed writers, in a folder and below.
std::vector<std::string> temporaries_below(const std::string& folder) {
  std::vector<std::string> out = stale_temporaries(folder);
  std::error_code status;
  for (auto entry = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, status);
       !status && entry != fs::recursive_directory_iterator(); entry.increment(status))
    if (entry->is_directory(status) && !entry->is_symlink(status))
      for (std::string& file : stale_temporaries(entry->path().string())) out.push_back(std::move(file));
  return out;
}

int run_checkpoints(Context& context, const CheckpointsCommand& o) {
  nlohmann::json list = nlohmann::json::array();
  std::vector<std::string> lines;
  bool failed = false;
  for (const std::string& folder : o.folders.empty() ? std::vector<std::string>{"."} : o.folders) {
    std::error_code status;
    if (!fs::is_directory(folder, status)) return fail({folder, "is no folder"});
    for (const CheckpointFound& c : find_checkpoints(folder)) {
      // One that is named itself goes, whatever it is.
      const bool goes = o.clean && !c.in_use && (!c.stale.empty() || c.folder == fs::path(folder));
      std::string state = c.in_use ? "in use" : c.stale.empty() ? "can go on" : "stale: " + c.stale;
      if (goes) {
        if (auto ok = remove_checkpoint(c.folder); !ok) failed = true, fail(ok.error());
        else state = "removed";
      }
      list.push_back({{"folder", c.folder},
                      {"scene", c.scene},
                      {"output", c.output},
                      {"bytes", c.bytes},
                      {"age", c.age},
                      {"state", state}});
      lines.push_back(fmt::format("{}\n  {} for {}, {}, kept {} ago\n  {}", c.folder, c.scene, c.output,
                                  human_bytes(double(c.bytes)), age(c.age), state));
    }
    for (const std::string& file : temporaries_below(folder)) {
      if (o.clean) fs::remove_all(file, status);
      list.push_back({{"temporary", file}, {"state", o.clean ? "removed" : "left by a killed program"}});
      lines.push_back(file + "\n  " + (o.clean ? "removed" : "left by a killed program"));
    }
  }
  if (context.json) print_json({{"checkpoints", list}});
  else fmt::print("{}\n", lines.empty() ? "no checkpoints" : fmt::format("{}", fmt::join(lines, "\n")));
  return failed ? failure : success;
}

}  // namespace

void add_checkpoints(CLI::App& app, Run& run) {
  auto o = std::make_shared<CheckpointsCommand>();
  CLI::App* c = app.add_subcommand("checkpoints", "List what interrupted bakes have kept, and remove it");
  c->add_option("folders", o->folders, "Where to look, with the folders below; the current one if none is named");
  c->add_flag("--clean", o->clean,
              "Remove those that cannot be gone on with, those that are named themselves, and what killed programs "
              "left half-written");
  c->callback([o, &run] { run = [o](Context& context) { return run_checkpoints(context, *o); }; });
}

}  // namespace lambent::tool
