#pragma once
// The clock that work is timed by: it never goes back.
#include <chrono>

namespace lambent {

using Clock = std::chrono::steady_clock;

// Seconds from `start` until now.
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace lambent
