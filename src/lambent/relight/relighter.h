#pragma once
// Relights a field, whatever its store: what a program embeds. One relighter a store lies behind it; nothing else needs
// to know which.
#include <lambent/relight/indirect.h>
#include <lambent/relight/products.h>
#include <lambent/relight/relight_haar.h>
#include <lambent/relight/zonal.h>
#include <lambent/transfer/field.h>

#include <optional>

namespace lambent {

// What stays from frame to frame, by store; of other stores it is not looked at.
struct RelighterOptions {
  // Lobes: summed one by one, exactly; else looked up in a table of the light, much faster (zonal.h).
  bool direct_lobes = false;
  // Visibility in blocks: where its receivers are and what they are made of; a must. How light, visibility and BRDF are
  // multiplied, and of Haar coefficients the share that is kept.
  ProductReceivers receivers = {};
  Product product = Product::blocks;
  double haar_fraction = 0.01;
  // Direct to indirect light: other albedos of the surfels than were baked, one each; empty: those.
  std::vector<Vec3> albedos = {};
  // Haar wavelets: how many of the light's are used, those that change most; 0: all.
  size_t terms = 0;
};

// What changes from frame to frame.
struct RelightFrame {
  // Lobes alone: how each receiver has turned since the bake (null: as baked), and a light of each receiver's own in
  // place of set_light()'s (null: that).
  const ReceiverFrames* frames = nullptr;
  const LightField* light = nullptr;
  // Visibility in blocks, where radiance depends on the view: the eye. Other stores relight for every eye at once.
  Vec3 eye{0.0f};
  // The receivers to relight (none given: all); others get 0, or where `keep` stay as they are in `out`. Of dense
  // transfer, clusters and lobes their neighbours in the store are relit with them; factors, wavelets and surfels, and
  // lobes under a light each, relight all.
  bool keep = false;
  // Of BRDFs in a block, 1, 4, 16, 64 or 256: fewer are faster, for what moves, and `breakdown` says what they cost.
  int most_samples = 256;
  std::optional<std::span<const uint32_t>> seen = std::nullopt;
  Breakdown* breakdown = nullptr;  // of blocks; added to
  HaarReading* reading = nullptr;  // of wavelets; set
};

// See above; errors name what does not fit, in a line.
class Relighter {
 public:
  // The field is not copied: it must outlive the relighter and stay where it is. Errors: parts of the field that do not
  // fit one another; visibility without a place and a material for each receiver; Haar wavelets on a cube whose side is
  // not a power of two.
  static Result<Relighter> make(const Field& field, RelighterOptions options = {});
  Relighter(Relighter&&) noexcept;
  Relighter& operator=(Relighter&&) noexcept;
  ~Relighter();

  const Field& field() const;
  LightBasis light() const;  // the columns that set_light() takes; none of blocks, surfels, wavelets
  size_t receivers() const;
  int rows() const;  // of what relight() gives: what the field's Rows mean; of visibility one, exit radiance

  // One coefficient of radiance a column, light().count() of them; of direct to indirect light instead one a surfel:
  // exit radiance of a white surface there by direct light alone. Errors: another number; a store without columns.
  Result<void> set_light(std::span<const Vec3> columns);
  // For visibility in blocks, and for wavelets. Errors: another store; a cube of another size than the store's.
  Result<void> set_light(const CubeLight& light);

  // T . light at every receiver; may be called from one thread at a time, and works on all cores. The first call sizes
  // `out` and what is needed between, later ones allocate nothing. Errors: no light set; frames, a light field or seen
  // receivers that do not fit the field, or that its store cannot use.
  Result<void> relight(const RelightFrame& frame, Relit& out);

  // The same into memory of the caller's, [receiver][row][r, g, b]: receiver r begins at out[r * stride], in floats.
  // Errors: those above; a stride below 3 rows(); too little room.
  Result<void> relight(const RelightFrame& frame, std::span<float> out, size_t stride);

 private:
  struct State;
  explicit Relighter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace lambent
