// Follows: general-prt (transfer matrices, the recursion over bounces with glossy scattering, the last reflection),
// triple-product-integrals (direct light as a triple product: with V known to order n + m - 1 the product of light and incident
// basis, of orders n and m, against it is exact). Instead of the recursion, bounces by paths (general-prt, "direct simulation").
#include <lambent/bake/gather.h>
#include <lambent/bake/lobes.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/matrix_kernels.h>
#include <lambent/bake/path.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/sampling.h>
#include <lambent/core/random.h>

#include <atomic>
#include <chrono>
#include <map>
#include <variant>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// A hit that scatters, as it is kept for the bounces.
struct MatrixHit {
  uint32_t corner;   // triangle, and in the lowest bit whether its front was met
  uint32_t ray;
  uint16_t u, v;     // of 65535
  uint16_t rgb[3];   // halves: base colour there
};

struct MatrixHits {  // of a block of receivers
  std::vector<MatrixHit> hits;
  std::vector<uint32_t> ends;  // by receiver
  size_t bytes() const { return hits.size() * sizeof(MatrixHit) + ends.size() * 4 + sizeof(MatrixHits); }
};

// Functions given by coefficients over rows j, turned by phi about z: rows (l, m) and (l, -m) mix. `rows` is [j][width].
void turn_rows_about_z(float* rows, int order, size_t width, float phi) {
  for (int m = 1; m < order; ++m) {
    const float c = std::cos(float(m) * phi), s = std::sin(float(m) * phi);
    for (int l = m; l < order; ++l) {
      float* p = rows + size_t(sh_index(l, m)) * width;
      float* q = rows + size_t(sh_index(l, -m)) * width;
      for (size_t i = 0; i < width; ++i) {
        const float a = p[i], b = q[i];
        p[i] = a * c - b * s, q[i] = a * s + b * c;
      }
    }
  }
}

// What a thread needs for one receiver at a time.
struct MatrixScratch {
  AlignedVector<float> x, y, z, visible, lobe;
  std::vector<Hit> hits;
  std::vector<float> V, column_row;
  AlignedVector<float> sh_rows, v, zb, full, half;
  std::vector<ViewWeights> weights;
  std::vector<float> scalars, z_values;
  std::vector<double> lobe_sums;
  LobeRays lobe_rays;
  DirectionChoice choice{};
  float phi = 0;  // from the set's frame to the receiver's, about the normal
};

struct MatrixBaker {
  const Scene& scene;
  Receivers receivers;  // a copy: buried ones move
  const ReceiverMaterials& materials;
  const BakeOptions& options;
  const MatrixOptions& matrix;
  const GatherSetup setup;
  Progress* progress;
  BakeReport& report;

  const LobeSets lobes = make_lobe_sets(options.lobe_kind, options.lobes, options.samples, options.seed);
  CosineBasis basis = make_cosine_basis(matrix.incident_order);
  TriplingTensor tensor = make_tripling_tensor(options.order, matrix.incident_order, options.order + matrix.incident_order - 1);
  ShZyzRotator rotator{options.order};
  std::vector<FactoredResponse> scatter{};
  std::vector<ViewMap> responses{};
  std::vector<size_t> first_row{};  // of each receiver's scattered rows; one more at the end
  Pool<MatrixScratch> scratch{[this] { return make_scratch(); }};

  const CornerReceivers& corners() const { return std::get<CornerReceivers>(receivers.basis); }
  size_t n() const { return receivers.count(); }
  size_t J() const { return size_t(basis.count()); }                // rows of X
  size_t harmonics() const { return size_t(sh_count(options.order)); }
  size_t C() const { return harmonics() + lobes.count(); }          // columns
  size_t channels() const { return size_t(setup.channels); }
  size_t width() const { return pad_lanes(C()); }                   // floats of a row of one channel
  size_t V_count() const { return setup.coefficients(); }
  size_t rays() const { return size_t(setup.sets.samples); }
  bool has_halves() const { return setup.sets.half < rays(); }

  std::unique_ptr<MatrixScratch> make_scratch() const {
    auto s = std::make_unique<MatrixScratch>();
    const size_t stride = setup.sets.stride, w = channels() * width();
    s->x.resize(stride), s->y.resize(stride), s->z.resize(stride), s->visible.resize(stride), s->lobe.resize(stride), s->hits.resize(rays());
    s->V.resize(V_count()), s->column_row.resize(C());
    s->sh_rows.resize(J() * w), s->v.resize(hit_batch * w), s->zb.resize(hit_batch * J());
    s->full.resize(J() * width()), s->half.resize(J() * width());
    s->weights.resize(J()), s->scalars.resize(J() * 3);
    s->z_values.resize(J()), s->lobe_sums.resize(2 * J()), s->lobe_rays = make_lobe_rays(lobes);
    return s;
  }

