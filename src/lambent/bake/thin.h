#pragma once
// Where receivers are denser than light varies, some stand for the others: they alone are traced, and local regression
// over them gives the rest. Sources: irradiance caching (Ward, Rubinstein and Clear, "A ray tracing solution for
// diffuse interreflection", 1988), with values compared instead of distances guessed from; radiosity, "Adaptive
// Refinement".
#include <lambent/core/result.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>

#include <array>
#include <functional>
#include <span>
#include <vector>

namespace lambent {

// Rows of receivers by few rays, [i][width]; `pass` chooses the rays. inside[i] 1: lies inside something.
using PilotRows =
    std::function<Result<void>(std::span<const uint32_t> which, uint32_t pass, float* rows, uint8_t* inside)>;

struct ThinOptions {
  double error = 0.005;   // relative RMS, by area, that the regression may lose; > 0
  double square = 0;      // mean |row|^2 that this is relative to, at least
  size_t fewest = 6'000;  // receivers to begin with, where there are as many; fewer than twice that are all traced
  double worth = 0.7;     // if more than this part would be traced, all are
};

struct Thinned {
  std::vector<uint32_t> chosen;  // receivers that are traced, ascending
  std::vector<uint32_t> of;      // [receiver]: the index into `chosen` of the one that stands for it
  size_t tried = 0;              // rows of the pilot
  double error = 0;              // relative RMS that the regression loses, measured at receivers that were left out
  double noise = 0;              // relative RMS of the noise of the pilot's rows
  bool all() const { return chosen.size() == of.size(); }
};

// All of them.
Thinned keep_all(size_t receivers);

// Chooses level by level: from a few that are spread evenly over the surface to more where leaving one out changes its
// row. Two passes of the pilot make differences that are right in the mean, whatever its noise. The same for any number
// of threads and ranks. Errors: those of the pilot.
Result<Thinned> thin(const Scene& scene, const Receivers& receivers, size_t width, const PilotRows& pilot,
                     const ThinOptions& options);

// The chosen ones as receivers of their own: what a ray meets is received by those that stand for it.
Receivers thinned_receivers(const Receivers& receivers, const Thinned& thinned);

// Rows of all receivers from those of the chosen ones: a quadratic over the tangent plane and a plane over normals,
// fitted to neighbours on the same surface.
class Spread {
 public:
  static constexpr size_t most = 16;
  struct Shares {
    std::array<uint32_t, most> index;  // into the chosen
    std::array<float, most> share;
    size_t count = 0;
  };
  // Of the chosen, left_out[i] 1: tells nothing (inside something); empty: none. `receivers` and `thinned` must outlive
  // it.
  // `guide`: rows of the chosen; neighbours whose row is very different, as beyond a wall, tell nothing. Null: all
  // tell.
  Spread(const Receivers& receivers, const Thinned& thinned, std::span<const uint8_t> left_out,
         const float* guide = nullptr, size_t width = 0);
  Shares shares(size_t receiver) const;
  // rows: [chosen][width]
  void row(size_t receiver, const float* rows, size_t width, float* out) const;

 private:
  struct Near {
    std::array<uint32_t, most> index{};
    uint32_t count = 0;
  };
  const Receivers& receivers_;
  const Thinned& thinned_;
  std::vector<Near> near_;  // of the chosen that stand for others: itself first
};

// The part of the surface that each receiver stands for; they add up to the area of all sides that receive.
std::vector<float> receiver_areas(const Scene& scene, const Receivers& receivers);

}  // namespace lambent
