// Follows: general-prt (transfer matrices, glossy scattering at the hits); triple-product-integrals (with V known to
// order n + m - 1 the product of light and incident basis, of orders n and m, against it is exact). Instead of
// scattering, paths (general-prt, "direct simulation").
#include <lambent/bake/kernels.h>
#include <lambent/bake/fan.h>
#include <lambent/bake/matrix_gather.h>
#include <lambent/bake/matrix_kernels.h>
#include <lambent/bake/path.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>

namespace lambent {
namespace {

// Functions given by coefficients over rows j, turned by phi about z: rows (l, m) and (l, -m) mix. `rows` is
// [j][width].
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

}  // namespace

std::unique_ptr<MatrixScratch> MatrixGather::make_scratch() const {
  auto s = std::make_unique<MatrixScratch>();
  const size_t stride = setup.sets.stride, w = channels() * width();
  s->x.resize(stride), s->y.resize(stride), s->z.resize(stride), s->lobe.resize(stride), s->hits.resize(rays()),
      s->passages.resize(setup.tracer.lets_pass() ? rays() : 0);
  s->visible.assign(sky_channels(), AlignedVector<float>(stride));
  s->V.resize(V_count()), s->column_row.resize(C());
  s->sh_rows.resize(J() * w), s->v.resize(hit_batch * w), s->zb.resize(hit_batch * J());
  s->full.resize(t0_width()), s->half.resize(t0_width());
  s->weights.resize(J()), s->scalars.resize(J() * 3);
  s->z_values.resize(J()), s->lobe_sums.resize(2 * J()), s->lobe_rays = make_lobe_rays(lobes, setup.sky_channels);
  return s;
}

Directions MatrixGather::aim(MatrixScratch& s, size_t r) const {
  const DirectionSets& sets = setup.sets;
  s.choice = choose_directions(sets, receivers.normals[r], setup.seed, r);
  const size_t base = size_t(s.choice.set) * sets.stride;
  rotate_directions(s.choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                    s.x.data(), s.y.data(), s.z.data());
  const Vec3 x_axis = s.choice.rotation[0] * materials.frames[r];  // the set's x axis in the receiver's frame
  s.phi = std::atan2(x_axis.y, x_axis.x);
  return {s.x.data(), s.y.data(), s.z.data(), rays()};
}

void MatrixGather::to_incident(float* sh_rows, float phi, size_t w, float scale, float* out) const {
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

void MatrixGather::direct(MatrixScratch& s, size_t count, float* out) const {
  for (const AlignedVector<float>& visible : s.visible) direct(s, visible, count, out), out += J() * width();
}

void MatrixGather::direct(MatrixScratch& s, const AlignedVector<float>& visible, size_t count, float* out) const {
  const size_t w = width(), base = size_t(s.choice.set) * V_count() * setup.sets.stride;
  weighted_rows(setup.sets.table.data() + base, V_count(), setup.sets.stride, visible.data(),
                count == rays() ? setup.sets.stride : count, s.V.data());
  float open = 0;  // the same control variate as of diffuse transfer
  for (size_t j = 0; j < count; ++j) open += visible[j];
  const float* excess = setup.sets.excess.data() + (size_t(s.choice.set) * 2 + (count == rays() ? 0 : 1)) * V_count();
  for (size_t k = 0; k < V_count(); ++k) s.V[k] -= open * excess[k];
  float* rows = s.sh_rows.data();
  std::fill(rows, rows + J() * w, 0.0f);
  for (size_t k = 0; k < V_count(); ++k) {
    const float v = s.V[k];
    for (uint32_t e = tensor.begin[k]; e < tensor.begin[k + 1]; ++e)
      rows[size_t(tensor.j[e]) * w + tensor.i[e]] += tensor.single[e] * v;
  }
  for (size_t j = 0; j < J(); ++j) rotator.rotate(s.choice.a, s.choice.b, s.choice.c, {rows + j * w, harmonics()});
  // Broad lobes: V b takes the place of V, and the harmonics below J that of the triple product.
  for (uint32_t k : lobes.broad) {
    evaluate_on_fan(lobes, k, s.x.data(), s.y.data(), s.z.data(), setup.sets.stride, s.lobe.data());
    multiply_values(s.lobe.data(), visible.data(), setup.sets.stride, s.lobe.data());
    weighted_rows(setup.sets.table.data() + base, J(), setup.sets.stride, s.lobe.data(),
                  count == rays() ? setup.sets.stride : count, s.V.data());
    for (size_t j = 0; j < J(); ++j) rows[j * w + harmonics() + k] = s.V[j];
  }
  to_incident(rows, s.phi, w, 1.0f / float(count), out);
}

void MatrixGather::direct_sharp_lobes(MatrixScratch& s, size_t r, float* out, float* half_out) const {
  for (size_t lobe = 0; lobe < lobes.sharp.size(); ++lobe) {
    const size_t k = lobes.sharp[lobe];
    trace_lobe(lobes, setup.tracer, receivers.origins[r], receivers.normals[r], r, lobe, s.lobe_rays);
    const double scale = double(lobes.integrals[k]) / std::numbers::pi;
    for (size_t c = 0; c < sky_channels(); ++c) {
      std::fill(s.lobe_sums.begin(), s.lobe_sums.end(), 0.0);
      for (size_t i = 0; i < s.lobe_rays.count; ++i) {
        const float weight = s.lobe_rays.visible[c][i] * s.lobe_rays.cosine[i];
        if (weight == 0) continue;
        evaluate_cosine_basis(basis, Vec3(s.lobe_rays.x[i], s.lobe_rays.y[i], s.lobe_rays.z[i]) * materials.frames[r],
                              s.z_values);
        double* sums = s.lobe_sums.data() + (i < s.lobe_rays.half ? 0 : J());
        for (size_t j = 0; j < J(); ++j) sums[j] += double(weight) * s.z_values[j];
      }
      for (size_t j = 0; j < J(); ++j) {
        const size_t at = (c * J() + j) * width() + harmonics() + k;
        out[at] = float(scale * (s.lobe_sums[j] + s.lobe_sums[J() + j]) / lobes.rays);
        if (half_out) half_out[at] = float(scale * s.lobe_sums[j] / double(lobes.half));
      }
    }
  }
}

void MatrixGather::expand(const float* t, float* x) const {
  for (size_t j = 0; j < J(); ++j)
    for (size_t c = 0; c < channels(); ++c)
      std::copy_n(t + (setup.sky_channel(c) * J() + j) * width(), width(), x + (j * channels() + c) * width());
}

void MatrixGather::scattered(MatrixScratch& s, std::span<const MatrixHit> hits, const Vec3* through, size_t limit,
                             const float* Y, float* out) const {
  const size_t w = width(), wc = channels() * w;
  float* rows = s.sh_rows.data();
  std::fill(rows, rows + J() * wc, 0.0f);
  const float* table = setup.sets.table.data() + size_t(s.choice.set) * V_count() * setup.sets.stride;
  size_t in_batch = 0;
  for (size_t i = 0; i < hits.size() && hits[i].ray < limit; ++i) {
    if (ends_fan(i, setup.progress)) return;
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
        Vec3 weight = b[k] * (Vec3(weights[r]) + colour * weights[r].w);
        if (through) weight *= through[i];
        for (size_t ch = 0; ch < channels(); ++ch) s.scalars[r * channels() + ch] = weight[int(ch)];
      }
      add_weighted_rows(Y + first_row[c] * wc, size_t(f.rows), channels(), w, s.scalars.data(), v);
    }
    for (size_t j = 0; j < J(); ++j) s.zb[in_batch * J() + j] = table[j * setup.sets.stride + h.ray];
    if (++in_batch == hit_batch) add_outer_products(s.zb.data(), J(), s.v.data(), wc, rows), in_batch = 0;
  }
  add_rest(s, in_batch, limit, out);
}

