// Rooms that are joined, against the same scene baked whole.
#include "sanitizers.h"

#include <lambent/bake/room_space.h>
#include <lambent/bake/rooms.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace lambent {
namespace {

// Relative RMS difference over receivers, and each one's own at most.
double difference(const Transfer& a, const Transfer& b) {
  double squares = 0, all = 0;
  for (size_t r = 0; r < a.receivers; ++r) {
    const std::vector<float> x = load_receiver(a, r), y = load_receiver(b, r);
    for (size_t k = 0; k < x.size(); ++k)
      squares += std::pow(double(x[k]) - double(y[k]), 2), all += double(y[k]) * double(y[k]);
  }
  return std::sqrt(squares / all);
}

BakeOptions plain(int samples) {
  BakeOptions o{.order = 3, .samples = samples, .bounces = 40, .precision = Precision::single};
  o.denoise = o.certify = false;
  return o;
}

TEST(Rooms, AreCutAtWallsAndTileTheScene) {
  const Scene scene = make_building(3, 0.7f);
  const std::vector<Room> rooms = find_rooms(scene, 16);
  EXPECT_GE(rooms.size(), 7u);
  const Bounds whole = room_bounds(scene);
  double volume = 0;
  for (const Room& room : rooms) {
    const Vec3 d = room.box.max - room.box.min;
    volume += double(d.x) * d.y * d.z;
  }
  const Vec3 d = whole.max - whole.min;
  EXPECT_NEAR(volume, double(d.x) * d.y * d.z, 1e-4 * volume);
  // The middles of the rooms and of the hall lie in boxes of their own.
  std::vector<size_t> at;
  const auto box_of = [&](Vec3 p) {
    for (size_t i = 0; i < rooms.size(); ++i)
      if (min(p, rooms[i].box.min) == rooms[i].box.min && max(p, rooms[i].box.max) == rooms[i].box.max) return i;
    return rooms.size();
  };
  for (int i = 0; i < 3; ++i)
    for (float z : {2.2f, 5.4f, 8.6f}) at.push_back(box_of(Vec3(2.2f + 4.2f * float(i), 1.5f, z)));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < i; ++j)
      for (size_t side : {0u, 2u}) EXPECT_NE(at[size_t(3 * i) + side], at[size_t(3 * j) + side]) << i << " " << j;
  EXPECT_NE(at[0], at[1]);
  EXPECT_NE(at[1], at[2]);
}

TEST(Rooms, ThatAreAskedForArePartedByPlanes) {
  const Bounds whole{Vec3(0), Vec3(10, 3, 10)};
  auto rooms = part_rooms(whole, {{"a", {Vec3(0.2f), Vec3(4, 3, 10)}},
                                  {"b", {Vec3(4.5f, 0, 0), Vec3(10, 3, 4)}},
                                  {"c", {Vec3(4.5f, 0, 4.2f), Vec3(10, 3, 10)}}});
  ASSERT_TRUE(rooms) << rooms.error().text();
  ASSERT_EQ(rooms->size(), 3u);
  EXPECT_EQ((*rooms)[0].box.max.x, 4.25f);
  EXPECT_EQ((*rooms)[1].box.min.x, 4.25f);
  EXPECT_EQ((*rooms)[1].box.max.z, (*rooms)[2].box.min.z);
  auto overlap = part_rooms(whole, {{"a", {Vec3(0), Vec3(6, 3, 10)}}, {"b", {Vec3(3, 0, 0), Vec3(10, 3, 10)}}});
  ASSERT_FALSE(overlap);
  EXPECT_NE(overlap.error().text().find("\"a\""), std::string::npos);
}

// Of each cell those that are least, in whatever parts and order they come; and a number for each cell that was met.
TEST(Rooms, CellsKeepTheRaysThatAreLeast) {
  Random random(3);
  std::vector<Crossing> all;
  for (int i = 0; i < 20000; ++i)
    all.push_back({0, uint32_t(std::pow(random.next(), 3) * 2000), random.next64() % 5000});
  std::map<uint32_t, std::multiset<CellRay>> expected;
  for (const Crossing& c : all) expected[c.cell].insert(c.ray);
  for (const size_t part : {size_t{1700}, all.size()}) {
    CellRays rays;
    for (size_t begin = 0; begin < all.size(); begin += part) {
      std::vector<Crossing> some(all.begin() + ptrdiff_t(begin),
                                 all.begin() + ptrdiff_t(std::min(all.size(), begin + part)));
      keep_least(some);
      rays.merge(some, 0);
    }
    const CellSet met(2000, rays.cells);
    ASSERT_EQ(rays.cells.size(), expected.size());
    size_t number = 0, most = 0;
    for (const auto& [cell, own] : expected) {
      ASSERT_EQ(rays.cells[number], cell);
      ASSERT_TRUE(met.has(cell));
      ASSERT_EQ(met.number(cell), number);
      std::vector<CellRay> least(own.begin(), own.end());
      least.resize(std::min(least.size(), size_t(most_node_rays)));
      most = std::max(most, own.size());
      const auto kept = rays.of(number++);
      ASSERT_EQ(std::vector<CellRay>(kept.begin(), kept.end()), least);
    }
    for (uint32_t cell = 0; cell < 2000; ++cell) ASSERT_EQ(met.has(cell), expected.contains(cell));
    EXPECT_GT(most, size_t(most_node_rays));
  }
}

