// The way back to the input's vertices, through a file; more, from outside, is in python/tests/test_arrays.py.
#include <lambent/baked/baked_file.h>
#include <lambent/scene/arrays.h>
#include <lambent/scene/refine.h>

#include "temporary_folder.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A cube of eight vertices, and one that nothing uses before them.
Scene cube() {
  std::vector<Vec3d> v{Vec3d(9)};
  for (int i = 0; i < 8; ++i) v.push_back(Vec3d(i & 1, i >> 1 & 1, i >> 2 & 1));
  const std::vector<uint32_t> faces{1, 3, 4, 1, 4, 2, 5, 6, 8, 5, 8, 7, 1, 2, 6, 1, 6, 5,
                                    3, 7, 8, 3, 8, 4, 1, 5, 7, 1, 7, 3, 2, 4, 8, 2, 8, 6};
  auto scene = scene_from_arrays({.vertices = v, .faces = faces});
  EXPECT_TRUE(scene);
  return std::move(*scene);
}

TEST(InputVertices, CreasesSplitThemAndFilesKeepThem) {
  Scene scene = cube();
  add_ground(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const std::vector<Vec3> origins = receivers.origins;
  WritableTransfer transfer = make_transfer({.order = 1}, 1, 1, receivers.count(), Precision::half);
  const Baked baked = make_baked(std::move(scene), receivers, std::move(transfer.transfer), DiffuseRows{});
  const test::TemporaryFolder folder;
  const std::string path = folder.file("cube.glb");
  ASSERT_TRUE(save_baked(path, baked));
  const auto loaded = load_baked(path);
  ASSERT_TRUE(loaded);
  const VertexPlacement& at = *vertices_of(*loaded);
  EXPECT_EQ(at.input, vertices_of(baked)->input);
  EXPECT_EQ(at.input_count, 9u);
  const auto pairs = input_receivers(at);
  EXPECT_EQ(pairs.size(), 24u);  // three at each corner
  for (const auto& [vertex, receiver] : pairs) {
    ASSERT_GE(vertex, 1u);
    const uint32_t i = vertex - 1;
    EXPECT_LT(length(origins[receiver] - Vec3(i & 1, i >> 1 & 1, i >> 2 & 1)), 0.01f);
  }
}

}  // namespace
}  // namespace lambent
