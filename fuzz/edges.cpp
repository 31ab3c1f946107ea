// libFuzzer counts how often edges are passed; ours are flags of whether (cmake/fuzz.cmake), bytes as well.
#include <cstdint>

extern "C" void __sanitizer_cov_8bit_counters_init(uint8_t* begin, uint8_t* end);
extern "C" void __sanitizer_cov_bool_flag_init(bool* begin, bool* end) {
  static_assert(sizeof(bool) == 1);
  __sanitizer_cov_8bit_counters_init(reinterpret_cast<uint8_t*>(begin), reinterpret_cast<uint8_t*>(end));
}
