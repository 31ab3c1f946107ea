// The reader of zonal textures on hostile bytes: whatever it accepts must be safe to look up.
#include <lambent/transfer/zonal_texture.h>

#include <sys/mman.h>
#include <unistd.h>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const int memory = ::memfd_create("lpt", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(memory);
  if (::ftruncate(memory, 0) != 0 || ::pwrite(memory, data, size, 0) != ssize_t(size)) return 0;
  auto file = lambent::MappedFile::open(path);
  if (!file) return 0;
  auto texture = lambent::load_zonal_texture(*file, "fuzz.lpt");
  if (!texture) return 0;
  std::vector<float> values(texture->transfer.row_values());
  for (lambent::Vec2 uv : {lambent::Vec2(0), lambent::Vec2(0.99f), lambent::Vec2(-3.2f, 1e30f)}) {
    lambent::sample_zonal_texture(*texture, uv, values, size_t(texture->transfer.rows) - 1);
    (void)lambent::zonal_harmonics(texture->transfer, values);
    if (texture->groove_depth > 0) lambent::sample_groove(*texture, uv.x, uv.y, values);
  }
  return 0;
}
