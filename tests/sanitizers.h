#pragma once
// Tests of accuracy that take long, and whose code shorter tests or tests/command_line.sh run too, are left to the
// release build.
#include <gtest/gtest.h>

#if defined(__SANITIZE_ADDRESS__)
#define LAMBENT_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LAMBENT_SANITIZED 1
#endif
#endif

#ifdef LAMBENT_SANITIZED
#define SKIP_UNDER_SANITIZERS() GTEST_SKIP() << "long, and only accuracy: run without sanitizers"
#else
#define SKIP_UNDER_SANITIZERS() static_cast<void>(0)
#endif
