// Ranks that are threads here: whatever is baked has the bytes of one process, on each of them.
#include "temporary_folder.h"
#include "thread_ranks.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/rooms.h>
#include <lambent/bake/thin.h>
#include <lambent/bake/visibility.h>
#include <lambent/compress/cpca.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/file.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <mutex>
#include <numeric>
#include <set>

#include "sanitizers.h"

namespace lambent {
namespace {

using Bytes = std::vector<uint8_t>;

// With receivers inside a block, and enough of them for stripes of several blocks.
Scene room(int n = 14) {
  Scene scene;
  const uint32_t m = add_material(scene, "wall", Vec3(0.7f, 0.5f, 0.4f)), lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(4);
  add_box(scene, m, "room", Vec3(-1), Vec3(1, 1, 1.5f), n, true);
  add_box(scene, m, "block", Vec3(-0.6f, -1.2f, -0.6f), Vec3(0.5f, 0.2f, 0.4f), n / 2);
  add_quad(scene, lamp, "lamp", Vec3(-0.2f, 0.99f, -0.2f), Vec3(0.4f, 0, 0), Vec3(0, 0, 0.4f), 2, 2);
  return scene;
}

struct Place {
  Scene scene = room();
  Tracer tracer = *Tracer::build(scene);
  Receivers receivers = make_vertex_receivers(scene);
};

void append(Bytes& out, std::span<const uint8_t> more) { out.insert(out.end(), more.begin(), more.end()); }
Bytes bytes(const Transfer& t) { return {t.data.data(), t.data.data() + t.bytes()}; }

// The same from every rank of 1, 2, 3 and 5, and from none.
void expect_alike(const char* what, const std::function<Bytes(Progress*)>& work) {
  const Bytes alone = work(nullptr);
  ASSERT_FALSE(alone.empty()) << what;
  for (const int count : under_sanitizers() ? std::vector{1, 3} : std::vector{1, 2, 3, 5}) {
    const auto each = by_ranks(count, work);
    for (int k = 0; k < count; ++k) EXPECT_TRUE(*each[size_t(k)] == alone) << what << ", rank " << k << " of " << count;
  }
}

TEST(Ranks, ShareEveryItemOnce) {
  for (const int count : {1, 2, 3, 7})
    for (const size_t items : {0, 1, 63, 64, 65, 1000, 30000}) {
      const auto own = by_ranks(count, [&](Progress*) {
        const Shares shares(items, 64);
        std::mutex mutex;
        std::set<size_t> mine;
        shares.for_own([&](size_t begin, size_t end) {
          std::lock_guard lock(mutex);
          EXPECT_EQ(begin % 64, 0u);
          for (size_t i = begin; i < end; ++i) {
            EXPECT_TRUE(mine.insert(i).second);
            EXPECT_EQ(shares.owner(i), shares.ranks().rank());
          }
        });
        EXPECT_EQ(mine.size(), shares.own());
        return mine;
      });
      size_t all = 0, most = 0;
      for (const auto& o : own) all += o->size(), most = std::max(most, o->size());
      EXPECT_EQ(all, items);
      if (items == 30000) {
        EXPECT_LE(most * size_t(count), items + items / 8);
      }
    }
}

TEST(Ranks, GatherWhatEachHasMade) {
  for (const int count : {1, 2, 5}) {
    const auto rows = by_ranks(count, [&](Progress*) {
      const Shares shares(1000, 16);
      std::vector<int> values(3000, -1), pieces(63, -1);
      shares.for_own([&](size_t begin, size_t end) {
        for (size_t i = 3 * begin; i < 3 * end; ++i) values[i] = int(i);
        pieces[begin / 16] = int(begin);
      });
      shares.gather(values.data(), 3), shares.gather_pieces(pieces.data());
      values.insert(values.end(), pieces.begin(), pieces.end());
      EXPECT_EQ(this_ranks().sum(uint64_t(this_ranks().rank()) + 1), uint64_t(count * (count + 1) / 2));
      EXPECT_EQ(this_ranks().from_first(this_ranks().rank() + 7), 7);
      return values;
    });
    std::vector<int> expected(3063);
    std::iota(expected.begin(), expected.begin() + 3000, 0);
    for (int p = 0; p < 63; ++p) expected[size_t(3000 + p)] = 16 * p;
    for (const auto& r : rows) EXPECT_EQ(*r, expected);
  }
}

TEST(Ranks, RoomsAreAlike) {
  const Place p;
  auto rooms = part_rooms(room_bounds(p.scene), {{"left", {Vec3(-1), Vec3(-0.4f, 1, 1.5f)}},
                                                 {"near", {Vec3(-0.4f, -1, -1), Vec3(0.2f, 1, 0)}},
                                                 {"far", {Vec3(-0.4f, -1, 0), Vec3(0.2f, 1, 1.5f)}},
                                                 {"right", {Vec3(0.2f, -1, -1), Vec3(1, 1, 1.5f)}}});
  ASSERT_TRUE(rooms);
  BakeOptions options{.order = 2, .samples = under_sanitizers() ? 16 : 64};
  RoomsOptions how{.residual = 1e-3, .places = 6, .directions = 4};
  const auto work = [&](Progress* progress) {
    auto t = bake_rooms(p.scene, p.receivers, *rooms, options, how, nullptr, nullptr, progress);
    EXPECT_TRUE(t) << t.error().text();
    return t ? bytes(*t) : Bytes();
  };
  // By light fields and rays that are handed on, and by such rays alone.
  for (const double loss : {0.02, 0.0}) {
    how.loss = loss, options.memory = size_t{4} << 30;
    const Bytes kept = work(nullptr);
    options.memory = 0;
    const auto refused = bake_rooms(p.scene, p.receivers, *rooms, options, how);
    ASSERT_FALSE(refused);
    const std::string text = refused.error().text();
    options.memory = std::stoull(text.substr(text.find("least ") + 6)) + 20000;  // most of the rows are traced again
    EXPECT_TRUE(work(nullptr) == kept) << loss;
    if (loss == 0) options.memory = size_t{4} << 30;
    expect_alike("rooms", work);
  }
}

// Those but the first find no file by the name that they are told, as on machines that share no folder.
class BlindRanks final : public Ranks {
 public:
  explicit BlindRanks(Ranks& inner) : inner_(inner) {}
  int rank() const override { return inner_.rank(); }
  int count() const override { return inner_.count(); }
  bool all(bool mine) override { return inner_.all(mine); }
  void broadcast(std::span<uint8_t> bytes) override {
    inner_.broadcast(bytes);
    if (rank() > 0 && bytes.size() > sizeof(uint64_t)) bytes[bytes.size() / 2] ^= 1;
  }
  void exchange(std::span<const std::span<const uint8_t>> give, std::span<const std::span<uint8_t>> take) override {
    inner_.exchange(give, take);
  }

