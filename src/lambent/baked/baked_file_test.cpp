#include <lambent/baked/baked_test-inl.h>
#include <lambent/baked/extension.h>

namespace lambent {
namespace {

TEST(BakedFile, ComesBackAsItWas) {
  for (Precision precision : {Precision::half, Precision::single})
    for (int channels : {1, 3}) {
      const TemporaryFile file("round_trip.glb");
      const Small s = small_bake(channels, precision);
      ASSERT_TRUE(save_baked(file.path, with_provenance(baked_of(s), R"({"options":{"order":3}})")));
      EXPECT_TRUE(is_baked(file.path));
      auto back = load_baked(file.path);
      ASSERT_TRUE(back) << back.error().text();
      EXPECT_EQ(back->scene.positions, s.scene.positions);
      EXPECT_EQ(back->scene.normals, s.scene.normals);
      EXPECT_EQ(back->scene.triangles.size(), s.scene.triangles.size());
      EXPECT_EQ(vertices_of(*back)->front, s.receivers.front);
      EXPECT_EQ(vertices_of(*back)->back, s.receivers.back);
      EXPECT_EQ(std::get<Transfer>(back->surface.store).light.order, 3);
      EXPECT_EQ(std::get<Transfer>(back->surface.store).channels, channels);
      EXPECT_EQ(std::get<Transfer>(back->surface.store).precision, precision);
      EXPECT_TRUE(std::equal(std::get<Transfer>(back->surface.store).data.begin(),
                             std::get<Transfer>(back->surface.store).data.end(), s.transfer.transfer.data.begin(),
                             s.transfer.transfer.data.end()));
      EXPECT_EQ(back->provenance, R"({"options":{"order":3}})");
      EXPECT_EQ(reinterpret_cast<uintptr_t>(std::get<Transfer>(back->surface.store).data.data()) % 64,
                0u);  // in place, fit for SIMD
    }
}

TEST(BakedFile, MatricesComeBackWithTheirLastReflection) {
  Small s = small_bake(1, Precision::half);
  const size_t n = s.receivers.count();
  Random random(8);
  for (OutgoingKind kind :
       {OutgoingKind::map, OutgoingKind::svd, OutgoingKind::sh, OutgoingKind::hsh, OutgoingKind::directional}) {
    Outgoing o;
    o.kind = kind, o.order = 2, o.has_b = kind == OutgoingKind::sh || kind == OutgoingKind::directional;
    if (kind == OutgoingKind::directional) o.lobes = outgoing_lobes(12);
    const bool mapped = kind == OutgoingKind::map || kind == OutgoingKind::svd;
    if (mapped)
      for (int m = 0; m < 3; ++m) {
        ViewMap map{5, 4, std::vector<ViewWeights>(100)};
        for (ViewWeights& w : map.values) w = ViewWeights(random.next(), random.next(), random.next(), random.next());
        o.maps.push_back(std::move(map));
      }
    for (size_t r = 0; r < n; ++r) {
      if (mapped) o.map_of.push_back(uint16_t(r % 3));
      o.frames.push_back(
          frame_about(normalize_or(Vec3(random.next(), random.next(), random.next() - 0.5f), Vec3(0, 0, 1))));
    }
    const WritableTransfer w = make_transfer({.order = 3}, o.rows(), 3, n, Precision::single);
    std::vector<float> values(w.transfer.receiver_values());
    for (size_t r = 0; r < n; ++r) {
      for (float& v : values) v = random.next();
      store_receiver(w, r, values);
    }
    const TemporaryFile file("matrix.glb"), cut("matrix_cut.glb");
    ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, w.transfer, o)));
    auto back = load_baked(file.path);
    ASSERT_TRUE(back) << back.error().text();
    ASSERT_TRUE(outgoing_of(back->surface));
    EXPECT_EQ(std::get<Transfer>(back->surface.store).rows, o.rows());
    EXPECT_TRUE(std::equal(std::get<Transfer>(back->surface.store).data.begin(),
                           std::get<Transfer>(back->surface.store).data.end(), w.transfer.data.begin(),
                           w.transfer.data.end()));
    std::vector<ViewWeights> a(size_t(o.rows())), b(a.size());
    for (size_t r = 0; r < n; ++r) {
      const Vec3 view = normalize_or(o.frames[r] * Vec3(0.3f, -0.5f, 0.6f), Vec3(0));
      evaluate_outgoing(o, r, view, a), evaluate_outgoing(*outgoing_of(back->surface), r, view, b);
      for (size_t k = 0; k < a.size(); ++k) EXPECT_LT(length(a[k] - b[k]), mapped ? 2e-3f : 1e-5f);  // maps are halves
    }
    const std::vector<uint8_t> bytes = *read_file(file.path);
    for (size_t length = 0; length < bytes.size(); length += 997) {
      const std::span<const uint8_t> piece(bytes.data(), length);
      ASSERT_TRUE(write_file_atomically(cut.path, {&piece, 1}));
      EXPECT_FALSE(load_baked(cut.path)) << length;
    }
  }
}

