#include "commands.h"
#include "serve.h"

#include <fmt/format.h>
#include <spawn.h>

namespace lambent::tool {
namespace {

struct ViewCommand {
  WebOptions web;
  int port = 0;
  bool no_browser = false;
};

void open_browser(const std::string& address) {
  const auto is_set = [](const char* name) {
    const char* value = std::getenv(name);
    return value && *value;
  };
  if (!is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY")) return;
  char program[] = "xdg-open";
  std::string argument = address;
  char* const arguments[] = {program, argument.data(), nullptr};
  pid_t child;
  if (::posix_spawnp(&child, program, nullptr, nullptr, arguments, environ) != 0)
    warn("no browser could be started: open the address by hand");
}

int run_view(Context& context, const ViewCommand& o) {
  context.cleans_up = true;
  auto files = web_files(o.web);
  if (!files) return fail(files.error());
  auto listener = listen_on(o.port);
  if (!listener) return fail(listener.error());
  const std::string address = fmt::format("http://127.0.0.1:{}/", listener->port);
  if (context.json) print_json({{"address", address}});
  else fmt::print("{} is at {} (Ctrl-C ends it)\n", o.web.baked, address);
  std::fflush(stdout);
  if (!o.no_browser) open_browser(address);
  serve(*listener, *files, [&] { return context.progress.cancelled(); });
  return success;
}

}  // namespace

void add_view(CLI::App& app, Run& run) {
  auto o = std::make_shared<ViewCommand>();
  CLI::App* c = app.add_subcommand("view", "Show a baked file in the browser; the light turns under the hand");
  o->web.add_to(*c);
  c->add_option("--port", o->port, "Port on 127.0.0.1; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  c->add_flag("--no-browser", o->no_browser, "Only print the address");
  c->callback([o, &run] { run = [o](Context& context) { return run_view(context, *o); }; });
}

}  // namespace lambent::tool
