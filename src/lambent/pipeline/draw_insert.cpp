#include <lambent/pipeline/draw_insert.h>

#include <lambent/bake/bake.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>

#include <cmath>

namespace lambent {

Result<Scene> place_object(const Insertion& insertion, const Lattice& lattice, const Job& job) {
  auto object = load_scene(insertion.path);
  if (!object) return object.error();
  for (const std::string& warning : object->warnings) job.warn(warning);
  place_scene(*object, insertion.foot, insertion.scale);
  for (const Vec3& p : object->positions)
    if (!is_finite(p)) return Error{insertion.path, "is too large to be scaled so"};
  const Bounds box = bounds(*object);
  // The outer points stand for half a cell more; of an axis with one point, for all of it.
  Vec3 slack;
  const int points[] = {lattice.nx, lattice.ny, lattice.nz};
  for (int k = 0; k < 3; ++k)
    slack[k] = points[k] > 1 ? 0.51f * (lattice.max[k] - lattice.min[k]) / float(points[k] - 1) : INFINITY;
  if (!all_at_most(lattice.min - slack, box.min) || !all_at_most(box.max, lattice.max + slack))
    job.warn(insertion.path + ": reaches out of the lattice's box; light there is that of the box's border");
  return object;
}

Result<InsertedObject> bake_object(const Insertion& insertion, Scene object, int order, const Job& job) {
  auto tracer = Tracer::build(object);
  if (!tracer) return tracer.error();
  Receivers receivers = make_vertex_receivers(object);
  auto transfer = bake(object, *tracer, receivers,
                       {.order = order, .samples = 512, .bounces = 1, .precision = Precision::single}, nullptr,
                       job.progress);
  if (!transfer) return transfer.error();
  return InsertedObject{insertion, std::move(object), std::move(receivers), std::move(*transfer)};
}

Result<std::shared_ptr<const InsertedObject>> make_inserted(const Insertion& insertion, const Lattice& lattice,
                                                            int order, const Job& job) {
  auto object = place_object(insertion, lattice, job);
  if (!object) return object.error();
  auto made = bake_object(insertion, std::move(*object), order, job);
  if (!made) return made.error();
  return std::make_shared<const InsertedObject>(std::move(*made));
}

}  // namespace lambent