  Directions aim(MatrixScratch& s, size_t r) const {
    const DirectionSets& sets = setup.sets;
    s.choice = choose_directions(sets, receivers.normals[r], setup.seed, r);
    const size_t base = size_t(s.choice.set) * sets.stride;
    rotate_directions(s.choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride, s.x.data(), s.y.data(), s.z.data());
    const Vec3 x_axis = s.choice.rotation[0] * materials.frames[r];  // the set's x axis in the receiver's frame
    s.phi = std::atan2(x_axis.y, x_axis.x);
    return {s.x.data(), s.y.data(), s.z.data(), rays()};
  }

  // Rows over the harmonics of the set's frame -> rows over the incident basis of the receiver's frame, into out[j][width].
  void to_incident(float* sh_rows, float phi, size_t w, float scale, float* out) const {
    turn_rows_about_z(sh_rows, basis.order, w, phi);
    for (size_t j = 0; j < J(); ++j) {
      std::fill(out + j * w, out + (j + 1) * w, 0.0f);
      for (size_t k = 0; k <= j; ++k) {
        const float f = scale * float(basis.from_sh[j * J() + k]);
        if (f == 0) continue;
        for (size_t i = 0; i < w; ++i) out[j * w + i] += f * sh_rows[k * w + i];
      }
    }
  }

  // Direct light from the first `count` rays: X0_ji = mean of V y_i z_j = sum_k C_ijk V_k. out is [J][width].
  void direct(MatrixScratch& s, size_t count, float* out) const {
    const size_t w = width(), base = size_t(s.choice.set) * V_count() * setup.sets.stride;
    weighted_rows(setup.sets.table.data() + base, V_count(), setup.sets.stride, s.visible.data(), count == rays() ? setup.sets.stride : count, s.V.data());
    float* rows = s.sh_rows.data();
    std::fill(rows, rows + J() * w, 0.0f);
    for (size_t k = 0; k < V_count(); ++k) {
      const float v = s.V[k];
      for (uint32_t e = tensor.begin[k]; e < tensor.begin[k + 1]; ++e) rows[size_t(tensor.j[e]) * w + tensor.i[e]] += tensor.single[e] * v;
    }
    for (size_t j = 0; j < J(); ++j) rotator.rotate(s.choice.a, s.choice.b, s.choice.c, {rows + j * w, harmonics()});
    // Broad lobes: V b takes the place of V, and the harmonics below J that of the triple product.
    for (uint32_t k : lobes.broad) {
      evaluate_on_fan(lobes, k, s.x.data(), s.y.data(), s.z.data(), setup.sets.stride, s.lobe.data());
      multiply_values(s.lobe.data(), s.visible.data(), setup.sets.stride, s.lobe.data());
      weighted_rows(setup.sets.table.data() + base, J(), setup.sets.stride, s.lobe.data(), count == rays() ? setup.sets.stride : count, s.V.data());
      for (size_t j = 0; j < J(); ++j) rows[j * w + harmonics() + k] = s.V[j];
    }
    to_incident(rows, s.phi, w, 1.0f / float(count), out);
  }

  // Direct light of the sharp lobes, by rays of their own: X0_jk = 1/pi integral of V b_k z_j cos, into out and, if given, half_out.
  void direct_sharp_lobes(MatrixScratch& s, size_t r, float* out, float* half_out) const {
    for (size_t lobe = 0; lobe < lobes.sharp.size(); ++lobe) {
      const size_t k = lobes.sharp[lobe];
      trace_lobe(lobes, setup.tracer, receivers.origins[r], receivers.normals[r], r, lobe, s.lobe_rays);
      std::fill(s.lobe_sums.begin(), s.lobe_sums.end(), 0.0);
      for (size_t i = 0; i < s.lobe_rays.count; ++i) {
        const float weight = s.lobe_rays.visible[i] * s.lobe_rays.cosine[i];
        if (weight == 0) continue;
        evaluate_cosine_basis(basis, Vec3(s.lobe_rays.x[i], s.lobe_rays.y[i], s.lobe_rays.z[i]) * materials.frames[r], s.z_values);
        double* sums = s.lobe_sums.data() + (i < s.lobe_rays.half ? 0 : J());
        for (size_t j = 0; j < J(); ++j) sums[j] += double(weight) * s.z_values[j];
      }
      const double scale = double(lobes.integrals[k]) / std::numbers::pi;
      for (size_t j = 0; j < J(); ++j) {
        out[j * width() + harmonics() + k] = float(scale * (s.lobe_sums[j] + s.lobe_sums[J() + j]) / lobes.rays);
        if (half_out) half_out[j * width() + harmonics() + k] = float(scale * s.lobe_sums[j] / double(lobes.half));
      }
    }
  }

