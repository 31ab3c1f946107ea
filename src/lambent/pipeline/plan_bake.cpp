// What a bake would take, from a little of it.
#include <lambent/bake/gather.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/pipeline/bake_lightmap.h>
#include <lambent/pipeline/bake_parse.h>
#include <lambent/pipeline/bake_surfels.h>
#include <lambent/pipeline/place_receivers.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <atomic>

namespace lambent {
namespace {

// That most scenes need for the default error, all rounds together.
constexpr int expected_samples = 512;

// Rows and columns that will be stored, of so many channels where the kind leaves it open.
size_t stored_bytes(const BakePlan& plan, const BakeRequest& r, size_t receivers, size_t groups, size_t channels) {
  const size_t value = r.precision == "half" ? 2 : 4, columns = plan.bake.light().count();
  const size_t incident = size_t(sh_count(r.incident_order));
  switch (plan.kind) {
    case BakeKind::diffuse: return receivers * columns * channels * value;
    case BakeKind::lightmap:
      return receivers * (columns + groups) * size_t(directional_rows(plan.lightmap.directional)) * 3 * value;
    case BakeKind::factors: return receivers * size_t(sh_count(plan.bake.order + r.incident_order - 1)) * value;
    case BakeKind::matrix: {
      const OutgoingKind kind = plan.matrix.outgoing;
      const size_t rows = kind == OutgoingKind::map         ? incident
                        : kind == OutgoingKind::svd         ? size_t(plan.matrix.svd_rows)
                        : kind == OutgoingKind::directional ? 2 * size_t(plan.matrix.outgoing_lobes)
                                                            : 2 * size_t(sh_count(plan.matrix.outgoing_order));
      return receivers * rows * columns * channels * value;
    }
    case BakeKind::zonal:
    case BakeKind::glossy_zonal:
      return receivers * (4 + size_t(r.lobes) * (3 + channels * size_t(plan.bake.order))) * value;
    case BakeKind::membrane: return receivers * size_t(4 + plan.bake.order) * value;
    case BakeKind::indirect:
      return 0;  // expect_indirect() tells
    // Where hardly any coefficient is 0.
    case BakeKind::wavelets: return receivers * cube_texels(plan.visibility.size);
    case BakeKind::blocks: return expected_visibility_bytes(receivers, plan.visibility);
  }
  return 0;
}

// Seconds for all receivers by those that a few blocks, evenly apart, take: tracing, and a product with each block's
// rows.
double expected_seconds(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const BakePlan& plan,
                        const BakeRequest& r) {
  constexpr size_t most_blocks = 24;
  const size_t blocks = (receivers.count() + gather_block - 1) / gather_block, sampled = std::min(blocks, most_blocks);
  const int order = std::max(1, plan.bake.order);
  const GatherSetup setup =
      make_gather_setup(scene, tracer, receivers, order, r.samples > 0 ? r.samples : expected_samples, r.seed);
  std::atomic<size_t> done{0};
  const auto start = Clock::now();
  parallel_for(sampled, 1, [&](size_t begin, size_t end) {
    const ScratchPointer scratch = make_gather_scratch(setup);
    GatherBlock block;
    for (size_t i = begin; i < end; ++i) {
      const size_t first = i * blocks / sampled * gather_block,
                   count = std::min(gather_block, receivers.count() - first);
      std::vector<float> rows(count * setup.sky_width());
      std::vector<uint8_t> buried(count);
      const GatherSky sky{rows.data(), nullptr, setup.sky_width(), nullptr, buried.data()};
      trace_gather(setup, *scratch, first, count, &block, &sky);
      done += count;
    }
  });
  return seconds_since(start) * double(receivers.count()) / double(std::max<size_t>(done, 1));
}

// Of a scene and its receivers in a file, at least: a position and a receiver a vertex, three indices a triangle.
size_t scene_bytes(const Scene& scene) { return 16 * scene.positions.size() + 6 * scene.triangles.size(); }

}  // namespace

Result<void> check_file_size(const BakePlan& plan, const BakeRequest& r, const Scene& scene, size_t receivers,
                             size_t groups) {
  // What is stored in another form than it is baked in is not known before.
  if (file_extension(r.output) != "glb" || !r.compress.empty() || !r.fix_view.empty() || !r.fix_light.empty() ||
      plan.kind == BakeKind::blocks || plan.kind == BakeKind::wavelets || plan.kind == BakeKind::indirect ||
      plan.kind == BakeKind::zonal || plan.kind == BakeKind::glossy_zonal)
    return {};
  const bool coloured = plan.bake.bounces > 0 && r.subsurface.empty() && has_coloured_albedo(scene);
  const size_t each = stored_bytes(plan, r, receivers, groups, coloured ? 3 : 1);
  const size_t bytes = each * (r.terms ? size_t(plan.bake.bounces) + 2 : 1) + scene_bytes(scene);
  if (bytes < size_t{1} << 32) return {};
  return Error{
      r.output,
      fmt::format("would take at least {} for {} receivers, and a .glb holds 4 GiB: write a .gltf (-o {}.gltf), "
                  "whose data are beside it, or take fewer bands, --precision half or --compress",
                  human_bytes(double(bytes)), human_count(receivers), r.output.substr(0, r.output.find_last_of('.'))),
      true};
}

Result<Summary> plan_bake(const BakeRequest& asked, const Job& job) {
  auto request = resolved(asked);
  if (!request) return request.error();
  auto plan = plan_of(*request, job);
  if (!plan) return plan.error();
  auto scene = load_scene_of(*request, job);
  if (!scene) return scene.error();
  if (auto ok = adapt_scene(*scene, *request, *plan, job); !ok) return ok.error();
  size_t groups = 0;
  std::string density;
  if (plan->kind == BakeKind::lightmap) {
    auto sky = sky_of_request(*request, job);
    if (!sky) return sky.error();
    const Lamps lamps = make_lamps(*scene, *sky ? &**sky : nullptr, request->light_groups);
    groups = lamps.groups();
    auto dense = with_density(*request, *plan, *scene, lamps, density, job);
    if (!dense) return dense.error();
    *request = std::move(*dense);
  }
  auto placed = place_receivers(*scene, *request, job);
  if (!placed) return placed.error();
  auto tracer = Tracer::build(*scene, job.progress);
  if (!tracer) return tracer.error();
  const size_t receivers = placed->receivers.count();
  size_t bytes = stored_bytes(*plan, *request, receivers, groups, 3);
  double seconds = 0;
  const bool traced = request->shadows == "on" && plan->kind != BakeKind::membrane && receivers > 0;
  if (plan->kind == BakeKind::indirect) {
    auto options = indirect_options(*request, *plan, *scene);
    if (!options) return options.error();
    auto expected = expect_indirect(*scene, *tracer, placed->receivers, *options, job.progress);
    if (!expected) return expected.error();
    bytes = expected->bytes.all(), seconds = expected->seconds;
  } else if (traced) {
    seconds = expected_seconds(*scene, *tracer, placed->receivers, *plan, *request);
  }
  Summary s;
  s.json = {{"request", to_json(*request)}, {"receivers", receivers}, {"bytes", bytes}, {"seconds", seconds}};
  s.lines = {{"request", to_text(*request)},
             {"receivers", human_count(receivers)},
             {"size", (plan->kind == BakeKind::indirect ? "about " : "at most about ") + human_bytes(double(bytes))},
             {"time", fmt::format("about {} of tracing on {} threads", human_seconds(seconds), thread_count())}};
  return s;
}

}  // namespace lambent
