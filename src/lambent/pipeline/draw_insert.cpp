#include <lambent/pipeline/draw_insert.h>

#include <lambent/bake/bake.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>

#include <cmath>

namespace lambent {

Result<void> add_insertion(const Insertion& insertion, const Lattice& lattice, int order, const Relit& free_space,
                           RelitScene& into, const Job& job) {
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
  auto tracer = Tracer::build(*object);
  if (!tracer) return tracer.error();
  const Receivers receivers = make_vertex_receivers(*object);
  // What the object does to light that comes to it: own shadows, and one bounce.
  auto transfer = bake(*object, *tracer, receivers,
                       {.order = order, .samples = 512, .bounces = 1, .precision = Precision::single}, nullptr,
                       job.progress);
  if (!transfer) return transfer.error();
  return insert_object(into, *object, receivers, *transfer, lattice, free_space);
}

}  // namespace lambent
