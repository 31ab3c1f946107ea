#include <lambent/baked/extension.h>
#include <lambent/core/file.h>
#include <lambent/pipeline/bake.h>
#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>
#include <malloc.h>

#include <filesystem>
#include <map>

#include "sanitizers.h"

namespace lambent {
namespace {

// A floor, a wall, a pyramid and a lamp: everything that a bake may meet, in thirteen vertices.
constexpr const char* scene_mtl = R"(newmtl red
Kd 0.8 0.2 0.1
newmtl grey
Kd 0.5 0.6 0.7
newmtl lamp
Kd 0 0 0
Ke 3 2 1
)";
constexpr const char* scene_obj = R"(mtllib m.mtl
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
v 0.6 0 0.6
v 1.4 0 0.6
v 1 0 1.4
v 1 0.8 0.9
v 0.5 1.5 1
v 1.5 1.5 1
v 1 1.5 1.6
usemtl grey
f 4 3 2 1
usemtl red
f 1 2 6 5
usemtl grey
f 7 10 8
f 8 10 9
f 9 10 7
usemtl lamp
f 11 12 13
)";

class Requests : public testing::Test {
 protected:
  std::filesystem::path folder;
  void SetUp() override {
    folder = std::filesystem::temp_directory_path() / ("lambent_requests_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    ASSERT_TRUE(write_file_atomically((folder / "m.mtl").string(), scene_mtl));
    ASSERT_TRUE(write_file_atomically((folder / "s.obj").string(), scene_obj));
    test::Builder lit = test::triangle();
    lit.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 10}}};
    lit.json["nodes"].push_back(
        {{"translation", {1, 0, 2}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    test::write_bytes(at("lit.glb"), lit.glb());
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  std::string at(const std::string& name) const { return (folder / name).string(); }

  // The least that makes a request of a kind, quick to bake.
  nlohmann::json least(BakeKind kind) const {
    nlohmann::json r{{"scene", at("s.obj")}, {"output", at("out.glb")}};
    switch (kind) {
      case BakeKind::diffuse: break;
      case BakeKind::matrix: r.update({{"transfer", "matrix"}, {"incident_order", 3}, {"view_map", 8}}); break;
      case BakeKind::factors:
        r.update({{"transfer", "matrix"}, {"factors", true}, {"incident_order", 2}, {"view_map", 8}});
        break;
      case BakeKind::zonal: r["transfer"] = "zonal"; break;
      case BakeKind::glossy_zonal:
        r.update({{"transfer", "zonal"}, {"outgoing", "svd:2"}, {"incident_order", 3}, {"view_map", 8}});
        break;
      case BakeKind::membrane: r["membrane"] = "0.4"; break;
      case BakeKind::lightmap: r.update({{"transfer", "lightmap"}, {"atlas", "24x24"}, {"lamp_samples", 4}}); break;
      case BakeKind::blocks: r.update({{"transfer", "blocks"}, {"cube", 16}}); break;
      case BakeKind::indirect: r.update({{"transfer", "indirect"}, {"surfels", 256}}); break;
      case BakeKind::wavelets:
        r.update({{"light", "haar:16,keep=0.2"}, {"visibility", "binary"}, {"bounces", "2"}});
        break;
    }
    const bool on_cube = kind == BakeKind::blocks || kind == BakeKind::wavelets;
    if (kind != BakeKind::membrane && kind != BakeKind::blocks) r["samples"] = 32;
    if (!on_cube && kind != BakeKind::lightmap && kind != BakeKind::indirect) r["order"] = 3;
    return r;
  }
};

BakeRequest must_read(const nlohmann::json& object) {
  auto request = bake_request_from_json(object);
  EXPECT_TRUE(request) << object.dump() << ": " << request.error().text();
  return request ? *request : BakeRequest();
}

// Everything that a bake makes, as one hash; provenance apart.
std::string fingerprint(BakeOutcome outcome) {
  outcome.baked.provenance = "{}";
  BlobWriter bulk;
  std::string text = encode_fields(outcome.baked, bulk).dump();
  for (const auto& blob : bulk.blobs) text += content_hash(blob.bytes);
  const Scene& s = outcome.baked.scene;
  text += std::to_string(s.triangles.size());
  for (const Material& m : s.materials)
    text += std::to_string(luminance(m.base_color)) + std::to_string(luminance(m.emissive)) + ";";
  for (const auto& [name, picture] : outcome.pictures) {
    text += name;
    text += content_hash({reinterpret_cast<const uint8_t*>(picture.rgb.data()), picture.rgb.size() * sizeof(Vec3)});
  }
  return content_hash({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

// Another value than least() and the defaults have, and what it needs beside itself.
struct Change {
  nlohmann::json value, with = nlohmann::json::object();
};
const std::map<std::string, Change> changes{
    {"bin_limit", {size_t{1} << 20, {{"output", "out.gltf"}}}},
    {"checkpoint", {"off"}},
    {"depfile", {"out.d"}},
    {"scratch", {"off"}},
    {"order", {2}},
    {"light", {"sh:2"}},
    {"precision", {"single"}},
    {"projection", {"least-squares"}},
    {"texels_per_unit", {5.0, {{"receivers", "texels"}}}},
    {"atlas", {"32x32", {{"receivers", "texels"}, {"atlas", "24x24"}}}},
    {"quality", {"preview", {{"adapt", "on"}}}},
    {"error", {"60%", {{"samples", nullptr}}}},
    {"time", {0.0, {{"samples", nullptr}, {"error", "0.1%"}, {"bounces", "0"}}}},
    {"adapt", {"on"}},
    {"denoise", {"off"}},
    {"samples", {48}},
    {"bounces", {"1"}},
    {"shadows", {"off"}},
    {"terms", {true}},
    {"memory", {size_t{1} << 30}},
    {"seed", {7}},
    {"ground", {true}},
    {"max_edge", {0.5}},
    {"emit", {nlohmann::json::array({"grey=1,2,3"})}},
    {"light_units", {"raw"}},
    {"lamp", {nlohmann::json::array({"lamp=2"})}},
    {"max_albedo", {0.3}},
    {"exclude", {nlohmann::json::array({"red"})}},
    {"rooms", {"auto"}},
    {"rooms_error", {0.3, {{"rooms", "auto"}}}},
    {"brdf", {"ggx:roughness=0.4"}},
    {"outgoing", {"svd:3"}},
    {"incident_order", {4}},
    {"view_map", {12}},
    {"simulate", {"paths"}},
    {"factors", {true}},
    {"lobes", {2}},
    {"subsurface", {"sigma_s=2,sigma_a=0.1"}},
    {"membrane", {"0.7"}},
    {"direct", {"separate"}},
    {"directional", {"sh:2"}},
    {"solver", {"southwell", {{"bounces", "converge:0.1"}}}},
    {"gather", {"hemicube"}},
    {"sky", {"sky:elevation=40"}},
    {"light_groups", {true}},
    {"lamp_samples", {9}},
    {"cube", {32}},
    {"visibility", {"bits:3"}},
    {"compress", {"cpca:2,1"}},
    {"fix_light", {"sky:elevation=40"}},
    {"fix_view", {"auto"}},
    {"size", {"12x9", {{"fix_view", "auto"}}}},
    {"spp", {3, {{"fix_view", "auto"}, {"size", "16x12"}}}},
    {"surfels", {512}},
    {"gatherers", {"all"}},
    {"lattice", {"2,1,1"}},
    {"lattice_box", {"0,0,0,1,1,1", {{"lattice", "2,1,1"}}}},
    {"lattice_order", {2, {{"lattice", "2,1,1"}}}},
};

// Every option with every kind: refused by name, or baked, and then it has an effect.
TEST_F(Requests, EveryOptionHasAnEffectOrIsRefusedByName) {
  std::map<std::string, std::string> known;           // fingerprints by request: many options change the same one
  const size_t of_each = under_sanitizers() ? 6 : 1;  // every option with some kinds, every kind with some options
  for (int k = 0; k < int(std::size(bake_kind_names)); ++k) {
    size_t index = size_t(k);
    for (const Option<BakeRequest>& o : bake_options()) {
      const std::string name = json_name(o.name);
      if (name == "scene" || name == "output" || name == "transfer" || name == "receivers") continue;
      if (index++ % of_each != 0) continue;
      ASSERT_TRUE(changes.contains(name)) << name << " has no value to be tried with";
      const Change& change = changes.at(name);
      nlohmann::json before = least(BakeKind(k));
      if (name == "light")
        before.erase("order"), before.erase("visibility");  // of diffuse transfer, which it turns into
      if (name == "light_units") before["scene"] = at("lit.glb");
      if (name == "surfels" && BakeKind(k) == BakeKind::diffuse)
        before["receivers"] = "meshless", before["surfels"] = 256;
      for (const auto& [key, value] : change.with.items())  // null: without it
        if (!value.is_null()) before[key] = value;
        else if (o.kinds >> k & 1) before.erase(key);
      if (BakeKind(k) == BakeKind::lightmap && (name == "quality" || name == "denoise"))  // of a bake to an error
        before.erase("samples"), before.erase("adapt");
      if (change.with.contains("receivers") && !change.with.contains(name) && (o.kinds >> k & 1)) before.erase(name);
      if (name == "size") before["size"] = "16x12";
      nlohmann::json after = before;
      after[name] = change.value;
      if (name == "fix_view") after["size"] = "16x12";
      if (name == "texels_per_unit") after.erase("atlas"), before["atlas"] = "24x24";
      SCOPED_TRACE(std::string(bake_kind_names[k]) + ": " + after.dump());
      const bool changes_kind = name == "factors" || name == "membrane" || (name == "outgoing" || name == "brdf");
      const BakeRequest changed = must_read(after);
      if (!(o.kinds >> k & 1)) {
        // What turns one kind into another is refused where the other cannot be.
        if (changes_kind && kind_of(changed) != BakeKind(k)) continue;
        auto refused = resolved(changed);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().where.substr(0, 2), "--");
        if (change.with.empty()) {
          EXPECT_EQ(refused.error().where, std::string("--") + o.name);
        }
        continue;
      }
      auto with = bake_with_summary(changed);
      EXPECT_TRUE(with) << with.error().text();
      if (!with) continue;
      if (!o.recorded || kind_of(changed) != BakeKind(k) || name == "factors") continue;  // which is the kind itself
      std::string& other = known[before.dump()];
      if (other.empty()) {
        auto without = bake_with_summary(must_read(before));
        EXPECT_TRUE(without) << without.error().text();
        if (!without) continue;
        other = fingerprint(std::move(*without));
      }
      EXPECT_NE(fingerprint(std::move(*with)), other);
    }
  }
}

TEST_F(Requests, BakeAgainToTheByte) {
  for (int k = 0; k < int(std::size(bake_kind_names)); ++k) {
    SCOPED_TRACE(bake_kind_names[k]);
    nlohmann::json object = least(BakeKind(k));
    if (BakeKind(k) == BakeKind::diffuse) object.update({{"lattice", "2,2,1"}, {"max_edge", 0.7}, {"ground", true}});
    if (BakeKind(k) == BakeKind::lightmap)
      object.update(
          {{"light_groups", true}, {"sky", "sky:elevation=40"}, {"lamp", {"lamp=0.5", "sky=2"}}, {"exclude", {"red"}}});
    auto first = bake_to_file(must_read(object));
    ASSERT_TRUE(first) << first.error().text();
    auto request = request_of_baked_file(at("out.glb"), "");
    ASSERT_TRUE(request) << request.error().text();
    request->output = at("again.glb");
    auto second = bake_to_file(*request);
    ASSERT_TRUE(second) << second.error().text();
    EXPECT_EQ(*read_file(at("out.glb")), *read_file(at("again.glb")));
  }
}

// As a program fills it in, without names of what it said; and as text.
TEST_F(Requests, FieldsSetByHandCountAsSaid) {
  BakeRequest request;
  request.scene = at("s.obj"), request.samples = 32, request.order = 3;
  auto baked = bake(request);
  ASSERT_TRUE(baked) << baked.error().text();
  auto read = bake_request(to_text(*resolved(request)));
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->samples, 32);
  read->scene = request.scene;
  EXPECT_EQ(bake(*read)->provenance, baked->provenance);
  request.lobes = 2;
  auto refused = bake(request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--lobes");
  EXPECT_FALSE(bake_request("{"));
}

TEST_F(Requests, AnotherSceneIsRefused) {
  ASSERT_TRUE(bake_to_file(must_read(least(BakeKind::membrane))));
  ASSERT_TRUE(write_file_atomically(at("s.obj"), std::string(scene_obj) + "# changed\n"));
  auto request = request_of_baked_file(at("out.glb"), "");
  ASSERT_FALSE(request);
  EXPECT_NE(request.error().text().find("is not the scene"), std::string::npos);
}

TEST_F(Requests, BadFieldsAreNamed) {
  auto where = [](const nlohmann::json& object) {
    auto request = bake_request_from_json(object);
    if (!request) return request.error().where;
    auto checked = bake(*request);
    return checked ? std::string() : checked.error().where;
  };
  nlohmann::json good = least(BakeKind::diffuse);
  auto with = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json object = good;
    object[key] = value;
    return object;
  };
  EXPECT_EQ(where(good), "");
  EXPECT_EQ(where(with("sample", 5)), "sample");
  EXPECT_EQ(where(with("samples", "5")), "samples");
  EXPECT_EQ(where(with("samples", 0)), "samples");
  EXPECT_EQ(where(with("samples", 1e30)), "samples");
  EXPECT_EQ(where(with("samples", 2.5)), "samples");
  EXPECT_EQ(where(with("samples", -3)), "samples");
  EXPECT_EQ(where(with("samples", nullptr)), "samples");
  EXPECT_EQ(where(with("ground", "yes")), "ground");
  EXPECT_EQ(where(with("emit", "grey=1,2,3")), "emit");
  EXPECT_EQ(where(with("precision", "double")), "precision");
  EXPECT_EQ(where(with("transfer", "magic")), "transfer");
  EXPECT_EQ(where(with("seed", 4294967296.0)), "seed");
  EXPECT_EQ(where(with("light", "sh:3")), "--order");
  EXPECT_EQ(where(with("bounces", "many")), "--bounces");
  EXPECT_EQ(where(with("bounces", "converge:0.1")), "--bounces");
  EXPECT_EQ(where(with("lattice", "2,2")), "--lattice");
  EXPECT_EQ(where(with("scene", at("missing.obj"))), at("missing.obj"));
  EXPECT_FALSE(bake_request_from_json(nlohmann::json::array()));
  ASSERT_TRUE(write_file_atomically(at("bad.json"), "{\"samples\": "));
  EXPECT_FALSE(load_bake_request(at("bad.json")));
  EXPECT_FALSE(load_bake_request(at("none.json")));
}

TEST_F(Requests, ErrorsAndTimesOutOfRangeAreNamedAndTheLeastTimeEnds) {
  nlohmann::json plain = least(BakeKind::diffuse);
  plain.erase("samples");
  auto outcome = [&](const char* key, const nlohmann::json& value) -> Result<BakeOutcome> {
    nlohmann::json object = plain;
    object[key] = value;
    auto request = bake_request_from_json(object);
    if (!request) return request.error();
    return bake_with_summary(*request);
  };
  for (const char* error : {"0", "0%", "200%", "1.5", "nan", "NaN%", "inf", "-1%", "0.001%", "%", "1 %%", "one"})
    EXPECT_EQ(outcome("error", error).error().where, "--error") << error;
  for (const double time : {-1.0, -1e-3, 1e30}) EXPECT_EQ(outcome("time", time).error().where, "time") << time;
  EXPECT_EQ(outcome("time", "nan").error().where, "time");
  auto hurried = outcome("time", 0);
  ASSERT_TRUE(hurried) << hurried.error().text();
  EXPECT_GT(hurried->summary.json["certificate"]["error"].get<double>(), 0);
}

TEST_F(Requests, FewRowsOfIncidentLightNeedNoWordAboutOthers) {
  for (int order : {1, 2}) {
    nlohmann::json object = least(BakeKind::matrix);
    object["incident_order"] = order;
    auto baked = bake(must_read(object));
    EXPECT_TRUE(baked) << baked.error().text();
  }
}

TEST_F(Requests, PlansSayReceiversAndBytesBeforeTheWork) {
  for (BakeKind kind : {BakeKind::diffuse, BakeKind::matrix, BakeKind::lightmap}) {
    const BakeRequest request = must_read(least(kind));
    auto plan = plan_bake(request);
    auto baked = bake_with_summary(request);
    ASSERT_TRUE(plan) << plan.error().text();
    ASSERT_TRUE(baked);
    EXPECT_EQ(plan->json["receivers"], baked->summary.json["receivers"]);
    EXPECT_GE(plan->json["bytes"].get<double>() + 16 * 3 * 9 * 4 * 25, baked->summary.json["bytes"].get<double>());
    EXPECT_EQ(must_read(plan->json["request"]).transfer, request.transfer);
  }
}

TEST_F(Requests, PlansOfIndirectLightAreWithinThreeTenths) {
  nlohmann::json object = least(BakeKind::indirect);
  object.update({{"scene", at("fine.obj")}, {"surfels", 2048}, {"max_edge", 0.05}});
  {  // two walls and a floor
    std::ofstream out(at("fine.obj"));
    out << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\nv 1 0 1\nv 0 1 1\n"
           "f 1 2 5 3\nf 1 3 7 4\nf 1 4 6 2\n";
  }
  for (const char* lattice : {"", "6,6,6"})
    for (const char* gatherers : {"quarter", "all"}) {
      object["gatherers"] = gatherers;
      if (*lattice) object["lattice"] = lattice;
      const BakeRequest request = must_read(object);
      const auto plan = plan_bake(request);
      const auto baked = bake_with_summary(request);
      ASSERT_TRUE(plan && baked) << plan.error().text();
      EXPECT_NEAR(plan->json["bytes"].get<double>() / baked->summary.json["bytes"].get<double>(), 1, 0.3)
          << gatherers << lattice;
    }
}

TEST_F(Requests, MeshlessAndLeastSquaresAreRefusedByNameElsewhere) {
  const auto refused = [&](BakeKind kind, const nlohmann::json& more) {
    nlohmann::json object = least(kind);
    object.update(more);
    auto request = resolved(must_read(object));
    return request ? std::string("taken") : request.error().where;
  };
  for (int k = 0; k < int(std::size(bake_kind_names)); ++k) {
    nlohmann::json object = least(BakeKind(k));
    object["receivers"] = "meshless", object.erase("atlas");
    const auto request = resolved(must_read(object));
    EXPECT_EQ(request ? "taken" : request.error().where, BakeKind(k) == BakeKind::diffuse ? "taken" : "--receivers")
        << bake_kind_names[k];
  }
  EXPECT_EQ(refused(BakeKind::diffuse, {{"surfels", 300}}), "--surfels");
  for (const auto& [option, value] : std::initializer_list<std::pair<const char*, nlohmann::json>>{
           {"adapt", "on"}, {"denoise", "on"}, {"rooms", "auto"}, {"subsurface", "marble"}, {"light", "sh:3"}}) {
    nlohmann::json more{{"projection", "least-squares"}, {option, value}};
    if (std::string(option) == "light") more["order"] = nullptr;
    nlohmann::json object = least(BakeKind::diffuse);
    object.update(more);
    if (std::string(option) == "light") object.erase("order");
    auto request = resolved(must_read(object));
    ASSERT_FALSE(request) << option;
    EXPECT_EQ(request.error().where, std::string("--") + option);
  }
  EXPECT_EQ(refused(BakeKind::diffuse, {{"projection", "least-squares"}, {"receivers", "meshless"}}), "--projection");
  EXPECT_EQ(refused(BakeKind::diffuse, {{"projection", "collocation"}, {"receivers", "meshless"}}), "taken");
  EXPECT_EQ(refused(BakeKind::lightmap, {{"projection", "least-squares"}, {"directional", "vector"}}), "--directional");
  EXPECT_EQ(refused(BakeKind::lightmap,
                    {{"projection", "least-squares"}, {"bounces", "converge:0.1"}, {"solver", "southwell"}}),
            "--projection");
  // The request that a file keeps is one that can be baked again.
  for (const char* projection : {"least-squares", "collocation"}) {
    nlohmann::json object = least(BakeKind::diffuse);
    object["projection"] = projection;
    const auto once = resolved(must_read(object));
    ASSERT_TRUE(once);
    const auto again = resolved(must_read(to_json(*once)));
    ASSERT_TRUE(again) << again.error().text();
    EXPECT_EQ(to_json(*once), to_json(*again));
  }
}

TEST_F(Requests, TwoHundredLeaveMemoryWhereItWas) {
  if (under_sanitizers()) GTEST_SKIP() << "their allocator counts otherwise";
  const BakeRequest request = must_read(least(BakeKind::diffuse));
  size_t before = 0;
  for (int i = 0; i < 220; ++i) {
    if (i == 20) before = ::mallinfo2().uordblks;
    ASSERT_TRUE(bake_to_file(request));
  }
  // A leak of a hundred bytes a request would show; what threads keep for themselves does not grow with requests.
  EXPECT_LT(double(::mallinfo2().uordblks), double(before) + 200 * 100);
}

}  // namespace
}  // namespace lambent
