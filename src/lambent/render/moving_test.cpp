// Objects over a baked scene against the path tracer, which knows the joint scene.
#include <lambent/bake/bake.h>
#include <lambent/bake/shells.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/light/project.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/reflecting.h>
#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

std::vector<Vec3> uneven_light(int order) {
  Random random(11);
  std::vector<Vec3> light(size_t(sh_count(order)));
  for (size_t k = 0; k < light.size(); ++k)
    light[k] = (Vec3(random.next(), random.next(), random.next()) - 0.5f) * 2.0f / float(1 + sh_band(int(k)));
  light[0] = Vec3(3, 2.5f, 2);
  return light;
}

Scene yard() {
  Scene scene;
  add_quad(scene, add_material(scene, "floor", Vec3(0.7f)), "floor", Vec3(-3, 0, -3), Vec3(0, 0, 6), Vec3(6, 0, 0), 40,
           40);
  add_quad(scene, add_material(scene, "wall", Vec3(0.6f)), "wall", Vec3(-3, 0, -3), Vec3(6, 0, 0), Vec3(0, 2, 0), 40,
           14);
  return scene;
}

// An object with its field.
struct Thing {
  Scene scene;
  Receivers receivers;
  Transfer transfer;
  Field field;
  HiddenLight light;
  Thing(Scene s, int order, int own_order, int samples = 64) : scene(std::move(s)) {
    const ShellOptions options{.order = order, .samples = samples};
    auto tracer = Tracer::build(scene);
    receivers = make_vertex_receivers(scene);
    transfer = *bake(scene, *tracer, receivers, {.order = own_order, .samples = 512, .bounces = 0});
    field = *bake_hidden(*tracer, *make_shells(scene, options), options);
    light = hidden_light(field, order);
  }
};

Scene moved(const Scene& scene, const Shells& shells, const RigidPlace& place) {
  Scene out = scene;
  for (Vec3& p : out.positions) p = place.position + place.scale * (place.rotation * (p - shells.center));
  for (Vec3& n : out.normals) n = place.rotation * n;
  return out;
}

// dB of our light against the truth, its greatest as the peak.
double decibels(const std::vector<Vec3>& ours, const std::vector<Vec3>& truth) {
  double squares = 0, peak = 0;
  for (size_t i = 0; i < ours.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      squares += std::pow(double(ours[i][c] - truth[i][c]), 2);
      peak = std::max(peak, double(truth[i][c]));
    }
  return 10 * std::log10(peak * peak / (squares / double(3 * ours.size())));
}

TEST(Moving, TwoObjectsShadowASceneAsThePathTracerSays) {
  SKIP_UNDER_SANITIZERS();
  constexpr int light_order = 4, order = 8;
  const Scene scene = yard();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = order, .samples = 1024, .bounces = 0});
  ASSERT_TRUE(transfer);
  Scene box;
  add_box(box, add_material(box, "box", Vec3(0.5f)), "box", Vec3(-0.4f, -0.3f, -0.5f), Vec3(0.4f, 0.3f, 0.5f), 4);
  const Thing ball(make_sphere(0.5f, 3, Vec3(0.5f)), order, light_order, 256), block(box, order, light_order, 256);
  const PlacedObject placed[] = {
      place_object(ball.light, {Vec3(-0.7f, 0.8f, 0.3f), Mat3(1.0f), 1}),
      place_object(block.light, {Vec3(0.8f, 0.7f, -0.6f), rotation_from_yaw_pitch_roll({30, 20, 0}), 1})};
  const std::vector<const PlacedObject*> objects{&placed[0], &placed[1]};
  const std::vector<Vec3> light = uneven_light(light_order);
  std::vector<Vec3> padded(light);
  padded.resize(size_t(sh_count(order)), Vec3(0.0f));
  const MovingReceivers moving = moving_receivers(*transfer, receivers.origins, receivers.normals);
  Relit relit, alone;
  relight(*transfer, padded, relit);
  alone = relit;
  MovingShader shader;
  const MovingLight lights[] = {{light, false, &relit}};
  const MovingCount done = shader.shade(moving, objects, {.light_order = light_order}, lights);
  EXPECT_GT(done.pairs, 0u);
  Scene joint = scene;
  append_scene(joint, moved(ball.scene, ball.light.shells, placed[0].place));
  append_scene(joint, moved(block.scene, block.light.shells, placed[1].place));
  std::vector<Vec3> at, normals, ours, without;
  for (size_t r = 0; r < receivers.count(); r += 7) {
    at.push_back(receivers.origins[r]), normals.push_back(receivers.normals[r]);
    ours.push_back(relit.at(r)), without.push_back(alone.at(r));
  }
  const Environment env = reconstruct_environment(light, 128);
  std::vector<Vec3> truth;
  for (const ExitRadiance& e : exit_radiances(joint, env, at, normals, 0, 1024, 7)) truth.push_back(e.mean);
  const double with = decibels(ours, truth), before = decibels(without, truth);
  RecordProperty("decibels", std::to_string(with));
  RecordProperty("decibels_without_shadows", std::to_string(before));
  EXPECT_GT(with, 35);
  EXPECT_GT(with, before + 8);
}