// A lightmap of one group over texels or patches: values that tell every receiver apart.
struct Mapped {
  Scene scene;
  Receivers receivers;
  WritableTransfer transfer;
};
Mapped small_map(bool texels) {
  Mapped m;
  m.scene = small_bake(1, Precision::half).scene;
  m.scene.materials[0].emissive = Vec3(0, 2, 1);
  if (texels) {
    auto atlas = make_atlas(m.scene, {.texels_per_unit = 6});
    EXPECT_TRUE(atlas);
    m.receivers = make_texel_receivers(m.scene, *atlas);
  } else {
    m.receivers = make_patch_receivers(m.scene);
  }
  m.transfer = make_transfer({.groups = {"lamp"}}, 1, 3, m.receivers.count(), Precision::single);
  for (size_t r = 0; r < m.receivers.count(); ++r)
    store_receiver(m.transfer, r, std::vector<float>{float(r), 1, -float(r)});
  return m;
}

// All look-ups at one point of every triangle's sides.
std::vector<double> look_ups(const Scene& scene, const SpatialBasis& basis) {
  std::vector<double> out;
  std::visit(
      [&](const auto& b) {
        for (uint32_t i = 0; i < scene.triangles.size(); ++i)
          for (bool front : {true, false})
            if (const auto* at = b.find(i, front))
              b.spread(*at, 0.21f, 0.47f, [&](uint32_t r, float w) { out.push_back(double(r) + double(w)); });
      },
      basis);
  return out;
}

TEST(BakedFile, KeepsTexelsAndPatchesAndWhatViewersShow) {
  for (bool texels : {true, false}) {
    const TemporaryFile file("map.glb");
    const Mapped m = small_map(texels);
    const Image picture(4, 4);
    const ViewerLook look{*encode_png(picture, {}, ""), 3.5f};
    ASSERT_TRUE(save_baked(file.path, make_baked(m.scene, m.receivers, m.transfer.transfer, DiffuseRows{}), &look));
    auto back = load_baked(file.path);
    ASSERT_TRUE(back) << back.error().text();
    EXPECT_EQ(std::get<Transfer>(back->surface.store).light.groups, std::vector<std::string>{"lamp"});
    ASSERT_EQ(back->scene.triangles.size(), m.scene.triangles.size());  // backs for viewers are left out
    EXPECT_EQ(back->scene.positions, m.scene.positions);
    EXPECT_EQ(look_ups(back->scene, back->basis), look_ups(m.scene, m.receivers.basis));
    // The scene's own materials are back, not the glowing ones.
    for (size_t p = 0; p < m.scene.parts.size(); ++p) {
      const Material &was = m.scene.materials[m.scene.parts[p].material],
                     &is = back->scene.materials[back->scene.parts[p].material];
      EXPECT_EQ(is.base_color, was.base_color);
      EXPECT_EQ(is.emissive, was.emissive);
    }
    // To a viewer: lamps glow as before, the rest by the picture; the sheet has a second primitive for its back.
    auto bytes = MappedFile::open(file.path);
    auto chunks = split_gltf(bytes->bytes(), file.path);
    ASSERT_TRUE(chunks);
    size_t primitives = 0, glowing = 0, lamps = 0;
    for (const auto& mesh : chunks->json["meshes"])
      for (const auto& primitive : mesh["primitives"]) {
        ++primitives;
        const auto& material = chunks->json["materials"][primitive["material"].get<size_t>()];
        if (!texels) continue;
        EXPECT_TRUE(primitive["attributes"].contains("TEXCOORD_0"));
        EXPECT_TRUE(primitive["attributes"].contains("TEXCOORD_1"));
        EXPECT_EQ(material["doubleSided"], false);
        glowing += material.contains("emissiveTexture");
        lamps += !material.contains("emissiveTexture") && material["emissiveFactor"] == nlohmann::json({0.0, 1.0, 0.5});
      }
    EXPECT_EQ(primitives, texels ? 3u : 2u);
    if (texels) {
      EXPECT_EQ(glowing, 2u);
      EXPECT_EQ(lamps, 1u);
    }
    // Baked again from the baked file: still the scene's own materials.
    const TemporaryFile again("again.glb");
    Mapped second{std::move(back->scene), m.receivers, m.transfer};
    ASSERT_TRUE(save_baked(again.path,
                           make_baked(second.scene, second.receivers, second.transfer.transfer, DiffuseRows{}), &look));
    auto twice = load_baked(again.path);
    ASSERT_TRUE(twice) << twice.error().text();
    EXPECT_EQ(twice->scene.materials[twice->scene.parts[1].material].base_color, Vec3(0.2f, 0.5f, 0.7f));
    EXPECT_EQ(twice->scene.triangles.size(), m.scene.triangles.size());
  }
}

