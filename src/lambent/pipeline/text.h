#pragma once
// Numbers as people read them.
#include <lambent/transfer/transfer.h>

#include <string>

namespace lambent {

// "1.5 MB", "830 bytes"; "12.3 s", "2 min 5 s"; 1234567 -> "1,234,567".
std::string human_bytes(double bytes);
std::string human_seconds(double seconds);
std::string human_count(size_t count);

// "order 6", "order 5 and 8 lobes", "36 lobes".
std::string describe_light(const LightBasis& light);

}  // namespace lambent