// Tables of what objects hide of the light (hidden_table.h), where they are made, against products one by one.
TEST(Moving, TablesAreAsProducts) {
  constexpr int order = 4, side = 160;
  const Thing ball(make_sphere(0.5f, 2, Vec3(0.5f)), 3, 3);
  Random random(5);
  std::vector<Vec3> places, normals;
  for (int i = 0; i < side * side - 7; ++i) {
    places.emplace_back(float(i % side) / side * 4 - 2, -0.6f + 0.2f * random.next(), float(i / side) / side * 4 - 2);
    normals.push_back(normalize(Vec3(random.next() - 0.5f, 1, random.next() - 0.5f)));
  }
  const std::vector<Vec3> light = uneven_light(order), peaks(light.rbegin(), light.rend());
  for (int channels : {1, 3})
    for (int light_order : {order, 2})
      for (bool bounced : {false, true}) {
        const WritableTransfer t = make_transfer({.order = order}, 1, channels, places.size(), Precision::half);
        std::vector<float> row(size_t(channels * sh_count(order)));
        for (size_t r = 0; r < places.size(); ++r) {
          for (float& v : row) v = random.next() - 0.5f;
          store_receiver(t, r, row);
        }
        MovingReceivers receivers = moving_receivers(t.transfer, places, normals);
        for (int count : {1, 3}) {
          std::vector<PlacedObject> placed;
          for (int i = 0; i < count; ++i)
            placed.push_back(place_object(
                ball.light, {Vec3(0.4f * float(i) - 0.3f, 0.1f * float(i), 0.2f),
                             rotation_from_yaw_pitch_roll({20.0f * float(i), 10, 5}), 0.6f + 0.2f * float(i)}));
          std::vector<const PlacedObject*> objects;
          for (const PlacedObject& p : placed) objects.push_back(&p);
          Relit all[2], of_peaks[2];
          size_t pairs[2];
          bool made = false;
          for (int tables : {0, 1}) {
            MovingReceivers used = receivers;
            if (tables) arrange_rows(used);
            const MovingLight lights[] = {{light, false, &all[tables]}, {peaks, false, &of_peaks[tables]}};
            for (const MovingLight& l : lights) {
              light_receivers(used, light_order, l);
              if (bounced)
                for (float& v : l.values->values) v += 0.3f;
            }
            MovingShader shader;
            const MovingCount done =
                shader.shade(used, objects, {.light_order = light_order, .bounced = bounced}, lights);
            pairs[tables] = done.pairs;
            made = done.tables > 0;
            if (!tables) EXPECT_FALSE(made);
            else if (light_order == order) EXPECT_TRUE(made);  // of fewer bands products may take less
          }
          EXPECT_EQ(pairs[0], pairs[1]);
          for (const auto& [plain, quick] : {std::pair(&all[0], &all[1]), std::pair(&of_peaks[0], &of_peaks[1])}) {
            float most = 0, off = 0;
            for (size_t r = 0; r < places.size(); ++r)
              for (int c = 0; c < 3; ++c) {
                most = std::max(most, std::abs(plain->at(r)[c]));
                off = std::max(off, std::abs(plain->at(r)[c] - quick->at(r)[c]));
              }
            // 16 bits a value and weight, and rows are halves as the file's.
            EXPECT_LT(off, 2e-4f * most) << channels << " " << light_order << " " << bounced << " " << count;
            EXPECT_EQ(off > 0, made);
          }
        }
      }
}

// How a Thing reflects.
ReflectingLight reflects(const Thing& thing, int order, int samples) {
  const ShellOptions options{.order = order, .samples = samples};
  auto tracer = Tracer::build(thing.scene);
  return reflecting_light(*bake_reflecting(thing.scene, *tracer, std::get<CornerReceivers>(thing.receivers.basis),
                                           thing.transfer, thing.light.shells, options));
}

