#include <lambent/pipeline/relight_loop.h>

#include <lambent/core/clock.h>
#include <lambent/light/cube_light.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <algorithm>

namespace lambent {
namespace {

constexpr const char* taken[] = {"baked", "env",    "env-rotate",   "camera",   "size",
                                 "brdf",  "method", "brdf-samples", "tolerance"};

Result<void> check_loop(const LoopRequest& request, const Baked& baked) {
  if (kind_of(baked.surface) != DrawKind::blocks)
    return Error{request.draw.baked, "holds no visibility in blocks: lambent bake --transfer blocks"};
  for (const Option<DrawRequest>& o : draw_options())
    if (std::find(std::begin(taken), std::end(taken), std::string(o.name)) == std::end(taken) &&
        is_given(request.draw, json_name(o.name)))
      return Error{std::string("--") + o.name, "has no effect on the loop", true};
  return check_draw(request.draw, baked);
}

Result<Summary> summary_of(const BlockShading& s, const LoopRequest& request, int done, double seconds) {
  const double frames = double(std::max(done, 1));
  const double each = s.seen ? 1e9 * s.shade_seconds / double(s.seen) : 0.0;
  const size_t receivers = receivers_of(s.baked->surface.store);
  const VisibilityStatistics stored = visibility_statistics(std::get<Visibility>(s.baked->surface.store));
  const double bytes = double(std::get<Visibility>(s.baked->surface.store).bytes());
  Summary out;
  out.json = {{"frames", done},
              {"seconds", seconds},
              {"frames_per_second", frames / seconds},
              {"receivers", receivers},
              {"seen", double(s.seen) / frames},
              {"ns_per_vertex", each},
              {"changes_per_block", stored.changes * stored.mixed},
              {"bytes", bytes},
              {"ms",
               {{"project", 1e3 * s.project_seconds / frames},
                {"forms", 1e3 * s.forms_seconds / frames},
                {"cull", 1e3 * s.cull_seconds / frames},
                {"shade", 1e3 * s.shade_seconds / frames}}},
              {"breakdown", describe(s.breakdown)}};
  out.lines.emplace_back(
      "frames", fmt::format("{} in {}: {:.1f} a second; {} of {} receivers seen", done, human_seconds(seconds),
                            frames / seconds, human_count(size_t(double(s.seen) / frames)), human_count(receivers)));
  out.lines.emplace_back("ms a frame",
                         fmt::format("project {:.2f}, forms {:.2f}, cull {:.2f}, shade {:.2f} ({:.0f} ns a receiver)",
                                     1e3 * s.project_seconds / frames, 1e3 * s.forms_seconds / frames,
                                     1e3 * s.cull_seconds / frames, 1e3 * s.shade_seconds / frames, each));
  // As the paper's Table 3; and its Tables 1 and 2.
  out.lines.emplace_back(
      "table", fmt::format("{:>8} {:>10} {:>10} {:>8} {:>9}", "FPS", "vertices", "seen", "changes", "database"));
  out.lines.emplace_back("",
                         fmt::format("{:>8.1f} {:>10} {:>10} {:>8.1f} {:>9}", frames / seconds, human_count(receivers),
                                     human_count(size_t(double(s.seen) / frames)), stored.changes, human_bytes(bytes)));
  if (request.draw.method != "blocks") return out;
  const Breakdown& b = s.breakdown;
  const double all = double(std::max<size_t>(1, b.light_brdf + b.light_visibility + b.triple)) / 100;
  const auto& n = b.samples;
  const double samples = double(std::max<size_t>(1, b.all_samples())) / 100;
  out.lines.emplace_back(
      "blocks", fmt::format("{:.1f} % light x BRDF, {:.1f} % light x visibility, {:.1f} % all three",
                            double(b.light_brdf) / all, double(b.light_visibility) / all, double(b.triple) / all));
  out.lines.emplace_back("samples", fmt::format("1: {:.1f} %, 4: {:.1f} %, 16: {:.1f} %, 64: {:.1f} %, 256: {:.1f} %",
                                                double(n[0]) / samples, double(n[1]) / samples, double(n[2]) / samples,
                                                double(n[3]) / samples, double(n[4]) / samples));
  if (const StageTimes& t = b.times; t.receivers > 0) {
    const double of = double(t.receivers);
    out.lines.emplace_back("ns a receiver", fmt::format("visibility {:.0f}, BRDF {:.0f}, integral {:.0f}",
                                                        t.visibility / of, t.brdf / of, t.integral / of));
  }
  return out;
}

}  // namespace

std::vector<Option<DrawRequest>> loop_options() {
  std::vector<Option<DrawRequest>> out;
  for (const Option<DrawRequest>& o : draw_options())
    if (std::find(std::begin(taken), std::end(taken), std::string(o.name)) != std::end(taken)) out.push_back(o);
  return out;
}

Result<Summary> relight_loop(const LoopRequest& request, const Job& job) {
  auto baked = load_baked(request.draw.baked);
  if (!baked) return baked.error();
  if (auto ok = check_loop(request, *baked); !ok) return ok.error();
  if (request.frames < 1 || request.frames > 100000) return Error{"--frames", "must lie between 1 and 100000", true};
  auto view = parse_view(request.draw.camera, request.draw.size, baked->scene);
  if (!view) return view.error();
  auto around = surroundings_of(request.draw, job);
  if (!around) return around.error();
  auto shading = make_block_shading(*baked, request.draw);
  if (!shading) return shading.error();
  const Environment env = reduced(*around->env, 8 * std::get<Visibility>(baked->surface.store).size);
  if (auto ok = set_environment(*shading, env, around->rotation, &job); !ok) return ok.error();
  shading->project_seconds = shading->forms_seconds = 0;
  const View first = *view;
  const auto start = Clock::now();
  int done = 0;
  for (; done < request.frames && !is_cancelled(job.progress); ++done) {
    const Mat3 turn = rotation_from_yaw_pitch_roll({360.0f * float(done) / float(request.frames), 0, 0});
    if (request.spin_light)
      if (auto ok = set_environment(*shading, env, turn * around->rotation); !ok) return ok.error();
    if (request.turntable) view->camera.eye = first.camera.target + turn * (first.camera.eye - first.camera.target);
    if (auto ok = shade_view(*shading, *view); !ok) return ok.error();
  }
  const double seconds = seconds_since(start);
  return summary_of(*shading, request, done, seconds);
}

}  // namespace lambent
