// Follows: general-prt (transferred incident radiance at points in free space), triple-product-integrals (light from
// the sky as a triple product: with visibility known to order n + m - 1 it is exact, as in matrix.cpp).
#include <lambent/bake/columns.h>
#include <lambent/bake/fan.h>
#include <lambent/bake/gather.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/lobes.h>
#include <lambent/bake/matrix_kernels.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/check.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <atomic>

namespace lambent {
namespace {

// What a thread needs for one point at a time.
struct LatticeScratch {
  AlignedVector<float> x, y, z, sum, v, yb;
  std::vector<AlignedVector<float>> visible;  // of each sky channel
  std::vector<Hit> hits;
  std::vector<Passage> passages;
  std::vector<float> V, scalars, out;
  std::vector<ViewWeights> weights;
  LobeRays lobe_rays;
  AlignedVector<float> lobe;
  std::vector<double> open;  // a broad lobe's rows with nothing in the way, less their sums over the rays
};

struct LatticeBaker {
  const Scene& scene;
  const Transfer& surface;
  const Outgoing* outgoing;
  const Lattice& lattice;
  const LatticeOptions& options;
  const GatherSetup& setup;
  int channel_count;

  TriplingTensor tensor = make_tripling_tensor(surface.light.order, options.order, setup.sets.order);
  ShZyzRotator rotator{setup.sets.order};
  AlignedVector<float> Y = unpack_surface();        // [receiver][row][channel][width]
  std::vector<float> shortfall = make_shortfall();  // [set][k]
  // The rays of a point are spread over the sphere: as dense as a fan of a fourth of them about its axis.
  LobeSets lobes =
      make_lobe_sets(surface.light.lobe_kind, surface.light.lobes, std::max(1, options.samples / 4), options.seed);
  std::vector<double> lobe_rows = make_lobe_rows();  // [lobe][j], of an open sky
  Pool<LatticeScratch> scratch{[this] { return make_scratch(); }};

  size_t C() const { return surface.columns(); }
  size_t harmonics() const { return size_t(sh_count(surface.light.order)); }
  size_t J() const { return size_t(sh_count(options.order)); }
  size_t channels() const { return size_t(channel_count); }
  size_t rows() const { return size_t(surface.rows); }
  size_t width() const { return pad_lanes(C()); }
  size_t wc() const { return channels() * width(); }
  size_t V_count() const { return setup.coefficients(); }
  size_t rays() const { return size_t(setup.sets.samples); }
  float ray_angle() const { return 4 * pi / float(rays()); }

  AlignedVector<float> unpack_surface() const {
    AlignedVector<float> out(surface.receivers * rows() * wc(), 0.0f);
    parallel_for(surface.receivers, gather_block, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r) {
        const std::vector<float> t = load_receiver(surface, r);
        for (size_t row = 0; row < rows(); ++row)
          for (size_t c = 0; c < channels(); ++c)
            std::copy_n(t.data() + (row * size_t(surface.channels) + std::min(c, size_t(surface.channels) - 1)) * C(),
                        C(), out.data() + (r * rows() + row) * wc() + c * width());
      }
    });
    return out;
  }

  // What a set of directions lacks of the sphere, the exact integrals of y_k less its sums. Added in the measure in
  // which a point sees the sky it takes the sampling noise of an open sky away altogether, and most of it where the sky
  // is nearly open.
  std::vector<float> make_shortfall() const {
    const DirectionSets& sets = setup.sets;
    std::vector<float> out(size_t(sets.sets) * V_count());
    AlignedVector<float> ones(sets.stride, 0.0f);
    std::fill_n(ones.begin(), rays(), 1.0f);
    for (size_t set = 0; set < size_t(sets.sets); ++set) {
      float* row = out.data() + set * V_count();
      weighted_rows(sets.table.data() + set * V_count() * sets.stride, V_count(), sets.stride, ones.data(), sets.stride,
                    row);
      for (size_t k = 0; k < V_count(); ++k) row[k] = (k == 0 ? std::sqrt(4 * pi) : 0.0f) - row[k] * ray_angle();
    }
    return out;
  }

  std::vector<double> make_lobe_rows() const {
    if (lobes.count() == 0) return {};
    const DirectionalBasis basis = make_directional_basis(options.order, surface.light.lobe_kind, surface.light.lobes);
    std::vector<double> out(lobes.count() * J());
    for (size_t k = 0; k < lobes.count(); ++k)
      for (size_t j = 0; j < J(); ++j) out[k * J() + j] = basis.gram[(J() + k) * basis.count() + j];
    return out;
  }

