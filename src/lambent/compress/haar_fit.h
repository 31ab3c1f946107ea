#pragma once
// What receivers see of a cube, times the cosine, as transfer in Haar wavelets. Source: Ng, Ramamoorthi, Hanrahan 2003.
#include <lambent/core/progress.h>
#include <lambent/core/vec.h>
#include <lambent/transfer/haar_transfer.h>
#include <lambent/transfer/visibility.h>

namespace lambent {

// Which coefficients stay. At each receiver the largest: a share of all, or as few as leave an error.
struct HaarFitOptions {
  double keep = 0;      // (0, 1]: of all coefficients; 0: by `error`
  double error = 0.05;  // of each receiver's transfer, relative RMS over the texels, before quantisation
};
struct HaarFitReport {
  double error = 0;    // of all receivers together, quantised: relative RMS over the texels
  double entries = 0;  // a receiver
};

// Direct light alone, grey. Errors: a cube whose side is no power of two; other numbers of normals; options out of
// range; cancelled.
Result<HaarTransfer> fit_haar(const Visibility& visibility, std::span<const Vec3> normals,
                              const HaarFitOptions& options, HaarFitReport* report = nullptr,
                              Progress* progress = nullptr);

// One receiver's coefficients, none left out: [face][coefficient].
std::vector<float> haar_row(const Visibility& visibility, size_t receiver, Vec3 normal);

}  // namespace lambent
