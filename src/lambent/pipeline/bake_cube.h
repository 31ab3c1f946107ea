#pragma once
// Bakes over a cube of directions: visibility in blocks, and diffuse transfer in wavelets, which is made of it.
#include <lambent/bake/bake.h>
#include <lambent/pipeline/bake_parse.h>
#include <lambent/pipeline/parse.h>
#include <lambent/render/render.h>

namespace lambent {

// What the receivers see; what it says of itself goes to the report and the summary. Warns of glass that it cannot
// hold. Errors: those of bake_visibility().
Result<Visibility> bake_visibility_of_plan(const BakePlan& plan, const Scene& scene, const Tracer& tracer,
                                           const Receivers& receivers, const Job& job, BakeReport& report,
                                           Summary& summary);

// That times the cosine, in wavelets; with bounces the Neumann series of those rows, X = T0 + B X, some columns at a
// time. for_view: finer than the plan says, for haar_of_view() to mix. Errors: cancelled.
Result<HaarTransfer> fit_haar_of_plan(const BakePlan& plan, bool for_view, const Visibility& seen, const Scene& scene,
                                      const Tracer& tracer, const Receivers& receivers, const Job& job,
                                      BakeReport& report, HaarFitReport& fit);

// Pixels' rows, mixed from the receivers' some columns at a time: what the options leave of each. No more than `memory`
// bytes are taken beyond the mix and both stores, but for one chunk's rows. Errors: cancelled.
Result<HaarTransfer> haar_of_view(const HaarTransfer& receivers, const PixelMix& mix, const HaarFitOptions& options,
                                  size_t memory, HaarFitReport& report, Progress* progress = nullptr);

// Before all else is traced: would pixels' rows, of as many entries as receivers here and there have, take more than a
// GLB holds? Error: by --size, which is `size`.
Result<void> check_haar_of_view(const BakePlan& plan, const std::string& size, const Scene& scene, const Tracer& tracer,
                                const Receivers& receivers, const View& view);

// What was kept, `of` a receiver or a pixel.
void tell_wavelets(const HaarTransfer& transfer, const HaarFitReport& fit, const char* of, Summary& summary,
                   nlohmann::json& told);

}  // namespace lambent
