#pragma once
// Relighting by Haar wavelets: the light's largest terms, and the columns of the transfer that they wake. Source: Ng,
// Ramamoorthi, Hanrahan 2003.
#include <lambent/light/cube_light.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/haar_transfer.h>

namespace lambent {

// Light in wavelets, as many terms as are kept, by rising column of the transfer: of three channels each its own, with
// the light of its colour.
struct HaarTerms {
  std::vector<uint32_t> columns;
  std::vector<Vec3> values;
};
// The `count` terms (0: all that are not 0) that change the receivers most: by the length of a term's colour times its
// column's norm (haar_column_norms()). The cube has the transfer's size.
HaarTerms haar_terms(const HaarTransfer& transfer, std::span<const float> norms, const CubeLight& light, size_t count);

// What a relighting by wavelets has read.
struct HaarReading {
  size_t terms = 0, bytes = 0;  // of the light; of the transfer's columns
};

// T . light of white receivers, by those terms; the sum of each receiver has a fixed order. `reading`, where it is
// given, is set.
void relight(const HaarTransfer& transfer, const HaarTerms& light, Relit& out, HaarReading* reading = nullptr);

}  // namespace lambent
