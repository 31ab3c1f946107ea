#pragma once
// Tests of accuracy that take long, and whose code shorter tests or tests/command_line.sh run too, are left to the
// release build.
#include <gtest/gtest.h>

extern "C" void __asan_init() __attribute__((weak));

namespace lambent {

// Whether the program is linked with the address sanitizer: asked as it runs, since tests are compiled once for both.
inline bool under_sanitizers() { return __asan_init != nullptr; }

}  // namespace lambent

#define SKIP_UNDER_SANITIZERS() \
  if (lambent::under_sanitizers()) GTEST_SKIP() << "long, and only accuracy: run without sanitizers"
