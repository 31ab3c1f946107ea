#pragma once
// Files that tests of loaders write.
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace lambent::test {

// A folder of its own that goes away with the object.
struct TemporaryFolder {
  std::filesystem::path path;
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lambent-test-XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  std::string file(const std::string& name) const { return (path / name).string(); }
  void write(const std::string& name, std::string_view bytes) const {
    std::ofstream(path / name, std::ios::binary) << bytes;
  }
};

// 2 x 1 pixels, red and blue, RGB, no compression; checksums by the PNG specification.
inline std::string tiny_png() {
  auto be = [](uint32_t x) { return std::string{char(x >> 24), char(x >> 16), char(x >> 8), char(x)}; };
  auto chunk = [&](std::string body) {
    uint32_t crc = ~0u;
    for (char c : body) {
      crc ^= uint8_t(c);
      for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return be(uint32_t(body.size() - 4)) + body + be(~crc);
  };
  std::string raw("\0\xff\0\0\0\0\xff", 7);  // filter byte, two pixels
  uint32_t a = 1, b = 0;
  for (char c : raw) a = (a + uint8_t(c)) % 65521, b = (b + a) % 65521;
  std::string header = "IHDR" + be(2) + be(1) + std::string("\x08\x02\0\0\0", 5);
  std::string data = "IDAT" + std::string("\x78\x01\x01\x07\0\xf8\xff", 7) + raw + be(b << 16 | a);
  return "\x89PNG\r\n\x1a\n" + chunk(header) + chunk(data) + chunk("IEND");
}

}  // namespace lambent::test
