#include <lambent/baked/baked_test-inl.h>
#include <lambent/relight/relight_haar.h>

#include <fstream>

namespace lambent {
namespace {

LatticeTransfer small_lattice() {
  LatticeTransfer l{{Vec3(-1, 0, -2), Vec3(1, 2.5f, 3), 3, 1, 2}, 2, {}, {1, 1, 0, 1, 1, 0}};
  const WritableTransfer w = make_transfer({.order = 3}, 4, 3, 6, Precision::half);
  Random random(12);
  std::vector<float> values(w.transfer.receiver_values());
  for (size_t p = 0; p < 6; ++p) {
    for (float& v : values) v = random.next();
    store_receiver(w, p, values);
  }
  l.transfer = w.transfer;
  return l;
}

TEST(BakedFile, LightInFreeSpaceComesBack) {
  const TemporaryFile file("lattice.glb"), cut("lattice_cut.glb");
  const Small s = small_bake(1, Precision::single);
  const LatticeTransfer l = small_lattice();
  Baked baked = baked_of(s);
  baked.more.push_back(lattice_field(l));
  ASSERT_TRUE(save_baked(file.path, baked));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(lattice_of(*back));
  const auto& place = std::get<LatticePlacement>(lattice_of(*back)->where);
  const auto& free_space = std::get<Transfer>(lattice_of(*back)->store);
  EXPECT_EQ(place.lattice.min, l.lattice.min);
  EXPECT_EQ(place.lattice.max, l.lattice.max);
  EXPECT_EQ(place.lattice.count(), 6u);
  EXPECT_EQ(place.lattice.nx, 3);
  EXPECT_EQ(std::get<IncidentRows>(lattice_of(*back)->rows).order, 2);
  EXPECT_EQ(place.valid, l.valid);
  EXPECT_EQ(free_space.channels, 3);
  EXPECT_EQ(free_space.columns(), 9u);
  EXPECT_TRUE(
      std::equal(free_space.data.begin(), free_space.data.end(), l.transfer.data.begin(), l.transfer.data.end()));
  EXPECT_EQ(reinterpret_cast<uintptr_t>(free_space.data.data()) % 64, 0u);

  expect_refused(file.path, "\"lattice\":{",
                 {{"\"points\":[3,1,2]", "\"points\":[3,2,2]"},
                  {"\"points\":[3,1,2]", "\"points\":[3,0,2]"},
                  {"\"points\":[3,1,2]", "\"points\":[3,-1] "},
                  {"\"points\":[3,1,2]", "\"points\":[3,1  ]"},
                  {"\"points\":[3,1,2]", "\"points\":[3,99] "},
                  {"\"order\":2", "\"order\":3"},
                  {"\"order\":2", "\"order\":0"},
                  {"\"channels\":3", "\"channels\":1"},
                  {"\"channels\":3", "\"channels\":2"},
                  {"\"precision\":\"half\"", "\"precision\":\"hal?\""},
                  {"\"max\":[1.0,", "\"max\":[-9 ,"},
                  {"\"max\":[1.0,", "\"max\":[9e9,"},
                  {"\"max\":[1.0,", "\"max\":[\"\" ,"},
                  {"\"min\"", "\"mid\""},
                  {"\"valid\"", "\"vapid\""},
                  {"\"bufferView\"", "\"bufferVeil\""}});
  const std::vector<uint8_t> bytes = *read_file(file.path);
  for (size_t length = 0; length < bytes.size(); length += 199) {
    const std::span<const uint8_t> piece(bytes.data(), length);
    ASSERT_TRUE(write_file_atomically(cut.path, {&piece, 1}));
    EXPECT_FALSE(load_baked(cut.path)) << length;
  }
}

TEST(BakedFile, ClustersComeBack) {
  const TemporaryFile file("clusters.glb");
  const Small s = small_bake(3, Precision::half);
  const size_t n = s.receivers.count();
  CpcaTransfer c;
  c.light = {.order = 3}, c.channels = 3, c.receivers = n, c.clusters = 4, c.rank = 2;
  Random random(21);
  for (size_t i = 0; i < 4 * 3 * c.receiver_values(); ++i) c.vectors.push_back(random.next());
  for (size_t r = 0; r < n; ++r)
    c.cluster_of.push_back(uint16_t(random.next() * 4)), c.weights.push_back(float_to_half(random.next())),
        c.weights.push_back(0);
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, c, DiffuseRows{})));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(std::holds_alternative<CpcaTransfer>(back->surface.store));
  EXPECT_EQ(receivers_of(back->surface.store), n);
  EXPECT_EQ(light_of(back->surface.store).order, 3);
  EXPECT_EQ(vertices_of(*back)->front, s.receivers.front);
  EXPECT_EQ(std::get<CpcaTransfer>(back->surface.store).clusters, 4);
  EXPECT_EQ(std::get<CpcaTransfer>(back->surface.store).rank, 2);
  EXPECT_EQ(std::get<CpcaTransfer>(back->surface.store).vectors, c.vectors);
  EXPECT_EQ(std::get<CpcaTransfer>(back->surface.store).cluster_of, c.cluster_of);
  EXPECT_EQ(std::get<CpcaTransfer>(back->surface.store).weights, c.weights);
  expect_refused(file.path, "\"cpca\":{",
                 {{"\"clusters\":4", "\"clusters\":3"},
                  {"\"clusters\":4", "\"clusters\":0"},
                  {"\"rank\":2", "\"rank\":1"},
                  {"\"rank\":2", "\"rank\":9"},
                  {"\"clusterOf\"", "\"clusterof\""},
                  {"\"weights\"", "\"weighty\""}});
  c.cluster_of[1] = 4;
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, c, DiffuseRows{})));
  EXPECT_FALSE(load_baked(file.path));
  c.cluster_of[1] = 3, c.vectors[5] = NAN;
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, c, DiffuseRows{})));
  EXPECT_FALSE(load_baked(file.path));
  c.vectors[5] = 1, c.weights[1] = 0x7c00;
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, c, DiffuseRows{})));
  EXPECT_FALSE(load_baked(file.path));
}

