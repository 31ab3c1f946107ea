#pragma once
// Drawing direct-to-indirect transport: lamps of the request light the scene, sharply at the pixel; what they send on
// is read there from surfels. Step by step, for who draws frame after frame (live_indirect.h).
#include <lambent/bake/lamps.h>
#include <lambent/bake/surfels.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/draw_insert.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/relight/indirect.h>

namespace lambent {

// draw() of such a file.
Result<Drawing> draw_indirect(const Baked& baked, const DrawRequest& request, const Job& job);

// How closely light is looked at.
struct IndirectQuality {
  // Places that a leaf is lit at; where a lamp is within a few spacings of it.
  size_t places = 4, places_near = 64;
  // Rays towards a sphere: over a leaf's places; at a ray of a pixel.
  int lamp_samples = 8, pixel_samples = 2;
  // Rays towards what stands still, the scene's own lamps by group and the sky, and as many all around: at each place
  // of a leaf; at a ray of a pixel.
  int still_samples = 16, still_pixel_samples = 4;
  // Rays of a pixel towards what a lamp lights near it, and as many all around; 0: all bounces are read off surfels.
  int near_samples = 8;
};
IndirectQuality quality_of(const DrawRequest& request);
// Of a picture that moves.
inline constexpr IndirectQuality hurried_indirect{1, 1, 1, 1, 2, 1, 0};

// Light that does not move: of the scene's own lamps, and of the environment as it is turned.
struct StillLight {
  std::optional<Environment> sky{};  // turned
  Lamps lamps{};
  std::vector<Vec3> scales{};                       // by group
  std::vector<std::vector<LampLight>> at_leaves{};  // direct, a sum for each group that arrives
  bool shines() const;
  Vec3 scale_of(const std::string& name) const;  // of the group of that name; 1 if there is none
};

// A lamp that moves, and what it gave leaves where it stood last.
struct LitLamp {
  MovingLamp lamp;
  std::vector<Vec3> at_leaves{};
  // Where not all leaves are lit anew each frame: what rays found last, where the lamp stood then, and how many leaves
  // have not seen it where it stands.
  std::vector<Vec3> found{}, from{};
  size_t behind = 0;
};

// A lamp whose first bounce pixels gather themselves, where that comes from within a few spacings of it.
struct NearLamp {
  MovingLamp lamp;
  // Places that its rays met: exit radiance by it, and how many of the rays an area's unit has, times 1 / scale.
  struct Sent {
    Vec3 position, face, light;
    float density;
  };
  std::vector<Sent> sent{};
  float scale = 1;
  std::vector<Vec3> smooth{};  // what gathering surfels have of that part of the bounce
  size_t behind = 0;           // as of its leaves
};

// Objects put into the scene, over light in free space.
struct ObjectsInScene {
  std::vector<std::shared_ptr<const InsertedObject>> made{};
  Scene scene{};                   // with the one that was baked, which comes first
  std::optional<Tracer> tracer{};  // of it
  RelitScene lit{};                // alone
  SpatialBasis basis{};            // of those
  size_t first = 0;                // triangle in `scene`
};

// A drawing under way. What it is made of must outlive it.
struct IndirectDrawing {
  const DrawRequest& request;
  const Job& job;
  const IndirectTransfer& transfer;
  Show show;
  Scene scene{};  // repainted
  Tracer tracer{};
  float diagonal = 0;
  StillLight still{};
  std::vector<MovingLamp> lamps{};
  std::vector<LampPath> paths{};
  std::unique_ptr<const SurfelSearch> search{};
  std::vector<std::vector<SurfacePlace>> places{};  // of leaves
  // Those of leaves that a lamp has come near to: found once, as they take hundreds of rays a leaf.
  std::vector<std::vector<SurfacePlace>> near_places{};
  IndirectSolve solve{};
  std::vector<LitLamp> lit{};  // the lamps
  std::vector<NearLamp> near{};
  std::vector<Vec3> direct{};  // at surfels
  Relit relit{};               // at receivers, where they are read
  ObjectsInScene objects{};
  size_t evaluated = 0, leaves_lit = 0;  // lamps, and leaves by all of them, in the last frame
  double ray_seconds = 1e9, solve_seconds = 1e9, read_seconds = 1e9, near_seconds = 1e9;