// As a tool does that keeps unknown JSON and gathers anew the bytes that it knows of; and as one that drops both.
TEST(BakedFile, SaysThatAnotherToolRewroteIt) {
  const TemporaryFile file("baked.glb"), rewritten("rewritten.gltf");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(save_baked(file.path, baked_of(s)));
  const auto bytes = MappedFile::open(file.path);
  const auto chunks = split_gltf(bytes->bytes(), file.path);
  ASSERT_TRUE(chunks);
  EXPECT_FALSE(find_rewritten(chunks->json, file.path));
  const auto error = [&](const nlohmann::json& document) {
    const std::string text = document.dump();
    const std::span<const uint8_t> piece(reinterpret_cast<const uint8_t*>(text.data()), text.size());
    EXPECT_TRUE(write_file_atomically(rewritten.path, {&piece, 1}));
    const auto fields = read_fields(rewritten.path);
    return fields ? "read" : fields.error().text();
  };
  const std::string place = rewritten.path + ": was rewritten by ",
                    unknowing = "a tool that does not know LAMBENT_transfer; bake again";
  nlohmann::json fewer = chunks->json;
  fewer["bufferViews"].erase(fewer["bufferViews"].size() - 1);
  EXPECT_EQ(error(fewer), place + unknowing);
  fewer["asset"]["generator"] = "some\noptimiser 1.0";
  EXPECT_EQ(error(fewer), place + "some?optimiser 1.0, " + unknowing);
  nlohmann::json shorter = chunks->json;
  shorter["buffers"][0]["byteLength"] = shorter["buffers"][0]["byteLength"].get<size_t>() - 4;
  EXPECT_EQ(error(shorter), place + unknowing);
  nlohmann::json dropped = chunks->json;
  dropped.erase("extensions");
  dropped["asset"]["generator"] = "glTF-Transform v4.2.0";
  EXPECT_EQ(error(dropped), place + "glTF-Transform v4.2.0, " + unknowing);
  dropped.erase("extensionsUsed");
  EXPECT_NE(error(dropped).find("is not a baked file"), std::string::npos);
  // What is wrong inside "written" is no more than a sign of the same.
  nlohmann::json broken = chunks->json;
  broken["extensions"]["LAMBENT_transfer"]["written"]["byteLength"] = "many";
  EXPECT_EQ(error(broken), place + unknowing);
  // A name changed in the JSON alone does no harm, and files of earlier builds say nothing.
  nlohmann::json renamed = chunks->json;
  renamed["nodes"][0]["name"] = "other", renamed["asset"]["generator"] = "editor";
  EXPECT_FALSE(find_rewritten(renamed, ""));
  nlohmann::json old = fewer;
  old["extensions"]["LAMBENT_transfer"].erase("written");
  EXPECT_FALSE(find_rewritten(old, ""));
}