TEST(BakedFile, FixedViewsComeBack) {
  const TemporaryFile file("view.glb");
  const Small s = small_bake(1, Precision::half);
  const WritableTransfer w = make_transfer({.order = 2}, 1, 3, 6, Precision::half);
  FixedView view{Camera{Vec3(1, 2, 3), Vec3(0, 0.5f, 0), Vec3(0, 1, 0), 33}, 3, 2, {0, 0.25f, 1, 1, 0.5f, 0}};
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, view, w.transfer)));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(std::holds_alternative<FixedView>(back->surface.where));
  const auto& seen = std::get<FixedView>(back->surface.where);
  EXPECT_EQ(seen.width, 3);
  EXPECT_EQ(seen.height, 2);
  EXPECT_EQ(seen.camera.eye, view.camera.eye);
  EXPECT_EQ(seen.camera.target, view.camera.target);
  EXPECT_EQ(seen.camera.fov, 33);
  EXPECT_EQ(seen.coverage, view.coverage);
  EXPECT_EQ(back->scene.triangles.size(), s.scene.triangles.size());
  expect_refused(file.path, "\"view\":{",
                 {{"\"width\":3", "\"width\":2"},
                  {"\"height\":2", "\"height\":0"},
                  {"\"fov\":33", "\"fov\":-3"},
                  {"\"eye\":[", "\"eya\":["},
                  {"\"target\":[0.0", "\"target\":[9e9"},
                  {"\"coverage\"", "\"coverall\""}});
  view.coverage[2] = 1.5f;
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, view, w.transfer)));
  EXPECT_FALSE(load_baked(file.path));
}

TEST(BakedFile, IsTheSameBytesEveryTime) {
  const TemporaryFile a("a.glb"), b("b.glb");
  const Small s = small_bake(3, Precision::half);
  ASSERT_TRUE(save_baked(a.path, baked_of(s)));
  ASSERT_TRUE(save_baked(b.path, baked_of(s)));
  EXPECT_EQ(*read_file(a.path), *read_file(b.path));
}

