#pragma once
// Solution vectors as they are stored.
#include <lambent/core/ranks.h>
#include <lambent/transfer/transfer.h>

namespace lambent {

struct BakeOptions;

// Solution vectors: T0, X, the next X and that denoised, with its neighbours; copies of rows without their lobes; the
// terms, and one of them before it was denoised.
// `ranks`: where they have rows of their own alone, and one vector with those that they ask for.
size_t solution_bytes(size_t receivers, size_t coefficients, int channels, int sky_channels, const BakeOptions& o,
                      size_t ranks = 1);

// x, [receiver][row][column][channel] with `width` floats a row, as a Transfer. `places`: of each receiver, where it is
// in x; empty: in their order.
Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision, std::span<const uint32_t> places = {});

// A transfer of one row that no rank has whole (core/own_part.h): receivers [ends[i - 1], ends[i]), whole blocks of
// storage, are of rank i % ranks, which stores and writes them.
WritableTransfer make_parted_transfer(const LightBasis& light, int channels, size_t receivers, Precision precision,
                                      std::vector<size_t> ends, size_t ranks);
// The same of those that have x, each its own.
Transfer store_own_columns(const Shares& shares, const LightBasis& light, const float* x, int channels,
                           size_t receivers, size_t width, Precision precision);

// One receiver's rows of it. `values`: scratch.
void store_columns_of(const WritableTransfer& out, size_t receiver, const float* x, size_t width,
                      std::vector<float>& values);

// Transfer where nothing stands in the light's way, by normals alone.
Transfer unshadowed_transfer(const LightBasis& light, std::span<const Vec3> normals, Precision precision);
// Columns of harmonics added up to those of band-limited lobes, `light`'s, which are sums of harmonics.
Transfer add_up_lobes(const Transfer& t, const LightBasis& light, Precision precision);

// Each rank has stored its own receivers, and gets the others'. `shares`: of the receivers, by whole blocks of storage.
void gather_stored(const Shares& shares, const WritableTransfer& out);

}  // namespace lambent