// A ray is kept in 48 bits: it stays in its cell, and where it was but for a few thousandths of the cell.
TEST(Rooms, RaysOfNodesAreWhatWasMet) {
  const Scene scene = make_building(1, 0.5f);
  const Bounds all = room_bounds(scene);
  Bounds left = all, right = all;
  left.max.x = right.min.x = 0.4f * all.min.x + 0.6f * all.max.x;
  const RoomSpace space(scene, {{"left", left}, {"right", right}}, 8, 6);
  Random random(5);
  size_t crossed = 0;
  for (int i = 0; i < 2000; ++i) {
    const size_t room = i % 2;
    const Bounds& box = space.rooms[room].box;
    const Vec3 p(random.next(), random.next(), random.next()), origin = box.min + p * (box.max - box.min);
    const Vec3 d = normalize(Vec3(random.next(), random.next(), random.next()) - Vec3(0.5f));
    const Exit exit = space.exit(room, origin, d, {});
    if (exit.opening == none) continue;
    ++crossed;
    const Crossing crossing = space.crossing(exit, random.next64());
    const NodeRay ray = space.ray(space.openings[exit.opening], crossing.cell, crossing.ray);
    const Exit again = space.exit(room, ray.origin - 0.001f * ray.direction, ray.direction, {});
    EXPECT_EQ(again.opening, exit.opening);
    EXPECT_LT(length(ray.origin - exit.at), 2e-3f * length(box.max - box.min) / 8);
    EXPECT_LT(length(ray.direction - d), 5e-3f);
    EXPECT_NEAR(length(ray.direction), 1.0f, 1e-5f);
  }
  EXPECT_GT(crossed, 300u);
}

TEST(Rooms, OneRoomIsTheSceneItself) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_building(1, 0.5f);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const BakeOptions options = plain(256);
  auto whole = bake(scene, *tracer, receivers, options);
  RoomsReport report;
  auto one = bake_rooms(scene, receivers, {{"all", room_bounds(scene)}}, options, {.residual = 1e-4}, nullptr, &report);
  ASSERT_TRUE(whole && one);
  EXPECT_EQ(report.nodes, 0u);
  EXPECT_TRUE(report.converged);
  EXPECT_LT(difference(*one, *whole), 0.01);  // the same rays, but for a control variate of the sky's
}

TEST(Rooms, JoinToTheSceneBakedWhole) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_building(6, 0.8f);  // twelve rooms and a hall
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options = plain(256), other = options;
  other.seed = 7;
  auto whole = bake(scene, *tracer, receivers, options), again = bake(scene, *tracer, receivers, other);
  RoomsReport report;
  auto joined = bake_rooms(scene, receivers, find_rooms(scene, 32), options, {.residual = 1e-3}, nullptr, &report);
  ASSERT_TRUE(whole && again && joined);
  EXPECT_GE(report.rooms, 13u);
  EXPECT_LT(report.largest, receivers.count() / 4);
  EXPECT_TRUE(report.converged);
  EXPECT_LT(report.lost, 0.01);
  for (size_t k = 1; k < report.residuals.size(); ++k) EXPECT_LT(report.residuals[k], report.residuals[k - 1]);
  const double noise = difference(*again, *whole), found = difference(*joined, *whole);
  RecordProperty("noise", std::to_string(noise)), RecordProperty("difference", std::to_string(found));
  EXPECT_LT(found, 0.025) << "noise of the rays alone: " << noise;  // what --quality good asks for
}

// A field in the open, with things above it.
Scene open_place() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f)),
                 red = add_material(scene, "red", Vec3(0.7f, 0.3f, 0.2f));
  add_quad(scene, grey, "ground", Vec3(-3, 0, -3), Vec3(0, 0, 6), Vec3(6, 0, 0), 20, 20);
  add_sphere(scene, red, "ball", Vec3(-0.4f, 0.7f, 0.3f), 0.6f, 2);
  add_sphere(scene, red, "ball", Vec3(1.2f, 0.6f, -0.7f), 0.5f, 2);
  add_box(scene, grey, "box", Vec3(-0.9f, 0.2f, -1.6f), Vec3(0.6f, 1.5f, -0.9f), 5);
  return scene;
}