  // Light that the hits of rays below `limit` scatter to receiver r, added to out[J][channel][width]; Y holds scattered rows.
  void scattered(MatrixScratch& s, std::span<const MatrixHit> hits, size_t limit, const float* Y, float* out) const {
    const size_t w = width(), wc = channels() * w;
    float* rows = s.sh_rows.data();
    std::fill(rows, rows + J() * wc, 0.0f);
    const float* table = setup.sets.table.data() + size_t(s.choice.set) * V_count() * setup.sets.stride;
    size_t in_batch = 0;
    for (size_t i = 0; i < hits.size() && hits[i].ray < limit; ++i) {
      const MatrixHit& h = hits[i];
      float* v = s.v.data() + in_batch * wc;
      std::fill(v, v + wc, 0.0f);
      const Corners& at = *corners().find(h.corner >> 1, h.corner & 1);
      const Vec3 back(-s.x[h.ray], -s.y[h.ray], -s.z[h.ray]);
      const Vec3 colour(half_to_float(h.rgb[0]), half_to_float(h.rgb[1]), half_to_float(h.rgb[2]));
      const float b1 = float(h.u) / 65535.0f, b2 = float(h.v) / 65535.0f, b[3] = {1 - b1 - b2, b1, b2};
      for (int k = 0; k < 3; ++k) {
        const uint32_t c = at.receiver[k];
        const FactoredResponse& f = scatter[materials.of_receiver[c]];
        const ViewWeights* weights = f.g.values.data();
        if (!f.constant) {
          Vec3 wo = back * materials.frames[c];
          if (wo.z < 0) wo = normalize_or(Vec3(wo.x, wo.y, 0), Vec3(0, 0, 1));
          look_up(f.g, wo, s.weights);
          weights = s.weights.data();
        }
        for (size_t r = 0; r < size_t(f.rows); ++r) {
          const Vec3 weight = b[k] * (Vec3(weights[r]) + colour * weights[r].w);
          for (size_t ch = 0; ch < channels(); ++ch) s.scalars[r * channels() + ch] = weight[int(ch)];
        }
        add_weighted_rows(Y + first_row[c] * wc, size_t(f.rows), channels(), w, s.scalars.data(), v);
      }
      for (size_t j = 0; j < J(); ++j) s.zb[in_batch * J() + j] = table[j * setup.sets.stride + h.ray];
      if (++in_batch == hit_batch) add_outer_products(s.zb.data(), J(), s.v.data(), wc, rows), in_batch = 0;
    }
    add_rest(s, in_batch, limit, out);
  }

  // The same light by following the rays below `limit` on from their hits, each to its end.
  void simulated(MatrixScratch& s, size_t r, std::span<const MatrixHit> hits, size_t limit, float* out) const {
    const size_t w = width(), wc = channels() * w;
    std::fill(s.sh_rows.begin(), s.sh_rows.end(), 0.0f);
    const float* table = setup.sets.table.data() + size_t(s.choice.set) * V_count() * setup.sets.stride;
    const uint64_t key = hash64(hash64(setup.seed, 0x9a7e5), r);
    size_t in_batch = 0;
    for (size_t i = 0; i < hits.size() && hits[i].ray < limit; ++i) {
      const uint32_t ray = hits[i].ray;
      const PathEnd end = follow_path(scene, setup.tracer, materials.reflection, {s.x[ray], s.y[ray], s.z[ray]}, s.hits[ray], options.bounces, key, ray);
      if (!end.leaves) continue;
      evaluate_sh(options.order, end.direction, s.column_row);
      float* v = s.v.data() + in_batch * wc;
      for (size_t c = 0; c < channels(); ++c)
        for (size_t k = 0; k < C(); ++k) v[c * w + k] = end.throughput[int(c)] * s.column_row[k];
      for (size_t j = 0; j < J(); ++j) s.zb[in_batch * J() + j] = table[j * setup.sets.stride + ray];
      if (++in_batch == hit_batch) add_outer_products(s.zb.data(), J(), s.v.data(), wc, s.sh_rows.data()), in_batch = 0;
    }
    add_rest(s, in_batch, limit, out);
  }

