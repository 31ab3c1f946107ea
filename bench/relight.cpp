// Relighting against the memory it streams: the limit is a plain SIMD sum over the same bytes, same threads, same run.
#include "bench.h"

#include <lambent.h>

#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/baked/extension.h>
#include <lambent/compress/cpca.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <atomic>
#include <cstring>

namespace lambent::bench {
namespace {

// Bytes a second of reading memory once, with as many running sums as hide the latency of adding.
double read_bandwidth(std::span<const uint8_t> data) {
  std::atomic<uint64_t> total{0};
  const double seconds = least_seconds(7, [&] {
    parallel_for(data.size() / 64, size_t{1} << 14, [&](size_t begin, size_t end) {
      uint64_t sums[16] = {};
      const uint8_t* p = data.data() + begin * 64;
      for (size_t i = begin; i + 1 < end; i += 2, p += 128) {
        uint64_t words[16];
        std::memcpy(words, p, 128);
        for (int k = 0; k < 16; ++k) sums[k] += words[k];
      }
      uint64_t sum = 0;
      for (uint64_t s : sums) sum += s;
      total += sum;
    });
  });
  if (total == 42) std::fprintf(stderr, "an unlikely sum\n");  // the result is used
  return double(data.size()) / seconds;
}

WritableTransfer random_transfer(int order, int rows, size_t receivers, int channels, Precision precision) {
  WritableTransfer w = make_transfer({.order = order}, rows, channels, receivers, precision);
  parallel_for(w.transfer.bytes() / 4, 1 << 16, [&](size_t begin, size_t end) {
    Random random(begin);
    for (size_t i = begin; i < end; ++i) {
      const float a = random.next(), b = random.next();
      if (precision == Precision::half) {
        const uint16_t h[2] = {float_to_half(a), float_to_half(b)};
        std::memcpy(w.values + 4 * i, h, 4);
      } else {
        std::memcpy(w.values + 4 * i, &a, 4);
      }
    }
  });
  return w;
}

void relight_case(const std::string& name, int order, int rows, size_t receivers, int channels, Precision precision,
                  const char* aim) {
  const WritableTransfer w = random_transfer(order, rows, receivers, channels, precision);
  std::vector<Vec3> light(size_t(order * order), Vec3(0.3f, -0.2f, 0.1f));
  Relit out;
  relight(w.transfer, light, out);
  const double bandwidth = read_bandwidth(w.transfer.data);
  const double seconds = least_seconds(9, [&] { relight(w.transfer, light, out); });
  const double bytes = double(w.transfer.bytes());
  report(name, bytes / seconds / 1e9, bandwidth / 1e9, "GB/s", "reading the same memory",
         {{"receivers", receivers},
          {"columns", order * order},
          {"rows", rows},
          {"channels", channels},
          {"ms", 1e3 * seconds},
          {"with_writes_GBs", (bytes + 12.0 * double(rows) * double(receivers)) / seconds / 1e9},
          {"aim", aim}});
}

// One million receivers through the C interface, into memory of the caller's: a baked file in memory, without a scene.
void c_case() {
  constexpr size_t receivers = 1'000'000;
  WritableTransfer w = random_transfer(6, 1, receivers, 1, Precision::half);
  BakedFields fields;
  VertexPlacement vertices{std::vector<uint32_t>(receivers), {}};
  for (uint32_t r = 0; r < receivers; ++r) vertices.front[r] = r;
  fields.surface = {std::move(vertices), w.transfer, DiffuseRows{}};
  fields.parts = {{0, 0, 0, receivers}};
  BlobWriter bulk;
  nlohmann::json extension = encode_fields(fields, bulk), document{{"asset", {{"version", "2.0"}}}};
  extension["parts"][0]["node"] = extension["parts"][0]["primitive"] = 0;
  std::vector<std::vector<int>> numbers;
  for (size_t i = 0; i < bulk.blobs.size(); ++i) numbers.push_back({int(i)});
  resolve_views(extension, numbers);
  // JSON of a length that is known before its offsets are, so that bulk data begin on a cache line.
  std::vector<uint8_t> binary;
  for (const BlobWriter::Blob& blob : bulk.blobs) {
    binary.resize((binary.size() + blob.alignment - 1) / blob.alignment * blob.alignment);
    document["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", blob.bytes.size()}});
    binary.insert(binary.end(), blob.bytes.begin(), blob.bytes.end());
  }
  binary.resize((binary.size() + 3) / 4 * 4);
  document["buffers"] = {{{"byteLength", binary.size()}}};
  document["extensions"][extension_name] = std::move(extension);
  std::string text = document.dump();
  while ((12 + 8 + text.size() + 8) % 64) text += ' ';
  std::vector<uint8_t> file;
  auto add = [&](std::initializer_list<uint32_t> words) {
    for (uint32_t word : words)
      for (int k = 0; k < 4; ++k) file.push_back(uint8_t(word >> 8 * k));
  };
  add({0x46546c67, 2, uint32_t(28 + text.size() + binary.size()), uint32_t(text.size()), 0x4e4f534a});
  file.insert(file.end(), text.begin(), text.end());
  add({uint32_t(binary.size()), 0x004e4942});
  file.insert(file.end(), binary.begin(), binary.end());

