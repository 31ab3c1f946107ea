#pragma once
// certify() (certify.h) of a field that is a function, with what was measured where.
#include <lambent/bake/certify.h>
#include <lambent/bake/certify_reflect.h>

namespace lambent {

// A place, and squares there that are right in the mean alone: of the error, which may be negative, and of the truth.
struct MeasuredPlace {
  Vec3 at, normal;
  double error2, truth2;
  double weight;  // of it in a mean over all surfaces
};

// `reflected`, where not null: the gathers read a solution that has the field's errors, too. `again`: the same field
// with noise of its own, and not together with `reflected->read`; with it, the field's noise does not count.
// `measured`, where not null, becomes the places that counted. Errors: cancelled.
Result<Certificate> certify_field(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                                  const GatherAt& gather, size_t places, uint32_t seed, Progress* progress = nullptr,
                                  const ReflectedErrors* reflected = nullptr, const FieldRow* again = nullptr,
                                  std::vector<MeasuredPlace>* measured = nullptr);

}  // namespace lambent
