#pragma once
// Rows in wavelets that are made of other rows, a few columns of the light at a time, and never all at once: bounces,
// pixels.
#include <lambent/compress/haar_fit.h>

#include <functional>

namespace lambent {

// How such rows are made.
struct HaarColumnsMaker {
  int size = 0, channels = 1;  // of the cube; one channel or three
  size_t rows = 0;
  size_t together = 0;          // columns of the light that are made at once
  std::vector<double> squares;  // of each row: no more than its sum of squares; what is far below is dropped at once
  double error = 0;             // relative RMS error of what they are made of
  // Columns [first, first + count) of the light, [row][column - first][channel], rows `together` * channels apart; the
  // same whenever it is asked; empty where all are 0. Good until it is called again.
  std::function<Result<std::span<const float>>(size_t first, size_t count)> make;
};

// What the options leave of each row, as a store. Of rows that are not yet rounded no more than `memory` bytes are kept
// at a time, but for one chunk's: what has no room is made in further passes over all columns, to the same bytes.
// `passes`, where it is given, is set. Errors: those of make(); cancelled.
Result<HaarTransfer> store_haar_columns(const HaarColumnsMaker& maker, const HaarFitOptions& options, size_t memory,
                                        HaarFitReport* report = nullptr, Progress* progress = nullptr,
                                        const std::string& stage = "wavelets", int* passes = nullptr);

}  // namespace lambent
