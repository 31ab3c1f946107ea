#include <lambent/pipeline/browser.h>
#include <lambent/pipeline/describe.h>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

namespace lambent {
namespace {

// Seven receivers that read nothing of it.
IndirectTransfer one_surfel() {
  IndirectTransfer t;
  t.surfels = {.counts = {1}, .spacings = {1}, .positions = {Vec3(0)}, .normals = {Vec3(0, 1, 0)}, .areas = {1}};
  t.surfels.albedos = {Vec3(0.5f)}, t.surfels.materials = {0}, t.surfels.names = {"wall"};
  t.gather.first = {0, 0}, t.gather.scales = {0}, t.receivers = 7;
  t.reader_surfels.assign(7 * kernel_slots, 0), t.reader_weights.assign(7 * kernel_slots, 0);
  return t;
}

HaarTransfer no_wavelets() {
  HaarTransfer t;
  t.size = 16, t.receivers = 7, t.steps.assign(t.columns(), 0), t.starts = {0, 0}, t.begin.assign(t.columns() + 1, 0);
  return t;
}

// One field of every store with every meaning and placement that there are names for; only their headers count here.
std::vector<Field> all_fields() {
  const Store stores[] = {Transfer{{.order = 3}, 1, 3, 7},
                          CpcaTransfer{.light = {.order = 2}, .receivers = 7},
                          ZonalTransfer{.order = 3, .lobes = 2, .receivers = 7},
                          FactoredTransfer{Transfer{{.order = 5}, 1, 1, 7}, 2},
                          Visibility{.size = 16, .bits = 1, .receivers = 0, .begin = {0}},
                          one_surfel(),
                          no_wavelets()};
  const Rows rows[] = {DiffuseRows{},        DirectionalRows{DirectionalKind::sh2},
                       Outgoing{.order = 1}, IncidentRows{2},
                       PixelRows{},          SightRows{}};
  const Placement places[] = {VertexPlacement{}, TexelPlacement{4, 5}, PatchPlacement{},
                              LatticePlacement{{Vec3(0), Vec3(1), 7, 1, 1}, {}}, FixedView{{}, 7, 1}};
  std::vector<Field> all;
  for (const Store& store : stores)
    for (const Rows& meaning : rows)
      for (const Placement& where : places) all.push_back({where, store, meaning});
  return all;
}

TEST(Describe, NamesEveryAxis) {
  std::set<std::string> words;
  for (const Field& field : all_fields()) {
    const nlohmann::json d = describe(field);
    EXPECT_EQ(d["store"], name_of(field.store));
    EXPECT_EQ(d["where"], name_of(field.where));
    EXPECT_EQ(d["meaning"], name_of(field.rows));
    EXPECT_EQ(d["receivers"], receivers_of(field.store));
    EXPECT_EQ(d["bytes"], bytes_of(field.store));
    const char* rows = std::holds_alternative<FixedView>(field.where) ? " pixels, " : " receivers, ";
    EXPECT_NE(describe_in_words(field).find(rows), std::string::npos);
    words.insert(d["store"].get<std::string>() + d["where"].get<std::string>() + d["meaning"].get<std::string>());
  }
  EXPECT_EQ(words.size(), 7u * 6u * 5u);
}

TEST(Describe, SaysWhatAFieldIs) {
  const Transfer dense{{.order = 2, .groups = {"a", "b"}}, 1, 3, 1234};
  EXPECT_EQ(describe_in_words({VertexPlacement{}, dense, DiffuseRows{}}),
            "diffuse, order 2 and 2 lamp groups, 6 columns, 1 row, 3 channels, 1,234 receivers, 44.9 kB (half)");
  EXPECT_EQ(describe({TexelPlacement{8, 4}, dense, DiffuseRows{}})["atlas"], nlohmann::json({8, 4}));
  EXPECT_EQ(describe({VertexPlacement{}, dense, DiffuseRows{}})["groups"], nlohmann::json({"a", "b"}));
}

std::string page_source() {
  const auto path = std::filesystem::path(__FILE__).parent_path() / "../../../web/src/kinds.ts";
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(Browser, DrawsWhatThePageSaysThatItDraws) {
  const std::string source = page_source();
  const size_t begin = source.find("export const drawn ="), end = source.find("] as const", begin);
  ASSERT_NE(begin, std::string::npos);
  ASSERT_NE(end, std::string::npos);
  const std::string table = source.substr(begin, end - begin);
  std::set<std::string> page, ours;
  const std::regex row(R"(\['(\w+)', '(\w+)', '(\w+)'\])");
  for (std::sregex_iterator at(table.begin(), table.end(), row), stop; at != stop; ++at)
    page.insert((*at)[1].str() + " " + (*at)[2].str() + " " + (*at)[3].str());
  for (const DrawnKind& kind : drawn_kinds()) ours.insert(std::string(kind.store) + " " + kind.rows + " " + kind.where);
  EXPECT_EQ(page, ours);
  EXPECT_EQ(page.size(), drawn_kinds().size());
  for (const auto& [name, value] :
       {std::pair("columns", max_drawn_columns), std::pair("lobes", max_drawn_lobes),
        std::pair("texels", max_drawn_texels), std::pair("lamps", max_drawn_lamps),
        std::pair("ownLamps", max_drawn_own_lamps), std::pair("unfolded", max_drawn_unfolded),
        std::pair("inserts", max_drawn_inserts), std::pair("insertVertices", max_drawn_insert_vertices)}) {
    std::smatch found;
    ASSERT_TRUE(std::regex_search(source, found, std::regex("limits = \\{[^}]*\\b" + std::string(name) + ": (\\d+)")))
        << name;
    EXPECT_EQ(size_t(std::stoul(found[1].str())), value);
  }
}

// Rays of the page pass no surface, know no picture that glows, and are where the file says that the scene is.
TEST(Browser, RefusesScenesThatLampsDoNotLightThere) {
  Scene scene;
  scene.materials.resize(1), scene.textures.resize(1);
  const Field field{VertexPlacement{}, one_surfel(), DiffuseRows{}};
  const auto why = [&](const Scene& s) {
    const auto ok = check_for_browser(field, s, "f");
    return ok ? std::string() : ok.error().message;
  };
  EXPECT_EQ(why(scene), "");
  Scene glows = scene, far = scene, glass = scene;
  glows.materials[0].emissive = Vec3(1);
  EXPECT_EQ(why(glows), "");
  glows.materials[0].emissive_texture = 0;
  EXPECT_NE(why(glows).find("glow by a picture"), std::string::npos);
  Scene many = scene;
  many.lights.resize(65);
  EXPECT_NE(why(many).find("more than 64 lamps"), std::string::npos);
  far.origin = Vec3d(1e6, 0, 0);
  EXPECT_NE(why(far).find("far from the origin"), std::string::npos);
  glass.materials[0].transmission = 0.5f, glass.materials[0].metallic = 0;
  EXPECT_NE(why(glass).find("seen through"), std::string::npos);
  EXPECT_TRUE(check_for_browser({VertexPlacement{}, Transfer{{.order = 2}, 1, 1, 7}, DiffuseRows{}}, glass, "f"));
}

TEST(Describe, RowsOfAFixedViewAreOfPixels) {
  const HaarTransfer t = no_wavelets();
  const Field fixed{FixedView{{}, 7, 1}, t, PixelRows{}}, at_vertices{VertexPlacement{}, t, DiffuseRows{}};
  EXPECT_NE(describe_in_words(fixed).find("1,536 a pixel"), std::string::npos) << describe_in_words(fixed);
  EXPECT_NE(describe_in_words(fixed).find("7 pixels"), std::string::npos);
  EXPECT_EQ(describe_in_words(fixed).find("receiver"), std::string::npos);
  EXPECT_NE(describe_in_words(at_vertices).find("1,536 a receiver"), std::string::npos);
  EXPECT_NE(describe_in_words(at_vertices).find("7 receivers"), std::string::npos);
  EXPECT_TRUE(describe(fixed).contains("wavelets_per_pixel"));
  EXPECT_TRUE(describe(at_vertices).contains("wavelets_per_receiver"));
}

TEST(Browser, RefusesAllElseByName) {
  size_t drawn = 0;
  for (const Field& field : all_fields()) {
    const auto ok = check_for_browser(field, "file.glb");
    drawn += bool(ok);
    if (ok) continue;
    EXPECT_EQ(ok.error().where, "file.glb");
  }
  EXPECT_EQ(drawn, drawn_kinds().size());
  const auto why = [](Placement where, Store store, Rows rows) {
    const auto ok = check_for_browser({std::move(where), std::move(store), std::move(rows)}, "f");
    return ok ? std::string() : ok.error().message;
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_TRUE(has(why(PatchPlacement{}, CpcaTransfer{}, DiffuseRows{}), "clusters transfer, diffuse, at patches"));
  const CpcaTransfer many{.light = {.order = 4}, .rows = 16, .receivers = size_t(1) << 20};
  EXPECT_EQ(why(VertexPlacement{}, many, Outgoing{}), "");
  CpcaTransfer more = many;
  ++more.receivers;
  EXPECT_TRUE(has(why(VertexPlacement{}, more, Outgoing{}), "more than 512 MiB once unfolded"));
  EXPECT_EQ(why(FixedView{}, Transfer{}, PixelRows{}), "");
  EXPECT_TRUE(has(why(FixedView{}, Transfer{{.groups = {"a"}}}, PixelRows{}), "lamps at"));
  EXPECT_EQ(why(FixedView{}, Transfer{{.lobes = {{{0, 1, 0}, 2}}}}, PixelRows{}), "");
  EXPECT_EQ(why(FixedView{}, HaarTransfer{}, PixelRows{}), "");
  EXPECT_EQ(why(VertexPlacement{}, HaarTransfer{}, DiffuseRows{}), "");
  EXPECT_TRUE(has(why(PatchPlacement{}, HaarTransfer{}, DiffuseRows{}), "wavelets at patches"));
  EXPECT_EQ(why(VertexPlacement{}, Visibility{}, SightRows{}), "");
  EXPECT_TRUE(has(why(PatchPlacement{}, IndirectTransfer{}, DiffuseRows{}),
                  "direct-to-indirect transport that is diffuse, at patches"));
  const FactoredTransfer factors{Transfer{{.order = 9}, 1, 1, size_t(1) << 20}, 5};  // 25 rows of 25 columns
  EXPECT_TRUE(has(why(VertexPlacement{}, factors, Outgoing{}), "625 values, more than 512 MiB once unfolded"));
  EXPECT_TRUE(has(why(VertexPlacement{}, FactoredTransfer{Transfer{{.order = 16}, 1, 1, 1}, 8}, DiffuseRows{}),
                  "factors transfer, diffuse"));
  LightBasis lobes{.order = 15, .lobes = std::vector<Lobe>(31)};
  EXPECT_EQ(why(VertexPlacement{}, Transfer{lobes}, DiffuseRows{}), "");
  EXPECT_EQ(why(TexelPlacement{}, CpcaTransfer{.light = lobes}, DiffuseRows{}), "");
  lobes.lobes.emplace_back();
  EXPECT_TRUE(has(why(VertexPlacement{}, Transfer{lobes}, DiffuseRows{}), "257 columns"));
  EXPECT_TRUE(has(why(VertexPlacement{}, Transfer{{.groups = {"a"}}}, DiffuseRows{}), "lamps"));
  EXPECT_EQ(why(TexelPlacement{}, Transfer{{.groups = {"a"}}}, DiffuseRows{}), "");
  EXPECT_TRUE(has(why(TexelPlacement{}, Transfer{{.order = 16, .groups = {"a"}}}, DiffuseRows{}), "257 columns"));
  EXPECT_TRUE(has(why(VertexPlacement{}, ZonalTransfer{.order = 3, .lobes = 8, .rows = 9}, Outgoing{}), "9 rows of 8"));
  EXPECT_TRUE(has(why(VertexPlacement{}, Transfer{{.order = 16}, 16, 3}, Outgoing{}), "more than a texture"));
}

}  // namespace
}  // namespace lambent
