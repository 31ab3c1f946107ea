#include "commands.h"
#include "serve.h"
#include "window/window.h"

#include <fmt/format.h>
#include <spawn.h>

namespace lambent::tool {
namespace {

struct ViewCommand {
  WebOptions web;
  WindowOptions window;
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

// In a window of its own.
int run_window(Context& context, const ViewCommand& o) {
  SessionOptions session{.baked = {o.web.baked}, .env = o.web.env, .reference = o.web.reference};
  if (!o.web.compare.empty()) session.baked.push_back(o.web.compare);
  session.baked.insert(session.baked.end(), o.window.more.begin(), o.window.more.end());
  DrawRequest& draw = session.draw;
  draw = o.window.draw, draw.given.clear();  // what is as it would be counts as not said
  draw.camera = o.web.camera, draw.exposure = o.web.exposure, draw.tone = o.web.tone;
  if (!o.web.rotate.empty()) draw.env_rotate = o.web.rotate;
  const Job job{&context.progress, [](const std::string& message) { warn(message); }};
  auto shown = run_window(session, o.window, job);
  return shown ? success : fail(shown.error());
}

// Options of the one that the other has no use for, by name.
Result<void> check_view(const CLI::App& command, bool window) {
  for (const char* option : {"--port", "--no-browser"})
    if (window && command.count(option))
      return Error{option, "is of the page that a browser shows, not of --window", true};
  std::vector<std::string> of_window{"more", "--script", "--size"};
  for (const Option<DrawRequest>& o : draw_options())
    if (WindowOptions::takes(o.name) && o.name != std::string_view("insert"))
      of_window.push_back(std::string("--") + o.name);
  for (const std::string& option : of_window)
    if (!window && command.count(option)) return Error{option, "is for --window", true};
  return {};
}

int run_view(Context& context, const ViewCommand& o, const CLI::App& command) {
  if (auto ok = check_view(command, o.window.window); !ok) return fail(ok.error());
  context.cleans_up = true;
  if (o.window.window) return run_window(context, o);
  WebOptions web = o.web;
  web.insert = o.window.draw.insert;  // one option, of both
  auto files = web_files(web, {&context.progress, [](const std::string& message) { warn(message); }});
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
  CLI::App* c =
      app.add_subcommand("view", "Show a baked file in the browser, or in a window; the light turns under the hand");
  o->web.add_to(*c);
  o->window.add_to(*c);
  c->add_option("--port", o->port, "Port on 127.0.0.1; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  c->add_flag("--no-browser", o->no_browser, "Only print the address");
  c->callback([o, c, &run] { run = [o, c](Context& context) { return run_view(context, *o, *c); }; });
}

}  // namespace lambent::tool
