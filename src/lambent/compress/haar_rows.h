#pragma once
// Rows in Haar wavelets before they are stored: direct light, to which bounces are added.
#include <lambent/compress/haar_fit.h>

namespace lambent {

// The rows of direct light: of each receiver what the options leave, by rising column. Errors: those of fit_haar().
Result<std::vector<std::vector<HaarEntry>>> haar_rows(const Visibility& visibility, std::span<const Vec3> normals,
                                                      const HaarFitOptions& options, Progress* progress = nullptr);

// What the options leave of a row of `columns`, which has its entries by rising column.
std::vector<HaarEntry> largest_entries(std::span<const HaarEntry> row, const HaarFitOptions& options, size_t columns);

// Rows of so many channels, one or three, as a store. `all` and `left`: the sums of squares of the whole rows, and of
// what is not in them.
HaarTransfer store_haar_rows(int size, int channels, std::span<const std::vector<HaarEntry>> rows, double all,
                             double left, HaarFitReport* report = nullptr);

}  // namespace lambent
