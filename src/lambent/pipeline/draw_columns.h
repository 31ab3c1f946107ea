#pragma once
// Drawing by columns of light, step by step: light -> rows -> pixels. draw() goes through all of it; who draws frame
// after frame (live.h) goes on from the first step whose input changed.
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/draw_insert.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/motion.h>
#include <lambent/relight/relighter.h>

#include <deque>

namespace lambent {

// A drawing by columns of light under way. What it is made of must outlive it.
struct ColumnDrawing {
  const Baked& baked;
  const DrawRequest& request;
  const Job& job;
  Show show;
  std::vector<Insertion> insertions;
  std::vector<std::shared_ptr<const InsertedObject>> inserted = {};  // one for each, once they are made
  Surroundings around;
  ColumnLight light;
  double time = request.time;              // of lamps of the light that move
  Rows rows = {};                          // the surface's, or those of other materials
  std::deque<Field> terms = {};            // of the Neumann series, where they are drawn one by one
  std::vector<Relighter> relighters = {};  // what they give is summed
  std::vector<Relighter> of_peaks = {};    // the same of the light's peaks; none where nothing rings
  std::vector<Vec3> emission = {};
  Relit peaks = {};          // T . their light, where rows are held above 0 at once
  HaarReading reading = {};  // of wavelets
  double relight_seconds = 1e9;

  const Placement& where() const { return baked.surface.where; }
  const Scene& scene() const { return baked.scene; }
  size_t receivers() const { return receivers_of(baked.surface.store); }
  // Only lobes turn with the surface, and have a light of each receiver's own.
  bool turns() const { return std::holds_alternative<ZonalTransfer>(baked.surface.store); }
};

// What is shown and by which materials. Errors: those of the little syntaxes, and of change_materials().
Result<ColumnDrawing> begin_columns(const Baked& baked, const DrawRequest& request, const Job& job);
// From `around`: the light, and what lamps are seen to emit.
Result<void> choose_light(ColumnDrawing& d);
// After another time: lamps of the light that move. Needs set_lights() then.
Result<void> choose_time(ColumnDrawing& d, double time);
// Needs the light, and sets it.
Result<void> make_relighters(ColumnDrawing& d);
// Again, after the light has changed.
Result<void> set_lights(ColumnDrawing& d);
// T . light, in that pose; `peaks` is of light's peaks, where rows have still to be held above 0, else empty. `seen`:
// of no other receivers than these, where the store can.
Result<void> relight(ColumnDrawing& d, const std::optional<Pose>& pose, Relit& out, Relit& peaks,
                     const std::vector<uint32_t>* seen = nullptr);
// Whether it can.
bool relights_in_part(const ColumnDrawing& d);
// The rows' meaning, turned with the surface where it can be.
Rows posed_rows(const ColumnDrawing& d, const std::optional<Pose>& pose);
// Objects of `insertions` that are not made yet; those of `known` need not be made again. Errors: make_inserted()'s.
Result<void> make_insertions(ColumnDrawing& d, std::span<const std::shared_ptr<const InsertedObject>> known = {});
// The scene with what is inserted, all of it relit; needs the light, and the objects made.
Result<RelitScene> with_insertions(const ColumnDrawing& d, Relit relit);
// O(view), a whole picture.
Result<Image> shade(ColumnDrawing& d, const std::optional<Pose>& pose, Relit relit, const Relit& peaks,
                    const View& view);

}  // namespace lambent
