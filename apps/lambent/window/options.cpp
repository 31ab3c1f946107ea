#include "window.h"

namespace lambent::tool {

void WindowOptions::add_to(CLI::App& command) {
  const char* group = "In a window";
  command.add_flag("--window", window, "A window of its own in place of the browser's page")->group(group);
  command.add_option("more", more, "With --window: more baked files, to compare with")->group(group);
  command.add_option("--script", script, "With --window: do what this file says, an action a line, and end")
      ->group(group);
  command.add_option("--size", size, "With --window: its size, WIDTHxHEIGHT")->group(group)->capture_default_str();
  command.add_option("--spp", spp, "With --window: rays a pixel, once nothing moves")
      ->check(CLI::Range(1, 4096))
      ->group(group)
      ->capture_default_str();
  command.add_option("--brdf", brdf, "With --window: other materials, as for render")->group(group);
  command.add_option("--insert", insert, "With --window: an object put into the scene, as for render")->group(group);
  command.add_option("--place", place, "With --window: an object over the scene, as for render")->group(group);
  command.add_option("--move", move, "With --window: the path of one, as for render")->group(group);
  command.add_option("--method", method, "With --window: how blocks are multiplied, as for render")->group(group);
  command.add_option("--light-order", light_order, "With --window: bands to begin with, as for render")
      ->check(CLI::Range(1, max_sh_order))
      ->group(group);
}

}  // namespace lambent::tool
