#pragma once
// The interactive loop over visibility in blocks, without a window: `lambent relight`.
#include <lambent/pipeline/draw.h>

namespace lambent {

struct LoopRequest {
  DrawRequest draw;         // baked, env, env_rotate, camera and size, brdf, method, brdf_samples, tolerance
  bool turntable = false;   // the eye goes once around its target
  bool spin_light = false;  // the light goes once around, rebuilt for each frame
  int frames = 60;
};

// What the frames take, part by part. Errors: as draw(); other options of `draw` that were given; another kind of file.
// Cancelled, it says what was done until then.
Result<Summary> relight_loop(const LoopRequest& request, const Job& job = {});

// The options of `draw` that the loop takes.
std::vector<Option<DrawRequest>> loop_options();

}  // namespace lambent