void MatrixGather::simulated(MatrixScratch& s, size_t r, std::span<const MatrixHit> hits, size_t limit,
                             float* out) const {
  const size_t w = width(), wc = channels() * w;
  std::fill(s.sh_rows.begin(), s.sh_rows.end(), 0.0f);
  const float* table = setup.sets.table.data() + size_t(s.choice.set) * V_count() * setup.sets.stride;
  const uint64_t key = hash64(hash64(setup.seed, 0x9a7e5), r);
  size_t in_batch = 0;
  for (size_t i = 0; i < hits.size() && hits[i].ray < limit; ++i) {
    if (ends_fan(i, setup.progress)) return;
    const uint32_t ray = hits[i].ray;
    const PathEnd end = follow_path(scene, setup.tracer, materials.reflection, {s.x[ray], s.y[ray], s.z[ray]},
                                    s.hits[ray], options.bounces, key, ray);
    if (!end.leaves) continue;
    const Vec3 throughput = s.passages.empty() ? end.throughput : end.throughput * s.passages[ray].hit;
    evaluate_sh(options.order, end.direction, s.column_row);
    float* v = s.v.data() + in_batch * wc;
    for (size_t c = 0; c < channels(); ++c)
      for (size_t k = 0; k < C(); ++k) v[c * w + k] = throughput[int(c)] * s.column_row[k];
    for (size_t j = 0; j < J(); ++j) s.zb[in_batch * J() + j] = table[j * setup.sets.stride + ray];
    if (++in_batch == hit_batch) add_outer_products(s.zb.data(), J(), s.v.data(), wc, s.sh_rows.data()), in_batch = 0;
  }
  add_rest(s, in_batch, limit, out);
}

