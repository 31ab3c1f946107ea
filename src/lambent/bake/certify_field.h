#pragma once
// certify() (certify.h) of a field that is a function, with what was measured where.
#include <lambent/bake/certify.h>
#include <lambent/bake/certify_reflect.h>

#include <functional>
#include <vector>

namespace lambent {

// A place, and squares there that are right in the mean alone: of the error, which may be negative, and of the truth.
struct MeasuredPlace {
  Vec3 at, normal;
  double error2, truth2;
  double weight;  // of it in a mean over all surfaces
};

// Of a field whose rows ranks (core/ranks.h) have their own alone, called by all ranks: what brings the rows that
// `asked` says, and those that gathers have met, each of which was called once before, with the same key, and then
// returned whether the place is clear and no row.
struct AskForRows {
  std::function<void(const std::vector<uint8_t>& asked)> field;
  std::function<void()> met;
};

// `reflected`, where not null: the gathers read a solution that has the field's errors, too. `again`: the same field
// with noise of its own, and not together with `reflected->read`; with it, the field's noise does not count.
// `measured`, where not null, becomes the places that counted. `ask`: of vertices alone, where `field` has not all.
// Errors: cancelled.
Result<Certificate> certify_field(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                                  const GatherAt& gather, size_t places, uint32_t seed, Progress* progress = nullptr,
                                  const ReflectedErrors* reflected = nullptr, const FieldRow* again = nullptr,
                                  std::vector<MeasuredPlace>* measured = nullptr, const AskForRows* ask = nullptr);

}  // namespace lambent