  // What is seen.
  const Scene& drawn() const { return objects.tracer ? objects.scene : scene; }
  const Tracer& sight() const { return objects.tracer ? *objects.tracer : tracer; }
};

// The environment that shines from afar, or none: turned already. Then nothing is known of what arrives at leaves.
void set_sky(IndirectDrawing& d, std::optional<Environment> turned);
// Lamps of the request: where they stand anywhere, and what the scene's own are scaled by, whose names set_sky() has
// found. Errors name the option; no light at all.
Result<void> read_lamps(IndirectDrawing& d);
// Repaints walls: the scene that is seen, and the albedos of surfels. Errors name --albedo.
Result<void> repaint(const DrawRequest& request, Scene& scene, const Surfels& surfels, std::vector<Vec3>& albedos);
// Tracer, search, and the places of leaves, for d.scene. Errors: those of Tracer::build(); cancelled.
Result<void> make_places(IndirectDrawing& d);

// Exit radiance of a white surface by what stands still, sample by sample: the thread's own until it asks again.
std::vector<LampLight>& still_light(const IndirectDrawing& d, const Scene& scene, const Tracer& tracer, Vec3 origin,
                                    Vec3 normal, int samples, uint64_t key);
// Their sum, each times its group's scale.
Vec3 scaled_sum(const StillLight& still, const std::vector<LampLight>& arrived);
// What stands still, at leaves [first, first + count): kept by group, so that lamps are scaled without a ray.
void light_leaves(IndirectDrawing& d, size_t first, size_t count, const IndirectQuality& quality,
                  ProgressStage* stage = nullptr);
// Light of lamp k alone at leaves [first, first + count), into d.lit[k], which has room for all.
void light_lamp(IndirectDrawing& d, size_t k, size_t first, size_t count, const IndirectQuality& quality);
// Light of a lamp at some leaves.
void light_some_leaves(IndirectDrawing& d, const MovingLamp& lamp, std::span<const uint32_t> leaves,
                       std::vector<Vec3>& at_leaves);
// Light of lamp k at all leaves, which d.lit[k] knows of another place of it, by rays at `most` of them: those whose
// shadow is likeliest to matter, by how bright the lamp would be there, what the leaf weighs, and the angle that the
// lamp has moved by since it was looked at. The others keep their shadow, and have the light that is without one
// change. Of a lamp that stands still all come to what light_lamp() finds, `most` a call. How many were lit.
size_t follow_lamp(IndirectDrawing& d, size_t k, size_t most);
// All direct light at leaves, of what stands still and of d.lit one after the other, into d.direct.
void sum_direct(IndirectDrawing& d);
// Parts the first bounce near lamps from the rest, into d.near: of d.lit, as far as it is known. Uses d.solve's room,
// whose s.sent is another then. Nothing where surfaces let light pass. Returns how many lamps it left, after the first
// 64.
size_t part_near_light(IndirectDrawing& d);
// What a place has of the bounces near lamps beyond what its kernels read of them, by `samples` rays of each kind from
// `origin`, which is clear of its surface; `above`: the normal of its face.
Vec3 near_bounce(const IndirectDrawing& d, Vec3 origin, Vec3 normal, Vec3 above, const Kernels& kernels, int samples,
                 uint64_t key);

// Light that has bounced, as if what was hit were white.
using IndirectShade = std::function<Vec3(const Hit&, Vec3 direction, const SurfacePlace&)>;
// What receivers read, with directions where rows have them, into d.relit.
void read_receivers(IndirectDrawing& d, DirectionalKind directional);
// Where light that has bounced is not read off surfels at the pixel: at receivers, as the file has them, and on
// objects; by options that outlive it, light alone. Else nothing.
IndirectShade bounced_light(const IndirectDrawing& d, const Baked& baked, const RenderOptions& on_objects,
                            const RenderOptions& in_file);
// What is known of a ray of a pixel: what its place reads, if it is known; light of each lamp there, and, last, of what
// stands still. Of those that are NaN it is found, and kept; without room it is found each time.
struct KnownPlace {
  const Kernels* kernels = nullptr;
  std::span<Vec3> lights{};
};
// What a ray of a pixel meets sends towards the eye. `bounced`: where light is not read off surfels.
Vec3 shade_indirect(const IndirectDrawing& d, Vec3 eye, const IndirectQuality& quality, const Hit& hit, Vec3 direction,
                    const KnownPlace& known = {}, const IndirectShade& bounced = {});
// The place at a hit, and what it reads there.
Kernels kernels_at(const IndirectDrawing& d, const Hit& hit);

// The scene as the path tracer is to see it: lamps that stand anywhere in it, its own scaled.
Scene scene_with_lamps(const IndirectDrawing& d);

}  // namespace lambent
