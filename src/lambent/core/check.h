#pragma once
// A broken contract between our own functions stops the program with the place, in release builds too.
#include <cstdio>
#include <cstdlib>

#define LAMBENT_CHECK(condition)                                                            \
  do {                                                                                      \
    if (!(condition)) {                                                                     \
      std::fprintf(stderr, "%s:%d: broken contract: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                         \
    }                                                                                       \
  } while (0)
