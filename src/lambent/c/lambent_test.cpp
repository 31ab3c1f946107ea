#include <lambent.h>

#include <lambent/baked/baked_file.h>
#include <lambent/baked/fields.h>
#include <lambent/basis/sh_convert.h>
#include <lambent/core/random.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/sky.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relighter.h>
#include <lambent/render/products.h>

#include <gtest/gtest.h>

#include <thread>

namespace lambent {
namespace {

std::string golden(const std::string& name) { return std::string(LAMBENT_GOLDEN) + "/" + name + ".glb"; }

struct Opened {
  lambent_file* file = nullptr;
  lambent_relighter* relighter = nullptr;
  lambent_info info{};
  BakedFields fields;  // the same by the library's own reader

  explicit Opened(const std::string& name, size_t field = 0) : fields(*read_fields(golden(name))) {
    EXPECT_EQ(lambent_open(golden(name).c_str(), &file), LAMBENT_OK) << lambent_error();
    info.size = sizeof info;
    EXPECT_EQ(lambent_describe(file, field, &info), LAMBENT_OK) << lambent_error();
    EXPECT_EQ(lambent_relighter_new(file, field, &relighter), LAMBENT_OK) << lambent_error();
  }
  Opened(const Opened&) = delete;
  ~Opened() {
    lambent_close(file);  // before its relighter, which needs it no longer
    EXPECT_EQ(lambent_relight(relighter, nullptr, 0, 0), LAMBENT_NULL);
    lambent_relighter_free(relighter);
  }
  std::vector<float> relight() {
    std::vector<float> out(info.receivers * info.rows * 3);
    EXPECT_EQ(lambent_relight(relighter, out.data(), out.size(), info.rows * 3), LAMBENT_OK) << lambent_error();
    return out;
  }
};

std::vector<float> relight(const Field& field, std::span<const Vec3> light, const RelightFrame& frame = {}) {
  auto relighter = Relighter::make(field);
  EXPECT_TRUE(relighter && relighter->set_light(light));
  std::vector<float> out(relighter->receivers() * size_t(relighter->rows()) * 3);
  EXPECT_TRUE(relighter->relight(frame, out, size_t(relighter->rows()) * 3));
  return out;
}

std::vector<Vec3> random_light(size_t columns, uint64_t seed = 1) {
  Random random(seed);
  std::vector<Vec3> light;
  for (size_t k = 0; k < columns; ++k) light.push_back({random.next(), random.next() - 0.5f, -random.next()});
  return light;
}

// One file for every store, placement and meaning but blocks, which want materials.
const char* const names[] = {"diffuse",
                             "diffuse_grey_single",
                             "diffuse_lobes",
                             "compressed_cpca",
                             "matrix_map",
                             "matrix_svd",
                             "matrix_sh",
                             "matrix_phong",
                             "zonal",
                             "zonal_glossy",
                             "factors",
                             "lightmap",
                             "lightmap_prt",
                             "diffuse_texels",
                             "lightmap_directional",
                             "diffuse_patches",
                             "diffuse_fixed_view"};

TEST(C, RelightsAsTheRelighterDoes) {
  for (const char* name : names) {
    Opened o(name);
    const Field& field = o.fields.surface;
    EXPECT_EQ(o.info.receivers, receivers_of(field.store));
    EXPECT_EQ(o.info.columns, light_of(field.store).count());
    EXPECT_STREQ(o.info.store, name_of(field.store));
    const std::vector<Vec3> light = random_light(o.info.columns);
    ASSERT_EQ(lambent_set_columns(o.relighter, &light[0].x, light.size()), LAMBENT_OK) << lambent_error();
    EXPECT_EQ(o.relight(), relight(field, light)) << name;
  }
}

TEST(C, RelightsFreeSpace) {
  Opened o("diffuse_lattice", 1);
  ASSERT_EQ(o.fields.more.size(), 1u);
  EXPECT_STREQ(o.info.placement, "lattice");
  EXPECT_EQ(size_t(o.info.points[0]) * size_t(o.info.points[1]) * size_t(o.info.points[2]), o.info.receivers);
  const std::vector<Vec3> light = random_light(o.info.columns);
  ASSERT_EQ(lambent_set_columns(o.relighter, &light[0].x, light.size()), LAMBENT_OK);
  EXPECT_EQ(o.relight(), relight(o.fields.more[0], light));
}

// What the scene of a bake of blocks says of its receivers, as an engine would.
struct BlockReceivers {
  Baked baked = *load_baked(golden("blocks"));
  std::vector<float> positions, normals;
  ProductReceivers products;
  explicit BlockReceivers(const Brdf& brdf) {
    const VertexPlacement& at = *vertices_of(baked);
    const Visibility& visibility = std::get<Visibility>(baked.surface.store);
    Reflection reflection;
    reflection.everywhere = brdf;
    products = make_product_receivers(baked.scene, at.front, at.back, visibility.receivers, reflection,
                                      make_cube(visibility.size), {});
    for (const Vec3 p : products.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
    for (const Mat3& f : products.frames) normals.insert(normals.end(), {f[2].x, f[2].y, f[2].z});
  }
};

TEST(C, RelightsBlocksAsTheRelighterDoes) {
  const lambent_material materials[] = {{LAMBENT_LAMBERT, {0.5f, 0.25f, 1}, 0, 0},
                                        {LAMBENT_METALLIC_ROUGHNESS, {0.9f, 0.6f, 0.3f}, 1, 0.4f}};
  const Brdf brdfs[] = {Lambert{Vec3(0.5f, 0.25f, 1)},
                        MetallicRoughness{.base_color = Vec3(0.9f, 0.6f, 0.3f), .metallic = 1, .roughness = 0.4f}};
  lambent_file* file = nullptr;
  ASSERT_EQ(lambent_open(golden("blocks").c_str(), &file), LAMBENT_OK) << lambent_error();
  const float eye[3] = {1, 2, 4};
  for (uint32_t m = 0; m < 2; ++m) {
    BlockReceivers of(brdfs[m]);
    const size_t n = of.products.positions.size();
    const std::vector<uint32_t> material_of(n, m);
    lambent_relighter* relighter = nullptr;
    ASSERT_EQ(lambent_relighter_new_blocks(file, 0, of.positions.data(), of.normals.data(), n, materials, 2,
                                           material_of.data(), &relighter),
              LAMBENT_OK)
        << lambent_error();
    std::vector<float> ours(3 * n), theirs(3 * n);
    EXPECT_EQ(lambent_relight(relighter, ours.data(), ours.size(), 3), LAMBENT_NO_LIGHT);
    ASSERT_EQ(lambent_set_sky(relighter, 40, 20, 3, 0.2f, 0, nullptr), LAMBENT_OK) << lambent_error();
    ASSERT_EQ(lambent_set_eye(relighter, eye), LAMBENT_OK) << lambent_error();
    ASSERT_EQ(lambent_relight(relighter, ours.data(), ours.size(), 3), LAMBENT_OK) << lambent_error();
    EXPECT_EQ(lambent_set_columns(relighter, eye, 0), LAMBENT_UNSUPPORTED);
    EXPECT_EQ(lambent_set_sh(relighter, eye, 1, LAMBENT_SH_LAMBENT), LAMBENT_UNSUPPORTED);
    lambent_relighter_free(relighter);

    auto same = Relighter::make(of.baked.surface, {.receivers = std::move(of.products)});
    ASSERT_TRUE(same) << same.error().text();
    const int size = std::get<Visibility>(of.baked.surface.store).size;
    ASSERT_TRUE(same->set_light(cube_light(*make_sky({40, 20, 3, Vec3(0.2f), false}), size)));
    ASSERT_TRUE(same->relight({.eye = Vec3(eye[0], eye[1], eye[2])}, theirs, 3));
    float sum = 0;
    for (size_t i = 0; i < ours.size(); ++i) {
      EXPECT_NEAR(ours[i], theirs[i], 1e-5f * (1 + theirs[i])) << "float " << i << " of material " << m;  // frames spin
      sum += ours[i];
    }
    EXPECT_GT(sum, 0);
  }
  lambent_close(file);
}

TEST(C, OpensMemoryAsItOpensAPath) {
  Opened o("diffuse");
  const std::vector<uint8_t> bytes = *read_file(golden("diffuse"));
  std::vector<uint8_t> odd(bytes.size() + 1);  // at an odd address
  std::copy(bytes.begin(), bytes.end(), odd.begin() + 1);
  lambent_file* file = nullptr;
  ASSERT_EQ(lambent_open_memory(odd.data() + 1, bytes.size(), &file), LAMBENT_OK) << lambent_error();
  odd.assign(odd.size(), 0);  // it was copied
  std::vector<float> a(o.info.values), b(o.info.values);
  for (size_t r = 0; r < o.info.receivers; ++r) {
    ASSERT_EQ(lambent_read(file, 0, r, a.data(), a.size()), LAMBENT_OK) << lambent_error();
    ASSERT_EQ(lambent_read(o.file, 0, r, b.data(), b.size()), LAMBENT_OK);
    EXPECT_EQ(a, b);
    EXPECT_EQ(a, load_receiver(std::get<Transfer>(o.fields.surface.store), r));
  }
  lambent_close(file);
}

TEST(C, NamesEveryVertexReceiver) {
  for (const char* name : {"diffuse", "diffuse_patches", "lightmap"}) {
    Opened o(name);
    size_t total = 0;
    for (size_t i = 0; i < o.info.parts; ++i) {
      lambent_part part{};
      part.size = sizeof part;
      ASSERT_EQ(lambent_get_part(o.file, i, &part), LAMBENT_OK) << lambent_error();
      EXPECT_EQ(part.node, o.fields.parts[i].node);
      EXPECT_EQ(part.primitive, o.fields.parts[i].primitive);
      for (size_t v = 0; v < part.count; ++v) {
        if (const auto* p = std::get_if<VertexPlacement>(&o.fields.surface.where)) {
          EXPECT_EQ(part.front[v], p->front[total + v]);
          if (part.back) {
            EXPECT_EQ(part.back[v], p->back[total + v]);
          }
        }
        if (const auto* p = std::get_if<PatchPlacement>(&o.fields.surface.where)) {
          EXPECT_EQ(part.front[v], p->front[total + v]);
        }
        if (const auto* p = std::get_if<TexelPlacement>(&o.fields.surface.where)) {
          EXPECT_EQ(Vec2(part.front_uv[2 * v], part.front_uv[2 * v + 1]), p->front[total + v]);
        }
      }
      total += part.count;
    }
    EXPECT_GT(total, 0u);
    const uint32_t* texels = nullptr;
    if (const auto* p = std::get_if<TexelPlacement>(&o.fields.surface.where)) {
      ASSERT_EQ(lambent_get_texels(o.file, &texels), LAMBENT_OK);
      EXPECT_TRUE(std::equal(p->texels.begin(), p->texels.end(), texels));
      EXPECT_EQ(size_t(o.info.width) * size_t(o.info.height), p->texels.size());
    }
  }
}

TEST(C, TakesHarmonicsOfEveryConvention) {
  Opened o("diffuse");
  const std::vector<Vec3> light = random_light(9);
  std::vector<Vec3> columns(o.info.columns, Vec3(0));
  std::copy(light.begin(), light.end(), columns.begin());
  const std::vector<float> expected = relight(o.fields.surface, columns);
  const std::pair<lambent_sh, ShConvention> all[] = {{LAMBENT_SH_LAMBENT, ShConvention::lambent},
                                                     {LAMBENT_SH_THREE, ShConvention::three},
                                                     {LAMBENT_SH_UNITY, ShConvention::unity},
                                                     {LAMBENT_SH_GODOT, ShConvention::godot},
                                                     {LAMBENT_SH_GLTF, ShConvention::gltf_ibl}};
  for (auto [c, ours] : all) {
    const std::vector<Vec3> given = convert_sh(light, ours);
    ASSERT_EQ(lambent_set_sh(o.relighter, &given[0].x, 3, c), LAMBENT_OK) << lambent_error();
    const std::vector<float> out = o.relight();
    for (size_t i = 0; i < out.size(); ++i) EXPECT_NEAR(out[i], expected[i], 2e-6f * (1 + std::abs(expected[i])));
  }
  // More bands than the file has are left out.
  const std::vector<Vec3> many = random_light(64);
  ASSERT_EQ(lambent_set_sh(o.relighter, &many[0].x, 8, LAMBENT_SH_LAMBENT), LAMBENT_OK);
  EXPECT_EQ(o.relight(), relight(o.fields.surface, std::span(many).first(o.info.columns)));
}

TEST(C, ProjectsPicturesAndSkies) {
  const Mat3 R = rotation_from_yaw_pitch_roll({40, 10, -20});
  const Environment env = make_environment("", 32, 16, [](Vec3 d) { return Vec3(1 + d.x, 2 + d.y, 1.5f - d.z); });
  for (const char* name : {"diffuse", "diffuse_lobes", "lightmap_prt"}) {
    Opened o(name);
    const LightBasis basis = light_of(o.fields.surface.store);
    auto expected = [&](const Environment& e, const Mat3& rotation) {
      std::vector<Vec3> light = project_light(e, basis, rotation).light;
      std::fill(light.end() - ptrdiff_t(basis.groups.size()), light.end(), Vec3(1));
      return relight(o.fields.surface, light);
    };
    ASSERT_EQ(lambent_set_environment(o.relighter, &env.image.rgb[0].x, 32, 16, &R[0].x), LAMBENT_OK)
        << name << lambent_error();
    EXPECT_EQ(o.relight(), expected(env, R)) << name;
    ASSERT_EQ(lambent_set_sky(o.relighter, 30, 70, 4, 0.3f, 0, nullptr), LAMBENT_OK);
    EXPECT_EQ(o.relight(), expected(*make_sky({30, 70, 4, Vec3(0.3f), false}), Mat3(1.0f))) << name;
  }
}

TEST(C, DimsLampsByName) {
  Opened o("lightmap");
  ASSERT_GE(o.info.groups, 1);
  EXPECT_EQ(o.relight(), relight(o.fields.surface, std::vector<Vec3>(o.info.columns, Vec3(1))));  // as they are
  const char* name = nullptr;
  ASSERT_EQ(lambent_get_group(o.file, 0, &name), LAMBENT_OK);
  EXPECT_EQ(std::string(name), light_of(o.fields.surface.store).groups[0]);
  const Vec3 dim(0.1f, 0.2f, 0.3f);
  ASSERT_EQ(lambent_set_lamp(o.relighter, name, &dim.x), LAMBENT_OK);
  std::vector<Vec3> light(o.info.columns, Vec3(1));
  light[o.info.columns - size_t(o.info.groups)] = dim;
  EXPECT_EQ(o.relight(), relight(o.fields.surface, light));
}

TEST(C, TurnsLobes) {
  Opened o("zonal");
  std::vector<Mat3> rotations;
  Random random(3);
  for (size_t r = 0; r < o.info.receivers; ++r)
    rotations.push_back(rotation_from_yaw_pitch_roll({360 * random.next(), 90 * random.next(), 0}));
  const std::vector<Vec3> light = random_light(o.info.columns);
  ASSERT_EQ(lambent_set_columns(o.relighter, &light[0].x, light.size()), LAMBENT_OK);
  const std::vector<float> still = o.relight();
  ASSERT_EQ(lambent_set_rotations(o.relighter, &rotations[0][0].x, rotations.size()), LAMBENT_OK) << lambent_error();
  const ReceiverFrames frames = make_receiver_frames(rotations);
  EXPECT_EQ(o.relight(), relight(o.fields.surface, light, {.frames = &frames}));
  EXPECT_NE(o.relight(), still);
  ASSERT_EQ(lambent_set_rotations(o.relighter, nullptr, 0), LAMBENT_OK);
  EXPECT_EQ(o.relight(), still);
}

// One file, a relighter and a light for each thread, errors of their own.
TEST(C, WorksInSeveralThreads) {
  Opened o("diffuse");
  constexpr size_t threads = 4;
  std::vector<int> wrong(threads, 0);
  std::vector<std::vector<float>> expected;
  for (size_t t = 0; t < threads; ++t)
    expected.push_back(relight(o.fields.surface, random_light(o.info.columns, t + 1)));
  std::vector<std::thread> all;
  for (size_t t = 0; t < threads; ++t)
    all.emplace_back([&, t] {
      lambent_relighter* r = nullptr;
      const std::vector<Vec3> light = random_light(o.info.columns, t + 1);
      if (lambent_relighter_new(o.file, 0, &r) || *lambent_error()) ++wrong[t];
      std::vector<float> out(expected[t].size());
      for (int i = 0; i < 200; ++i) {
        std::fill(out.begin(), out.end(), 0.0f);
        if (lambent_set_columns(r, &light[0].x, light.size()) || lambent_relight(r, out.data(), out.size(), 3))
          ++wrong[t];
        if (out != expected[t]) ++wrong[t];
        if (t == 1 && lambent_relight(r, out.data(), 1, 3) != LAMBENT_ARGUMENT) ++wrong[t];
        if ((t == 1) != (*lambent_error() != 0)) ++wrong[t];
      }
      lambent_relighter_free(r);
    });
  for (std::thread& t : all) t.join();
  EXPECT_EQ(wrong, std::vector<int>(threads, 0));
}

}  // namespace
}  // namespace lambent
