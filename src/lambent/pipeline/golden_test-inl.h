#pragma once
// Files of every kind (tests/golden/), and how each is asked to be drawn.
#include <lambent/pipeline/draw.h>

#include <algorithm>
#include <filesystem>

namespace lambent::test {

// lambent render NAME.glb --camera 3,2,4,1,0.5,1,40 --size 16x12 --spp 4 --env sky:... --background none, but for what
// some kinds do not take.
inline DrawRequest golden_request(const std::string& name) {
  DrawRequest request{.baked = std::string(LAMBENT_GOLDEN) + "/" + name + ".glb", .background = "none"};
  if (name.find("fixed_view") == std::string::npos)
    request.camera = "3,2,4,1,0.5,1,40", request.size = "16x12", request.spp = 4;
  if (name == "indirect_texels") request.at = "receivers";
  if (name.starts_with("indirect")) request.background = "env", request.lamp = {"sphere@1,1.2,1,0.1=30,20,10"};
  else if (name == "lightmap") request.lamp = {"lamp=1,0.5,0.25", "sky=0.5,1,2"};
  else if (name != "lightmap_directional") request.env = "sky:elevation=40,azimuth=20,turbidity=4";
  return request;
}

inline std::vector<std::string> golden_names() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(LAMBENT_GOLDEN))
    if (entry.path().extension() == ".glb") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace lambent::test