  // Adds the last hits of a sum over rays, and the sum, as rows over the incident basis, to out.
  void add_rest(MatrixScratch& s, size_t in_batch, size_t limit, float* out) const {
    const size_t wc = channels() * width();
    if (in_batch) {
      std::fill(s.zb.data() + in_batch * J(), s.zb.data() + hit_batch * J(), 0.0f);
      add_outer_products(s.zb.data(), J(), s.v.data(), wc, s.sh_rows.data());
    }
    AlignedVector<float> sum(J() * wc);
    to_incident(s.sh_rows.data(), s.phi, wc, 1.0f / float(limit), sum.data());
    for (size_t i = 0; i < sum.size(); ++i) out[i] += sum[i];
  }

  // Traces receiver r: its visible rays, and its scattering hits if wanted. True: it lies inside something.
  bool trace(MatrixScratch& s, size_t r, MatrixHits* hits) const {
    const Directions d = aim(s, r);
    if (!hits) {
      setup.tracer.visible_fan(receivers.origins[r], d, s.visible.data());
      size_t seen = 0;
      for (size_t j = 0; j < rays(); ++j) seen += s.visible[j] > 0;
      return 4 * seen < rays() && is_buried(setup.tracer, receivers.basis, receivers.origins[r], d);
    }
    setup.tracer.closest_fan(receivers.origins[r], d, s.hits.data());
    size_t backs = 0;
    for (size_t j = 0; j < rays(); ++j) {
      const Hit& h = s.hits[j];
      s.visible[j] = h.triangle == none ? 1.0f : 0.0f;
      if (h.triangle == none) continue;
      const Corners* corner = corners().find(h.triangle, h.front);
      if (!corner) {
        ++backs;
        continue;
      }
      const Vec3 colour = setup.part_varies[corner->part] ? albedo(scene, scene.triangles[h.triangle], h.u, h.v) : setup.part_albedo[corner->part];
      hits->hits.push_back({h.triangle << 1 | uint32_t(h.front), uint32_t(j), uint16_t(h.u * 65535.0f + 0.5f), uint16_t(h.v * 65535.0f + 0.5f),
                            {float_to_half(colour.x), float_to_half(colour.y), float_to_half(colour.z)}});
    }
    return 2 * backs > rays();
  }

  // out[row][channel][width] = H x, x[J][channel][width].
  static void apply(std::span<const float> h, size_t rows, size_t J, size_t wc, const float* x, float* out) {
    std::fill(out, out + rows * wc, 0.0f);
    for (size_t r = 0; r < rows; ++r)
      for (size_t j = 0; j < J; ++j) {
        const float f = h[r * J + j];
        if (f == 0) continue;
        for (size_t i = 0; i < wc; ++i) out[r * wc + i] += f * x[j * wc + i];
      }
  }

  void make_responses() {
    ProgressStage stage(progress, "materials", materials.materials.size());
    responses.resize(materials.materials.size()), scatter.resize(responses.size());
    parallel_for(responses.size(), 1, [&](size_t begin, size_t end) {
      for (size_t m = begin; m < end; ++m) {
        responses[m] = make_response(materials.materials[m], basis, matrix.grid, matrix.response_samples);
        scatter[m] = factor_response(responses[m], matrix.scatter_rows, matrix.scatter_error);
        stage.advance();
      }
    });
    first_row.assign(1, 0);
    for (size_t r = 0; r < n(); ++r) first_row.push_back(first_row.back() + size_t(scatter[materials.of_receiver[r]].rows));
  }

