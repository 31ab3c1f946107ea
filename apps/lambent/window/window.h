#pragma once
#include "../terminal.h"
#include "session.h"

#include <CLI/CLI.hpp>

namespace lambent::tool {

struct WindowOptions {
  bool window = false;
  std::vector<std::string> more;  // bakes to compare with
  std::string script, size = "1280x800", brdf, method;
  std::vector<std::string> insert, place, move;  // as for render
  int spp = 16, light_order = 0;
  void add_to(CLI::App& command);
};

// Shows the session in a window of its own until it is closed or its script ends. Errors: no display, no OpenGL 3.3, a
// script's action that fails; of a build without windows, that.
Result<void> run_window(const SessionOptions& session, const WindowOptions& options, const Job& job);

}  // namespace lambent::tool
