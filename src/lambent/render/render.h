#pragma once
// Relit receivers -> picture: primary rays, interpolation between receivers, albedo at the pixel.
#include <lambent/core/camera.h>
#include <lambent/core/progress.h>
#include <lambent/image/image.h>
#include <lambent/light/environment.h>
#include <lambent/receivers/receivers.h>
#include <lambent/relight/relight.h>
#include <lambent/trace/tracer.h>
#include <lambent/transfer/outgoing.h>
#include <lambent/transfer/directional.h>

#include <functional>

namespace lambent {

// What a picture is asked for, beside its camera.
struct RenderOptions {
  int width = 512, height = 512;            // pixels
  int samples = 16;                         // rays a pixel, [1, 4096], box filter
  const Environment* background = nullptr;  // null: black, and the image has alpha (coverage)
  // The light that surfaces receive, as if they were white (radiosity); their colour; or the product of both.
  enum class Show { product, radiosity, albedo } show = Show::product;
  // What of relit comes from the light's peaks, row by row: light is kept from ringing at the pixel (relight/dering.h).
  // Null: as it is.
  const Relit* peaks = nullptr;
  const Outgoing* outgoing = nullptr;  // the last reflection of transfer matrices; null: diffuse
  DirectionalKind directional =
      DirectionalKind::none;   // what relit's rows are; shaded with the normal that the normal texture gives
  std::vector<Vec3> emission;  // radiance of each material's surfaces as lamps that are seen, times emissive textures;
                               // empty: none are
};

// One-sided triangles are absent from behind, as in any glTF viewer. Errors: cancelled.
Result<Image> render(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Relit& relit,
                     const Camera& camera, const RenderOptions& options, Progress* progress = nullptr);

// O(view) . T with the view fixed: a transfer whose receivers are the pixels of a picture, row by row from the top,
// with one row and three channels, so that relighting is T . light and the picture is there. Directional lightmaps and
// lamps that are seen are left out. coverage: of each pixel, [0, 1], grey behind glass. Source: general-prt, "Special
// cases" (fixed view: image relighting). Errors: cancelled.
struct FixedViewTransfer {
  Transfer transfer;
  std::vector<float> coverage;
};
Result<FixedViewTransfer> fix_view(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis,
                                   const Transfer& transfer, const Camera& camera, const RenderOptions& options,
                                   Progress* progress = nullptr);

// The same of diffuse receivers without their transfer: what each pixel shows of whom, so that any store can be mixed.
// Those of pixel p are [begin[p], begin[p + 1]). Errors: cancelled.
struct PixelMix {
  std::vector<size_t> begin;
  std::vector<uint32_t> receivers;
  std::vector<Vec3> weights;  // of a receiver's exit radiance as if it were white
  std::vector<float> coverage;
};
Result<PixelMix> mix_of_view(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Camera& camera,
                             const RenderOptions& options, Progress* progress = nullptr);

// The picture of such a transfer, relit.
Image pixels_image(const Relit& relit, const std::vector<float>& coverage, const Camera& camera, int width, int height,
                   const Environment* background);

// What render() is made of: primary rays, and `shade` for the radiance of what they meet, in the direction that they
// came along. `make_shade` is called once for each row, on the thread that draws it.
using SurfaceShade = std::function<Vec3(const Hit&, Vec3 direction)>;
Result<Image> render_surfaces(const Scene& scene, const Tracer& tracer, const Camera& camera,
                              const RenderOptions& options, const std::function<SurfaceShade()>& make_shade,
                              Progress* progress = nullptr);
// render()'s own; what it is made of must outlive it.
std::function<SurfaceShade()> relit_shade(const Scene& scene, const SpatialBasis& basis, const Relit& relit,
                                          const RenderOptions& options);

// What a ray from the eye shows.
struct ViewRay {
  Hit hit;  // no triangle where it meets nothing
  Vec3 direction;
  Vec3 weight{1};  // of what is met in the ray: less than all where light passes, here or before
};

// Rays that are kept while the camera stands, so that light may change without tracing: `samples` a pixel, each one or,
// where light passes through what it meets, several; those of pixel p are [begin[p], begin[p + 1]).
struct ViewRays {
  int width = 0, height = 0, samples = 0;
  std::vector<ViewRay> rays;
  std::vector<uint32_t> begin;
  std::vector<Vec3> colours = {};  // of what each ray met, where find_colours() has looked
};
// Base colours, which do not change with the light, at what the rays met.
void find_colours(const Scene& scene, ViewRays& view);
// Samples [first, first + count) of those that render() takes. Errors: cancelled.
Result<ViewRays> trace_view(const Scene& scene, const Tracer& tracer, const Camera& camera, int width, int height,
                            int first, int count, Progress* progress = nullptr);

// Pixels' sums over the samples so far: radiance, and what of their rays met nothing. Samples added in order and
// divided at the end make render()'s picture to the bit.
struct ViewSums {
  std::vector<Vec3> rgb;
  std::vector<float> open;
  int samples = 0;
};
// Of view.rays, by number, where it met something: radiance.
using RayShade = std::function<Vec3(size_t ray)>;
// Adds rows [first, last) of the picture to `sums`, which count the samples with the last row of all; `background`:
// radiance by direction, none: black.
void shade_rays(const ViewRays& view, const std::function<RayShade()>& make_shade,
                const std::function<Vec3(Vec3)>& background, ViewSums& sums, int first, int last);
// All rows, by what was met.
void shade_rays(const ViewRays& view, const std::function<SurfaceShade()>& make_shade,
                const std::function<Vec3(Vec3)>& background, ViewSums& sums);
// The one as the other; `view` must outlive it.
std::function<RayShade()> by_number(const ViewRays& view, std::function<SurfaceShade()> make_shade);
// As relit_shade() of what was met, by the rays' colours where they are known. All but the function itself must outlive
// it.
std::function<RayShade()> relit_shade(const ViewRays& view, const Scene& scene, const SpatialBasis& basis,
                                      const Relit& relit, const RenderOptions& options);
Image mean_of(const ViewSums& sums, int width, int height);

}  // namespace lambent
