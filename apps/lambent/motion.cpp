#include "motion.h"

#include <charconv>

namespace lambent::tool {
namespace {

constexpr size_t max_frames = 64;

// A:B[:STEP], in seconds.
Result<std::vector<double>> parse_frames(const std::string& text) {
  const Error wrong{"--frames", "expects FROM:TO[:STEP] in seconds, at most " + std::to_string(max_frames) +
                                    " of them, not \"" + text + "\""};
  double n[3] = {0, 0, 0};
  size_t count = 0;
  const char* p = text.data();
  const char* end = p + text.size();
  for (; count < 3; ++p) {
    const auto [next, status] = std::from_chars(p, end, n[count]);
    if (status != std::errc() || !std::isfinite(n[count])) return wrong;
    ++count, p = next;
    if (p == end || *p != ':') break;
  }
  if (p != end || count < 2 || n[1] < n[0]) return wrong;
  if (count == 2) n[2] = (n[1] - n[0]) / 5;
  if (n[1] == n[0]) return std::vector<double>{n[0]};
  if (!(n[2] > 0) || (n[1] - n[0]) / n[2] >= double(max_frames)) return wrong;
  std::vector<double> times;
  for (size_t i = 0; n[0] + double(i) * n[2] <= n[1] + 1e-9 * n[2]; ++i) times.push_back(n[0] + double(i) * n[2]);
  return times;
}

}  // namespace

void MotionOptions::add_to(CLI::App& c, bool with_frames) {
  auto* named = c.add_option("--animation", animation, "Pose the scene by this glTF animation, by name or number");
  auto* at = c.add_option("--time", time, "At this time, seconds")->needs(named);
  if (with_frames)
    c.add_option("--frames", frames, "FROM:TO[:STEP]: at these times, seconds, as a strip of pictures")
        ->needs(named)
        ->excludes(at);
  c.add_option("--deform", deform,
               "bend:ANGLE[,along[,towards]] or twist:ANGLE[,along]: degrees from end to end, axes x, y or z")
      ->excludes(named);
}

Result<std::vector<std::optional<Pose>>> make_poses(const MotionOptions& o, const Scene& scene) {
  std::vector<std::optional<Pose>> poses;
  if (!o.deform.empty()) {
    auto deformation = parse_deformation(o.deform);
    if (!deformation) return deformation.error();
    poses.push_back(deform_scene(scene, *deformation));
  } else if (!o.animation.empty()) {
    std::vector<double> times{o.time};
    if (!o.frames.empty()) {
      auto given = parse_frames(o.frames);
      if (!given) return given.error();
      times = *given;
    }
    auto animation = find_animation(scene, o.animation);
    if (!animation) return animation.error();
    for (double t : times) {
      auto pose = pose_scene(scene, *animation, t);
      if (!pose) return pose.error();
      poses.push_back(std::move(*pose));
    }
  } else {
    poses.emplace_back();
  }
  return poses;
}

std::vector<Mat3> receiver_rotations(const Pose& pose, const std::vector<uint32_t>& front,
                                     const std::vector<uint32_t>& back, size_t receivers) {
  std::vector<Mat3> rotations(receivers, Mat3(1.0f));
  std::vector<bool> known(receivers);
  for (const auto* map : {&front, &back})
    for (size_t v = 0; v < map->size(); ++v)
      if (const uint32_t r = (*map)[v]; r != none && !known[r]) rotations[r] = pose.rotations[v], known[r] = true;
  return rotations;
}

}  // namespace lambent::tool
