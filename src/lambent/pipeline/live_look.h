#pragma once
// What pixels of a live picture show in place of it.
#include <lambent/pipeline/live.h>
#include <lambent/pipeline/view_error.h>

namespace lambent {

// What no file holds and rays tell, found on a thread of its own.
class LookMeasure {
 public:
  LookMeasure();
  LookMeasure(LookMeasure&&) noexcept;
  LookMeasure& operator=(LookMeasure&&) noexcept;
  ~LookMeasure();  // stops

  // Whether a look needs it; and can have it of this file: errors say why not.
  static bool is_for(Look look) { return look == Look::hits || look == Look::buried || look == Look::error; }
  static Result<void> check(Look look, const Baked& baked);
  // Begins to find what the look needs, unless that is known or under way. The file must outlive it.
  void start(Look look, const Baked& baked);
  bool knows(Look look) const;  // also where nothing was found
  std::string failure() const;  // of the latest; empty: none

  const std::vector<float>& hits() const;      // by receiver: the share of its rays that meet a surface
  const std::vector<uint8_t>& buried() const;  // by receiver
  const ErrorView& error() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// What a look is made of, which must outlive it. `number`: of a coefficient, row or lobe.
struct LookAt {
  Look look;
  int number;
  const Scene& scene;
  const SpatialBasis& basis;
  const Relit& relit;  // of Look::coefficient, the values of that column alone
  const LookMeasure& measured;
};
std::function<SurfaceShade()> look_shade(const LookAt& at);

// Looks that are painted over the whole picture, once: by a pass of its rays.
bool is_overlay(Look look);
Image paint_look(const LookAt& at, const Baked& baked, const Tracer& tracer, const ViewRays& pass, const View& view);

// Whether the file has such a look. Errors begin with "look".
Result<void> check_look(Look look, int number, const Baked& baked, const Rows& rows);

}  // namespace lambent
