#pragma once
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/motion.h>
#include <lambent/relight/relighter.h>
#include <lambent/render/transfer_texture.h>

namespace lambent {

// draw() with a transfer texture: any scene, moving or not, baked or not.
Result<Drawing> draw_texture(const DrawRequest& request, const Job& job);

// Step by step. How the request lays the texture on surfaces. Errors: grooves of a texture that has none; files.
Result<TextureUse> texture_use(const DrawRequest& request, const ZonalTexture& texture, const Job& job);

// --wrinkle: where a pose presses the surface, the direction of grooves and their depths. Directions are of all of an
// animation, so that grooves stay where they are in it.
class Wrinkles {
 public:
  // Errors: text that cannot be read, animations that cannot be played; nothing that moves.
  static Result<Wrinkles> make(const DrawRequest& request, const TextureUse& use, const Scene& scene, const Job& job);
  void press(const Scene& scene, const std::optional<Pose>& pose, TextureUse& use) const;

 private:
  std::vector<Vec2> tile_;  // empty: none were asked for
  float limit_ = 0;
};

// Why what was baked cannot light the relief; empty where it can.
std::string cannot_light(const Baked& baked, const DrawRequest& request);

// The light that arrives at what was baked; `peaks` where it has any.
struct ArrivingParts {
  std::optional<ArrivingLight> all, peaks;
};
Result<ArrivingParts> relight_arriving(Relighter& relighter, const Baked& baked, const DrawRequest& request,
                                       const Surroundings& around);

}  // namespace lambent