  // How X becomes the stored rows: for each material and channel a matrix, rows x J.
  struct Last {
    Outgoing outgoing;
    int rows = 0, channels = 1;
    std::vector<std::array<std::vector<float>, 3>> h;  // by material, by channel
  };
  Last make_last() const {
    Last last;
    Outgoing& o = last.outgoing;
    o.kind = matrix.outgoing;
    o.frames = materials.frames;
    last.channels = setup.channels;
    last.h.resize(materials.materials.size());
    if (o.kind == OutgoingKind::map) {
      o.order = matrix.incident_order, o.maps = responses, o.map_of = materials.of_receiver;
      std::vector<float> identity(J() * J(), 0.0f);
      for (size_t j = 0; j < J(); ++j) identity[j * J() + j] = 1;
      for (auto& h : last.h) h = {identity, identity, identity};
    } else if (o.kind == OutgoingKind::svd) {
      o.order = matrix.incident_order, o.map_of = materials.of_receiver;
      std::vector<FactoredResponse> factors;
      size_t rows = 1;
      for (const ViewMap& response : responses) factors.push_back(factor_response(response, matrix.svd_rows, 1e-4)), rows = std::max(rows, size_t(factors.back().rows));
      for (size_t m = 0; m < factors.size(); ++m) {  // every receiver has as many rows; the rest are zero
        FactoredResponse& f = factors[m];
        ViewMap wide{f.g.grid, int(rows), std::vector<ViewWeights>(size_t(f.g.grid) * size_t(f.g.grid) * rows, ViewWeights(0.0f))};
        for (size_t i = 0; i < size_t(f.g.grid) * size_t(f.g.grid); ++i)
          std::copy_n(f.g.values.begin() + ptrdiff_t(i * size_t(f.rows)), f.rows, wide.values.begin() + ptrdiff_t(i * rows));
        o.maps.push_back(std::move(wide));
        f.h.resize(rows * J(), 0.0f);
        last.h[m] = {f.h, f.h, f.h};
      }
    } else if (o.kind == OutgoingKind::phong) {
      o.order = matrix.incident_order, o.has_b = false;
      for (size_t m = 0; m < materials.materials.size(); ++m)
        for (size_t c = 0; c < 3; ++c) {
          last.h[m][c] = convolve_phong(materials.materials[m], basis, int(c));
          const auto b = last.h[m][c].end() - ptrdiff_t(J());
          o.has_b |= std::any_of(b, last.h[m][c].end(), [](float x) { return x != 0; });
          if (last.h[m][c] != last.h[m][0]) last.channels = 3;
        }
    } else {
      o.order = matrix.outgoing_order;
      std::vector<std::array<std::vector<float>, 4>> parts;
      bool coloured = false;
      o.has_b = false;
      for (const ViewMap& response : responses) {
        parts.push_back(project_response(response, o.kind, o.order));
        for (const ViewWeights& w : response.values) coloured |= w.x != w.y || w.y != w.z, o.has_b |= w.w != 0;
      }
      if (coloured) last.channels = 3;
      for (size_t m = 0; m < parts.size(); ++m)
        for (size_t c = 0; c < 3; ++c) {
          last.h[m][c] = parts[m][c];
          if (o.has_b) last.h[m][c].insert(last.h[m][c].end(), parts[m][3].begin(), parts[m][3].end());
        }
    }
    last.rows = o.rows();
    return last;
  }

  // T0 in every channel.
  void expand(const float* t, float* x) const {
    for (size_t j = 0; j < J(); ++j)
      for (size_t c = 0; c < channels(); ++c) std::copy_n(t + j * width(), width(), x + (j * channels() + c) * width());
  }

  // X of receiver r as the rows that are kept.
  void store(const Last& last, const WritableTransfer& out, size_t r, const float* x) const {
    std::vector<float> values(size_t(last.rows) * size_t(last.channels) * C());
    for (size_t row = 0; row < size_t(last.rows); ++row)
      for (size_t c = 0; c < size_t(last.channels); ++c) {
        const float* h = last.h[materials.of_receiver[r]][c].data() + row * J();
        float* v = values.data() + (row * size_t(last.channels) + c) * C();
        for (size_t j = 0; j < J(); ++j) {
          const float* xj = x + (j * channels() + std::min(c, channels() - 1)) * width();
          if (h[j] != 0)
            for (size_t k = 0; k < C(); ++k) v[k] += h[j] * xj[k];
        }
      }
    store_receiver(out, r, values);
  }

  // Sums of squares by block, added up in order.
  struct ErrorSums {
    std::vector<double> differences, totals;
    explicit ErrorSums(size_t blocks) : differences(blocks, 0.0), totals(blocks, 0.0) {}
    void add(size_t block, const float* half, const float* full, size_t count) {
      for (size_t i = 0; i < count; ++i) differences[block] += double(half[i] - full[i]) * (half[i] - full[i]), totals[block] += double(full[i]) * full[i];
    }
    double relative() const {
      double difference = 0, total = 0;
      for (size_t b = 0; b < differences.size(); ++b) difference += differences[b], total += totals[b];
      return total > 0 ? std::sqrt(difference / total) : 0;
    }
  };

