#pragma once
// The header of a PLY file: what elements of what properties follow, and how their values are written.
#include <lambent/core/result.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lambent::ply {

enum class Type : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
inline constexpr size_t type_size[] = {1, 1, 2, 2, 4, 4, 4, 8};
inline bool is_float(Type t) { return t == Type::f32 || t == Type::f64; }

template <class Act>
void with_type(Type type, Act act) {
  switch (type) {
    case Type::i8: return act(int8_t{});
    case Type::u8: return act(uint8_t{});
    case Type::i16: return act(int16_t{});
    case Type::u16: return act(uint16_t{});
    case Type::i32: return act(int32_t{});
    case Type::u32: return act(uint32_t{});
    case Type::f32: return act(float{});
    case Type::f64: return act(double{});
  }
}

struct Property {
  std::string name;
  Type type{};
  bool is_list = false;
  Type count_type{};
};

struct Element {
  std::string name;
  uint64_t count = 0;
  size_t line = 0;
  std::vector<Property> properties;
  size_t row_size = 0;  // bytes in binary; 0 where there are lists
};

enum class Format { ascii, little_endian, big_endian };

struct Header {
  Format format{};
  std::vector<Element> elements;
  std::vector<std::string> textures;  // what `comment TextureFile` lines say
  size_t size = 0;                    // bytes
  size_t lines = 0;
};

// Errors: not PLY, malformed, of another version.
Result<Header> parse_header(std::string_view text, const std::string& path);

}  // namespace lambent::ply
