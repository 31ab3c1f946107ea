#pragma once
// What surfaces send back of their own errors. A gather whose bounce reads the stored solution does not see the part of
// an error that this solution has, too: with the residual r = gather - stored, the error is e = r + B e.
#include <lambent/bake/certify.h>
#include <lambent/bake/gather.h>

#include <functional>
#include <span>
#include <vector>

namespace lambent {

struct ReflectedErrors {
  const GatherSetup& setup;  // its geometry and albedo
  int bounces;
  // The field that gathers read, where it is not the one that is measured: over the same receivers, of as many bounces,
  // with errors of its own, which are those that come back.
  const FieldRow* read = nullptr;
};

// Places where residuals were measured.
struct ResidualPlaces {
  std::vector<Vec3> at, normal;
  std::vector<double> weight;  // of each in a mean over all surfaces
};

// rows, [place][width], from residuals to errors: what a place sees of others is the mean of residuals around there, so
// that their noise does not count. Two sets of rows with noise of their own want two keys. The same for any number of
// threads and ranks. Errors: cancelled.
Result<void> add_reflected_errors(const ReflectedErrors& of, const ResidualPlaces& places, uint32_t key, size_t width,
                                  float* rows, Progress* progress);

}  // namespace lambent
