// All-frequency products (locally-adaptive-products): its Tables 1 to 3 and the comparison of its Fig. 5 on our scenes,
// and what a new environment takes. The paper's figures stand beside ours as "limit" where it prints them; baselines
// are run on the same vertices. LAMBENT_PRODUCTS_SCENES names those that are wanted, with commas ("hall,bunny.obj");
// all if it is not set. LAMBENT_PRODUCTS_DETAIL below 1 takes so much of the vertices of the made scenes, leaves the
// shared ones as they are, and takes the first four where none are named. Times of a vertex are a thread's processor
// time.
#include "bench.h"
#include "embree.h"

#include <lambent/bake/visibility.h>
#include <lambent/core/random.h>
#include <lambent/render/products.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <functional>

namespace lambent::bench {
namespace {

struct Place {
  Vec3 position, normal;
};

// f over [0, 1] x [0, 1] in na x nb cells, turned to the side of its normals; `around` joins b = 1 to b = 0.
void add_grid(Scene& scene, uint32_t material, const char* name, int na, int nb, bool around,
              const std::function<Place(float, float)>& f) {
  const int columns = around ? nb : nb + 1;
  std::vector<Vec3> positions, normals;
  for (int i = 0; i <= na; ++i)
    for (int j = 0; j < columns; ++j) {
      const Place p = f(float(i) / float(na), float(j) / float(nb));
      positions.push_back(p.position), normals.push_back(normalize(p.normal));
    }
  std::vector<uint32_t> indices;
  auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
    const Vec3 n = cross(positions[b] - positions[a], positions[c] - positions[a]);
    if (dot(n, normals[a] + normals[b] + normals[c]) < 0) std::swap(b, c);
    indices.insert(indices.end(), {a, b, c});
  };
  for (int i = 0; i < na; ++i)
    for (int j = 0; j < nb; ++j) {
      const auto at = [&](int row, int column) { return uint32_t(row * columns + column % columns); };
      add(at(i, j), at(i + 1, j), at(i + 1, j + 1)), add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  add_mesh(scene, material, name, positions, normals, indices);
}

// A round bar from p to q, its radius going from r to s.
void add_bar(Scene& scene, uint32_t material, const char* name, Vec3 p, Vec3 q, float r, float s, int along,
             int around) {
  const Vec3 axis = q - p;
  const Mat3 frame = frame_about(normalize(axis));
  add_grid(scene, material, name, along, around, true, [&](float a, float b) {
    const Vec3 out = std::cos(2 * pi * b) * frame[0] + std::sin(2 * pi * b) * frame[1];
    return Place{p + a * axis + (r + a * (s - r)) * out, out};
  });
}

// A disc of radius r, facing n.
void add_disc(Scene& scene, uint32_t material, const char* name, Vec3 centre, Vec3 n, float r, int along, int around) {
  const Mat3 frame = frame_about(n);
  add_grid(scene, material, name, along, around, true, [&](float a, float b) {
    return Place{centre + std::max(a, 1e-3f) * r * (std::cos(2 * pi * b) * frame[0] + std::sin(2 * pi * b) * frame[1]),
                 n};
  });
}

void add_ring(Scene& scene, uint32_t material, const char* name, Vec3 centre, float radius, float thick, int around,
              int across) {
  add_grid(scene, material, name, around, across, true, [&](float a, float b) {
    const Vec3 out(std::cos(2 * pi * a), std::sin(2 * pi * a), 0),
        n = std::cos(2 * pi * b) * out + std::sin(2 * pi * b) * Vec3(0, 0, 1);
    return Place{centre + radius * out + thick * n, n};
  });
}

// Cells a side for a share `detail` of the vertices.
int cells(float n, float detail) { return std::max(3, int(n * std::sqrt(detail))); }

void add_floor(Scene& scene, uint32_t material, float half, int n) {
  add_quad(scene, material, "floor", Vec3(-half, 0, half), Vec3(2 * half, 0, 0), Vec3(0, 0, -2 * half), n, n);
}

// As the paper's Fig. 4: a round table, eight chairs about it with barred backs.
Scene make_table(float detail) {
  Scene scene;
  const uint32_t m = add_material(scene, "wood", Vec3(0.5f));
  auto n = [&](float count) { return cells(count, detail); };
  add_floor(scene, m, 3, n(300));
  add_bar(scene, m, "stem", Vec3(0), Vec3(0, 0.72f, 0), 0.25f, 0.06f, n(60), n(60));
  add_disc(scene, m, "top", Vec3(0, 0.76f, 0), Vec3(0, 1, 0), 0.9f, n(130), n(260));
  add_disc(scene, m, "under", Vec3(0, 0.72f, 0), Vec3(0, -1, 0), 0.9f, n(30), n(80));
  add_bar(scene, m, "rim", Vec3(0, 0.72f, 0), Vec3(0, 0.76f, 0), 0.9f, 0.9f, n(4), n(260));
  for (int chair = 0; chair < 8; ++chair) {
    const float turn = 2 * pi * float(chair) / 8;
    const Vec3 out(std::cos(turn), 0, std::sin(turn)), side(-out.z, 0, out.x), up(0, 1, 0), middle = 1.15f * out;
    add_disc(scene, m, "seat", middle + 0.46f * up, up, 0.24f, n(50), n(120));
    add_disc(scene, m, "seat", middle + 0.42f * up, -up, 0.24f, n(12), n(50));
    add_bar(scene, m, "seat", middle + 0.42f * up, middle + 0.46f * up, 0.24f, 0.24f, n(4), n(120));
    for (float x : {-1.0f, 1.0f})
      for (float z : {-1.0f, 1.0f}) {
        const Vec3 foot = middle + 0.16f * (x * side + z * out);
        add_bar(scene, m, "leg", foot, foot + 0.42f * up, 0.018f, 0.022f, n(60), n(20));
      }
    for (int bar = 0; bar < 7; ++bar) {
      const float angle = 0.9f * (float(bar) / 3 - 1);
      const Vec3 at = middle + 0.22f * (std::cos(angle) * out + std::sin(angle) * side) + 0.46f * up;
      add_bar(scene, m, "bar", at, at + 0.5f * up, 0.01f, 0.01f, n(90), n(14));
    }
  }
  return scene;
}

// Height over a plate: domes, a knotted rosette and fine grooves.
Scene make_relief(float detail) {
  Scene scene;
  const uint32_t m = add_material(scene, "stone", Vec3(0.5f));
  auto height = [](float x, float z) {
    const float r = std::sqrt(x * x + z * z) + 1e-6f, turn = std::atan2(z, x);
    const float rosette = 0.09f * std::exp(-2.5f * r * r) * (1 + std::cos(9 * turn + 6 * r)) * std::min(1.0f, 4 * r);
    const float u = x * 5 - std::round(x * 5), v = z * 5 - std::round(z * 5),
                dome = std::sqrt(std::max(0.0f, 0.12f - u * u - v * v));
    return rosette + 0.25f * dome + 0.006f * std::sin(60 * r) + 0.05f * std::cos(3 * x) * std::cos(2 * z);
  };
  const int n = cells(706, detail);
  add_grid(scene, m, "relief", n, n, false, [&](float a, float b) {
    const float x = 2 * a - 1, z = 2 * b - 1, d = 1e-3f;
    return Place{Vec3(x, height(x, z), z),
                 Vec3(height(x - d, z) - height(x + d, z), 2 * d, height(x, z - d) - height(x, z + d))};
  });
  return scene;
}

// Two wheels of thin spokes in a frame of tubes.
Scene make_wheels(float detail) {
  Scene scene;
  const uint32_t m = add_material(scene, "steel", Vec3(0.5f));
  auto n = [&](float count) { return cells(count, detail); };
  add_floor(scene, m, 2, n(290));
  for (float x : {-0.5f, 0.5f}) {
    const Vec3 hub(x, 0.35f, 0);
    add_ring(scene, m, "tyre", hub, 0.33f, 0.02f, n(600), n(24));
    add_bar(scene, m, "hub", hub - Vec3(0, 0, 0.04f), hub + Vec3(0, 0, 0.04f), 0.02f, 0.02f, n(20), n(30));
    for (int k = 0; k < 32; ++k) {
      const float turn = 2 * pi * float(k) / 32;
      const Vec3 out(std::cos(turn), std::sin(turn), 0), lean(0, 0, k % 2 ? 0.03f : -0.03f);
      add_bar(scene, m, "spoke", hub + 0.02f * out + lean, hub + 0.315f * out, 0.0015f, 0.0015f, n(120), n(8));
    }
  }
  const Vec3 pedals(-0.08f, 0.3f, 0), saddle(-0.2f, 0.85f, 0), head(0.35f, 0.85f, 0), back(-0.5f, 0.35f, 0),
      front(0.5f, 0.35f, 0);
  for (const auto& [p, q] : {std::pair{pedals, saddle},
                             {pedals, head},
                             {saddle - Vec3(0, 0.1f, 0), head},
                             {pedals, back},
                             {saddle, back},
                             {head, front}})
    add_bar(scene, m, "tube", p, q, 0.016f, 0.016f, n(140), n(30));
  return scene;
}

// Two rows of fluted columns under a roof, open at the sides.
Scene make_hall(float detail) {
  Scene scene;
  const uint32_t m = add_material(scene, "stone", Vec3(0.5f));
  auto n = [&](float count) { return cells(count, detail); };
  add_floor(scene, m, 7, n(330));
  add_box(scene, m, "roof", Vec3(-5, 4, -2.5f), Vec3(5, 4.4f, 2.5f), n(90));
  for (int row : {-1, 1})
    for (int k = 0; k < 7; ++k) {
      const Vec3 foot(1.5f * float(k - 3), 0, 1.9f * float(row));
      add_box(scene, m, "base", foot - Vec3(0.3f, 0, 0.3f), foot + Vec3(0.3f, 0.15f, 0.3f), n(10));
      add_grid(scene, m, "column", n(60), n(80), true, [&](float a, float b) {
        const float turn = 2 * pi * b, r = 0.22f * (1 - 0.15f * a) * (1 + 0.05f * std::cos(16 * turn));
        const float slope = -0.22f * (1 - 0.15f * a) * 0.8f * std::sin(16 * turn);
        const Vec3 out(std::cos(turn), 0, std::sin(turn)), along(-out.z, 0, out.x);
        return Place{foot + Vec3(0, 0.15f + 3.85f * a, 0) + r * out, r * out - slope * along};
      });
    }
  return scene;
}

Environment harsh_light(std::string& name) {
  const char* given = std::getenv("LAMBENT_DATA");
  const std::filesystem::path folder =
      given ? std::filesystem::path(given)
            : std::filesystem::path(__FILE__).parent_path().parent_path().parent_path() / "shared" / "data";
  auto env = load_environment((folder / "environments" / "chinese_garden_1k.hdr").string());
  name = "chinese_garden_1k.hdr";
  if (env) return std::move(*env);
  name = "made";
  Environment made = make_environment(
      "made", 1024, 512, [](Vec3 d) { return Vec3(0.3f + 0.2f * d.y, 0.4f + 0.2f * d.y, 0.6f + 0.2f * d.y); });
  made.image.at(600, 170) = Vec3(70000, 60000, 50000);
  return made;
}

// Embree on the bake's own rays, origins and directions, 256 at a time, nothing done with the answer; of some 20,000
// receivers.
double raw_rays_a_second(const Scene& scene, const Receivers& receivers, const Cube& cube) {
  const RawScene raw(scene);
  std::atomic<size_t> rays{0}, hits{0};
  const size_t step = std::max<size_t>(1, receivers.count() / 20'000);
  const double seconds = least_seconds(1, [&] {
    parallel_for((receivers.count() + step - 1) / step, 64, [&](size_t begin, size_t end) {
      AlignedVector<float> x, y, z;
      size_t count = 0, found = 0;
      for (size_t i = begin; i < end; ++i) {
        const size_t r = i * step;
        x.clear(), y.clear(), z.clear();
        for (size_t t = 0; t < cube.count(); ++t)
          if (const Vec3 d = cube.texels.at(t); dot(receivers.normals[r], d) > 0)
            x.push_back(d.x), y.push_back(d.y), z.push_back(d.z);
        for (size_t k = 0; k < x.size(); k += 256)
          found += occluded_stream(raw.scene, receivers.origins[r], &x[k], &y[k], &z[k],
                                   std::min<size_t>(256, x.size() - k));
        count += x.size();
      }
      rays += count, hits += found;
    });
  });
  if (hits == 0) std::fprintf(stderr, "no ray hit anything\n");
  return double(rays) / seconds;
}

// PSNR as of a picture: the brightest hundredth of the truth is white, and values beyond are clipped.
double clipped_psnr(std::span<const Vec3> values, std::span<const Vec3> truth) {
  std::vector<float> sorted;
  for (const Vec3& v : truth) sorted.push_back(std::max({v.x, v.y, v.z}));
  std::sort(sorted.begin(), sorted.end());
  const float white = std::max(sorted[sorted.size() * 99 / 100], 1e-6f);
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const Vec3 d = clamp(values[i] / white, 0.0f, 1.0f) - clamp(truth[i] / white, 0.0f, 1.0f);
    sum += double(dot(d, d)) / 3;
  }
  return 10 * std::log10(double(truth.size()) / std::max(sum, 1e-12));
}

std::vector<Camera> flyby(const Scene& scene, int views) {
  std::vector<Camera> cameras(size_t(views), camera_around(bounds(scene)));
  for (int k = 0; k < views; ++k) {
    Camera& c = cameras[size_t(k)];
    c.eye = c.target + rotation_from_yaw_pitch_roll({360.0f * float(k) / float(views), 0, 0}) * (c.eye - c.target);
  }
  return cameras;
}

nlohmann::json shares(const Breakdown& b) {
  const double all = double(b.light_brdf + b.light_visibility + b.triple);
  nlohmann::json samples = nlohmann::json::array();
  for (size_t n : b.samples) samples.push_back(100 * double(n) / all);
  return {{"line_6", 100 * double(b.light_brdf) / all},
          {"line_9", 100 * double(b.light_visibility) / all},
          {"line_11", 100 * double(b.triple) / all},
          {"samples_1_4_16_64_256", samples}};
}

struct Case {
  const char* name;
  Brdf brdf;
  double paper_over_standard;  // how many times faster than the standard basis
};

void product_scene(const std::string& name, const Scene& scene) {
  constexpr int size = 64;
  std::string light_name;
  const Environment env = harsh_light(light_name);
  auto tracer = Tracer::build(scene);
  if (!tracer) return;
  const Receivers receivers = make_vertex_receivers(scene);
  VisibilityReport baked;
  auto made = bake_visibility(*tracer, receivers, {.size = size, .scene = &scene}, &baked);
  if (!made) return (void)std::fprintf(stderr, "skipped: %s: %s\n", name.c_str(), made.error().text().c_str());
  const Visibility& visibility = *made;
  const CubeLight cube = cube_light(env, size);
  BlockLight light;
  set_light(light, cube);
  const HaarLight haar = make_haar_light(cube, 0.01);
  const VisibilityStatistics s = visibility_statistics(visibility);
  const double count = double(receivers.count());
  const nlohmann::json about{{"scene", name}, {"receivers", receivers.count()}, {"light", light_name}, {"cube", size}};
  auto line = [&](const char* what, double ours, double limit, const char* unit, const std::string& is, const char* aim,
                  nlohmann::json more) {
    more.update(about), more["aim"] = aim;
    report(what, ours, limit, unit, is, more);
  };
  line("products_bake", double(baked.rays) / baked.seconds / 1e6,
       raw_rays_a_second(scene, receivers, *light.cube) / 1e6, "million rays/s", "Embree on the same rays", ">= 1.3",
       {{"seconds", baked.seconds}, {"rays", baked.rays}, {"certain", baked.certain}});
  line("products_database", double(visibility.bytes()) / count, 290e6 / 280e3, "bytes a vertex",
       "the paper, Table 3, round table", "<= 1",
       {{"MB", double(visibility.bytes()) / 1e6},
        {"blocked", s.blocked},
        {"clear", s.clear},
        {"mixed", s.mixed},
        {"changes_per_mixed_block", s.changes}});

  const Case cases[] = {{"diffuse", Lambert{Vec3(0.5f)}, 120},
                        {"phong_10", Phong{Vec3(0.3f), Vec3(0.4f), 10}, 50},
                        {"phong_200", Phong{Vec3(0.3f), Vec3(0.4f), 200}, 40},
                        {"ward", Ward{Vec3(0.3f), Vec3(0.4f), Vec2(0.1f, 0.2f)}, 40}};
  const std::vector<Camera> cameras = flyby(scene, 3);
  for (const Case& c : cases) {
    Reflection reflection;
    reflection.everywhere = c.brdf;
    auto shading = [&](SamplingRule rule) {
      return make_product_receivers(scene, receivers.front, receivers.back, receivers.count(), reflection, *light.cube,
                                    {.rule = rule});
    };
    auto visible = [&](const Camera& camera) {
      return seen_receivers(scene, receivers.front, receivers.back, receivers.count(), camera, 800, 600);
    };
    auto shade = [&](const ProductReceivers& by, const std::vector<uint32_t>& list, const Camera& camera, Relit& out,
                     Breakdown* tally) {
      shade_receivers(Product::blocks, light, nullptr, visibility, by, list, camera.eye, out, tally);
    };
    const ProductReceivers ours = shading(SamplingRule::bounded), paper = shading(SamplingRule::appendix_a);
    Relit relit, by_paper;
    Breakdown tally, paper_tally;
    double seconds = 0, paper_seconds = 0, frame_seconds = 0, near_seconds = 0;
    size_t seen_all = 0, seen_near = 0;
    std::vector<Vec3> blocks, appendix, standard, wavelets, truth_of_wavelets;
    double simd_seconds = 0, scalar_seconds = 0, haar_seconds = 0;
    size_t simd_count = 0, scalar_count = 0;
    HaarScratch scratch;
    for (const Camera& camera : cameras) {
      const std::vector<uint32_t> seen = visible(camera);
      if (seen.empty()) continue;
      Camera near = camera;
      near.fov /= 3;
      const std::vector<uint32_t> few = visible(near);
      frame_seconds += least_seconds(2, [&] { shade(ours, seen, camera, relit, nullptr); });
      ThreadLimit one(1);
      near_seconds += least_thread_seconds(1, [&] { shade(ours, few, camera, relit, nullptr); });
      paper_seconds += least_thread_seconds(1, [&] { shade(paper, seen, camera, by_paper, nullptr); });
      seconds += least_thread_seconds(2, [&] { shade(ours, seen, camera, relit, nullptr); });
      shade(ours, seen, camera, relit, &tally);
      shade(paper, seen, camera, by_paper, &paper_tally);
      seen_all += seen.size(), seen_near += few.size();
      // The slow ones on every so manieth vertex.
      const size_t step = std::max<size_t>(1, seen.size() / 1000);
      for (size_t i = 0; i < seen.size(); i += step) {
        const uint32_t r = seen[i];
        const ProductMaterial& m = ours.materials[0];
        const Vec3 wo = normalize_or(camera.eye - ours.positions[r], ours.frames[r][2]);
        Vec3 value(0);
        simd_seconds +=
            least_thread_seconds(1, [&] { value = shade_standard(light, visibility, r, m, ours.frames[r], wo); });
        ++simd_count;
        blocks.push_back(relit.at(r)), appendix.push_back(by_paper.at(r)), standard.push_back(value);
        if (i / step % 10) continue;
        scalar_seconds += least_thread_seconds(
            1, [&] { value = shade_standard_scalar(light, visibility, r, m, ours.frames[r], wo); });
        ++scalar_count;
        truth_of_wavelets.push_back(value);
        project_haar(haar, visibility, r, m, ours.frames[r], wo, scratch);
        haar_seconds += least_thread_seconds(1, [&] { value = multiply_haar(haar, scratch); });
        wavelets.push_back(value);
      }
    }
    if (seen_all == 0) return;
    const double each = 1e9 * seconds / double(seen_all), simd = 1e9 * simd_seconds / double(simd_count),
                 scalar = 1e9 * scalar_seconds / double(scalar_count);
    const nlohmann::json material{{"material", c.name}};
    auto with = [&](nlohmann::json more) { return more.update(material), more; };
    line("products_blocks_vs_simd", each, simd, "ns a vertex and core", "our best standard basis",
         c.paper_over_standard == 120  ? "<= 1/120"
         : c.paper_over_standard == 50 ? "<= 1/50"
                                       : "<= 1/40",
         with({{"times_faster", simd / each},
               {"appendix_a_ns", 1e9 * paper_seconds / double(seen_all)},
               {"seen", double(seen_all) / double(cameras.size())}}));
    line("products_blocks_vs_scalar", each, scalar, "ns a vertex and core", "a plain loop over all texels",
         c.paper_over_standard == 120  ? "<= 1/300"
         : c.paper_over_standard == 50 ? "<= 1/120"
                                       : "<= 1/100",
         with({{"times_faster", scalar / each}}));
    line("products_haar_vs_scalar", 1e9 * haar_seconds / double(scalar_count), scalar, "ns a vertex and core",
         "a plain loop over all texels", "<= 1/10 (Ng et al.)", with({{"fraction", 0.01}}));
    line("products_frame", 1e3 * frame_seconds / double(cameras.size()), 1e3 / 14, "ms",
         "the paper's round table, on four cores of 2011", "-",
         with({{"ns_a_vertex_near", seen_near ? 1e9 * near_seconds / double(seen_near) : 0.0},
               {"ns_a_vertex_all", each},
               {"seen_near", double(seen_near) / double(cameras.size())}}));
    const nlohmann::json own = shares(tally), theirs = shares(paper_tally);
    line("products_table_1_2", own["line_11"], 2.5, "% of blocks in line 11", "the most of the paper's Table 1", "<= 1",
         with({{"bounded", own}, {"appendix_a", theirs}}));
    line("products_accuracy", clipped_psnr(blocks, standard), 45.67, "dB", "the paper, its Fig. 5", ">= 50 dB",
         with({{"appendix_a", clipped_psnr(appendix, standard)},
               {"haar_1_percent", clipped_psnr(wavelets, truth_of_wavelets)},
               {"haar_of_the_paper", 33.54}}));
  }
}

// A new environment: put on the cube, and made into the three forms.
void light_case(int size, double aim) {
  std::string name;
  const Environment env = reduced(harsh_light(name), 8 * size);
  BlockLight light;
  CubeLight cube;
  const Mat3 turn = rotation_from_yaw_pitch_roll({31, 7, 3});
  const double project = least_seconds(5, [&] { cube = cube_light(env, size, turn); });
  const double forms = least_seconds(5, [&] { set_light(light, cube); });
  report("products_light", 1e3 * (project + forms), aim, "ms", "the aim",
         {{"cube", size}, {"light", name}, {"project_ms", 1e3 * project}, {"forms_ms", 1e3 * forms}, {"aim", "<= 1"}});
}

}  // namespace

void each_product_scene(float detail, const std::function<bool(const std::string&)>& wanted,
                        const std::function<void(const std::string&, const Scene&)>& use) {
  if (wanted("round table")) use("round table", make_table(detail));
  if (wanted("relief")) use("relief", make_relief(detail));
  if (wanted("wheels")) use("wheels", make_wheels(detail));
  if (wanted("hall")) use("hall", make_hall(detail));
  if (wanted("courtyard")) use("courtyard", make_courtyard(1.5f * std::sqrt(detail)));
  for (const char* name : {"bunny.obj", "armadillo.obj", "scorpion_loop1_200k.ply"}) {
    if (!wanted(name)) continue;
    if (auto scene = refined(data_scene(name, true), size_t(120'000 * detail))) use(name, *scene);
  }
}

void bench_products() {
  const char* given = std::getenv("LAMBENT_PRODUCTS_DETAIL");
  const float detail = given ? std::clamp(std::strtof(given, nullptr), 0.001f, 1.0f) : 1.0f;
  light_case(64, 5);
  light_case(128, 20);
  const char* named = std::getenv("LAMBENT_PRODUCTS_SCENES");
  const std::string names = named ? named : detail < 1 ? "round table,relief,wheels,hall" : "";
  each_product_scene(
      detail,
      [&](const std::string& name) {
        return names.empty() || ("," + names + ",").find("," + name + ",") != std::string::npos;
      },
      product_scene);
}

}  // namespace lambent::bench
