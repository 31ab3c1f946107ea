#pragma once
// What a live picture holds, and the steps that its work is made of.
#include <lambent/light/lamps.h>
#include <lambent/core/clock.h>
#include <lambent/light/peaks.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/draw_columns.h>
#include <lambent/pipeline/draw_moving.h>
#include <lambent/pipeline/live_kind.h>
#include <lambent/pipeline/live_look.h>

#include <array>

namespace lambent {

inline double seconds_from(Clock::time_point start) { return seconds_since(start); }

// A light to draw by, and what --window auto asks of it.
struct LiveLight {
  std::shared_ptr<const Environment> env;
  std::shared_ptr<const KnownHarmonics> known;
};

// The scene with objects in it that were not baked with it.
struct Company {
  Scene scene;
  SpatialBasis basis;
  std::optional<Outgoing> outgoing;
  std::vector<Vec3> emission;
  std::vector<size_t> first;  // triangle of each object
};

inline constexpr int coarsest_live = 4;  // a side's share of pixels in a hurry, at least

struct LivePicture::State {
  const Baked& baked;
  DrawRequest asked;
  Job job;
  View view = {};
  Look look = Look::picture;
  int number = 0;  // of a coefficient, a row
  Mat3 turn{1.0f};

  // What has to be made anew, first to last; `draft`: made in a hurry, and to be made again.
  struct {
    bool environment = true, materials = true, pose = true, light = true, values = true, rays = true, shades = true,
         objects = true;
  } due = {};
  bool draft_light = false, draft_values = false, draft_shades = false;

  std::array<LiveLight, 2> light = {};  // as it is, and coarse
  // One of three.
  std::optional<ColumnDrawing> columns = std::nullopt;
  std::optional<BlockShading> blocks = std::nullopt;
  std::unique_ptr<LiveKind> kind = nullptr;
  std::optional<Pose> pose = std::nullopt;
  Scene moved = {};
  std::optional<MovingDrawing> moving = std::nullopt;  // of --place
  std::optional<Company> company = std::nullopt;
  std::optional<Tracer> tracer = std::nullopt;
  Relit relit = {}, peaks = {};
  Rows rows = {};
  std::vector<uint32_t> seen = {};      // receivers in the picture, in a hurry; empty: not known yet
  int seen_scale = 0;                   // of the rays that met them
  double seen_share = 1;                // of all blocks of receivers, those that they are in
  size_t turn_of = 0;                   // of blocks, of their parts
  std::vector<uint8_t> has_value = {};  // of blocks, receivers that were shaded, if long ago

  std::array<std::vector<ViewRays>, coarsest_live + 1> rays = {};  // by scale
  int scale = 1;
  bool fresh_rays = true;         // none of them has been shaded yet
  std::optional<ViewRays> extra;  // of a pass that is not kept
  ViewSums sums = {};
  int row = 0;  // of the pass under way, the first that is not shaded yet
  Image image = {};
  LookMeasure measured = {};
  double trace_cost = 2e-7, shade_cost = 1e-7, receiver_cost = 1e-6;  // seconds each, as measured
  LiveTimes times = {};

  const Scene& scene() const { return kind ? kind->scene() : company ? company->scene : pose ? moved : baked.scene; }
  const Tracer* rays_of() const { return kind ? &kind->tracer() : tracer ? &*tracer : nullptr; }
  LiveSkies skies() const;
  const SpatialBasis& basis() const { return company ? company->basis : baked.basis; }
  bool has_objects() const { return moving || (columns && !columns->insertions.empty()); }
  LightBasis light_basis() const { return light_of(baked.surface.store); }
  bool is_fixed() const { return !kind && std::holds_alternative<FixedView>(baked.surface.where); }
  int width() const { return std::max(1, view.width / scale); }
  int height() const { return std::max(1, view.height / scale); }

  Result<void> ask_kind(const DrawRequest& request, const DrawRequest& before, bool sky);
  Result<void> ask_parts(const DrawRequest& request, const DrawRequest& before, bool sky);
  Result<bool> work_on_light(bool hurry, double budget);
  bool can_look();
  void forget_rays();
  Result<void> make_kind();
  Result<void> make_environment_due();
  Result<void> make_materials();
  Result<void> make_pose();
  Result<void> make_objects();
  Result<void> join_objects();
  Result<void> project(bool hurry);
  Result<void> make_values(bool hurry, double budget);
  Result<void> shade_blocks_seen(bool hurry, double budget);
  void choose_scale(bool hurry, double budget);
  Result<void> add_sample(bool hurry);
  void draw_fixed();
  Result<const ViewRays*> trace_pass();
  std::function<Vec3(Vec3)> background() const;
  std::function<RayShade()> shade_maker(RenderOptions& options, const ViewRays& pass, bool hurry);
  Result<void> light_kind(bool hurry, double budget);
  void restart() { sums = {}, row = 0, extra.reset(); }
  const std::vector<uint32_t>& receivers_in_view();
  bool can_shade_what_is_seen() const;
};

}  // namespace lambent