TEST(BakedFile, RefusesEveryTruncation) {
  const TemporaryFile whole("whole.glb"), cut("cut.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(save_baked(whole.path, baked_of(s)));
  const std::vector<uint8_t> bytes = *read_file(whole.path);
  // Every length at the front, where the headers are; then every 61st.
  for (size_t length = 0; length < bytes.size(); length += length < 256 ? 1 : 61) {
    const std::span<const uint8_t> piece(bytes.data(), length);
    ASSERT_TRUE(write_file_atomically(cut.path, {&piece, 1}));
    EXPECT_FALSE(load_baked(cut.path)) << length;
  }
}

TEST(BakedFile, RefusesHeadersThatLie) {
  const TemporaryFile whole("whole.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(save_baked(whole.path, baked_of(s)));
  const std::string receivers = "\"receivers\":" + std::to_string(s.receivers.count());
  expect_refused(whole.path, "",
                 {{"\"version\":1,\"w", "\"version\":2,\"w"},
                  {"\"order\":3", "\"order\":4"},
                  {"\"order\":3", "\"order\":0"},
                  {"\"channels\":1", "\"channels\":2"},
                  {"\"channels\":1", "\"channels\":3"},
                  {receivers, receivers.substr(0, receivers.size() - 1) + (receivers.back() == '0' ? "1" : "0")},
                  {"\"kind\":\"diffuse\"", "\"kind\":\"unknown\""},
                  {"\"precision\":\"half\"", "\"precision\":\"hal?\""}});
}

TEST(BakedFile, KeepsZonalTransferAndRefusesLiesAboutIt) {
  const TemporaryFile file("zonal.glb"), lying("zonal_lie.glb");
  const Small s = small_bake(3, Precision::half);
  const WritableZonalTransfer w = make_zonal_transfer(6, 4, 3, s.receivers.count(), Precision::half);
  Random random(3);
  for (size_t r = 0; r < s.receivers.count(); ++r) {
    std::vector<float> v(w.transfer.receiver_values());
    for (float& x : v) x = random.next();
    store_receiver(w, r, v);
  }
  std::vector<float> errors(s.receivers.count());
  for (float& e : errors) e = random.next();
  ASSERT_TRUE(save_baked(file.path, with_errors(make_baked(s.scene, s.receivers, w.transfer, DiffuseRows{}), errors)));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(std::holds_alternative<ZonalTransfer>(back->surface.store));
  EXPECT_EQ(back->surface.fit_errors, errors);
  EXPECT_EQ(vertices_of(*back)->front, s.receivers.front);
  EXPECT_EQ(std::get<ZonalTransfer>(back->surface.store).order, 6);
  EXPECT_EQ(std::get<ZonalTransfer>(back->surface.store).lobes, 4);
  EXPECT_EQ(std::get<ZonalTransfer>(back->surface.store).channels, 3);
  EXPECT_TRUE(std::equal(std::get<ZonalTransfer>(back->surface.store).data.begin(),
                         std::get<ZonalTransfer>(back->surface.store).data.end(), w.transfer.data.begin(),
                         w.transfer.data.end()));
  EXPECT_EQ(reinterpret_cast<uintptr_t>(std::get<ZonalTransfer>(back->surface.store).data.data()) % 64, 0u);
  const std::pair<std::string, std::string> lies[] = {
      {"\"lobeCount\":4", "\"lobeCount\":5"}, {"\"lobeCount\":4", "\"lobeCount\":0"},
      {"\"lobeCount\":4", "\"lobeCount\":9"}, {"\"lobeCount\":4", "\"lobeCoun?\":4"},
      {"\"order\":6", "\"order\":0"},         {"\"kind\":\"zonal\"", "\"kind\":\"zona?\""}};
  for (const auto& [from, to] : lies) {
    const auto changed = edited(*read_file(file.path), from, to);
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    auto result = load_baked(lying.path);
    ASSERT_FALSE(result) << to;
    EXPECT_EQ(result.error().text().find('\n'), std::string::npos);
  }
}

TEST(BakedFile, LobesOfAMatrixComeBackWithTheirLastReflection) {
  const TemporaryFile file("glossy.glb");
  const Small s = small_bake(1, Precision::half);
  const size_t n = s.receivers.count();
  Outgoing o;
  o.kind = OutgoingKind::svd, o.order = 3, o.has_b = false;
  o.maps = {{8, 2, std::vector<ViewWeights>(8 * 8 * 2, ViewWeights(0.5f, 0.25f, 1, 0.125f))}};
  o.map_of.assign(n, 0);
  for (const Vec3& normal : s.receivers.normals) o.frames.push_back(frame_about(normal));
  const WritableZonalTransfer w = make_zonal_transfer(4, 3, 1, n, Precision::half, 2);
  Random random(3);
  for (size_t r = 0; r < n; ++r) {
    std::vector<float> v(w.transfer.receiver_values());
    for (float& x : v) x = random.next();
    store_receiver(w, r, v);
  }
  const std::vector<float> errors(n, 0.5f);
  ASSERT_TRUE(save_baked(file.path, with_errors(make_baked(s.scene, s.receivers, w.transfer, o), errors)));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(std::holds_alternative<ZonalTransfer>(back->surface.store) && outgoing_of(back->surface));
  EXPECT_EQ(std::get<ZonalTransfer>(back->surface.store).rows, 2);
  EXPECT_EQ(outgoing_of(back->surface)->maps[0].values, o.maps[0].values);
  EXPECT_EQ(back->surface.fit_errors, errors);
  EXPECT_TRUE(std::equal(std::get<ZonalTransfer>(back->surface.store).data.begin(),
                         std::get<ZonalTransfer>(back->surface.store).data.end(), w.transfer.data.begin(),
                         w.transfer.data.end()));
  // What a matrix of another kind may have, told of the right type and of none.
  Outgoing harmonics;
  harmonics.kind = OutgoingKind::sh, harmonics.order = 1, harmonics.frames = o.frames;
  const TemporaryFile other("glossy_sh.glb");
  ASSERT_TRUE(save_baked(other.path, make_baked(s.scene, s.receivers, w.transfer, harmonics)));
  ASSERT_TRUE(load_baked(other.path));
  expect_refused(other.path, "\"transfer\":{", {{"\"hasB\":true", "\"hasB\":7   "}});
  expect_refused(file.path, "\"transfer\":{",
                 {{"\"rows\":2", "\"rows\":3"},
                  {"\"rows\":2", "\"rows\":0"},
                  {"\"rows\"", "\"rose\""},
                  {"\"grid\":8", "\"grid\":9"},
                  {"\"lobeCount\":3", "\"lobeCount\":4"},
                  {"\"kind\":\"svd\"", "\"kind\":\"sv?\""}});
}

TEST(BakedFile, ErrorsOfFitsAreFinite) {
  const TemporaryFile file("zonal_nan.glb");
  const Small s = small_bake(3, Precision::half);
  const WritableZonalTransfer w = make_zonal_transfer(3, 1, 1, s.receivers.count(), Precision::half);
  const std::vector<float> errors(s.receivers.count(), NAN);
  ASSERT_TRUE(save_baked(file.path, with_errors(make_baked(s.scene, s.receivers, w.transfer, DiffuseRows{}), errors)));
  auto result = load_baked(file.path);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().text().find("not finite"), std::string::npos);
}

TEST(BakedFile, LobesComeBackAndTheirHeadersMayNotLie) {
  Small s = small_bake(1, Precision::half);
  const LightBasis light{2,
                         LobeKind::cosine_power,
                         {{Vec3(0, 1, 0), 50}, {normalize(Vec3(0.3f, -0.5f, 0.8f)), 77777.5f}},
                         {"desk", "roof"}};
  const WritableTransfer w = make_transfer(light, 1, 1, s.receivers.count(), Precision::half);
  const TemporaryFile file("lobes.glb"), lying("lobes_lying.glb");
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, w.transfer, DiffuseRows{})));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  const LightBasis& got = std::get<Transfer>(back->surface.store).light;
  EXPECT_EQ(got.order, 2);
  EXPECT_EQ(got.lobe_kind, LobeKind::cosine_power);
  EXPECT_EQ(got.groups, light.groups);
  ASSERT_EQ(got.lobes.size(), 2u);
  for (size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(got.lobes[k].axis, light.lobes[k].axis);
    EXPECT_EQ(got.lobes[k].sharpness, light.lobes[k].sharpness);
  }
  const std::vector<uint8_t> bytes = *read_file(file.path);
  // Both lobes are out of range of the other kinds: no whole number, or too sharp.
  const std::pair<std::string, std::string> lies[] = {{"\"cosine_power\"", "\"compact\"     "},
                                                      {"cosine_power", "band_limited"},
                                                      {"cosine_power", "cosine_tower"},
                                                      {"lobeKind", "lobeKine"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,-5.0]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,5e99]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,2.0,0.0,50.0]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,0.50]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,null]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.000050]"},
                                                      {"[0.0,1.0,0.0,50.0],", "                   "},
                                                      {"\"desk\",", "       "}};
  for (const auto& [from, to] : lies) {
    const auto changed = edited(bytes, from, to);
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    auto result = load_baked(lying.path);
    ASSERT_FALSE(result) << to;
    EXPECT_NE(result.error().text().find(lying.path), std::string::npos);
  }
}

