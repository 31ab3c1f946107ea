#pragma once
// Relief as geometry, from the command line.
#include <lambent/pipeline/relief.h>

#include <CLI/CLI.hpp>

namespace lambent::tool {

struct DisplaceOptions : Displacement {
  void add_to(CLI::App& command);
};

}  // namespace lambent::tool