 private:
  Ranks& inner_;
};

// No rank has all of the result, and the file is whole, whether all write it or the first one does for them.
void expect_parts_of(const std::function<Result<Transfer>(Progress*)>& baked) {
  const test::TemporaryFolder folder;
  auto whole = baked(nullptr);
  ASSERT_TRUE(whole);
  const Bytes head{1, 2, 3, 4, 5}, expected = bytes(*whole);
  for (const bool blind : {false, true})
    for (const int count : {2, 3, 5}) {
      const std::string path = folder.file("x" + std::to_string(count));
      const auto set = by_ranks(count, [&](Progress* progress) {
        auto t = baked(progress);
        EXPECT_TRUE(t);
        BlindRanks none_sees(this_ranks());
        const WriteTogether together(blind ? none_sees : this_ranks());
        // As files of a set have them, in two pieces.
        const std::span<const uint8_t> pieces[] = {head, t->data.first(1000), t->data.subspan(1000), head};
        EXPECT_TRUE(write_file_atomically(path, pieces));
        return std::count_if(t->data.begin(), t->data.end(), [](uint8_t b) { return b != 0; });
      });
      auto written = read_file(path);
      ASSERT_TRUE(written);
      Bytes all = head;
      all.insert(all.end(), expected.begin(), expected.end()), all.insert(all.end(), head.begin(), head.end());
      EXPECT_TRUE(Bytes(written->begin(), written->end()) == all) << count << " ranks, " << blind;
      const auto of_all = std::count_if(expected.begin(), expected.end(), [](uint8_t b) { return b != 0; });
      ptrdiff_t sum = 0;
      for (const auto& mine : set) {
        EXPECT_LT(*mine, 2 * of_all / count);
        sum += *mine;
      }
      EXPECT_EQ(sum, of_all);
    }
}

TEST(Ranks, EachHasAPartOfTheResultUpToTheFile) {
  const Place p;
  auto rooms = part_rooms(room_bounds(p.scene), {{"left", {Vec3(-1), Vec3(-0.4f, 1, 1.5f)}},
                                                 {"near", {Vec3(-0.4f, -1, -1), Vec3(1, 1, 0)}},
                                                 {"far", {Vec3(-0.4f, -1, 0), Vec3(1, 1, 1.5f)}}});
  ASSERT_TRUE(rooms);
  BakeOptions options{.order = 2, .samples = 16};
  const RoomsOptions how{.residual = 1e-2, .loss = 0, .own_part = true};
  expect_parts_of([&](Progress* progress) {
    return bake_rooms(p.scene, p.receivers, *rooms, options, how, nullptr, nullptr, progress);
  });
  options.own_part = true, options.bounces = 2;
  expect_parts_of([&](Progress* progress) { return bake(p.scene, p.tracer, p.receivers, options, nullptr, progress); });
}

TEST(Ranks, OneThatIsCancelledCancelsAll) {
  const auto ends = by_ranks(3, [&](Progress* progress) {
    if (this_ranks().rank() == 2) progress->cancel();
    const bool well = none_cancelled(progress);
    return well || !progress->cancelled();
  });
  for (const auto& e : ends) EXPECT_FALSE(*e);
}

TEST(Ranks, DiffuseBakesAreAlike) {
  const Place p;
  BakeOptions few{.order = 3, .samples = 128, .bounces = 2};
  BakeOptions again = few, terms = few, direct = few, error{.order = 3, .bounces = 2, .error = 0.05};
  again.memory = least_memory(p.receivers.count(), true, few) + 4000;
  terms.keep_terms = true, direct.bounces = 0;
  direct.lobes = {{normalize(Vec3(1, 2, 3)), 40.0f}};
  for (const auto& [name, options_here] :
       {std::pair("kept", few), std::pair("traced again", again), std::pair("terms", terms),
        std::pair("direct", direct), std::pair("error", error)})
    expect_alike(name, [&, &options = options_here](Progress* progress) {
      BakeReport report;
      auto t = bake(p.scene, p.tracer, p.receivers, options, &report, progress);
      EXPECT_TRUE(t) << t.error().text();
      if (!t) return Bytes{};
      Bytes out = bytes(*t);
      for (const Transfer& term : report.terms) append(out, bytes(term));
      for (const double value : {report.certificate.error, report.noise, report.denoised, double(report.samples)})
        append(out, {reinterpret_cast<const uint8_t*>(&value), sizeof value});
      EXPECT_GT(report.buried, 0u);
      return out;
    });
}

TEST(Ranks, OtherBakesAreAlike) {
  const Place p;
  const BakeOptions few{.order = 3, .samples = 64, .bounces = 2};
  for (const bool paths : {false, true})
    expect_alike(paths ? "paths" : "matrix", [&](Progress* progress) {
      Receivers receivers = p.receivers;
      MatrixOptions matrix{.incident_order = 3};
      matrix.simulate_paths = paths;
      BakeReport report;
      auto t = bake_matrix(p.scene, p.tracer, receivers, make_receiver_materials(p.scene, receivers, {}), few, matrix,
                           &report, progress);
      EXPECT_TRUE(t);
      Bytes out = t ? bytes(t->transfer) : Bytes{};
      append(out, {reinterpret_cast<const uint8_t*>(&report.error), sizeof report.error});
      return out;
    });
  const Transfer surface = *bake(p.scene, p.tracer, p.receivers, few);
  expect_alike("lattice", [&](Progress* progress) {
    auto l =
        bake_lattice(p.scene, p.tracer, p.receivers, surface, nullptr,
                     {default_lattice_box(p.scene, 5, 6, 7).min, default_lattice_box(p.scene, 5, 6, 7).max, 5, 6, 7},
                     {.order = 2, .samples = 64}, nullptr, progress);
    EXPECT_TRUE(l);
    return l ? bytes(l->transfer) : Bytes{};
  });
  expect_alike("blocks", [&](Progress* progress) {
    auto v = bake_visibility(p.tracer, p.receivers, {.size = 16}, nullptr, progress);
    EXPECT_TRUE(v);
    return v ? Bytes(v->data.data(), v->data.data() + v->data.size()) : Bytes{};
  });
  expect_alike("zonal", [&](Progress* progress) {
    auto z = fit_zonal(surface, {.lobes = 2}, nullptr, progress);
    EXPECT_TRUE(z);
    return z ? Bytes(z->data.data(), z->data.data() + z->data.size()) : Bytes{};
  });
  expect_alike("clusters", [&](Progress* progress) {
    auto c = compress_cpca(surface, {.clusters = 12, .rank = 3}, nullptr, progress);
    EXPECT_TRUE(c);
    Bytes out;
    if (!c) return out;
    append(out, {reinterpret_cast<const uint8_t*>(c->weights.data()), c->weights.size() * sizeof(c->weights[0])});
    append(out, {reinterpret_cast<const uint8_t*>(c->vectors.data()), c->vectors.size() * sizeof(c->vectors[0])});
    return out;
  });
}

TEST(Ranks, LightmapsAndSolversAreAlike) {
  const Place p;
  const Lamps lamps = make_lamps(p.scene, nullptr, false);
  struct Case {
    const char* name;
    Solver solver;
    double converge;
    DirectionalKind directional;
  };
  for (const Case& c : {Case{"bounces", Solver::jacobi, 0, DirectionalKind::none},
                        Case{"jacobi", Solver::jacobi, 1e-3, DirectionalKind::none},
                        Case{"gauss-seidel", Solver::gauss_seidel, 1e-3, DirectionalKind::none},
                        Case{"gmres", Solver::gmres, 1e-4, DirectionalKind::none},
                        Case{"directional", Solver::gmres, 1e-2, DirectionalKind::sh2}})
    expect_alike(c.name, [&](Progress* progress) {
      LightmapOptions options;
      options.samples = 64, options.lamp_samples = 4, options.bounces = 2, options.solver = c.solver,
      options.converge = c.converge, options.directional = c.directional;
      LightmapReport report;
      auto map = bake_lightmap(p.scene, p.tracer, p.receivers, lamps, options, true, &report, progress);
      EXPECT_TRUE(map) << map.error().text();
      if (!map) return Bytes{};
      Bytes out = bytes(map->all);
      append(out, bytes(*map->direct));
      for (const SolveStep& s : report.solve.steps)
        append(out, {reinterpret_cast<const uint8_t*>(&s.residual), sizeof s.residual});
      return out;
    });
}

TEST(Ranks, LightmapsToAnErrorAreAlike) {
  const Place p;
  const Environment sky = make_environment("sky", 8, 4, [](Vec3) { return Vec3(0.5f); });
  const Lamps lamps = make_lamps(p.scene, &sky, true);
  LightmapOptions options{.lamp_samples = 4, .bounces = 2, .keep_terms = true};
  options.error = 0.3;
  expect_alike("to an error", [&](Progress* progress) {
    LightmapReport report;
    auto map = bake_lightmap(p.scene, p.tracer, p.receivers, lamps, options, true, &report, progress);
    EXPECT_TRUE(map) << map.error().text();
    if (!map) return Bytes{};
    Bytes out = bytes(map->all);
    append(out, bytes(*map->direct));
    for (const Transfer& term : map->terms) append(out, bytes(term));
    append(out, {reinterpret_cast<const uint8_t*>(&report.certificate.error), sizeof(double)});
    return out;
  });
}

TEST(Ranks, ChosenReceiversAreAlike) {
  const Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 60, 60, Vec3(0.5f));
  const Receivers receivers = make_vertex_receivers(scene);
  auto truth = [&](uint32_t r) { return receivers.origins[r].x < 0.3f ? 0.2f : 1.0f; };
  const PilotRows pilot = [&](std::span<const uint32_t> which, uint32_t, float* rows, uint8_t* inside) {
    for (size_t i = 0; i < which.size(); ++i) rows[i] = truth(which[i]), inside[i] = 0;
    return Result<void>();
  };
  expect_alike("chosen", [&](Progress*) {
    auto thinned = thin(scene, receivers, 1, pilot, {.error = 0.05, .fewest = 300});
    EXPECT_TRUE(thinned);
    EXPECT_FALSE(thinned->all());
    std::vector<float> rows;
    for (uint32_t c : thinned->chosen) rows.push_back(truth(c));
    const Spread spread(receivers, *thinned, {}, rows.data(), 1);
    std::vector<float> all(receivers.count());
    for (size_t r = 0; r < all.size(); ++r) spread.row(r, rows.data(), 1, &all[r]);
    return Bytes(reinterpret_cast<const uint8_t*>(all.data()),
                 reinterpret_cast<const uint8_t*>(all.data() + all.size()));
  });
}

}  // namespace
}  // namespace lambent