  lambent_file* handle = nullptr;
  lambent_relighter* relighter = nullptr;
  const std::vector<Vec3> light(36, Vec3(0.3f, -0.2f, 0.1f));
  AlignedVector<float> rgb(3 * receivers);
  if (lambent_open_memory(file.data(), file.size(), &handle) || lambent_relighter_new(handle, 0, &relighter) ||
      lambent_set_columns(relighter, &light[0].x, 36) || lambent_relight(relighter, rgb.data(), rgb.size(), 3)) {
    std::fprintf(stderr, "%s\n", lambent_error());
    return;
  }
  // In turns, so that both meet the machine as it is.
  double bandwidth = 0, seconds = 1e300;
  for (int i = 0; i < 5; ++i) {
    bandwidth = std::max(bandwidth, read_bandwidth(w.transfer.data));
    seconds = std::min(seconds, least_seconds(7, [&] { lambent_relight(relighter, rgb.data(), rgb.size(), 3); }));
  }
  const double bytes = double(w.transfer.bytes());
  report("relight_c_1M_half", bytes / seconds / 1e9, bandwidth / 1e9, "GB/s", "reading the same memory",
         {{"receivers", receivers},
          {"columns", 36},
          {"ms", 1e3 * seconds},
          {"with_writes_GBs", (bytes + 12.0 * receivers) / seconds / 1e9},
          {"aim", ">= 0.85"}});
  lambent_relighter_free(relighter);
  lambent_close(handle);
}

// A glossy bake in clusters, of the least rank whose error is at most the bake's own (the estimate from half its
// samples), against the same bake whole. Both scenes are more than a cache holds: 360 MB of one channel, 290 MB of
// three.
void cpca_case(int bounces) {
  const Scene scene = make_courtyard(bounces == 0 ? 2 : 1);
  auto tracer = Tracer::build(scene);
  if (!tracer) return;
  const Receivers receivers = make_vertex_receivers(scene);
  const ReceiverMaterials materials =
      make_receiver_materials(scene, receivers, {.everywhere = Ggx{.alpha = Vec2(0.16f)}});
  BakeReport about;
  auto baked = bake_matrix(scene, *tracer, receivers, materials, {.order = 5, .samples = 512, .bounces = bounces},
                           {.outgoing = OutgoingKind::map, .response_samples = 64}, &about);
  if (!baked) return;
  const Transfer& t = baked->transfer;
  const std::vector<Vec3> light(25, Vec3(0.3f, -0.2f, 0.1f));
  Relit out;
  const double whole = least_seconds(9, [&] { relight(t, light, out); });
  constexpr int clusters = 512;
  for (int rank : {8, 10, 12, 16}) {
    double error = 0;
    auto packed = compress_cpca(t, {.clusters = clusters, .rank = rank}, &error);
    if (!packed) return;
    if (error > about.error) continue;
    const double clustered = least_seconds(9, [&] { relight(*packed, light, out); });
    report("relight_cpca", clustered, whole, "s", "the same transfer whole",
           {{"receivers", t.receivers},
            {"rows", t.rows},
            {"columns", 25},
            {"channels", t.channels},
            {"clusters", clusters},
            {"rank", rank},
            {"error", error},
            {"bake_error", about.error},
            {"bytes_ratio", double(t.bytes()) / double(packed->bytes())},
            {"bytes_per_receiver", double(packed->bytes()) / double(t.receivers)},
            {"aim", "<= 0.5, and bytes_ratio >= 4, where error <= bake_error"}});
    return;
  }
}

}  // namespace

void bench_relight() {
  c_case();
  for (size_t receivers : {size_t{1'000'000}, size_t{8'000'000}})
    for (Precision precision : {Precision::half, Precision::single})
      for (int channels : {1, 3})
        if (receivers < 8'000'000 || channels == 1 || precision == Precision::half)
          relight_case(std::string("relight_") + (receivers >= 8'000'000 ? "8M" : "1M") +
                           (precision == Precision::half ? "_half" : "_single") +
                           (channels == 3 ? "_rgb_transfer" : ""),
                       6, 1, receivers, channels, precision, precision == Precision::half ? ">= 0.85" : ">= 0.7");
  relight_case("relight_glossy_svd6", 5, 6, 100'000, 3, Precision::half, ">= 0.7");
  for (int bounces : {0, 1}) cpca_case(bounces);
}

}  // namespace lambent::bench
