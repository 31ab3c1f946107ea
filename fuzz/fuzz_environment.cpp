// Pictures from strangers' bytes: .hdr and .exr, and what an environment makes of them.
#include <lambent/light/environment.h>

#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lambent;
  std::span<const uint8_t> bytes(data, size);
  ImageFormat format = image_format(bytes);
  if (format != ImageFormat::hdr && format != ImageFormat::exr) return 0;
  auto image = load_image(bytes, "fuzz");
  if (!image) return 0;
  if (image->rgb.size() != size_t(image->width) * size_t(image->height)) std::abort();
  if (image->rgb.size() > size_t{1} << 16) return 0;  // enough: the rest costs time only
  Environment env = environment_from_image("fuzz", std::move(*image));
  EnvironmentSampler sampler = make_environment_sampler(env);
  EnvironmentSample sample = sample_environment(sampler, {0.3f, 0.7f});
  if (!is_finite(sample.direction) || !is_finite(sample.radiance) ||
      !is_finite(radiance_bilinear(env, sample.direction)))
    std::abort();
  return 0;
}
