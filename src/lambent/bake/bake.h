#pragma once
// Scene -> Transfer: diffuse light transport, direct and bounced.
#include <lambent/bake/certify.h>
#include <lambent/core/progress.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>
#include <lambent/trace/tracer.h>
#include <lambent/transfer/transfer.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace lambent {

// What a diffuse bake is asked for.
struct BakeOptions {
  int order = 6;  // SH bands of the light, [1, 16]: order^2 coefficients; 0 with lobes alone
  LobeKind lobe_kind = LobeKind::von_mises_fisher;
  std::vector<Lobe> lobes;          // more columns, one each: lamps beside the harmonics, or a basis of their own
  int samples = 1024;               // rays a receiver, [1, 2^20]; error falls a little faster than 1/sqrt.
                                    // Sharp lobes share as many again, at least 64 each
  int bounces = 3;                  // reflections between surfaces, [0, 64]
  bool shadows = true;              // false: light everywhere as if nothing stood in its way, and no bounces
  size_t memory = size_t{4} << 30;  // bytes of working memory beyond scene and result; less means rays traced again
  uint32_t seed = 1;                // of the ray directions
  Precision precision = Precision::half;  // of the stored transfer
  bool keep_terms = false;                // BakeReport::terms, in as much time again as the bounces take
  // Where > 0, bake to this relative RMS error (Certificate::error) with as many rays as that asks for, instead of
  // `samples`; where interpolation between receivers is what loses, to noise of 0.3 to 0.6 of it. No more rays are
  // asked for where they would end after so many seconds; negative: no limit.
  double error = 0, seconds = -1;
  bool denoise = true;  // takes away noise that neighbours do not share (denoise.h)
  bool certify = true;  // measures the result's error (certify.h)
  // Where > 0, of at least twice so many receivers, baked to an error, those that light does not tell apart are not
  // traced: others stand for them (stand_in.h).
  size_t thin = 0;
  // What a receiver has: the value where it is, or coefficients of least squares by rays from places all over its basis
  // function (receivers/receivers.h); of harmonics, with `samples`, on one rank, without denoising.
  Projection projection = Projection::collocation;
  // Of more ranks than one each has a part of the result alone, as the file is written (core/own_part.h), where it can:
  // for whom does nothing with the result but write it.
  bool own_part = false;
  // Others than the receivers are traced, surfels, about so many (0: as SurfelOptions has it): they bounce light, and
  // receivers, at vertices, read them by kernels (meshless.h).
  std::optional<size_t> meshless = std::nullopt;

  LightBasis light() const { return {order, lobe_kind, lobes, {}}; }
};

// What is wrong with the light basis of these options.
Result<void> check_light_basis(const BakeOptions& options, int least_order);

// What it says of itself.
struct BakeReport {
  size_t receivers = 0, buried = 0;  // buried: inside something, filled from their neighbours
  size_t traced = 0;                 // of the receivers; others stand for the rest (BakeOptions::thin)
  size_t rays = 0;                   // traced in all
  int samples = 0;                   // rays a receiver of the result
  size_t bytes = 0;                  // of the transfer
  size_t operator_bytes = 0;         // of the hit rows kept in memory
  double operator_kept = 1;          // fraction of the hit rows kept; the rest was traced again for each bounce
  size_t working_memory = 0;         // bytes, what the stages below allocated at their peak
  double trace_seconds = 0, bounce_seconds = 0, denoise_seconds = 0, certify_seconds = 0;
  // Relative RMS error of the result. Of diffuse transfer the certificate's; of other kinds of the transfer vectors at
  // the receivers, estimated from half-sample gathers at one in 16, which overestimates a little. Negative: not known.
  double error = -1;
  Certificate certificate;  // of diffuse transfer, where the options want it
  // Relative RMS of noise, negative: not measured. At the receivers, as their rays gave them and denoised; and of the
  // result over all surfaces, by area, as the certificate's error is.
  double noise_of_rays = -1, denoised = -1, noise = -1;
  // Where options.keep_terms says so, the result's terms: direct transfer, that of light reflected once, twice, ... E,
  // B E, B^2 E. They add up to the result, but for rounding. Source: radiosity, "Neumann series".
  std::vector<Transfer> terms;
  size_t operator_file_bytes = 0;  // of the hit rows kept beyond memory, in a file (Progress::scratch)
};

// Least working memory (BakeOptions::memory) with which such a bake can run.
size_t least_memory(size_t receivers, bool coloured, const BakeOptions& options);

// Errors: options out of range; memory too small (says what is needed); cancelled.
Result<Transfer> bake(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const BakeOptions& options,
                      BakeReport* report = nullptr, Progress* progress = nullptr);

}  // namespace lambent
