#include <lambent/pipeline/relight_loop.h>

#include <lambent/light/cube_light.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

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
  Summary out;
  out.json = {{"frames", done},
              {"seconds", seconds},
              {"frames_per_second", frames / seconds},
              {"receivers", receivers},
              {"seen", double(s.seen) / frames},
              {"ns_per_vertex", each},
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
  if (request.draw.method == "blocks") out.lines.emplace_back("blocks", describe(s.breakdown).dump());
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
  const auto start = std::chrono::steady_clock::now();
  int done = 0;
  for (; done < request.frames && !is_cancelled(job.progress); ++done) {
    const Mat3 turn = rotation_from_yaw_pitch_roll({360.0f * float(done) / float(request.frames), 0, 0});
    if (request.spin_light)
      if (auto ok = set_environment(*shading, env, turn * around->rotation); !ok) return ok.error();
    if (request.turntable) view->camera.eye = first.camera.target + turn * (first.camera.eye - first.camera.target);
    if (auto ok = shade_view(*shading, *view); !ok) return ok.error();
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary_of(*shading, request, done, seconds);
}

}  // namespace lambent
