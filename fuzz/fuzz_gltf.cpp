// Any bytes as a glTF file: an error, or a scene that can be read through.
#include <lambent/core/check.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>
#include <lambent/scene/pose.h>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lambent;
  auto scene = load_gltf({data, size}, "fuzz.glb", "");
  if (!scene) {
    LAMBENT_CHECK(!scene.error().message.empty());
    return 0;
  }
  LAMBENT_CHECK(!scene->triangles.empty() && scene->normals.size() == scene->positions.size());
  for (Vec3 n : scene->normals) LAMBENT_CHECK(dot(n, n) > 0.99f && dot(n, n) < 1.01f);
  for (const Triangle& t : scene->triangles) {
    Vec3 n = area_normal(*scene, t), a = albedo(*scene, t, 0.25f, 0.5f);
    LAMBENT_CHECK(a.x >= 0 && a.x <= 1 && (n.x <= 0 || n.x >= 0 || n.x != n.x));
  }
  // Animated by anything, too.
  auto animations = list_animations(*scene);
  for (size_t i = 0; animations && i < std::min<size_t>(animations->size(), 3); ++i) {
    auto pose = pose_scene(*scene, i, 0.4);
    if (!pose) {
      LAMBENT_CHECK(!pose.error().message.empty());
      continue;
    }
    LAMBENT_CHECK(pose->positions.size() == scene->positions.size() &&
                  pose->rotations.size() == scene->positions.size());
    for (Vec3 n : pose->normals) LAMBENT_CHECK(dot(n, n) > 0.99f && dot(n, n) < 1.01f);
  }
  return 0;
}
