#pragma once
// The objects that a drawing moves (--place): files of `lambent field` as they are read, and where they stand.
#include <lambent/baked/baked_file.h>
#include <lambent/pipeline/draw_request.h>
#include <lambent/pipeline/lamp_sight.h>
#include <lambent/pipeline/motion.h>
#include <lambent/pipeline/place.h>
#include <lambent/relight/reflecting.h>
#include <lambent/render/insert.h>

#include <map>
#include <memory>

namespace lambent {

// What was read of a field file, once for all objects that are of it.
struct MoverModel {
  Baked baked;
  HiddenLight hidden;
  std::optional<ShiningLight> shining;
  std::optional<ReflectingLight> reflecting;
  std::vector<ShiningPoint> shining_points, reflecting_points;
  std::vector<Vec3> positions, normals;  // of receivers
  // Of what is no diffuse transfer of harmonics, which products multiply: a stand-in, so that there are receivers.
  std::optional<Transfer> no_transfer;
  bool is_diffuse() const { return !no_transfer; }
  const Transfer& transfer() const { return no_transfer ? *no_transfer : std::get<Transfer>(baked.surface.store); }
  int light_order() const { return light_of(baked.surface.store).order; }
};
using MoverModels = std::map<std::string, std::unique_ptr<MoverModel>>;  // by path

struct Mover {
  PlacedFile file;
  const MoverModel* model = nullptr;
  std::optional<size_t> animation = {};  // of the object's own
  std::optional<Pose> pose = {};         // by that, at the time it was moved to
  PlacedObject placed = {};
  MovingReceivers receivers = {};
  PlacedLamp lamp = {};         // of a model that shines
  ShiningLight reflected = {};  // of a model that reflects: under the light of the moment
  PlacedLamp reflection = {};
};

// Whether a baked object can move: at vertices, under harmonics alone, diffuse, of a matrix whose last reflection is
// looked up by view, or of lobes. Errors name `path`.
Result<void> check_mover(const Baked& object, const std::string& path);

// What request.place, request.move and request.pose name; reads files that `models` has not. Errors: of those options
// and of files.
Result<std::vector<Mover>> load_movers(const DrawRequest& request, MoverModels& models);

// Where it is at that time, and in which pose; `origin` is the scene's. Errors: of the animation.
Result<void> move_to(Mover& mover, double time, Vec3d origin);

// T . light, every receiver under a light of its own, in the world's axes: order^2 coefficients each, of as many bands
// as the model's light_order().
Relit relight_each(const Mover& mover, std::span<const Vec3> light);

// Normals of receivers at vertices, towards their side, from those of the vertices.
std::vector<Vec3> receiver_normals(std::span<const Vec3> normals, const VertexPlacement& at, size_t receivers);

// The object, relit, beside what is there; `peaks`, without values where there are none, is what of it is held above 0
// by itself at the pixel; `emission` is that of materials, empty where nothing shines yet.
void append_mover(RelitScene& into, const Mover& mover, const Relit& relit, const Relit& peaks,
                  std::vector<Vec3>& emission);

}  // namespace lambent
