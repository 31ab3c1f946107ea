// Any bytes given as OBJ end in an error of one line or in a sound scene.
#include <lambent/core/check.h>
#include <lambent/scene/load.h>

#include "../tests/test_meshes.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  auto scene = lambent::load_obj({data, size}, "fuzz.obj", "");
  if (scene) {
    LAMBENT_CHECK(lambent::test::broken_invariant(*scene).empty());
    LAMBENT_CHECK(!scene->triangles.empty());
  } else {
    std::string text = scene.error().text();
    LAMBENT_CHECK(!text.empty() && text.find('\n') == std::string::npos);
  }
  return 0;
}
