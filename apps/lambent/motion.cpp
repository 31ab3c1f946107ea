#include "motion.h"

namespace lambent::tool {

void MotionOptions::add_to(CLI::App& c) {
  auto* named = c.add_option("--animation", animation, "Pose the scene by this glTF animation, by name or number");
  c.add_option("--time", time, "At this time, seconds")->needs(named);
  c.add_option("--deform", deform,
               "bend:ANGLE[,along[,towards]] or twist:ANGLE[,along]: degrees from end to end, axes x, y or z")
      ->excludes(named);
}

}  // namespace lambent::tool
