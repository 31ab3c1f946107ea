// What each test reaches: where $LAMBENT_REACHED names a file, a test adds a line to it, with its name, the
// microseconds that it took, and the ranges of edges in the libraries that it passed, counted from the first (FROM-TO,
// or one). For clang's inline counters of edges, which the sanitizers' build has for the fuzz targets; tests/reached.py
// reads it.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <vector>

namespace {

struct Counters {
  uint8_t *begin, *end;
};
// Not a global of its own: counters are told of by constructors, in whatever order.
std::vector<Counters>& counters() {
  static std::vector<Counters> all;
  return all;
}

class Reached : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override {
    for (const Counters& c : counters()) std::fill(c.begin, c.end, 0);
    begun_ = std::chrono::steady_clock::now();
  }
  void OnTestEnd(const testing::TestInfo& test) override {
    const auto took = std::chrono::steady_clock::now() - begun_;
    std::ofstream out(std::getenv("LAMBENT_REACHED"), std::ios::app);
    out << test.test_suite_name() << '.' << test.name() << ' '
        << std::chrono::duration_cast<std::chrono::microseconds>(took).count();
    size_t first = 0;
    for (const Counters& c : counters()) {
      for (const uint8_t* at = c.begin;
           (at = std::find_if(at, (const uint8_t*)c.end, [](uint8_t n) { return n; })) < c.end;) {
        const uint8_t* end = std::find(at, (const uint8_t*)c.end, 0);
        out << ' ' << first + (at - c.begin);
        if (end - at > 1) out << '-' << first + (end - c.begin) - 1;
        at = end;
      }
      first += c.end - c.begin;
    }
    out << '\n';
  }
  std::chrono::steady_clock::time_point begun_;
};

const bool listening = [] {
  if (std::getenv("LAMBENT_REACHED")) testing::UnitTest::GetInstance()->listeners().Append(new Reached);
  return true;
}();

}  // namespace

extern "C" void __sanitizer_cov_8bit_counters_init(uint8_t* begin, uint8_t* end) { counters().push_back({begin, end}); }
