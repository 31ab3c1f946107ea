#pragma once
// The error of a baked file, measured again and painted over its scene.
#include <lambent/bake/certify_field.h>
#include <lambent/baked/baked_file.h>
#include <lambent/image/image.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/request.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// What is painted: at each pixel the RMS error around there, relative to the RMS of all transfer, so that its mean
// square over all surfaces is the certificate's; from 0 to `scale`, with a legend.
struct ErrorView {
  Image image;  // for Tone::none
  Certificate certificate;
  std::vector<MeasuredPlace> measured;
  double scale = 0;
};

// In two steps, for who looks from several sides. Errors: as view_error(); `out` without a picture.
Result<void> can_measure_error(const Baked& baked);
Result<ErrorView> measure_error(const Baked& baked, const Tracer& tracer, const Job& job);
// The picture and its scale; a picture too low for the legend stays dark.
void paint_error(const Scene& scene, const Tracer& tracer, const View& view, ErrorView& out);

// Measured at 8,192 places by rays of their own, against surfaces whose light is gathered anew. `camera` and `size` as
// `render` takes them. Errors: not a dense field of diffuse transfer of harmonics that was baked with shadows and
// without a medium; those of parse_view(); cancelled.
Result<ErrorView> view_error(const Baked& baked, const std::string& camera, const std::string& size, const Job& job);

}  // namespace lambent
