// Pictures from strangers' bytes: .hdr and .exr, and the environment that they make, which is light and nothing else.
#include <lambent/light/environment.h>

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lambent;
  std::span<const uint8_t> bytes(data, size);
  ImageFormat format = image_format(bytes);
  if (format != ImageFormat::hdr && format != ImageFormat::exr) return 0;
  auto file = load_image_file(bytes, "fuzz");
  if (!file) return 0;
  if (file->image.rgb.size() != size_t(file->image.width) * size_t(file->image.height)) std::abort();
  // Enough: the rest costs time only.
  constexpr int64_t most = int64_t{1} << 16;
  if (int64_t(file->image.rgb.size()) > most || int64_t(file->width) * file->height > most) return 0;
  auto loaded = environment_from_file(bytes, "fuzz");
  if (!loaded) {
    if (loaded.error().text().find('\n') != std::string::npos) std::abort();
    return 0;
  }
  const Environment& env = *loaded;
  for (const Vec3& c : env.image.rgb)
    if (!is_finite(c) || !all_at_most(Vec3(0), c)) std::abort();
  EnvironmentSampler sampler = make_environment_sampler(env);
  EnvironmentSample sample = sample_environment(sampler, {0.3f, 0.7f});
  if (!is_finite(sample.direction) || !is_finite(sample.radiance) ||
      !is_finite(radiance_bilinear(env, sample.direction)))
    std::abort();
  return 0;
}