// Where nothing closes what is cut, light fields blur what is seen through it: measured as such, they give way to rays
// that are handed on, by which the rooms are the whole but for rounding.
TEST(Rooms, InTheOpenRaysAreHandedOn) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = open_place();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const BakeOptions options = plain(64);
  auto whole = bake(scene, *tracer, receivers, options);
  ASSERT_TRUE(whole);
  const Bounds all = room_bounds(scene);
  std::vector<Room> rooms;
  for (int i = 0; i < 4; ++i) {
    Bounds box = all;
    (i % 2 ? box.min.x : box.max.x) = -0.25f, (i / 2 ? box.min.z : box.max.z) = 0.1f;
    rooms.push_back({std::to_string(i), box});
  }
  BakeOptions exactly = plain(4096);
  exactly.seed = 5;
  auto truth = bake(scene, *tracer, receivers, exactly);
  ASSERT_TRUE(truth);
  const double noise = difference(*whole, *truth);
  RoomsReport blurred, measured, exact;
  const auto joined = [&](double loss, RoomsReport& told, const Transfer& other) {
    auto t = bake_rooms(scene, receivers, rooms, options,
                        {.residual = 1e-4, .places = 8, .directions = 6, .loss = loss}, nullptr, &told);
    EXPECT_TRUE(t) << t.error().text();
    EXPECT_TRUE(told.converged);
    return t ? difference(*t, other) : 1.0;
  };
  const double by_fields = joined(INFINITY, blurred, *truth), by_both = joined(0.01, measured, *truth);
  RecordProperty("noise", std::to_string(noise)), RecordProperty("by_fields", std::to_string(by_fields));
  RecordProperty("by_both", std::to_string(by_both)), RecordProperty("loss", std::to_string(measured.loss_of_all));
  EXPECT_LT(joined(0, exact, *whole), 2e-3);
  EXPECT_EQ(blurred.handed, 0u);
  EXPECT_EQ(exact.handed, exact.openings);
  EXPECT_EQ(exact.nodes, 0u);
  EXPECT_GT(measured.handed, 0u);
  EXPECT_LE(measured.loss, 0.01);
  EXPECT_GT(measured.loss_of_all, 0.01);
  RoomsReport cheapest;  // few rays leave their room, and nodes are many
  auto t = bake_rooms(scene, receivers, rooms, options,
                      {.residual = 1e-4, .places = 8, .directions = 6, .cheapest = true}, nullptr, &cheapest);
  ASSERT_TRUE(t);
  EXPECT_EQ(cheapest.handed, cheapest.openings);
  EXPECT_LT(cheapest.loss_of_all, 0);  // the search for nodes was given up
  EXPECT_LT(by_both, std::hypot(noise, 0.015));
  EXPECT_GT(by_fields, std::hypot(noise, 0.02));
}

TEST(Rooms, TheSameBytesWhateverTheThreadsAndTheMemory) {
  const Scene scene = make_building(2, 0.9f);
  const Receivers receivers = make_vertex_receivers(scene);
  const std::vector<Room> rooms = find_rooms(scene, 8);
  const auto bytes_with = [&](int threads, size_t memory, const char* scratch, double* kept, size_t* filed) {
    ThreadLimit limit(threads);
    BakeOptions options = plain(64);
    options.memory = memory;
    BakeReport report;
    auto t = bake_rooms(scene, receivers, rooms, options,
                        {.residual = 0.01, .places = 8, .directions = 6, .scratch = scratch}, &report);
    EXPECT_TRUE(t) << t.error().text();
    *kept = report.operator_kept, *filed = report.operator_file_bytes;
    return t ? std::vector<uint8_t>(t->data.begin(), t->data.end()) : std::vector<uint8_t>();
  };
  double kept = 0;
  size_t filed = 0;
  const auto expected = bytes_with(1, size_t{4} << 30, "", &kept, &filed);
  EXPECT_EQ(kept, 1.0);
  EXPECT_EQ(filed, 0u);
  EXPECT_EQ(bytes_with(2, size_t{4} << 30, "", &kept, &filed), expected);
  BakeOptions least = plain(64);
  least.memory = 0;
  auto refused = bake_rooms(scene, receivers, rooms, least, {.places = 8, .directions = 6});
  ASSERT_FALSE(refused);
  const std::string text = refused.error().text();
  const size_t needed = std::stoull(text.substr(text.find("least ") + 6));
  EXPECT_EQ(bytes_with(2, needed, "/tmp", &kept, &filed), expected);
  EXPECT_EQ(kept, 1.0);
  EXPECT_GT(filed, 0u);
  EXPECT_EQ(bytes_with(2, needed, "", &kept, &filed), expected);
  EXPECT_LT(kept, 0.1);
}

}  // namespace
}  // namespace lambent
