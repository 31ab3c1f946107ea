#pragma once
// One pose of a scene, from the command line.
#include <lambent/pipeline/motion.h>

#include <CLI/CLI.hpp>

namespace lambent::tool {

struct MotionOptions : Motion {
  void add_to(CLI::App& command);
};

}  // namespace lambent::tool
