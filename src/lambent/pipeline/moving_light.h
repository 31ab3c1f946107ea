#pragma once
// Light among objects that move and the scene under them: what lamps send, what objects reflect, and the scene's
// bounces of lamps' light. Nothing of the scene's own light under the sky is here (draw_moving.h).
#include <lambent/bake/operator.h>
#include <lambent/pipeline/movers.h>
#include <lambent/pipeline/request.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// Of the lattice, relit: what arrives at an object's receivers.
struct FreeSpace {
  Lattice lattice;
  std::vector<uint8_t> valid;
  int order = 0;
  Relit all, peaks;
  // For objects that reflect a part of the sky at a time: where there are peaks, both with those under a window.
  Relit soft = {}, soft_peaks = {};
};

// How light goes from surface to surface of the scene alone.
struct SceneBounces {
  Receivers receivers;
  std::unique_ptr<GatherSetup> setup;
  std::unique_ptr<GatherOperator> op;
};

// All that does not move, and its light: of the whole, and of the light's peaks where it has any.
struct MovingScene {
  MovingReceivers receivers;
  int order = 0;  // bands of the light straight from the sky
  Relit all = {}, peaks = {};
  FreeSpace space = {};
  int light_order = 0;
  std::optional<Tracer> tracer = std::nullopt;  // of the scene alone, where objects shine or reflect
  float diagonal = 0;
  std::optional<SceneBounces> bounces = std::nullopt;  // where lamps move
};

// Traces the scene's rays for what lamps' light does after it has met it. Nothing where the file's receivers are not
// those of its scene, which is warned of. `s.tracer` is there. Errors: cancelled.
Result<void> add_bounces(MovingScene& s, const Baked& baked, const Job& job);

// What lamps and reflections of a frame leave on what they light.
class LightAmongMovers {
 public:
  LightAmongMovers(const MovingScene& scene, const Baked& baked, std::vector<Mover>& movers, LampShader& shader,
                   MovingShader& sky, int lamp_bounces)
      : s_(scene), baked_(baked), movers_(movers), lamps_(shader), sky_(sky), lamp_bounces_(lamp_bounces) {}

  // Makes what objects reflect, and adds all to the scene's light.
  void light_scene(Relit& values);
  // Adds all to an object's light; after light_scene().
  void light_object(const Mover& mover, Relit& values);
  // For objects whose transfer is not multiplied but relit under a light of each receiver's own: what arrives there of
  // free space under that light, and what lamps and objects send; [receiver][order^2], world axes.
  std::vector<Vec3> arriving_at_each(const Mover& mover, const Relit& space, int order) const;
  std::vector<Vec3> sent_to_each(const Mover& mover, int order) const;
  bool sends_to(const Mover& mover) const;  // whether there is any of the latter

 private:
  // Lamps, or reflections, of all objects but `self`; `open` is what the lamps refer to.
  std::vector<SeenLamp> seen_from(const MovingReceivers& receivers, const Mover* self, bool reflections,
                                  std::vector<std::vector<float>>& open) const;
  void add(const MovingReceivers& receivers, const Mover* self, bool reflections, Relit& values);
  void bounce_lamps(const Relit& direct, Relit& values);
  std::vector<Vec3> arriving_at(const Mover& mover) const;
  std::vector<Vec3> scene_light(Vec3 from, int order) const;

  const MovingScene& s_;
  const Baked& baked_;
  std::vector<Mover>& movers_;
  LampShader& lamps_;
  MovingShader& sky_;
  int lamp_bounces_ = 0;
  Relit
      lit_;  // of lamps: what leaves the scene's receivers, were they white; empty where none shines or nothing bounces
};

}  // namespace lambent
