// Bakes a scene's light transport and relights it under an environment:  bake_and_relight SCENE ENVIRONMENT PICTURE.png
#include <lambent/lambent.h>

#include <cstdio>

using namespace lambent;

static int complain(const Error& error) {
  std::fprintf(stderr, "%s\n", error.text().c_str());
  return 1;
}

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "usage: bake_and_relight SCENE ENVIRONMENT PICTURE.png\n"), 2;

  // Scene -> receivers -> T
  auto scene = load_scene(argv[1]);
  if (!scene) return complain(scene.error());
  auto tracer = Tracer::build(*scene);
  if (!tracer) return complain(tracer.error());
  Receivers receivers = make_vertex_receivers(*scene);
  auto transfer = bake(*scene, *tracer, receivers, {.order = 6, .samples = 256, .bounces = 2});
  if (!transfer) return complain(transfer.error());

  // light
  auto environment = load_environment(argv[2]);
  if (!environment) return complain(environment.error());
  std::vector<Vec3> light = project_environment(*environment, transfer->light.order);

  // outgoing = O(view) . T . light
  Relit relit;
  relight(*transfer, light, relit);
  CornerReceivers corners = corner_receivers(*scene, receivers.front, receivers.back);
  auto picture = render(*scene, *tracer, corners, relit, camera_around(bounds(*scene)), {.background = &*environment});
  if (!picture) return complain(picture.error());
  if (auto saved = save_image(argv[3], *picture); !saved) return complain(saved.error());
}
