#pragma once
#include "session.h"

namespace lambent::tool {

// All work that there is but the path tracer's. Errors: the work's; cancelled.
Result<void> settle(Session& session, const Job& job);

// `count` settled pictures of the light's ("light") or the camera's way around: NAME%d.png and the like, or a film
// through ffmpeg. Errors: another way; no ffmpeg; what it or the disk says.
Result<void> film(Session& session, const std::string& what, int count, const std::string& path, const Job& job);

}  // namespace lambent::tool