TEST(BakedFile, RefusesOtherThings) {
  EXPECT_FALSE(load_baked("/nonexistent/x.glb"));
  EXPECT_FALSE(load_baked("/tmp"));
  EXPECT_FALSE(is_baked("/nonexistent/x.glb"));
}

// A small scene with visibility in blocks: a box over a sheet, levels by a formula.
Visibility small_visibility(size_t receivers, int bits) {
  std::vector<std::vector<uint8_t>> pieces(1);
  std::vector<uint32_t> lengths;
  std::vector<uint8_t> levels(cube_texels(16));
  Random random(4);
  for (size_t r = 0; r < receivers; ++r) {
    for (size_t t = 0; t < levels.size(); ++t)
      levels[t] = t < 512              ? uint8_t(0)
                : random.next() < 0.1f ? uint8_t(random.next() * float(1 << bits))
                                       : levels[t - 1];
    const size_t before = pieces[0].size();
    encode_visibility(16, bits, levels, pieces[0]);
    lengths.push_back(uint32_t(pieces[0].size() - before));
  }
  return make_visibility(16, bits, std::move(pieces), lengths);
}

TEST(BakedFile, VisibilityComesBackAsItWas) {
  for (int bits : {1, 6}) {
    const TemporaryFile file("blocks.glb");
    const Small s = small_bake(1, Precision::half);
    const Visibility v = small_visibility(s.receivers.count(), bits);
    ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, v, SightRows{})));
    auto back = load_baked(file.path);
    ASSERT_TRUE(back) << back.error().text();
    ASSERT_TRUE(std::holds_alternative<Visibility>(back->surface.store));
    const auto& kept = std::get<Visibility>(back->surface.store);
    EXPECT_EQ(kept.size, 16);
    EXPECT_EQ(kept.bits, bits);
    EXPECT_EQ(kept.begin, v.begin);
    EXPECT_TRUE(std::equal(v.data.begin(), v.data.end(), kept.data.begin(), kept.data.end()));
    EXPECT_EQ(vertices_of(*back)->front, s.receivers.front);
    EXPECT_EQ(vertices_of(*back)->back, s.receivers.back);
  }
}

