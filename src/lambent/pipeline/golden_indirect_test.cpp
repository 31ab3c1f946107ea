// Numbers of the relighter that the web page has to find as well (web/test/indirect.test.ts): indirect light at the
// receivers of tests/golden/indirect.glb, of direct light and of paint that a formula gives.
// LAMBENT_WRITE_GOLDEN=1 writes them.
#include <lambent/baked/baked_file.h>
#include <lambent/relight/indirect.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>

namespace lambent {
namespace {

std::vector<std::vector<float>> relit(const IndirectTransfer& t, std::span<const Vec3> albedos) {
  std::vector<Vec3> direct;
  for (size_t i = 0; i < t.surfels.count(); ++i) direct.push_back(Vec3(float(i % 5), float(i % 7), float(i % 11)) / 4);
  IndirectSolve s = make_indirect_solve(t, albedos);
  solve_indirect(t, s, direct, 1e-7);
  Relit out;
  read_indirect(t, s, out);
  std::vector<std::vector<float>> values;
  for (size_t r = 0; r < t.receivers; ++r) {
    const Vec3 v = out.at(r, 0);
    values.push_back({v.x, v.y, v.z});
  }
  return values;
}

TEST(GoldenIndirect, IsRelitToWhatThePageFinds) {
  const std::string folder = LAMBENT_GOLDEN, path = folder + "/indirect_values.json";
  const auto baked = load_baked(folder + "/indirect.glb");
  ASSERT_TRUE(baked) << baked.error().text();
  const auto& t = std::get<IndirectTransfer>(baked->surface.store);
  const std::vector<Vec3> paint(t.surfels.count(), Vec3(0.3f, 0.9f, 0));
  const nlohmann::json now{{"baked", relit(t, {})}, {"painted", relit(t, paint)}};
  if (std::getenv("LAMBENT_WRITE_GOLDEN")) std::ofstream(path) << now << '\n';
  std::ifstream file(path);
  const nlohmann::json then = nlohmann::json::parse(file, nullptr, false);
  for (const char* kind : {"baked", "painted"}) {
    ASSERT_EQ(then[kind].size(), t.receivers);
    for (size_t r = 0; r < t.receivers; ++r)
      for (size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(now[kind][r][c].get<float>(), then[kind][r][c].get<float>(), 1e-5f) << kind << " " << r;
  }
}

}  // namespace
}  // namespace lambent