  std::unique_ptr<LatticeScratch> make_scratch() const {
    auto s = std::make_unique<LatticeScratch>();
    const size_t stride = setup.sets.stride;
    s->x.resize(stride), s->y.resize(stride), s->z.resize(stride), s->hits.resize(rays());
    s->visible.assign(size_t(setup.sky_channels), AlignedVector<float>(stride));
    s->passages.resize(setup.tracer.lets_pass() ? rays() : 0);
    s->sum.resize(J() * wc()), s->v.resize(hit_batch * wc()), s->yb.resize(hit_batch * J());
    s->V.resize(V_count()), s->scalars.resize(rows() * channels()), s->out.resize(J() * channels() * C()),
        s->weights.resize(rows());
    if (lobes.count()) s->lobe_rays = make_lobe_rays(lobes, setup.sky_channels), s->lobe.resize(stride);
    return s;
  }

  // Transfer of what leaves a hit towards -w, added to v[channel][width].
  void add_exit_radiance(LatticeScratch& s, const Corners& corners, const Hit& h, Vec3 share, Vec3 w, float* v) const {
    const Vec3 colour = setup.albedo_at(corners.part, h);
    const float b[3] = {1 - h.u - h.v, h.u, h.v};
    for (int k = 0; k < 3; ++k) {
      const uint32_t r = corners.receiver[size_t(k)];
      if (outgoing) evaluate_outgoing(*outgoing, r, -w, s.weights);
      else s.weights[0] = ViewWeights(0, 0, 0, 1);
      for (size_t row = 0; row < rows(); ++row) {
        const Vec3 weight = share * b[k] * (Vec3(s.weights[row]) + colour * s.weights[row].w);
        for (size_t c = 0; c < channels(); ++c) s.scalars[row * channels() + c] = weight[int(c)];
      }
      add_weighted_rows(Y.data() + r * rows() * wc(), rows(), channels(), width(), s.scalars.data(), v);
    }
  }

  // What a lobe sends here by the sky: out of `count` rays with a weight each, in its column.
  void add_lobe_rays(LatticeScratch& s, size_t k, const Directions& d, size_t count, const float* weight,
                     const std::vector<AlignedVector<float>>& visible) const {
    float y[max_sh_order * max_sh_order];
    for (size_t i = 0; i < count; ++i) {
      evaluate_sh(options.order, Vec3(d.x[i], d.y[i], d.z[i]), {y, J()});
      for (size_t c = 0; c < channels(); ++c) {
        const float w = weight[i] * visible[visible.size() == 1 ? 0 : c][i];
        if (w == 0) continue;
        for (size_t j = 0; j < J(); ++j) s.out[(j * channels() + c) * C() + harmonics() + k] += w * y[j];
      }
    }
  }

  // Sharp lobes by rays of their own; broad ones by those of the point, and, as far as it sees the sky, what these lack
  // of the whole lobe.
  void add_lobes(LatticeScratch& s, size_t point, const std::array<float, 3>& seen) const {
    for (size_t i = 0; i < lobes.sharp.size(); ++i) {
      const size_t k = lobes.sharp[i];
      LobeRays& r = s.lobe_rays;
      const uint64_t bits = hash64(hash64(lobes.seed, k), point);
      const size_t sets = lobes.x.size() / (lobes.sharp.size() * lobes.stride);
      const size_t base = (i * sets + size_t(bits % sets)) * lobes.stride;
      const float spin = 2 * pi * to_unit_float(uint32_t(bits >> 32)), cosine = std::cos(spin), sine = std::sin(spin);
      const Mat3 turn = lobes.frames[k] * Mat3(Vec3(cosine, sine, 0), Vec3(-sine, cosine, 0), Vec3(0, 0, 1));
      rotate_directions(turn, lobes.x.data() + base, lobes.y.data() + base, lobes.z.data() + base, lobes.stride,
                        r.x.data(), r.y.data(), r.z.data());
      const Directions d{r.x.data(), r.y.data(), r.z.data(), size_t(lobes.rays)};
      trace_visible(setup.tracer, lattice.position(point), d, std::span(r.visible), nullptr);
      std::fill(r.cosine.begin(), r.cosine.end(), lobes.integrals[k] / float(lobes.rays));
      add_lobe_rays(s, k, d, d.count, r.cosine.data(), r.visible);
    }
    const Directions d{s.x.data(), s.y.data(), s.z.data(), rays()};
    float y[max_sh_order * max_sh_order];
    for (uint32_t k : lobes.broad) {
      evaluate_on_fan(lobes, k, d.x, d.y, d.z, setup.sets.stride, s.lobe.data());
      s.open.assign(lobe_rows.begin() + ptrdiff_t(k * J()), lobe_rows.begin() + ptrdiff_t((k + 1) * J()));
      for (size_t i = 0; i < rays(); ++i) {
        s.lobe[i] *= ray_angle();
        evaluate_sh(options.order, Vec3(d.x[i], d.y[i], d.z[i]), {y, J()});
        for (size_t j = 0; j < J(); ++j) s.open[j] -= double(s.lobe[i] * y[j]);
      }
      add_lobe_rays(s, k, d, rays(), s.lobe.data(), s.visible);
      for (size_t j = 0; j < J(); ++j)
        for (size_t c = 0; c < channels(); ++c)
          s.out[(j * channels() + c) * C() + harmonics() + k] += float(s.open[j]) *
                                                                 seen[s.visible.size() == 1 ? 0 : c] / float(rays());
    }
  }

