// The baked-file reader on hostile bytes: whatever it accepts must be safe to project light onto and to relight.
#include <lambent/baked/baked_file.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relight.h>

#include <sys/mman.h>
#include <unistd.h>

#include <string>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // The reader maps files: hand it one in memory.
  static const int memory = ::memfd_create("baked", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(memory);
  if (::ftruncate(memory, 0) != 0 || ::pwrite(memory, data, size, 0) != ssize_t(size)) return 0;
  auto file = lambent::MappedFile::open(path);
  if (!file) return 0;
  auto baked = lambent::load_baked(*file, "fuzz.glb");
  if (!baked) return 0;
  std::vector<lambent::Vec3> light(baked->transfer.columns(), lambent::Vec3(0.5f));
  if (light.size() <= 24) {  // the dual functions of many take long
    const auto env = lambent::make_environment("fuzz", 64, 32, [](lambent::Vec3 d) { return lambent::Vec3(1, 1 + d.x, 1 + d.y); });
    light = lambent::project_light(env, baked->transfer.light).light;
  }
  lambent::Relit relit;
  lambent::relight(baked->transfer, light, relit);
  float sum = 0;
  for (const auto* map : {&baked->front, &baked->back})
    for (uint32_t r : *map)
      if (r != lambent::none) {
        sum += relit.at(r).x;
        if (!baked->outgoing) continue;
        std::vector<lambent::ViewWeights> weights(size_t(relit.rows));
        lambent::evaluate_outgoing(*baked->outgoing, r, lambent::Vec3(0.6f, 0, 0.8f), weights);
        sum += lambent::reflect_rows(weights, lambent::Vec3(1), [&](size_t row) { return relit.at(r, int(row)); }).x;
      }
  volatile float used = sum;
  (void)used;
  return 0;
}
