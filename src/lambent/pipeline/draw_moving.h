#pragma once
// Drawing a baked scene with rigid objects that move over it (--place, --move): relight/moving.h behind draw(), and
// step by step for who draws frame after frame (live.h).
#include <lambent/pipeline/draw_columns.h>
#include <lambent/render/insert.h>

#include <memory>

namespace lambent {

class MovingDrawing {
 public:
  // Reads what request.place, request.move and request.pose name. `baked` and `job` must outlive it. Errors: of both
  // options and of files; a bake over which objects cannot move.
  static Result<MovingDrawing> make(const Baked& baked, const DrawRequest& request, const Job& job);
  MovingDrawing(MovingDrawing&&) noexcept;
  MovingDrawing& operator=(MovingDrawing&&) noexcept;
  ~MovingDrawing();

  // Other objects, places and paths; files that were read are kept. On an error all stays as it was.
  Result<void> change(const DrawRequest& request);
  // The light without the objects: to be called once the light of `d`, a drawing of the same bake, has changed.
  Result<void> set_light(ColumnDrawing& d);
  // Puts the objects where they are at that time. Errors: of their animations.
  Result<void> move_to(double time);
  // The scene with the objects, under that light; and what is seen to shine, by material, where anything does.
  RelitScene lit(const ColumnDrawing& d, std::vector<Vec3>& emission);

  size_t objects() const;
  // Names, and the first triangle of each in lit()'s scene, in the order of request.place.
  const std::vector<std::pair<std::string, size_t>>& parts() const;
  // Pairs of a receiver and an object that were looked at so far, and seconds that lit() took.
  size_t pairs() const;
  size_t tiles() const;
  double seconds() const;
  int light_order() const;

 private:
  struct State;
  explicit MovingDrawing(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// draw() with objects that move.
Result<Drawing> draw_moving(const Baked& baked, const DrawRequest& request, const Job& job);

}  // namespace lambent