  MatrixBake finish(const std::vector<uint8_t>& buried, const ErrorSums& errors, WritableTransfer&& out, const Last& last) const {
    report.error = has_halves() ? errors.relative() : -1;
    report.receivers = n(), report.bytes = out.transfer.bytes();
    for (uint8_t x : buried) report.buried += x;
    return {std::move(out.transfer), last.outgoing};
  }

  // Every receiver by itself: nothing is kept from one to the next.
  Result<MatrixBake> run_simulated() {
    make_responses();
    const auto start = Clock::now();
    const Last last = make_last();
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    std::vector<uint8_t> buried(n());
    ErrorSums errors((n() + gather_block - 1) / gather_block);
    auto receive = [&](MatrixScratch& s, size_t r) {
      MatrixHits hits;
      const bool inside = trace(s, r, &hits);
      AlignedVector<float> t0(J() * width()), x(J() * channels() * width());
      auto gather = [&](size_t limit) {
        direct(s, limit, t0.data());
        expand(t0.data(), x.data());
        simulated(s, r, hits.hits, limit, x.data());
      };
      AlignedVector<float> half;
      const bool checked = has_halves() && r % check_every == 0 && !inside;
      if (checked) gather(setup.sets.half), half = x;
      gather(rays());
      if (checked) errors.add(r / gather_block, half.data(), x.data(), x.size());
      store(last, out, r, x.data());
      return inside;
    };
    {
      ProgressStage stage(progress, "paths", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        auto s = scratch.borrow();
        for (size_t r = begin; r < end && !stage.cancelled(); ++r) buried[r] = receive(*s, r);
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    auto s = scratch.borrow();
    for (const FillStep& step : make_fill_steps(scene, receivers.basis, buried)) {
      receivers.origins[step.receiver] = receivers.origins[step.sources[0]];
      (void)receive(*s, step.receiver);
    }
    report.rays = n() * rays();
    report.trace_seconds = seconds_since(start);
    report.working_memory = matrix_memory(n(), int(channels()), options, matrix);
    return finish(buried, errors, std::move(out), last);
  }

  Result<MatrixBake> run() {
    make_responses();
    const size_t wc = channels() * width(), blocks = (n() + gather_block - 1) / gather_block;
    const bool bounces = options.bounces > 0;
    auto start = Clock::now();
    // Bounces need the direct rows of all receivers at once; without them each is stored as it comes.
    const size_t held = bounces ? n() : 0;
    AlignedVector<float> T0(held * J() * width());
    std::vector<float> T0_half((held + check_every - 1) / check_every * J() * width());
    const Last last = make_last();
    WritableTransfer out = make_transfer(options.light(), last.rows, last.channels, n(), options.precision);
    ErrorSums errors(blocks);
    std::vector<uint8_t> buried(n());
    std::vector<MatrixHits> kept(blocks);
    std::vector<uint8_t> is_kept(blocks, 0);
    const size_t fixed = matrix_memory(n(), int(channels()), options, matrix);
    const size_t budget = options.memory > fixed ? options.memory - fixed : 0;
    std::atomic<size_t> used{0};

    auto trace_receiver = [&](MatrixScratch& s, size_t r, MatrixHits* hits) {
      const bool moved = buried[r];
      buried[r] = trace(s, r, hits);
      const bool checked = r % check_every == 0;
      float* full = bounces ? T0.data() + r * J() * width() : s.full.data();
      float* half = !checked ? nullptr : bounces ? T0_half.data() + r / check_every * J() * width() : s.half.data();
      direct(s, rays(), full);
      if (half) direct(s, std::min(setup.sets.half, rays()), half);
      direct_sharp_lobes(s, r, full, half);
      if (hits) hits->ends.push_back(uint32_t(hits->hits.size()));
      if (bounces) return;
      store(last, out, r, full);
      if (checked && !buried[r] && !moved) errors.add(r / gather_block, half, full, J() * width());
    };
    // Which blocks are kept depends on the scheduling, the result does not: the others are traced again, alike.
    auto keep = [&](size_t block, MatrixHits&& hits) {
      const size_t bytes = hits.bytes();
      if (used.fetch_add(bytes) + bytes <= budget) kept[block] = std::move(hits), is_kept[block] = 1;
      else used.fetch_sub(bytes);
    };
    {
      ProgressStage stage(progress, "tracing", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        auto s = scratch.borrow();
        MatrixHits hits;
        for (size_t r = begin; r < end; ++r) trace_receiver(*s, r, bounces ? &hits : nullptr);
        if (bounces) keep(begin / gather_block, std::move(hits));
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    report.rays = n() * (rays() + size_t(lobes.rays) * lobes.sharp.size());
    move_buried(buried, trace_receiver, bounces, kept, is_kept, used);
    report.operator_bytes = used;
    report.operator_kept = bounces ? double(std::count(is_kept.begin(), is_kept.end(), uint8_t(1))) / double(blocks) : 1;
    report.trace_seconds = seconds_since(start);
    start = Clock::now();

    auto scatter_rows = [&](size_t r, const float* x, float* Y) {
      const FactoredResponse& f = scatter[materials.of_receiver[r]];
      apply(f.h, size_t(f.rows), J(), wc, x, Y + first_row[r] * wc);
    };

    AlignedVector<float> Y, next;
    if (bounces) Y.resize(first_row.back() * wc), next.resize(Y.size());
    parallel_for(held, gather_block, [&](size_t begin, size_t end) {
      AlignedVector<float> x(J() * wc);
      for (size_t r = begin; r < end; ++r) {
        expand(T0.data() + r * J() * width(), x.data());
        scatter_rows(r, x.data(), Y.data());
      }
    });

    for (int bounce = 1; bounce <= options.bounces; ++bounce) {
      const bool is_last = bounce == options.bounces;
      ProgressStage stage(progress, "bounce " + std::to_string(bounce), n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        auto s = scratch.borrow();
        const size_t b = begin / gather_block;
        MatrixHits again;
        if (!is_kept[b])
          for (size_t r = begin; r < end; ++r) (void)trace(*s, r, &again), again.ends.push_back(uint32_t(again.hits.size()));
        const MatrixHits& hits = is_kept[b] ? kept[b] : again;
        AlignedVector<float> x(J() * wc);
        for (size_t r = begin; r < end; ++r) {
          (void)aim(*s, r);
          const size_t first = r == begin ? 0 : hits.ends[r - begin - 1];
          const std::span<const MatrixHit> mine(hits.hits.data() + first, hits.ends[r - begin] - first);
          expand(T0.data() + r * J() * width(), x.data());
          scattered(*s, mine, rays(), Y.data(), x.data());
          if (!is_last) {
            scatter_rows(r, x.data(), next.data());
            continue;
          }
          store(last, out, r, x.data());
          if (has_halves() && r % check_every == 0 && !buried[r]) {
            AlignedVector<float> half(J() * wc);
            expand(T0_half.data() + r / check_every * J() * width(), half.data());
            scattered(*s, mine, setup.sets.half, Y.data(), half.data());
            errors.add(b, half.data(), x.data(), half.size());
          }
        }
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
      report.rays += size_t(double(n()) * (1 - report.operator_kept) + 0.5) * rays();
      std::swap(Y, next);
    }
    report.bounce_seconds = seconds_since(start);
    report.working_memory = fixed + used;
    return finish(buried, errors, std::move(out), last);
  }

  // A buried receiver looks out from where its nearest clear neighbour along the mesh lies.
  template <class TraceReceiver>
  void move_buried(const std::vector<uint8_t>& was_buried, TraceReceiver& trace_receiver, bool bounces, std::vector<MatrixHits>& kept,
                   std::vector<uint8_t>& is_kept, std::atomic<size_t>& used) {
    const std::vector<uint8_t> buried = was_buried;
    const auto steps = make_fill_steps(scene, receivers.basis, buried);
    if (steps.empty()) return;
    for (const FillStep& step : steps) receivers.origins[step.receiver] = receivers.origins[step.sources[0]];
    auto s = scratch.borrow();
    if (!bounces) {
      for (const FillStep& step : steps) trace_receiver(*s, step.receiver, nullptr);
      return;
    }
    std::map<size_t, bool> touched;
    for (const FillStep& step : steps) touched[step.receiver / gather_block] = true;
    for (const auto& [block, yes] : touched) {
      const size_t begin = block * gather_block, end = std::min(n(), begin + gather_block);
      MatrixHits hits;
      for (size_t r = begin; r < end; ++r) trace_receiver(*s, r, &hits);
      if (is_kept[block]) used += hits.bytes(), used -= kept[block].bytes(), kept[block] = std::move(hits);
    }
  }
};

// Whether a BRDF of no base colour tints what it reflects: judged along mirrored and along unrelated directions.
bool tints(const Brdf& brdf) {
  for (uint32_t i = 0; i < 16; ++i) {
    const Vec3 wo = square_to_cosine_hemisphere(sobol_owen(i, 1));
    for (const Vec3& wi : {Vec3(-wo.x, -wo.y, wo.z), square_to_cosine_hemisphere(sobol_owen(i, 2))}) {
      const Vec3 f = evaluate(brdf, wi, wo);
      const float most = std::max({f.x, f.y, f.z}), least = std::min({f.x, f.y, f.z});
      if (most - least > 1e-5f * most) return true;
    }
  }
  return false;
}

Result<void> check_options(const BakeOptions& o, const MatrixOptions& m, const ReceiverMaterials& materials, size_t receivers) {
  auto within = [](const char* name, int value, int least, int most) -> Result<void> {
    if (value >= least && value <= most) return {};
    return Error{name, "must lie between " + std::to_string(least) + " and " + std::to_string(most) + ", not " + std::to_string(value)};
  };
  for (auto& ok : {check_light_basis(o, 1), within("samples", o.samples, 1, 1 << 20), within("bounces", o.bounces, 0, 64),
                   within("incident-order", m.incident_order, 1, max_incident_order), within("outgoing-order", m.outgoing_order, 1, max_incident_order),
                   within("order and incident-order together", o.order + m.incident_order, 2, max_sh_order + 1),
                   within("svd rows", m.svd_rows, 1, sh_count(m.incident_order)), within("grid", m.grid, 8, 256)})
    if (!ok) return ok.error();
  // A path seldom meets a lamp by chance.
  if (m.simulate_paths && o.bounces > 0 && !o.lobes.empty()) return Error{"lobes", "bounces by simulated paths are of harmonics alone"};
  if (m.outgoing == OutgoingKind::phong)
    for (const LinearMaterial& material : materials.materials)
      if (convolve_phong(material, make_cosine_basis(1), 0).empty()) return Error{"outgoing", "phong convolves Phong's lobe and takes no other material"};
  LAMBENT_CHECK(materials.of_receiver.size() == receivers && materials.frames.size() == receivers && !materials.materials.empty());
  return {};
}

}  // namespace

size_t matrix_memory(size_t receivers, int channels, const BakeOptions& o, const MatrixOptions& m) {
  const size_t width = pad_lanes(o.light().count()), J = size_t(sh_count(m.incident_order));
  const size_t table = 8 * pad_lanes(size_t(o.samples)) * 4 * size_t(sh_count(o.order + m.incident_order - 1) + 3);
  // Bounces hold direct rows and scattered ones; direct light alone is stored as it comes.
  const size_t held = o.bounces > 0 ? J * width * (check_every + 1) / check_every + 2 * size_t(m.scatter_rows) * size_t(channels) * width : 0;
  return receivers * (4 * held + 2 * sizeof(Vec3) + sizeof(Mat3)) + table +
         lobe_set_bytes(o.samples, o.lobes.size());
}

Result<MatrixBake> bake_matrix(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const ReceiverMaterials& materials,
                               const BakeOptions& options, const MatrixOptions& matrix, BakeReport* report, Progress* progress) {
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  if (!std::holds_alternative<CornerReceivers>(receivers.basis)) return Error{scene.path, "transfer matrices are baked at vertices"};
  if (auto ok = check_options(options, matrix, materials, receivers.count()); !ok) return ok.error();
  BakeReport unwanted;
  BakeReport& r = report ? *report : unwanted;
  r = {};
  GatherSetup setup = make_gather_setup(scene, tracer, receivers, options.order + matrix.incident_order - 1, options.samples, options.seed);
  for (const LinearMaterial& m : materials.materials)
    if (tints(m.black)) setup.channels = 3;
  if (options.bounces == 0) setup.channels = 1;  // direct light meets no coloured surface on its way
  const size_t needed = matrix_memory(receivers.count(), setup.channels, options, matrix);
  if (needed > options.memory)
    return Error{scene.path, "baking needs at least " + std::to_string(needed) + " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  MatrixBaker baker{scene, receivers, materials, options, matrix, std::move(setup), progress, r};
  return matrix.simulate_paths && options.bounces > 0 ? baker.run_simulated() : baker.run();
}

}  // namespace lambent