std::vector<uint8_t> file_bytes(const std::string& path) { return *read_file(path); }

// The file of a bake into which that of another has gone, whatever was baked and shown before.
TEST(BakedFile, AnEarlierBakeLeavesNothing) {
  const TemporaryFile plain("plain.glb"), first("first.glb"), second("second.glb");
  for (bool texels : {true, false}) {
    SCOPED_TRACE(texels);
    Mapped m = small_map(texels);
    // One part wears no material, and one has both sets of texture coordinates already.
    ASSERT_TRUE(save_gltf(plain.path, m.scene, {}, [](nlohmann::json& document, const GltfPlaces&) {
      document["meshes"][0]["primitives"][0].erase("material");
      auto& attributes = document["meshes"][1]["primitives"][0]["attributes"];
      document["accessors"].push_back({{"componentType", 5126},
                                       {"count", document["accessors"][attributes["NORMAL"].get<size_t>()]["count"]},
                                       {"type", "VEC2"}});
      attributes["TEXCOORD_0"] = attributes["TEXCOORD_1"] = document["accessors"].size() - 1;
    }));
    ASSERT_TRUE(save_gltf(plain.path, *load_scene(plain.path), {}, {}));  // without what we have replaced
    auto scene = load_scene(plain.path);
    ASSERT_TRUE(scene) << scene.error().text();
    const nlohmann::json original = scene->document->json;
    ASSERT_EQ(scene->positions.size(), m.scene.positions.size());
    const ViewerLook look{*encode_png(Image(4, 4), {}, ""), 3.5f};
    for (const ViewerLook* shown : {&look, static_cast<const ViewerLook*>(nullptr)}) {
      const auto bake = [&](const Scene& from, const std::string& to) {
        auto saved = save_baked(to, make_baked(from, m.receivers, m.transfer.transfer, DiffuseRows{}), shown);
        ASSERT_TRUE(saved) << saved.error().text();
      };
      bake(*scene, first.path);
      auto back = load_baked(first.path);
      ASSERT_TRUE(back) << back.error().text();
      nlohmann::json left = back->scene.document->json;
      for (const char* key : {"accessors", "bufferViews", "buffers"}) left.erase(key);
      nlohmann::json due = original;
      for (const char* key : {"accessors", "bufferViews", "buffers"}) due.erase(key);
      EXPECT_EQ(left, due);
      bake(back->scene, second.path);
      EXPECT_EQ(file_bytes(second.path), file_bytes(first.path));
      // What was shown can be shown again.
      const auto mapped = MappedFile::open(first.path);
      const auto seen = load_look(*mapped, first.path);
      ASSERT_EQ(seen.has_value(), texels && shown);
      if (!seen) continue;
      EXPECT_EQ(seen->png, look.png);
      EXPECT_EQ(seen->strength, look.strength);
    }
  }
}

// Files as they were written before there was a record of what is to be undone.
TEST(BakedFile, OldFilesAreLeftNoLarger) {
  const auto golden = std::filesystem::path(__FILE__).parent_path() / "../../../tests/golden";
  size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(golden)) {
    if (entry.path().extension() != ".glb") continue;
    SCOPED_TRACE(entry.path().filename().string());
    ++files;
    auto baked = load_baked(entry.path().string());
    ASSERT_TRUE(baked) << baked.error().text();
    EXPECT_EQ(baked->scene.document->json.dump().find("LAMBENT"), std::string::npos);
    const auto mapped = MappedFile::open(entry.path().string());
    const auto look = load_look(*mapped, entry.path().string());
    const TemporaryFile again("again.glb"), third("third.glb");
    ASSERT_TRUE(save_baked(again.path, *baked, look ? &*look : nullptr));
    // But for "written", which old ones have not, with the rounding of what follows the JSON.
    constexpr size_t written = 128;
    EXPECT_LE(std::filesystem::file_size(again.path), std::filesystem::file_size(entry.path()) + written);
    auto back = load_baked(again.path);
    ASSERT_TRUE(back) << back.error().text();
    EXPECT_EQ(back->scene.positions, baked->scene.positions);
    EXPECT_EQ(back->scene.texcoords[0], baked->scene.texcoords[0]);
    ASSERT_TRUE(save_baked(third.path, *back, look ? &*look : nullptr));
    EXPECT_EQ(file_bytes(third.path), file_bytes(again.path));
  }
  EXPECT_GT(files, 20u);
}

