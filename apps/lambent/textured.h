#pragma once
// Scenes that carry a transfer texture.
#include "commands.h"
#include "motion.h"
#include "options.h"

#include <lambent/relight/local_light.h>
#include <lambent/render/render.h>

namespace lambent::tool {

struct TexturedFlags {
  std::string texture, tile = "1,1", groove_map;
  float groove_depth = 0, groove_width = 1;  // depth 0: the table's deepest
  bool grooves() const { return groove_depth > 0 || groove_width != 1 || !groove_map.empty(); }
  void add_to(CLI::App& command);
};

struct TexturedRender {
  std::string scene;
  TexturedFlags flags;
  LightOptions light;
  std::vector<SphereLamp> lamps;
  ViewOptions view;
  MotionOptions motion;
  ShWindow window;
  int light_order, samples;
  RenderOptions::Show show;
};

// Any mesh, animated or not, with a transfer texture on it.
int run_textured(Context& context, const TexturedRender& o);

}  // namespace lambent::tool
