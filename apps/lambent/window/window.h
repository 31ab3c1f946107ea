#pragma once
#include "../terminal.h"
#include "session.h"

#include <CLI/CLI.hpp>

namespace lambent::tool {

struct WindowOptions {
  bool window = false;
  std::vector<std::string> more;  // bakes to compare with
  std::string script, size = "1280x800";
  DrawRequest draw;  // options of render that the page has not
  void add_to(CLI::App& command);
  static bool takes(const std::string& option);  // of draw_options()
};

// Shows the session in a window of its own until it is closed or its script ends. Errors: no display, no OpenGL 3.3, a
// script's action that fails; of a build without windows, that.
Result<void> run_window(const SessionOptions& session, const WindowOptions& options, const Job& job);

}  // namespace lambent::tool
