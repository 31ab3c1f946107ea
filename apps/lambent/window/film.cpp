#include "film.h"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <functional>

namespace lambent::tool {

Result<void> settle(Session& session, const Job& job) {
  for (;;) {
    if (is_cancelled(job.progress)) return Error{"", "cancelled"};
    auto more = session.work(false);
    if (!more) return more.error();
    if (!*more) return {};
  }
}

namespace {

// Calls shoot(i) for each picture of the way around.
Result<void> go_around(Session& session, const std::string& what, int count, const Job& job,
                       const std::function<Result<void>(int)>& shoot) {
  const float step = 360.0f / float(count);
  for (int i = 0; i < count; ++i) {
    if (auto ok = settle(session, job); !ok) return ok;
    if (auto ok = shoot(i); !ok) return ok;
    if (auto ok = what == "light" ? session.turn_light(step, 0) : session.orbit(step, 0); !ok) return ok;
  }
  return {};
}

Result<void> encode(Session& session, const std::string& what, int count, const std::string& path, const Job& job) {
  if (path.find_first_of("'\\") != std::string::npos) return Error{path, "has a quote in its name"};
  if (std::system("command -v ffmpeg >/dev/null 2>&1") != 0)
    return Error{path, "is made by ffmpeg, which is not installed; NAME%d.png makes pictures"};
  const View view = session.live->view();
  const std::string order = fmt::format(
      "ffmpeg -nostdin -loglevel error -y -f rawvideo -pixel_format rgba -video_size {}x{} -framerate 30 "
      "-i pipe:0 -pix_fmt yuv420p -vf 'crop=trunc(iw/2)*2:trunc(ih/2)*2' 'file:{}'",
      view.width, view.height, path);
  FILE* pipe = popen(order.c_str(), "w");
  if (!pipe) return Error{path, "ffmpeg could not be started"};
  std::vector<uint8_t> rgba(4 * size_t(view.width) * size_t(view.height));
  auto result = go_around(session, what, count, job, [&](int) -> Result<void> {
    session.paint(rgba.data());
    if (fwrite(rgba.data(), 1, rgba.size(), pipe) != rgba.size()) return Error{path, "ffmpeg ended early"};
    return {};
  });
  const bool ended_well = pclose(pipe) == 0;
  if (result && !ended_well) return Error{path, "ffmpeg failed, as it says above"};
  return result;
}

}  // namespace

Result<void> film(Session& session, const std::string& what, int count, const std::string& path, const Job& job) {
  if (what != "light" && what != "camera") return Error{"film", "turns the light or the camera", true};
  const size_t at = path.find('%');
  if (at == std::string::npos) return encode(session, what, count, path, job);
  const size_t end = path.find('d', at);
  const std::string after = end == std::string::npos ? ".png" : path.substr(end + 1);
  return go_around(session, what, count, job,
                   [&](int i) { return session.save(path.substr(0, at) + fmt::format("{:03}", i) + after); });
}

}  // namespace lambent::tool