  // Writes a point's matrix; false: it lies inside something.
  bool gather(LatticeScratch& s, size_t point, const WritableTransfer& out) const {
    const DirectionSets& sets = setup.sets;
    // A pole of its own and a spin about it: every point's directions are turned at random.
    const uint64_t bits = hash64(hash64(setup.seed, 0x1a771ce), point);
    const Vec3 pole = square_to_sphere({to_unit_float(uint32_t(bits >> 32)), to_unit_float(uint32_t(bits))});
    const DirectionChoice choice = choose_directions(sets, pole, setup.seed, point);
    const size_t base = size_t(choice.set) * sets.stride;
    rotate_directions(choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                      s.x.data(), s.y.data(), s.z.data());
    const bool passes = !s.passages.empty();
    const Directions directions{s.x.data(), s.y.data(), s.z.data(), rays()};
    trace_hits(setup.tracer, lattice.position(point), directions, s.hits.data(), s.passages, setup.progress);
    if (is_cancelled(setup.progress)) return false;

    std::fill(s.sum.begin(), s.sum.end(), 0.0f), std::fill(s.v.begin(), s.v.end(), 0.0f);
    size_t backs = 0, in_batch = 0;
    std::array<float, 3> seen{};  // of each sky channel, as if counted
    for (size_t i = 0; i < rays(); ++i) {
      if (ends_fan(i, setup.progress)) return false;
      const Hit& h = s.hits[i];
      for (size_t c = 0; c < s.visible.size(); ++c)
        s.visible[c][i] = passes             ? s.passages[i].sky[int(c)]
                        : h.triangle == none ? 1.0f
                                             : 0.0f,
        seen[c] += s.visible[c][i];
      if (h.triangle == none) continue;
      const Corners* corners = std::get<CornerReceivers>(setup.receivers.basis).find(h.triangle, h.front);
      if (!corners) {  // black
        backs += !setup.tracer.lets_pass(h.triangle);
        continue;
      }
      const Vec3 w(s.x[i], s.y[i], s.z[i]);
      add_exit_radiance(s, *corners, h, passes ? s.passages[i].hit : Vec3(1), w, s.v.data() + in_batch * wc());
      evaluate_sh(options.order, w, {s.yb.data() + in_batch * J(), J()});
      if (++in_batch < hit_batch) continue;
      add_outer_products(s.yb.data(), J(), s.v.data(), wc(), s.sum.data());
      std::fill(s.v.begin(), s.v.end(), 0.0f);
      in_batch = 0;
    }
    if (in_batch) add_outer_products(s.yb.data(), J(), s.v.data(), wc(), s.sum.data());  // the rest of v is zero

    // V_k in the set's frame, turned into the world; then T_ji = sum_k C_ijk V_k.
    for (size_t j = 0; j < J(); ++j)
      for (size_t c = 0; c < channels(); ++c)
        for (size_t i = 0; i < C(); ++i)
          s.out[(j * channels() + c) * C() + i] = s.sum[j * wc() + c * width() + i] * ray_angle();
    const size_t skies = s.visible.size();
    for (size_t sky = 0; sky < skies; ++sky) {
      weighted_rows(sets.table.data() + size_t(choice.set) * V_count() * sets.stride, V_count(), sets.stride,
                    s.visible[sky].data(), sets.stride, s.V.data());
      const float open = seen[sky] / float(rays());
      for (size_t k = 0; k < V_count(); ++k)
        s.V[k] = s.V[k] * ray_angle() + open * shortfall[size_t(choice.set) * V_count() + k];
      rotator.rotate(choice.a, choice.b, choice.c, s.V);
      for (size_t k = 0; k < V_count(); ++k)
        for (uint32_t e = tensor.begin[k]; e < tensor.begin[k + 1]; ++e)
          for (size_t c = sky; c < (skies == 1 ? channels() : sky + 1); ++c)
            s.out[(tensor.j[e] * channels() + c) * C() + tensor.i[e]] += tensor.single[e] * s.V[k];
    }
    if (lobes.count()) add_lobes(s, point, seen);
    store_receiver(out, point, s.out);
    return 2 * backs <= rays();
  }
};

