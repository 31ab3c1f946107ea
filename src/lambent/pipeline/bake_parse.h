#pragma once
// The small syntaxes of a bake request, read into the options of the stages.
#include <lambent/bake/adapt.h>
#include <lambent/bake/indirect.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/subsurface.h>
#include <lambent/bake/visibility.h>
#include <lambent/compress/cpca.h>
#include <lambent/compress/haar_fit.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/pipeline/bake.h>
#include <lambent/scene/reflection.h>

#include <optional>

namespace lambent {

struct BakePlan {
  BakeKind kind = BakeKind::diffuse;
  BakeOptions bake;
  MatrixOptions matrix;
  ZonalFitOptions zonal;
  LatticeOptions lattice;
  CpcaOptions cpca;
  SubsurfaceOptions subsurface;
  LightmapOptions lightmap;
  VisibilityOptions visibility;
  HaarFitOptions haar;
  IndirectOptions indirect;
  Reflection reflection;
  bool adapts = false;  // where the scene can be
  AdaptOptions adapt;
  size_t most_texels = 0;  // of a lightmap whose density is chosen
};

// Errors name the option. Loads the environment that --light names.
Result<BakePlan> plan_of(const BakeRequest& request, const Job& job);

// Scenes as the request prepares them; warnings go to the job.
Result<Scene> load_scene_of(const BakeRequest& request, const Job& job);

// Splits the scene's edges where the plan says so and the scene has no bones; nothing where not.
Result<std::optional<AdaptReport>> adapt_scene(Scene& scene, const BakeRequest& request, const BakePlan& plan,
                                               const Job& job);

Result<Lattice> lattice_of_request(const BakeRequest& request, const Scene& scene);

// What share of the light a sheet lets through at each receiver: one number, or a picture's luminance at its texture
// coordinates.
Result<std::vector<float>> membrane_alphas(const std::string& text, const Scene& scene, const Receivers& receivers);

// Whether a baked file can hold the result, as far as that is known before the first ray. Errors: it cannot.
Result<void> check_file_size(const BakePlan& plan, const BakeRequest& request, const Scene& scene, size_t receivers,
                             size_t groups);

}  // namespace lambent