TEST(Reflecting, AWhiteBallInEvenLightReflectsAllThatItHides) {
  const Thing ball(make_sphere(1, 3, Vec3(1)), 4, 4, 256);
  const ReflectingLight light = reflects(ball, 4, 256);
  const std::vector<Vec3> even{
      Vec3(3.5449077f, 0, 7.0898154f), Vec3(0), Vec3(0), Vec3(0), Vec3(0), Vec3(0), Vec3(0), Vec3(0), Vec3(0)};
  const RigidPlace place{Vec3(1, 2, 3), rotation_from_yaw_pitch_roll({30, 40, 50}), 0.5f};
  const ShiningLight reflected = reflected_light(light, even, place.rotation);
  const PlacedLamp lamp = place_lamp(reflected, place);
  const PlacedObject object = place_object(ball.light, place);
  std::vector<Vec3> ours(16);
  std::vector<float> hidden(16);
  for (float distance : {0.51f, 0.6f, 1.0f, 3.0f, 20.0f})
    for (Vec3 way : {Vec3(0, 1, 0), Vec3(0.6f, 0, 0.8f), Vec3(-0.48f, -0.6f, 0.64f)}) {
      arriving_from(lamp, place.position + distance * way, ours);
      hidden_from(object, place.position + distance * way, hidden);
      for (size_t k = 0; k < 16; ++k) {
        EXPECT_NEAR(ours[k].x, hidden[k], 0.02f * hidden[0] + 1e-4f) << distance << " " << k;
        EXPECT_NEAR(ours[k].y, 0, 1e-5f);
        EXPECT_NEAR(ours[k].z, 2 * ours[k].x, 1e-4f);
      }
    }
}

// Of a light, what arrives at a place past a scene that sends nothing back.
std::vector<Vec3> arrives(const Tracer& tracer, std::span<const Vec3> light, Vec3 place) {
  std::vector<Vec3> out(light.size(), Vec3(0));
  std::vector<float> y(light.size());
  constexpr int rays = 4096;
  for (int i = 0; i < rays; ++i) {
    const Vec3 d = square_to_sphere(sobol_owen(uint32_t(i), 5));
    if (tracer.closest(place, d).triangle != none) continue;
    evaluate_sh(int(std::lround(std::sqrt(double(light.size())))), d, y);
    Vec3 radiance(0);
    for (size_t k = 0; k < light.size(); ++k) radiance += y[k] * light[k];
    for (size_t k = 0; k < light.size(); ++k) out[k] += (4 * pi / rays * y[k]) * radiance;
  }
  return out;
}

TEST(Reflecting, TwoObjectsLightASceneAsThePathTracerSays) {
  SKIP_UNDER_SANITIZERS();
  constexpr int light_order = 4, order = 6;
  Scene scene = yard();
  for (Material& m : scene.materials) m.base_color = Vec3(0);  // so that one bounce is that of the objects
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = order, .samples = 512, .bounces = 0});
  ASSERT_TRUE(transfer);
  Scene box;
  add_box(box, add_material(box, "box", Vec3(0.3f, 0.5f, 0.9f)), "box", Vec3(-0.4f, -0.3f, -0.5f),
          Vec3(0.4f, 0.3f, 0.5f), 4);
  const Thing ball(make_sphere(0.5f, 3, Vec3(0.95f, 0.6f, 0.3f)), order, light_order, 256),
      block(box, order, light_order, 256);
  const Thing* things[] = {&ball, &block};
  const RigidPlace places[] = {{Vec3(-0.7f, 0.8f, 0.3f), Mat3(1.0f), 1},
                               {Vec3(0.8f, 0.7f, -0.6f), rotation_from_yaw_pitch_roll({30, 20, 0}), 1}};
  const PlacedObject placed[] = {place_object(ball.light, places[0]), place_object(block.light, places[1])};
  const std::vector<const PlacedObject*> objects{&placed[0], &placed[1]};
  const std::vector<Vec3> light = uneven_light(light_order);
  std::vector<Vec3> padded(light);
  padded.resize(size_t(sh_count(order)), Vec3(0.0f));
  const MovingReceivers moving = moving_receivers(*transfer, receivers.origins, receivers.normals);
  Relit relit;
  relight(*transfer, padded, relit);
  const MovingLight lights[] = {{light, false, &relit}};
  MovingShader().shade(moving, objects, {.light_order = light_order}, lights);
  const Relit dark = relit;
  ShiningLight reflected[2];
  PlacedLamp lamps[2];
  Scene joint = scene;
  for (int i = 0; i < 2; ++i) {
    std::vector<Vec3> arriving = arrives(*tracer, light, places[i].position);
    pass_objects(arriving, places[i].position, {&objects[size_t(1 - i)], 1});
    reflected[i] = reflected_light(reflects(*things[i], order, 256), arriving, places[i].rotation);
    lamps[i] = place_lamp(reflected[i], places[i]);
    append_scene(joint, moved(things[i]->scene, things[i]->light.shells, places[i]));
  }
  const SeenLamp seen[] = {{&lamps[0], &placed[0]}, {&lamps[1], &placed[1]}};
  LampShader().add(moving, seen, objects, LampResponse::cosine, relit);
  std::vector<Vec3> at, normals, ours, without;
  for (size_t r = 0; r < receivers.count(); r += 7) {
    at.push_back(receivers.origins[r]), normals.push_back(receivers.normals[r]);
    ours.push_back(relit.at(r)), without.push_back(dark.at(r));
  }
  std::vector<Vec3> truth;
  for (const ExitRadiance& e : exit_radiances(joint, reconstruct_environment(light, 128), at, normals, 1, 1024, 7))
    truth.push_back(e.mean);
  const double with = decibels(ours, truth), before = decibels(without, truth);
  RecordProperty("decibels", std::to_string(with));
  RecordProperty("decibels_without_reflections", std::to_string(before));
  EXPECT_GT(with, 33);
  EXPECT_GT(with, before + 3);
}

