#pragma once
// The gather operator. Every receiver sends its rays once; a ray that leaves the scene adds to the receiver's SKY ROW
// (its direct transfer T0), one that meets a surface adds to its HIT ROW: receivers there, times interpolation weight,
// times albedo. The hit rows are a sparse matrix B, and a bounce is a product: T_{k+1} = B T_k (general-prt, "Transfer
// Matrix for Bounce k+1", one-row case), with no further ray. Any number of columns: the same B carries radiosity
// (alpha = e + B alpha).
#include <lambent/bake/directions.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/linear.h>
#include <lambent/bake/lamps.h>
#include <lambent/bake/lobes.h>
#include <lambent/core/aligned.h>
#include <lambent/receivers/project.h>
#include <lambent/trace/tracer.h>

#include <memory>
#include <optional>
#include <vector>

namespace lambent {

// Rows of the sparse matrix B of neighbouring receivers, stored by columns (kernels.h): neighbours see the same
// surfaces, so a column serves many of them. Weights are halves, `channels` an entry. Memory is someone else's: a
// SparseBlock's, or KeptRows'.
struct SparseRows {
  size_t row_count = 0;
  SparseEntries entries{};
};
// The same with memory of its own.
struct SparseBlock {
  size_t row_count = 0;
  std::vector<uint32_t> columns, ends;
  std::vector<uint8_t> rows;
  std::vector<uint16_t> weights;
  SparseRows view() const {
    return {row_count, {columns.data(), ends.data(), columns.size(), rows.data(), weights.data()}};
  }
};

// Made anew by each tracing, in the memory of the last.
struct GatherBlock {
  SparseBlock rows;       // of receivers [first, first + count), count at most gather_block
  SparseBlock half_rows;  // the same by the first half of the rays alone, for receivers divisible by check_every
};

struct GatherSetup {
  const Scene& scene;
  const Tracer& tracer;
  const Receivers& receivers;
  DirectionSets sets;
  uint32_t seed;
  int channels;                   // of weights: 1 if all albedo is grey, else 3
  int sky_channels;               // of sky rows: 3 where light comes through coloured surfaces, else 1
  float weight_unit;              // stored weight = sum of albedo x interpolation weight over rays, x weight_unit
  std::vector<Vec3> part_albedo;  // of parts with one albedo all over
  std::vector<uint8_t> part_varies;
  Progress* progress = nullptr;  // tracing looks at it receiver by receiver, and ends early when cancelled
  // Not null: receivers have means over the places of their basis functions, which share their rays, and
  // GatherOperator::fill() makes coefficients of means. trace_sky() and gather_point() know nothing of it.
  const LeastSquares* projection = nullptr;

  size_t coefficients() const { return size_t(sh_count(sets.order)); }
  size_t sky_width() const { return coefficients() * size_t(sky_channels); }
  size_t sky_channel(size_t channel) const { return std::min(channel, size_t(sky_channels) - 1); }
  // Linear base colour of a hit, less what passes.
  Vec3 albedo_at(uint32_t part, const Hit& hit) const {
    return part_varies[part] ? albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v) : part_albedo[part];
  }
  // What a stored weight has to be multiplied by, given how many rays the row averages.
  float row_scale(size_t rays) const { return 1.0f / (weight_unit * float(rays)); }
};

// Whether light that is reflected has to be kept for each colour.
bool has_coloured_albedo(const Scene& scene);

inline constexpr size_t most_places = 16;
// With places for each receiver to send so many rays from, 16, but for fewer than four rays each. None: collocation.
std::optional<LeastSquares> least_squares_of(const Scene& scene, const Receivers& receivers, Projection projection,
                                             int samples, uint32_t seed);
// Means become coefficients where all of them are known. Errors: more ranks than one.
Result<void> check_projection_ranks();

// `sets` of the setup may be replaced by make_hemicube_set(): its rows then are those of a hemicube ray cast at its
// pixels' centres, which stand for the integral over the cosine that random rays estimate.
GatherSetup make_gather_setup(const Scene& scene, const Tracer& tracer, const Receivers& receivers, int order,
                              int samples, uint32_t seed, DirectionWarp warp = square_to_cosine_hemisphere,
                              Progress* progress = nullptr);

// What tracing receivers [first, first + count) yields beside the hit rows. Spans are indexed from `first`.
struct GatherSky {
  float* rows;            // [receiver][stride], [sky channel] within: the coefficients of T0; then the lobes, if any
  float* half_rows;       // [checked receiver][stride]: T0 by the first half of the rays
  size_t stride;          // floats from one receiver to the next, those of all sky channels
  const LobeSets* lobes;  // broad ones are summed, sharp ones left alone; may be null
  uint8_t* buried;        // 1: most rays met the back of a one-sided surface; the receiver lies inside something
};
// The row of half_rows for a receiver of the block that begins at `first`; null where it is not checked.
float* checked_row(const GatherSky& sky, size_t first, size_t receiver);

// Direct light of lamps, from the same rays and from samples towards the lamps (lamps.h).
struct GatherDirect {
  const Lamps& lamps;
  int samples;   // a group, towards its lamps
  float* rows;   // [receiver][group][r, g, b], zero on entry
  size_t width;  // floats a row
};

// What one thread needs while it traces; made once and lent out (core/pool.h).
struct GatherScratch;
struct DeleteScratch {
  void operator()(GatherScratch* scratch) const;
};
using ScratchPointer = std::unique_ptr<GatherScratch, DeleteScratch>;
ScratchPointer make_gather_scratch(const GatherSetup& setup);

// Traces closest hits. `block`, `sky` and `direct` may be null. A ray that meets bilinear texels counts for one of the
// four, drawn with the probability of its weight: a quarter of the entries, with the same mean.
void trace_gather(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, GatherBlock* block,
                  const GatherSky* sky, const GatherDirect* direct = nullptr);

// Traces occlusion only: the sky rows, without hit rows.
void trace_sky(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, const GatherSky& sky);

// One gather from anywhere, as a receiver there would do it: `row` as GatherSky::rows (stride: that of all sky
// channels), and in `reflected` ([column][channel], `width` floats) what the surfaces that it meets send back of the
// solution x; both set. x null: no surface sends anything. `key` chooses the fan. `direct`, where not null, has one
// row, to which the lamps' light is added. False: the place lies inside something.
bool gather_point(const GatherSetup& setup, GatherScratch& scratch, Vec3 origin, Vec3 normal, uint64_t key,
                  const GatherSky& sky, const float* x, size_t width, float* reflected,
                  const GatherDirect* direct = nullptr);

// Whether a receiver lies inside something: most rays of a fan that no seed changes meet backs of one-sided surfaces.
bool is_buried(const Tracer& tracer, const Receivers& receivers, size_t receiver);
// The same for one that `backs` of `rays` rays found so: asks only where these leave it open, as at the rim of a lamp
// that hangs on a wall, so that no such receiver is one or the other by its seed.
bool is_buried(const Tracer& tracer, const Receivers& receivers, size_t receiver, size_t backs, size_t rays);

// Values of buried receivers are taken from their neighbours (neighbours_of).
struct FillStep {
  uint32_t receiver;
  std::vector<uint32_t> sources;  // not buried, or filled by an earlier step
};
std::vector<FillStep> make_fill_steps(const Scene& scene, const SpatialBasis& basis,
                                      const std::vector<uint8_t>& buried);
void fill_buried(const std::vector<FillStep>& steps, float* values, size_t stride, size_t width);

}  // namespace lambent