void MatrixGather::add_rest(MatrixScratch& s, size_t in_batch, size_t limit, float* out) const {
  const size_t wc = channels() * width();
  if (in_batch) {
    std::fill(s.zb.data() + in_batch * J(), s.zb.data() + hit_batch * J(), 0.0f);
    add_outer_products(s.zb.data(), J(), s.v.data(), wc, s.sh_rows.data());
  }
  AlignedVector<float> sum(J() * wc);
  to_incident(s.sh_rows.data(), s.phi, wc, 1.0f / float(limit), sum.data());
  for (size_t i = 0; i < sum.size(); ++i) out[i] += sum[i];
}

bool MatrixGather::trace(MatrixScratch& s, size_t r, MatrixHits* hits) const {
  const Directions d = aim(s, r);
  if (!hits) {
    std::vector<AlignedVector<float>>& v = s.visible;
    trace_visible(setup.tracer, receivers.origins[r], d, std::span(v), setup.progress);
    size_t seen = 0;
    for (size_t j = 0; j < rays(); ++j) seen += v[0][j] > 0 || (v.size() == 3 && v[1][j] + v[2][j] > 0);
    return 2 * seen < rays() && is_buried(setup.tracer, receivers, r);
  }
  const bool passes = !s.passages.empty();
  trace_hits(setup.tracer, receivers.origins[r], d, s.hits.data(), s.passages, setup.progress);
  if (is_cancelled(setup.progress)) return false;
  size_t backs = 0;
  for (size_t j = 0; j < rays(); ++j) {
    const Hit& h = s.hits[j];
    for (size_t c = 0; c < s.visible.size(); ++c)
      s.visible[c][j] = passes ? s.passages[j].sky[int(c)] : h.triangle == none ? 1.0f : 0.0f;
    if (h.triangle == none) continue;
    const Corners* corner = corners().find(h.triangle, h.front);
    if (!corner) {
      backs += !setup.tracer.lets_pass(h.triangle);
      continue;
    }
    const Vec3 colour = setup.albedo_at(corner->part, h);
    if (passes) hits->weights.push_back(s.passages[j].hit);
    hits->hits.push_back({h.triangle << 1 | uint32_t(h.front),
                          uint32_t(j),
                          uint16_t(h.u * 65535.0f + 0.5f),
                          uint16_t(h.v * 65535.0f + 0.5f),
                          {float_to_half(colour.x), float_to_half(colour.y), float_to_half(colour.z)}});
  }
  return is_buried(setup.tracer, receivers, r, backs, rays());
}

}  // namespace lambent