TEST(Moving, FarObjectsChangeNothingAndCostNothing) {
  const Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 12, 12, Vec3(0.5f));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = 3, .samples = 64, .bounces = 0});
  const Thing ball(make_sphere(0.1f, 1, Vec3(0.5f)), 3, 3);
  const PlacedObject far = place_object(ball.light, {Vec3(0, 40, 0), Mat3(1.0f), 1}),
                     below = place_object(ball.light, {Vec3(0, -1, 0), Mat3(1.0f), 1});
  const std::vector<const PlacedObject*> objects{&far, &below};
  const std::vector<Vec3> light = uneven_light(3);
  Relit relit;
  relight(*transfer, light, relit);
  const Relit before = relit;
  const MovingLight lights[] = {{light, false, &relit}};
  const MovingReceivers moving = moving_receivers(*transfer, receivers.origins, receivers.normals);
  const MovingCount done = MovingShader().shade(moving, objects, {.light_order = 3}, lights);
  EXPECT_EQ(done.pairs, 0u);
  EXPECT_EQ(relit.values, before.values);
}

TEST(Moving, UnderABlockNoLightIsLeft) {
  // A ball as large as the receiver's whole sky: the receiver lies within it.
  const Scene scene = make_quad(Vec3(-0.1f, 0, -0.1f), Vec3(0, 0, 0.2f), Vec3(0.2f, 0, 0), 4, 4, Vec3(0.5f));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = 4, .samples = 256, .bounces = 0});
  const Thing ball(make_sphere(2, 3, Vec3(0.5f)), 4, 3);
  const PlacedObject around = place_object(ball.light, {Vec3(0, 0.1f, 0), Mat3(1.0f), 1});
  const std::vector<const PlacedObject*> objects{&around};
  const std::vector<Vec3> light = uneven_light(4);
  Relit relit;
  relight(*transfer, light, relit);
  const float before = relit.at(0).x;
  const MovingLight lights[] = {{light, false, &relit}};
  const MovingReceivers moving = moving_receivers(*transfer, receivers.origins, receivers.normals);
  MovingShader().shade(moving, objects, {.light_order = 4}, lights);
  for (size_t r = 0; r < receivers.count(); ++r) EXPECT_NEAR(relit.at(r).x / before, 0, 0.01f);
}

TEST(Moving, TurnedReceiversAreThoseBakedTurned) {
  // A bent sheet's own transfer, turned with it: light turned the other way gives the same.
  Scene box;
  add_box(box, add_material(box, "box", Vec3(0.5f)), "box", Vec3(-1, -1, -1), Vec3(1, 1, 1), 2, true);
  box.triangles.resize(box.triangles.size() * 5 / 6);
  auto tracer = Tracer::build(box);
  const Receivers receivers = make_vertex_receivers(box);
  auto transfer = bake(box, *tracer, receivers, {.order = 4, .samples = 256, .precision = Precision::single});
  ASSERT_TRUE(transfer);
  const RigidPlace place{Vec3(5, 1, 2), rotation_from_yaw_pitch_roll({25, -40, 70}), 1.5f};
  const MovingReceivers turned = moving_receivers(*transfer, receivers.origins, receivers.normals, Vec3(0.0f), place);
  const std::vector<Vec3> light = uneven_light(4);
  Relit ours, truth;
  light_receivers(turned, 4, {light, false, &ours});
  relight(*transfer, rotate_sh(make_sh_rotation(4, transpose(place.rotation)), light), truth);
  for (size_t r = 0; r < receivers.count(); ++r) EXPECT_LT(length(ours.at(r) - truth.at(r)), 1e-4f);
}

}  // namespace
}  // namespace lambent