// Every other cube, more bits, any cut and any changed byte: refused in one line, or read without harm.
TEST(BakedFile, BrokenVisibilityIsRefusedOrHarmless) {
  const TemporaryFile file("blocks_broken.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(
      save_baked(file.path, make_baked(s.scene, s.receivers, small_visibility(s.receivers.count(), 6), SightRows{})));
  const std::vector<uint8_t> whole = *read_file(file.path);
  const std::string text(whole.begin(), whole.end());
  auto refuses = [&](const std::string& from, const std::string& to, const char* why) {
    ASSERT_EQ(from.size(), to.size());
    std::string changed = text;
    const size_t at = changed.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    ASSERT_TRUE(write_file_atomically(file.path, changed));
    auto baked = load_baked(file.path);
    ASSERT_FALSE(baked) << to;
    EXPECT_NE(baked.error().text().find(why), std::string::npos) << baked.error().text();
    EXPECT_EQ(baked.error().text().find('\n'), std::string::npos);
  };
  refuses("\"cube\":16", "\"cube\":32", "is broken");
  refuses("\"cube\":16", "\"cube\":17", "multiple of 16");
  refuses("\"bits\":6", "\"bits\":0", "bits");
  refuses("\"bits\":6", "\"bits\":1", "is broken");
  refuses("\"bits\":6", "\"bits\":9", "bits");
  Random random(8);
  size_t refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string changed = text;
    if (i % 8 == 0) changed.resize(size_t(random.next() * float(text.size())));
    else changed[size_t(random.next() * float(text.size()))] = char(random.next64());
    std::ofstream(file.path, std::ios::binary) << changed;  // no waiting for the disk
    auto baked = load_baked(file.path);
    if (!baked) {
      ++refused;
      continue;
    }
    const auto* read = std::get_if<Visibility>(&baked->surface.store);
    if (!read) continue;
    std::vector<uint8_t> levels(cube_texels(read->size));
    for (size_t r = 0; r < read->receivers; ++r) decode_visibility(*read, r, levels);
  }
  EXPECT_GT(refused, 500u);
}

