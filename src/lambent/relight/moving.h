#pragma once
// Rigid objects that move over what was baked: the light of each receiver times what every object lets pass ("shadow
// fields"). A receiver's transfer (visibility and cosine) is multiplied by the harmonics of what each object near it
// leaves open, nearest first, in tiles of receivers; objects that hide too little, or lie below a receiver's horizon,
// are passed over. Source: triple-product-integrals, on Zhou, Hu, Lin, Guo, Shum (2005).
#include <lambent/basis/sh_product_tile.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/field.h>

namespace lambent {

// x -> position + scale * rotation * (x - the centre of the object's shells).
struct RigidPlace {
  Vec3 position{0.0f};
  Mat3 rotation{1.0f};
  float scale = 1;
};

// What an object hides, in its own axes, as it is read; and where it stands, in the world's.
struct HiddenLight {
  Shells shells;
  std::vector<float> log_radii;
  int order = 0;
  std::vector<float> values;  // [point][order^2]
};
// The field is of HiddenRows; `order` bands of it at most.
HiddenLight hidden_light(const Field& field, int order);

// An object where it stands, its field turned to the world.
struct PlacedObject {
  const HiddenLight* light = nullptr;
  RigidPlace place;
  AlignedVector<float> values;  // [point][order^2, padded to a multiple of 16], world axes
  size_t stride() const { return (size_t(sh_count(light->order)) + 15) / 16 * 16; }
  float radius() const { return light->shells.radius * place.scale; }
};
// `light` must outlive it.
PlacedObject place_object(const HiddenLight& light, const RigidPlace& place);
// The coefficients of the light that the object hides from a point: a positive function of direction, order^2 values.
void hidden_from(const PlacedObject& object, Vec3 point, std::span<float> out);

// Receivers with a diffuse transfer of harmonics, arranged for products.
struct MovingReceivers {
  size_t count = 0;
  int order = 0, channels = 1;
  std::vector<Vec3> positions, normals;  // normals are unit
  AlignedVector<float> transfer;         // [tile][channel][coefficient][receiver in tile]
  AlignedVector<float> lobes;            // [tile][9][receiver in tile]: the cosine about the normal, over pi
  AlignedVector<float> lanes;            // [tile][position x, y, z, normal x, y, z][receiver in tile]
  // The same once more by receiver, where arrange_rows() was asked.
  AlignedVector<uint16_t> rows;       // halves, [receiver][channel][coefficient, padded to a multiple of 16]
  AlignedVector<uint16_t> lobe_rows;  // [receiver][9, padded to 16]
  // Receivers that are multiplied together: a sphere about them.
  struct Tile {
    Vec3 center{0.0f};
    float radius = 0;
  };
  std::vector<Tile> tiles;
};
// Turned and moved from where it was baked, about `center`; harmonics alone, one row.
MovingReceivers moving_receivers(const Transfer& transfer, std::span<const Vec3> positions,
                                 std::span<const Vec3> normals, Vec3 center = Vec3(0.0f), const RigidPlace& place = {});

// So that a light that all of them share is shaded by tables of what objects hide of it (hidden_table.h) where that is
// quicker. Takes as much memory as the transfer once more.
void arrange_rows(MovingReceivers& receivers);

// A light, and what of it leaves each receiver; `values` holds what does without the objects.
struct MovingLight {
  std::span<const Vec3> light;  // coefficients; of all receivers the same, or `each`
  bool each = false;            // [receiver][coefficient], `order`^2 a receiver
  Relit* values = nullptr;
};

// How objects are summed over receivers.
struct MovingOptions {
  int light_order = 0;          // bands of the light
  float least_share = 2.5e-4f;  // of the sphere: what hides less is passed over
  bool bounced = false;         // `values` hold more than T . light: light that has bounced
};

// `values` = T . light of each receiver, as if there were no objects.
void light_receivers(const MovingReceivers& receivers, int light_order, const MovingLight& light);

// How much was done: pairs of a receiver and an object that were looked at, and tiles that were multiplied.
struct MovingCount {
  size_t pairs = 0, tiles = 0;
  size_t tables = 0;  // objects that have one (hidden_table.h)
};

struct HiddenTable;

// Keeps tables from frame to frame; not for two threads at a time.
class MovingShader {
 public:
  MovingShader();
  MovingShader(MovingShader&&) noexcept;
  MovingShader& operator=(MovingShader&&) noexcept;
  ~MovingShader();
  // Light that comes straight from the sky (`receivers`) is multiplied by what the objects leave open, direction by
  // direction. The rest of `values`, where there is any, is dimmed by what they leave open of the cosine.
  MovingCount shade(const MovingReceivers& receivers, std::span<const PlacedObject* const> objects,
                    const MovingOptions& options, std::span<const MovingLight> lights);

 private:
  void make_tables(const MovingReceivers& receivers, std::span<const PlacedObject* const> objects,
                   const MovingOptions& options, std::span<const MovingLight> lights);

  ShTileProducts products_;
  std::vector<HiddenTable> tables_;  // [object]
};

}  // namespace lambent
