#pragma once
// The light of a drawing.
#include <lambent/light/cube_light.h>
#include <lambent/light/environment.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/draw_request.h>
#include <lambent/relight/light.h>
#include <lambent/relight/local_light.h>

namespace lambent {

// Of an environment, whichever way it is turned: its harmonics, which turn as coefficients; or, where lobes stand
// beside harmonics, its peaks.
struct KnownHarmonics {
  int order = 0;           // bands
  std::vector<Vec3> all;   // project_environment()
  std::vector<Vec3> rest;  // of without_peaks(); empty where `--window auto` does not ask
  int lamps = 0;           // that lobes of their own could stand for, where much of the light is sharp
  std::shared_ptr<const Environment> sharp = nullptr;  // beside lobes: env - without_peaks(); nothing else is there
};
// Null where the file's light is not within bands, nor of lobes beside them and `peaks`. `peaks`: --window auto asks.
std::shared_ptr<const KnownHarmonics> know_harmonics(const Environment& env, const DrawRequest& request,
                                                     const LightBasis& basis, bool peaks);

// The environment, turned, and whether it is seen behind the scene.
struct Surroundings {
  std::shared_ptr<const Environment> env;  // as loaded; none: nothing shines from afar
  Mat3 rotation{1.0f};
  std::optional<Environment> turned = std::nullopt;  // where it is seen and turned
  bool seen = false;
  std::shared_ptr<const KnownHarmonics> known = nullptr;  // of `env`, where many turns share it
  const Environment* background() const { return !seen || !env ? nullptr : turned ? &*turned : &*env; }
};
Result<Surroundings> surroundings_of(const DrawRequest& request, const Job& job);

// A coefficient a column, by the environment and by what the scene's own lamps are scaled by. `--window auto` finds
// peaks, for who sees shadows; else it windows the light as weakly as keeps open surfaces from going dark.
struct ColumnLight {
  std::vector<Vec3> lamps;     // by group
  LightProjection projection;  // lamps are in its columns
  std::vector<SphereLamp> near;
  CubeLight cube = {};  // the environment, for a store that takes light on one
  // What of the light is too sharp for its bands and rings, by column; empty where --window leaves it or there is none.
  std::vector<Vec3> peaks = {};
  double sharp = 0;  // the share of all light that the peaks have in the harmonics, where they are not empty
  int lamps_found = 0;
  bool in_lobes = false;       // lobes beside the harmonics hold most of them
  double held = -1;            // of lobes that stand: the share of the environment's squared radiance in the columns
  LightProjection still = {};  // where lamps of the light move: before they did, not turned and without a window
  LightProjection still_peaks = {};  // of --window auto, likewise
  // Those, as they now stand, in degrees from where they were baked; and what of the whole light is lost.
  struct MovedLamp {
    size_t lamp;
    double degrees, held;  // held: the share of its own squared radiance that the columns hold where it is
  };
  std::vector<MovedLamp> moved = {};
  double lost = 0;  // relative L2
  // Of each place its own, distant light included.
  LocalLight local() const { return {projection.light, near, projection.window}; }
};
Result<ColumnLight> column_light(const DrawRequest& request, const Surroundings& around, const LightBasis& basis,
                                 Vec3d origin, bool knows_shadows = true);
// Lamps among the lobes of light stand where request.move has them at that time; needs column_light()'s. Errors name
// --move.
Result<void> move_lamps(const DrawRequest& request, const Mat3& rotation, const LightBasis& basis, double time,
                        ColumnLight& light);
// Whether request.move is of such lamps.
bool moves_lobes(const DrawRequest& request, const LightBasis& basis);
// Windows the peaks (Lanczos), the whole with them: for surfaces that reflect a part of the sky at a time. Not where
// lobes hold most of them.
void soften_peaks(ColumnLight& light);

// What each material's surfaces emit, as they are seen; empty without groups.
std::vector<Vec3> seen_emission(const Scene& scene, const LightBasis& basis, const std::vector<Vec3>& lamps);

}  // namespace lambent
