// What each test reaches: where $LAMBENT_REACHED names a file, a test adds a line to it, with its name, the
// microseconds that it took, and the ranges of edges in the libraries that it passed, counted from the first (FROM-TO,
// or one). For clang's inline flags of edges, which the sanitizers' build has for the fuzz targets; tests/reached.py
// reads it.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <vector>

namespace {

struct Flags {
  bool *begin, *end;
};
// Not a global of its own: flags are told of by constructors, in whatever order.
std::vector<Flags>& flags() {
  static std::vector<Flags> all;
  return all;
}

class Reached : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override {
    for (const Flags& f : flags()) std::fill(f.begin, f.end, false);
    begun_ = std::chrono::steady_clock::now();
  }
  void OnTestEnd(const testing::TestInfo& test) override {
    const auto took = std::chrono::steady_clock::now() - begun_;
    std::ofstream out(std::getenv("LAMBENT_REACHED"), std::ios::app);
    out << test.test_suite_name() << '.' << test.name() << ' '
        << std::chrono::duration_cast<std::chrono::microseconds>(took).count();
    size_t first = 0;
    for (const Flags& f : flags()) {
      for (const bool* at = f.begin; (at = std::find(at, (const bool*)f.end, true)) < f.end;) {
        const bool* end = std::find(at, (const bool*)f.end, false);
        out << ' ' << first + (at - f.begin);
        if (end - at > 1) out << '-' << first + (end - f.begin) - 1;
        at = end;
      }
      first += f.end - f.begin;
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

extern "C" void __sanitizer_cov_bool_flag_init(bool* begin, bool* end) { flags().push_back({begin, end}); }