// Two columns of each face, one of them of every receiver.
HaarTransfer small_wavelets(size_t receivers) {
  Random random(9);
  std::vector<std::vector<HaarEntry>> rows(receivers);
  for (auto& row : rows)
    for (uint32_t face = 0; face < 6; ++face) {
      row.push_back({256 * face, random.next() - 0.5f});
      if (random.next() < 0.2f) row.push_back({256 * face + 40, random.next()});
    }
  HaarTransfer t = make_haar_transfer(16, rows);
  t.error = 0.25;
  return t;
}

TEST(BakedFile, WaveletsComeBackAsTheyWere) {
  const TemporaryFile file("wavelets.glb");
  const Small s = small_bake(1, Precision::half);
  const HaarTransfer t = small_wavelets(s.receivers.count());
  ASSERT_TRUE(save_baked(file.path, make_baked(s.scene, s.receivers, t, DiffuseRows{})));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_TRUE(std::holds_alternative<HaarTransfer>(back->surface.store));
  const auto& kept = std::get<HaarTransfer>(back->surface.store);
  EXPECT_EQ(kept.size, 16);
  EXPECT_EQ(kept.error, 0.25);
  EXPECT_EQ(kept.steps, t.steps);
  EXPECT_EQ(kept.starts, t.starts);
  EXPECT_EQ(kept.begin, t.begin);
  EXPECT_TRUE(std::equal(t.data.begin(), t.data.end(), kept.data.begin(), kept.data.end()));
}

// Another cube, any cut and any changed byte: refused in one line, or relit without harm.
TEST(BakedFile, WaveletsThatLieAreRefusedOrHarmless) {
  const TemporaryFile file("wavelets_broken.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(
      save_baked(file.path, make_baked(s.scene, s.receivers, small_wavelets(s.receivers.count()), DiffuseRows{})));
  const std::vector<uint8_t> whole = *read_file(file.path);
  const std::string text(whole.begin(), whole.end());
  const auto read = [&](const std::string& changed) {
    std::ofstream(file.path, std::ios::binary) << changed;  // no waiting for the disk
    return load_baked(file.path);
  };
  for (const char* to : {"\"cube\":32", "\"cube\":48", "\"cube\":-1"}) {
    std::string changed = text;
    changed.replace(changed.find("\"cube\":16"), 9, to);
    auto baked = read(changed);
    ASSERT_FALSE(baked) << to;
    EXPECT_EQ(baked.error().text().find('\n'), std::string::npos);
  }
  CubeLight light{16, std::vector<Vec3>(cube_texels(16), Vec3(1.0f)), {}};
  Random random(8);
  size_t refused = 0;
  for (int i = 0; i < 1000; ++i) {
    std::string changed = text;
    if (i % 8 == 0) changed.resize(size_t(random.next() * float(text.size())));
    else changed[size_t(random.next() * float(text.size()))] = char(random.next64());
    auto baked = read(changed);
    const auto* t = baked ? std::get_if<HaarTransfer>(&baked->surface.store) : nullptr;
    refused += !baked;
    if (!t) continue;
    Relit relit;
    relight(*t, haar_terms(*t, haar_column_norms(*t), light, 0), relit);
  }
  EXPECT_GT(refused, 200u);
}

}  // namespace
}  // namespace lambent
