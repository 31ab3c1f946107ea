#include <lambent/core/parallel.h>
#include <lambent/render/lightmap_picture.h>

namespace lambent {

Image lightmap_picture(const TexelReceivers& texels, const std::vector<Vec3>& values, int dilate) {
  const int w = texels.width, h = texels.height;
  Image image(w, h);
  std::vector<uint8_t> filled(image.rgb.size(), 0), next;
  for (size_t i = 0; i < image.rgb.size(); ++i)
    if (texels.texels[i] != none) image.rgb[i] = values[texels.texels[i]], filled[i] = 1;
  for (int ring = 0; ring < dilate; ++ring) {
    next = filled;
    parallel_for(size_t(h), 16, [&](size_t begin, size_t end) {
      for (int y = int(begin); y < int(end); ++y)
        for (int x = 0; x < w; ++x) {
          const size_t at = size_t(y) * size_t(w) + size_t(x);
          if (filled[at]) continue;
          Vec3 sum(0);
          int count = 0;
          for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
              if (x + dx < 0 || y + dy < 0 || x + dx >= w || y + dy >= h) continue;
              const size_t other = size_t(y + dy) * size_t(w) + size_t(x + dx);
              if (filled[other]) sum += image.rgb[other], ++count;
            }
          if (count) image.rgb[at] = sum / float(count), next[at] = 1;
        }
    });
    filled.swap(next);
  }
  return image;
}

Image lightmap_picture(const TexelReceivers& texels, const Relit& relit, int dilate, int row) {
  size_t count = 0;
  for (uint32_t r : texels.texels)
    if (r != none) count = std::max(count, size_t(r) + 1);
  std::vector<Vec3> values(count);
  for (size_t r = 0; r < count; ++r) values[r] = relit.at(r, row);
  return lightmap_picture(texels, values, dilate);
}

namespace {

template <class Value>
std::vector<Vec3> at_places(const Scene& scene, const Receivers& receivers, Value value) {
  std::vector<Vec3> out(receivers.places.size());
  parallel_for(out.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      const TexelPlace& p = receivers.places[r];
      out[r] = value(scene.triangles[p.triangle], p.u, p.v);
    }
  });
  return out;
}

}  // namespace

std::vector<Vec3> texel_albedo(const Scene& scene, const Receivers& receivers) {
  return at_places(scene, receivers, [&](const Triangle& t, float u, float v) { return albedo(scene, t, u, v); });
}

std::vector<Vec3> texel_emission(const Scene& scene, const Receivers& receivers) {
  return at_places(scene, receivers, [&](const Triangle& t, float u, float v) {
    return scene.materials[scene.parts[t.part].material].emissive_texture < 0 ? Vec3(0) : emission(scene, t, u, v);
  });
}

}  // namespace lambent