// Invalid points take the mean of their neighbours along the axes, layer by layer from the valid ones.
void fill_invalid(const Lattice& lattice, const std::vector<uint8_t>& valid, const WritableTransfer& out) {
  std::vector<uint8_t> known = valid;
  for (bool grew = true; grew;) {
    grew = false;
    const std::vector<uint8_t> before = known;
    for (size_t p = 0; p < lattice.count(); ++p) {
      if (before[p]) continue;
      const auto [x, y, z] = lattice.place(p);
      std::vector<float> mean(out.transfer.receiver_values());
      int sources = 0;
      const int steps[6][3] = {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}};
      for (const auto& step : steps) {
        const int a = x + step[0], b = y + step[1], c = z + step[2];
        if (a < 0 || b < 0 || c < 0 || a >= lattice.nx || b >= lattice.ny || c >= lattice.nz ||
            !before[lattice.index(a, b, c)])
          continue;
        const std::vector<float> value = load_receiver(out.transfer, lattice.index(a, b, c));
        for (size_t k = 0; k < mean.size(); ++k) mean[k] += value[k];
        ++sources;
      }
      if (!sources) continue;
      for (float& v : mean) v /= float(sources);
      store_receiver(out, p, mean);
      known[p] = 1, grew = true;
    }
  }
}

// Pairs of valid neighbours, and those with a solid surface between them.
std::pair<size_t, size_t> count_walled(const Tracer& tracer, const Lattice& lattice,
                                       const std::vector<uint8_t>& valid) {
  std::atomic<size_t> pairs = 0, walled = 0;
  parallel_for(lattice.count(), 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const std::array<int, 3> at = lattice.place(p), n{lattice.nx, lattice.ny, lattice.nz};
      for (size_t axis = 0; axis < 3; ++axis) {
        std::array<int, 3> next = at;
        if (++next[axis] == n[axis]) continue;
        const size_t q = lattice.index(next[0], next[1], next[2]);
        if (!valid[p] || !valid[q]) continue;
        const Vec3 from = lattice.position(p), way = lattice.position(q) - from;
        const float distance = length(way);
        if (!(distance > 0)) continue;
        const Hit hit = tracer.closest(from, way / distance, 0, distance);
        ++pairs, walled += hit.triangle != none && !tracer.lets_pass(hit.triangle);
      }
    }
  });
  return {pairs, walled};
}

bool is_coloured(const Outgoing& o) {
  for (const ViewMap& map : o.maps)
    for (const ViewWeights& w : map.values)
      if (w.x != w.y || w.y != w.z) return true;
  return false;
}

// The direction tables: eight sets (gather.cpp), harmonics and direction of each ray.
size_t table_bytes(const LightBasis& light, const LatticeOptions& o) {
  return 4 * 8 * pad_lanes(size_t(o.samples)) * size_t(sh_count(light.order + o.order - 1) + 3) +
         lobe_set_bytes(o.samples, light.lobes.size());
}

Error too_little_memory(size_t needed, size_t allowed) {
  return {"lattice",
          "needs at least " + std::to_string(needed) + " bytes of memory, and was allowed " + std::to_string(allowed)};
}

}  // namespace

Bounds default_lattice_box(const Scene& scene, int nx, int ny, int nz) {
  const Bounds box = bounds(scene);
  const Vec3 inset = 0.5f * (box.max - box.min) / Vec3(float(nx), float(ny), float(nz));
  return {box.min + inset, box.max - inset};
}

size_t lattice_bytes(const Lattice& lattice, const LightBasis& light, int order, int channels, Precision precision) {
  Transfer t;
  t.light = light, t.rows = sh_count(order), t.channels = channels, t.receivers = lattice.count(),
  t.precision = precision;
  return t.bytes();
}