TEST(BakedFile, RefusesSurfacesThatLie) {
  const TemporaryFile whole("surface.glb"), lying("lying.glb");
  const Mapped m = small_map(true);
  ASSERT_TRUE(save_baked(whole.path, make_baked(m.scene, m.receivers, m.transfer.transfer, DiffuseRows{})));
  const std::vector<uint8_t> bytes = *read_file(whole.path);
  const auto& texels = std::get<TexelReceivers>(m.receivers.basis);
  const std::string width = "\"width\":" + std::to_string(texels.width);
  std::string wider = width;
  wider.back() = wider.back() == '9' ? '8' : char(wider.back() + 1);
  for (const auto& [from, to] :
       {std::pair<std::string, std::string>{"\"kind\":\"texels\"", "\"kind\":\"pixels\""}, {width, wider}}) {
    const auto changed = edited(bytes, from, to);
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    EXPECT_FALSE(load_baked(lying.path)) << to;
  }
  for (size_t length = 0; length < bytes.size(); length += length < 256 ? 1 : 997) {
    const std::span<const uint8_t> piece(bytes.data(), length);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    EXPECT_FALSE(load_baked(lying.path)) << length;
  }
}

TEST(BakedFile, CompactAndSteerableLobesComeBack) {
  Small s = small_bake(1, Precision::half);
  for (const LightBasis& light : {LightBasis{0, LobeKind::compact, even_lobes(12, LobeKind::compact), {}},
                                  LightBasis{0, LobeKind::band_limited, steerable_lobes(3), {}}}) {
    const WritableTransfer w = make_transfer(light, 1, 1, s.receivers.count(), Precision::half);
    const TemporaryFile file("lobes_of_a_kind.glb");
    ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, w.transfer, DiffuseRows{})));
    auto back = load_baked(file.path);
    ASSERT_TRUE(back) << back.error().text();
    const LightBasis& got = std::get<Transfer>(back->surface.store).light;
    EXPECT_EQ(got.lobe_kind, light.lobe_kind);
    ASSERT_EQ(got.lobes.size(), light.lobes.size());
    for (size_t k = 0; k < got.lobes.size(); ++k) {
      EXPECT_EQ(got.lobes[k].axis, light.lobes[k].axis);
      EXPECT_EQ(got.lobes[k].sharpness, light.lobes[k].sharpness);
    }
  }
}

TEST(BakedFile, WaveletsOfThreeChannelsComeBackAndMayNotLie) {
  const TemporaryFile file("wavelets_rgb.glb");
  const Small s = small_bake(1, Precision::half);
  Random random(3);
  std::vector<std::vector<HaarEntry>> rows(s.receivers.count());
  for (auto& row : rows)
    for (uint32_t c = 5; c < 3 * 1536; c += 700) row.push_back({c, random.next()});
  HaarWriter writer(16, std::vector<float>(3 * 1536, 1.0f));
  writer.add(rows);
  const HaarTransfer t = writer.finish(0.1);
  ASSERT_EQ(t.channels, 3);
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, t, DiffuseRows{})));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  const auto& kept = std::get<HaarTransfer>(back->surface.store);
  EXPECT_EQ(kept.channels, 3);
  EXPECT_EQ(kept.begin, t.begin);
  for (size_t r = 0; r < rows.size(); ++r) EXPECT_EQ(load_receiver(kept, r), load_receiver(t, r));
  const std::vector<uint8_t> bytes = *read_file(file.path);
  for (const char* to : {"\"channels\":1", "\"channels\":2", "\"channels\":0"}) {
    std::string text(bytes.begin(), bytes.end());
    const size_t at = text.find("\"channels\":3");
    ASSERT_NE(at, std::string::npos);
    text.replace(at, 12, to);
    ASSERT_TRUE(write_file_atomically(file.path, text));
    EXPECT_FALSE(load_baked(file.path)) << to;
  }
}

}  // namespace
}  // namespace lambent
