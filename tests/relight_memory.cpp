// What a program that embeds the library may rely on: a frame allocates nothing, whatever the store, and two hundred
// files opened, relit and closed leave memory where it was.
//   relight_memory FOLDER_OF_GOLDEN_FILES
#include <lambent.h>

#include <lambent/baked/fields.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/relighter.h>

#include <malloc.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <new>

namespace {
std::atomic<size_t> allocations{0}, releases{0};
void release(void* p) {
  releases += p != nullptr;
  std::free(p);
}
void* take(size_t size, size_t alignment) {
  ++allocations;
  size = (size + alignment - 1) / alignment * alignment;
  if (void* p = std::aligned_alloc(alignment, size ? size : alignment)) return p;
  throw std::bad_alloc();
}
}  // namespace

void* operator new(size_t size) { return take(size, 16); }
void* operator new[](size_t size) { return take(size, 16); }
void* operator new(size_t size, std::align_val_t alignment) { return take(size, size_t(alignment)); }
void* operator new[](size_t size, std::align_val_t alignment) { return take(size, size_t(alignment)); }
void operator delete(void* p) noexcept { release(p); }
void operator delete[](void* p) noexcept { release(p); }
void operator delete(void* p, size_t) noexcept { release(p); }
void operator delete[](void* p, size_t) noexcept { release(p); }
void operator delete(void* p, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, std::align_val_t) noexcept { release(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, size_t, std::align_val_t) noexcept { release(p); }

using namespace lambent;

namespace {

// A frame: another light, for lobes another pose.
void frame(Relighter& relighter, std::vector<Vec3>& light, const CubeLight& cube, const RelightFrame& what, Relit& out,
           std::vector<float>& rgb) {
  if (!light.empty()) light[0].x += 0.1f;
  const bool ok = light.empty() ? bool(relighter.set_light(cube)) : bool(relighter.set_light(light));
  if (!ok || !relighter.relight(what, out) || !relighter.relight(what, rgb, size_t(relighter.rows()) * 3))
    std::printf("a frame failed\n"), std::exit(1);
}

int allocations_a_frame(const std::string& folder, const char* name) {
  const auto fields = read_fields(folder + "/" + name + ".glb");
  if (!fields) return std::printf("%s\n", fields.error().text().c_str()), 1;
  const Field& field = fields->surface;
  RelighterOptions options;
  CubeLight cube;
  if (const auto* v = std::get_if<Visibility>(&field.store)) {
    options.receivers.positions.assign(v->receivers, Vec3(0));
    options.receivers.frames.assign(v->receivers, Mat3(1.0f));
    options.receivers.material_of.assign(v->receivers, 0);
    options.receivers.materials.push_back(
        make_product_material(Phong{Vec3(0.2f), Vec3(0.7f), 20}, make_cube(v->size), {}));
    cube = cube_light(make_environment("", 64, 32, [](Vec3 d) { return Vec3(1 + d.y); }), v->size);
  }
  auto relighter = Relighter::make(field, std::move(options));
  if (!relighter) return std::printf("%s: %s\n", name, relighter.error().text().c_str()), 1;
  std::vector<Vec3> light(relighter->light().count(), Vec3(1));
  const ReceiverFrames frames =
      make_receiver_frames(std::vector<Mat3>(relighter->receivers(), rotation_from_yaw_pitch_roll({30, 0, 0})));
  RelightFrame what{.eye = Vec3(0, 0, 5)};
  if (std::holds_alternative<ZonalTransfer>(field.store)) what.frames = &frames;
  Relit out;
  std::vector<float> rgb(relighter->receivers() * size_t(relighter->rows()) * 3);
  frame(*relighter, light, cube, what, out, rgb);
  const size_t before = allocations;
  for (int i = 0; i < 5; ++i) frame(*relighter, light, cube, what, out, rgb);
  if (allocations != before)
    return std::printf("%s: a frame allocates %zu times\n", name, (allocations - before) / 5), 1;
  return 0;
}

int cycle(const std::string& path) {
  lambent_file* file = nullptr;
  lambent_relighter* relighter = nullptr;
  lambent_info info{};
  info.size = sizeof info;
  if (lambent_open(path.c_str(), &file) || lambent_describe(file, 0, &info) ||
      lambent_relighter_new(file, 0, &relighter))
    return std::printf("%s\n", lambent_error()), 1;
  std::vector<float> light(3 * info.columns, 1.0f), rgb(info.receivers * info.rows * 3);
  if (lambent_set_columns(relighter, light.data(), info.columns) ||
      lambent_relight(relighter, rgb.data(), rgb.size(), info.rows * 3))
    return std::printf("%s\n", lambent_error()), 1;
  lambent_file* none = nullptr;
  if (lambent_open_memory(path.data(), path.size(), &none) != LAMBENT_BROKEN) return 1;
  lambent_relighter_free(relighter);
  lambent_close(file);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::string folder = argv[1];
  const char* const names[] = {
      "diffuse", "diffuse_grey_single", "compressed_cpca", "matrix_map", "zonal_glossy", "zonal", "factors", "blocks"};
  int failures = 0;
  {
    ThreadLimit one(1);  // what a thread needs is allocated once, whenever it first takes part
    for (const char* name : names) failures += allocations_a_frame(folder, name);
  }
  for (const char* name : {"diffuse", "compressed_cpca", "zonal_glossy", "factors"}) {
    const std::string path = folder + "/" + name + ".glb";
    for (int i = 0; i < 20; ++i) failures += cycle(path);
    const size_t before = mallinfo2().uordblks, live = allocations - releases;
    for (int i = 0; i < 200; ++i) failures += cycle(path);
    const size_t after = mallinfo2().uordblks;
    if (allocations - releases != live)
      failures += std::printf("%s: %zu blocks more after 200 cycles\n", name, allocations - releases - live) > 0;
    // The task scheduler keeps some of its own, whatever the number of cycles.
    if (after > before + 65536)
      failures += std::printf("%s: memory grew by %zu bytes in 200 cycles\n", name, after - before) > 0;
  }
  if (failures == 0) std::printf("relight_memory passed\n");
  return failures != 0;
}
