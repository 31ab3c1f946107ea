#include "../table.h"
#include "window.h"

#include <algorithm>

namespace lambent::tool {

void WindowOptions::add_to(CLI::App& command) {
  const char* group = "In a window";
  command.add_flag("--window", window, "A window of its own in place of the browser's page")->group(group);
  command.add_option("more", more, "With --window: more baked files, to compare with")->group(group);
  command.add_option("--script", script, "With --window: do what this file says, an action a line, and end")
      ->group(group);
  command.add_option("--size", size, "With --window: its size, WIDTHxHEIGHT")->group(group)->capture_default_str();
  add_table(command, draw_options(), draw, draw.given, takes);
}

bool WindowOptions::takes(const std::string& option) {
  static const std::vector<std::string> others{"baked", "output",     "env",  "env-rotate", "window", "camera",
                                               "size",  "background", "tone", "exposure",   "frames", "indirect"};
  return std::find(others.begin(), others.end(), option) == others.end();
}

}  // namespace lambent::tool