Result<void> check_lattice(const Lattice& lattice, const LightBasis& light, const LatticeOptions& o) {
  auto within = [](const char* name, int value, int least, int most) -> Result<void> {
    if (value >= least && value <= most) return {};
    return Error{name, "must lie between " + std::to_string(least) + " and " + std::to_string(most) + ", not " +
                           std::to_string(value)};
  };
  for (auto& ok : {within("lattice points along x", lattice.nx, 1, max_lattice_points),
                   within("lattice points along y", lattice.ny, 1, max_lattice_points),
                   within("lattice points along z", lattice.nz, 1, max_lattice_points),
                   within("order", light.order, 1, max_sh_order), within("lattice order", o.order, 1, max_sh_order),
                   within("order and lattice order together", light.order + o.order, 2, max_sh_order + 1),
                   within("lattice samples", o.samples, 1, 1 << 20)})
    if (!ok) return ok.error();
  for (int k = 0; k < 3; ++k)
    if (!std::isfinite(lattice.min[k]) || !std::isfinite(lattice.max[k]) || !(lattice.min[k] <= lattice.max[k]))
      return Error{"lattice", "its box is empty or not finite"};
  const size_t least = lattice_bytes(lattice, light, o.order, 1, o.precision) + table_bytes(light, o);
  if (o.memory < least) return too_little_memory(least, o.memory);
  return {};
}

Result<LatticeTransfer> bake_lattice(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                     const Transfer& surface, const Outgoing* outgoing, const Lattice& lattice,
                                     const LatticeOptions& options, LatticeReport* report, Progress* progress) {
  LAMBENT_CHECK(surface.receivers == receivers.count() && surface.light.groups.empty());
  LAMBENT_CHECK(surface.rows == (outgoing ? outgoing->rows() : 1));
  if (auto ok = check_lattice(lattice, surface.light, options); !ok) return ok.error();
  const auto start = Clock::now();
  const GatherSetup setup = make_gather_setup(scene, tracer, receivers, surface.light.order + options.order - 1,
                                              options.samples, options.seed, square_to_sphere, progress);
  const int channels = setup.channels == 3 || surface.channels == 3 || (outgoing && is_coloured(*outgoing)) ? 3 : 1;

  const size_t wc = size_t(channels) * pad_lanes(surface.columns()), J = size_t(sh_count(options.order)),
               stride = setup.sets.stride;
  const size_t unpacked = 4 * surface.receivers * size_t(surface.rows) * wc;
  const size_t each_thread = stride * (16 + sizeof(Hit)) + 8 * (J + hit_batch) * wc;
  const size_t bytes = lattice_bytes(lattice, surface.light, options.order, channels, options.precision);
  const size_t needed = bytes + table_bytes(surface.light, options) + unpacked + size_t(thread_count()) * each_thread;
  if (needed > options.memory) return too_little_memory(needed, options.memory);

  LatticeBaker baker{scene, surface, outgoing, lattice, options, setup, channels};
  WritableTransfer out = make_transfer(surface.light, int(J), channels, lattice.count(), options.precision);
  LatticeTransfer result{lattice, options.order, {}, std::vector<uint8_t>(lattice.count())};
  {
    const Shares shares(lattice.count(), transfer_block);
    ProgressStage stage(progress, "lattice", shares.own());
    const KeptPieces pieces(progress, "lattice", lattice.count() / transfer_block);
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      const std::span<uint8_t> rows = stored_bytes(out, begin, end - begin),
                               valid(result.valid.data() + begin, end - begin);
      if (!pieces.load(begin / transfer_block, rows, valid)) {
        auto s = baker.scratch.borrow();
        for (size_t p = begin; p < end && !stage.cancelled(); ++p) result.valid[p] = baker.gather(*s, p, out);
        pieces.save(begin / transfer_block, rows, valid);
      }
      stage.advance(end - begin);
    });
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    shares.gather(result.valid.data()), gather_stored(shares, out);
  }
  const size_t valid = size_t(std::count(result.valid.begin(), result.valid.end(), uint8_t(1)));
  if (valid == 0) return Error{"lattice", "every one of its points lies inside something"};
  fill_invalid(lattice, result.valid, out);
  result.transfer = std::move(out.transfer);
  if (report) {
    const auto [pairs, walled] = count_walled(tracer, lattice, result.valid);
    *report = {lattice.count(),
               lattice.count() - valid,
               lattice.count() * (size_t(options.samples) + size_t(baker.lobes.rays) * baker.lobes.sharp.size()),
               bytes,
               seconds_since(start),
               pairs,
               walled};
  }
  return result;
}

}  // namespace lambent
