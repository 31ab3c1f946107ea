// Follows: local-deformable-prt, sections 3.1 and 4.1; variable projection as in G. Golub and V. Pereyra, "The
// differentiation of pseudo-inverses and nonlinear least squares problems whose variables separate" (1973), here with
// second derivatives, which the addition theorem makes cheap.
#include <lambent/basis/sh_tables.h>
#include <lambent/basis/zonal.h>
#include <lambent/compress/zonal_kernel.h>
#include <lambent/core/check.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/compress/zonal_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<double, zonal_lanes>;
using V = hn::Vec<F>;

// An array of vectors in the scratch memory.
struct Slots {
  double* p;
  V operator[](size_t i) const { return hn::Load(F(), p + i * hn::Lanes(F())); }
  void set(size_t i, V v) const { hn::Store(v, F(), p + i * hn::Lanes(F())); }
  void add(size_t i, V v) const { set(i, hn::Add((*this)[i], v)); }
};

// The fit of one group of lanes.
struct Fit {
  ZonalBatch& batch;
  size_t lane;  // first of the group
  double ridge;
  size_t N, B, C;
  Slots powers, legendre_m, local, frame, pairs, angles, factor, g, gradient, hessian, elimination;
  V norm;  // |t|^2 of the bands that are fitted

  Fit(ZonalBatch& b, size_t lane_, double ridge_, double*& memory)
      : batch(b),
        lane(lane_),
        ridge(ridge_),
        N(size_t(b.lobes)),
        B(size_t(b.bands())),
        C(size_t(b.channels)),
        norm(hn::Zero(F())) {
    auto take = [&](size_t n) {
      Slots s{memory};
      memory += n * hn::Lanes(F());
      return s;
    };
    const size_t order = size_t(b.order);
    powers = take(2 * (order + 1)), legendre_m = take(3 * order * order), local = take(N * B * C * 6),
    frame = take(N * 9);
    pairs = take(N * N * B * 3), angles = take(N * N * 6), factor = take(N * N), g = take(C * B * N),
    gradient = take(2 * N);
    hessian = take(4 * N * N), elimination = take(2 * N * N);
    for (int c = 0; c < b.channels; ++c)
      for (int k = sh_count(b.first_band); k < sh_count(b.order); ++k) {
        const V t = target(c, k);
        norm = hn::MulAdd(t, t, norm);
      }
  }

  V target(int c, int k) const { return hn::Load(F(), batch.target(c, k) + lane); }
  size_t h(size_t a, size_t b) const { return a * 2 * N + b; }

  // The target's bands at axis i: value, two tangent derivatives, and three second ones on the sphere, into `local`.
  void EvaluateTarget(size_t i) const {
    const F d;
    const ShTables& t = sh_tables();
    const int order = batch.order;
    const V x = frame[9 * i + 6], y = frame[9 * i + 7], z = frame[9 * i + 8];
    const Slots re = powers, im{powers.p + size_t(order + 1) * hn::Lanes(d)};
    re.set(0, hn::Set(d, 1.0)), im.set(0, hn::Zero(d));
    for (size_t m = 1; m < size_t(order); ++m) {
      re.set(m, hn::Sub(hn::Mul(re[m - 1], x), hn::Mul(im[m - 1], y)));
      im.set(m, hn::MulAdd(re[m - 1], y, hn::Mul(im[m - 1], x)));
    }
    // The Legendre part of (l, m), and its first two derivatives by z.
    auto at = [&](int l, int m) { return size_t(l * order + m) * 3; };
    for (int m = 0; m < order; ++m) {
      V q1 = hn::Set(d, t.diagonal[m]), d1 = hn::Zero(d), h1 = d1, q2 = d1, d2 = d1, h2 = d1;
      for (int l = m; l < order; ++l) {
        if (l > m) {
          const V a = hn::Set(d, t.a[l][m]), b = hn::Set(d, t.b[l][m]);
          const V q = hn::MulAdd(hn::Mul(a, z), q1, hn::Mul(b, q2));
          const V s = hn::MulAdd(a, hn::MulAdd(z, d1, q1), hn::Mul(b, d2));
          const V c = hn::MulAdd(a, hn::MulAdd(z, h1, hn::Add(d1, d1)), hn::Mul(b, h2));
          q2 = q1, d2 = d1, h2 = h1, q1 = q, d1 = s, h1 = c;
        }
        legendre_m.set(at(l, m), q1), legendre_m.set(at(l, m) + 1, d1), legendre_m.set(at(l, m) + 2, h1);
      }
    }
    const V ux = frame[9 * i], uy = frame[9 * i + 1], uz = frame[9 * i + 2];
    const V vx = frame[9 * i + 3], vy = frame[9 * i + 4], vz = frame[9 * i + 5];
    for (int c = 0; c < batch.channels; ++c)
      for (int l = batch.first_band; l < order; ++l) {
        // Of the polynomial in (x, y, z): value, gradient, and second derivatives; yy = -xx but for nothing, since (x +
        // iy)^m is harmonic in the plane.
        const V t0 = target(c, sh_index(l, 0));
        V value = hn::Mul(legendre_m[at(l, 0)], t0), gz = hn::Mul(legendre_m[at(l, 0) + 1], t0),
          zz = hn::Mul(legendre_m[at(l, 0) + 2], t0);
        V gx = hn::Zero(d), gy = gx, xx = gx, xy = gx, xz = gx, yz = gx;
        for (int m = 1; m <= l; ++m) {
          const size_t M = size_t(m);
          const V q = legendre_m[at(l, m)], q1 = legendre_m[at(l, m) + 1], q2 = legendre_m[at(l, m) + 2];
          const V plus = target(c, sh_index(l, m)), minus = target(c, sh_index(l, -m));
          const V f = hn::MulAdd(plus, re[M], hn::Mul(minus, im[M]));
          const V mm = hn::Set(d, double(m));
          const V fx = hn::Mul(mm, hn::MulAdd(plus, re[M - 1], hn::Mul(minus, im[M - 1])));
          const V fy = hn::Mul(mm, hn::Sub(hn::Mul(minus, re[M - 1]), hn::Mul(plus, im[M - 1])));
          value = hn::MulAdd(q, f, value), gz = hn::MulAdd(q1, f, gz), zz = hn::MulAdd(q2, f, zz);
          gx = hn::MulAdd(q, fx, gx), gy = hn::MulAdd(q, fy, gy), xz = hn::MulAdd(q1, fx, xz),
          yz = hn::MulAdd(q1, fy, yz);
          if (m > 1) {
            const V m2 = hn::Mul(q, hn::Set(d, double(m) * (m - 1)));
            xx = hn::MulAdd(m2, hn::MulAdd(plus, re[M - 2], hn::Mul(minus, im[M - 2])), xx);
            xy = hn::MulAdd(m2, hn::Sub(hn::Mul(minus, re[M - 2]), hn::Mul(plus, im[M - 2])), xy);
          }
        }
        auto along = [&](V ax, V ay, V az) { return hn::MulAdd(gx, ax, hn::MulAdd(gy, ay, hn::Mul(gz, az))); };
        auto second = [&](V ax, V ay, V az, V bx, V by, V bz) {
          const V hx = hn::MulAdd(xx, bx, hn::MulAdd(xy, by, hn::Mul(xz, bz)));
          const V hy = hn::MulAdd(xy, bx, hn::Sub(hn::Mul(yz, bz), hn::Mul(xx, by)));
          const V hz = hn::MulAdd(xz, bx, hn::MulAdd(yz, by, hn::Mul(zz, bz)));
          return hn::MulAdd(ax, hx, hn::MulAdd(ay, hy, hn::Mul(az, hz)));
        };
        const V outward = along(x, y, z);  // the sphere bends away from its tangent plane
        const size_t o = ((i * B + size_t(l - batch.first_band)) * C + size_t(c)) * 6;
        local.set(o, value), local.set(o + 1, along(ux, uy, uz)), local.set(o + 2, along(vx, vy, vz));
        local.set(o + 3, hn::Sub(second(ux, uy, uz, ux, uy, uz), outward));
        local.set(o + 4, second(ux, uy, uz, vx, vy, vz));
        local.set(o + 5, hn::Sub(second(vx, vy, vz, vx, vy, vz), outward));
      }
  }

  // Frames about the axes, and for each pair the Legendre polynomials of the angle between them with two derivatives.
  void EvaluatePairs(const Slots& axes) const {
    const F d;
    const V one = hn::Set(d, 1.0);
    for (size_t i = 0; i < N; ++i) {
      const V x = axes[3 * i], y = axes[3 * i + 1], z = axes[3 * i + 2];
      const V sign = hn::CopySign(one, z), a = hn::Neg(hn::Div(one, hn::Add(sign, z))), b = hn::Mul(hn::Mul(x, y), a);
      const V f[9] = {hn::MulAdd(hn::Mul(sign, a), hn::Mul(x, x), one),
                      hn::Mul(sign, b),
                      hn::Neg(hn::Mul(sign, x)),
                      b,
                      hn::MulAdd(hn::Mul(y, y), a, sign),
                      hn::Neg(y),
                      x,
                      y,
                      z};  // frame_about
      for (size_t k = 0; k < 9; ++k) frame.set(9 * i + k, f[k]);
    }
    auto dot = [&](size_t a, size_t b) {
      return hn::MulAdd(frame[a], frame[b],
                        hn::MulAdd(frame[a + 1], frame[b + 1], hn::Mul(frame[a + 2], frame[b + 2])));
    };
    for (size_t i = 0; i < N; ++i)
      for (size_t j = 0; j < N; ++j) {
        // s_j along the tangents at i, then the products of the tangents.
        const size_t o = (i * N + j) * 6;
        angles.set(o, dot(9 * j + 6, 9 * i)), angles.set(o + 1, dot(9 * j + 6, 9 * i + 3));
        if (j < i) continue;
        for (size_t a = 0; a < 2; ++a)
          for (size_t b = 0; b < 2; ++b) {
            const V product = dot(9 * i + 3 * a, 9 * j + 3 * b);
            angles.set(o + 2 + 2 * a + b, product), angles.set((j * N + i) * 6 + 2 + 2 * b + a, product);
          }
        const V x = i == j ? one : dot(9 * i + 6, 9 * j + 6);
        V p1 = hn::Zero(d), d1 = p1, h1 = p1, p0 = one, d0 = p1, h0 = p1;  // of l - 1 and l, from l = 0
        for (int l = 0; l < batch.order; ++l) {
          if (l > 0) {
            const double L = l;
            const V p =
                hn::Sub(hn::Mul(hn::Set(d, (2 * L - 1) / L), hn::Mul(x, p0)), hn::Mul(hn::Set(d, (L - 1) / L), p1));
            const V s = hn::MulAdd(hn::Set(d, 2 * L - 1), p0, d1), c = hn::MulAdd(hn::Set(d, 2 * L - 1), d0, h1);
            p1 = p0, d1 = d0, h1 = h0, p0 = p, d0 = s, h0 = c;
          }
          if (l < batch.first_band) continue;
          const V k = hn::Set(d, band_energy(l));
          for (size_t at : {((i * N + j) * B + size_t(l - batch.first_band)) * 3,
                            ((j * N + i) * B + size_t(l - batch.first_band)) * 3})
            pairs.set(at, hn::Mul(k, p0)), pairs.set(at + 1, hn::Mul(k, d0)), pairs.set(at + 2, hn::Mul(k, h0));
        }
      }
  }
  size_t pair(size_t i, size_t j, size_t b) const { return ((i * N + j) * B + b) * 3; }
  size_t at_axis(size_t i, size_t b, size_t c) const { return ((i * B + b) * C + c) * 6; }

  // Cholesky factor of band b's Gram matrix plus ridge, its diagonal inverted.
  void Factor(size_t b) const {
    const F d;
    for (size_t i = 0; i < N; ++i)
      for (size_t j = 0; j <= i; ++j) {
        V sum = pairs[pair(i, j, b)];
        if (i == j) sum = hn::Add(sum, hn::Set(d, ridge));
        for (size_t k = 0; k < j; ++k) sum = hn::NegMulAdd(factor[i * N + k], factor[j * N + k], sum);
        if (i == j) {
          // Rounding must not make the root of a negative number.
          factor.set(i * N + i, hn::Div(hn::Set(d, 1.0), hn::Sqrt(hn::Max(sum, hn::Set(d, 1e-14)))));
        } else {
          factor.set(i * N + j, hn::Mul(sum, factor[j * N + j]));
        }
      }
  }

  // psi / 2's gradient and Hessian by the angles, from band b and channel c, whose coefficients are known.
  void Differentiate(size_t b, size_t c) const {
    const F d;
    const Slots G{g.p + (c * B + b) * N * hn::Lanes(d)};
    for (size_t k = 0; k < N; ++k) {
      // The residual's derivatives at axis k.
      const size_t o = at_axis(k, b, c);
      V ru = local[o + 1], rv = local[o + 2], uu = local[o + 3], uv = local[o + 4], vv = local[o + 5];
      for (size_t j = 0; j < N; ++j) {
        const V su = angles[(k * N + j) * 6], sv = angles[(k * N + j) * 6 + 1];
        const V first = hn::Mul(G[j], pairs[pair(k, j, b) + 1]), second = hn::Mul(G[j], pairs[pair(k, j, b) + 2]);
        const V cosine = j == k ? hn::Set(d, 1.0)
                                : hn::MulAdd(frame[9 * k + 6], frame[9 * j + 6],
                                             hn::MulAdd(frame[9 * k + 7], frame[9 * j + 7],
                                                        hn::Mul(frame[9 * k + 8], frame[9 * j + 8])));
        if (j != k) {
          ru = hn::NegMulAdd(first, su, ru), rv = hn::NegMulAdd(first, sv, rv);
          uu = hn::NegMulAdd(second, hn::Mul(su, su), uu), uv = hn::NegMulAdd(second, hn::Mul(su, sv), uv);
          vv = hn::NegMulAdd(second, hn::Mul(sv, sv), vv);
        }
        uu = hn::MulAdd(first, cosine, uu), vv = hn::MulAdd(first, cosine, vv);
      }
      const V own = hn::Mul(G[k], pairs[pair(k, k, b) + 1]);
      gradient.add(2 * k, hn::Neg(hn::Mul(G[k], ru))), gradient.add(2 * k + 1, hn::Neg(hn::Mul(G[k], rv)));
      hessian.add(h(2 * k, 2 * k), hn::Mul(G[k], hn::Sub(own, uu)));
      hessian.add(h(2 * k + 1, 2 * k), hn::Neg(hn::Mul(G[k], uv)));
      hessian.add(h(2 * k + 1, 2 * k + 1), hn::Mul(G[k], hn::Sub(own, vv)));
      for (size_t j = 0; j < k; ++j) {
        const V gg = hn::Mul(G[k], G[j]), first = hn::Mul(gg, pairs[pair(k, j, b) + 1]),
                second = hn::Mul(gg, pairs[pair(k, j, b) + 2]);
        for (size_t a = 0; a < 2; ++a)
          for (size_t e = 0; e < 2; ++e)
            hessian.add(h(2 * k + a, 2 * j + e),
                        hn::MulAdd(second, hn::Mul(angles[(k * N + j) * 6 + a], angles[(j * N + k) * 6 + e]),
                                   hn::Mul(first, angles[(k * N + j) * 6 + 2 + 2 * a + e])));
      }
      // How the normal equations move with these two angles.
      for (size_t j = 0; j < N; ++j) {
        const V slope = hn::Mul(G[k], pairs[pair(k, j, b) + 1]);
        elimination.set(j * 2 * N + 2 * k, j == k ? hn::Neg(ru) : hn::Mul(slope, angles[(k * N + j) * 6]));
        elimination.set(j * 2 * N + 2 * k + 1, j == k ? hn::Neg(rv) : hn::Mul(slope, angles[(k * N + j) * 6 + 1]));
      }
    }
    // The coefficients follow the axes: Schur complement.
    for (size_t i = 0; i < N; ++i)
      for (size_t a = 0; a < 2 * N; ++a) {
        V sum = elimination[i * 2 * N + a];
        for (size_t k = 0; k < i; ++k) sum = hn::NegMulAdd(factor[i * N + k], elimination[k * 2 * N + a], sum);
        elimination.set(i * 2 * N + a, hn::Mul(sum, factor[i * N + i]));
      }
    for (size_t a = 0; a < 2 * N; ++a)
      for (size_t e = 0; e <= a; ++e) {
        V sum = hessian[h(a, e)];
        for (size_t i = 0; i < N; ++i) sum = hn::NegMulAdd(elimination[i * 2 * N + a], elimination[i * 2 * N + e], sum);
        hessian.set(h(a, e), sum);
      }
  }

  // At these axes: psi; g; and, if wanted, derivatives of psi / 2 (lower triangle of the Hessian).
  V Evaluate(const Slots& axes, bool derivatives) const {
    const F d;
    EvaluatePairs(axes);
    for (size_t i = 0; i < N; ++i) EvaluateTarget(i);
    if (derivatives) {
      for (size_t i = 0; i < 2 * N; ++i) gradient.set(i, hn::Zero(d));
      for (size_t i = 0; i < 4 * N * N; ++i) hessian.set(i, hn::Zero(d));
    }
    V psi = norm;
    for (size_t b = 0; b < B; ++b) {
      Factor(b);
      for (size_t c = 0; c < C; ++c) {
        const Slots G{g.p + (c * B + b) * N * hn::Lanes(d)};
        for (size_t i = 0; i < N; ++i) {
          V sum = local[at_axis(i, b, c)];
          for (size_t k = 0; k < i; ++k) sum = hn::NegMulAdd(factor[i * N + k], G[k], sum);
          G.set(i, hn::Mul(sum, factor[i * N + i]));
        }
        for (size_t i = N; i-- > 0;) {
          V sum = G[i];
          for (size_t k = i + 1; k < N; ++k) sum = hn::NegMulAdd(factor[k * N + i], G[k], sum);
          G.set(i, hn::Mul(sum, factor[i * N + i]));
        }
        for (size_t i = 0; i < N; ++i) psi = hn::NegMulAdd(local[at_axis(i, b, c)], G[i], psi);
        if (derivatives) Differentiate(b, c);
      }
    }
    return hn::Max(psi, hn::Zero(d));
  }
};

void Refine(ZonalBatch& batch, const ZonalRefineOptions& options) {
  const F d;
  const size_t N = size_t(batch.lobes), angles = 2 * N, lanes = hn::Lanes(d);
  for (size_t lane = 0; lane < zonal_lanes; lane += lanes) {
    double* memory = batch.scratch.data();
    Fit fit(batch, lane, options.ridge, memory);
    auto take = [&](size_t n) {
      Slots s{memory};
      memory += n * lanes;
      return s;
    };
    const Slots trial = take(3 * N), best = take(3 * N), slope = take(angles), curve = take(angles * angles),
                M = take(angles * angles);
    const Slots pivot = take(angles), step = take(angles);
    for (size_t i = 0; i < 3 * N; ++i) trial.set(i, hn::Load(d, batch.axes.data() + i * zonal_lanes + lane));
    auto keep = [&](auto mask, V psi, V& best_psi) {
      best_psi = hn::IfThenElse(mask, psi, best_psi);
      for (size_t i = 0; i < 3 * N; ++i) best.set(i, hn::IfThenElse(mask, trial[i], best[i]));
      for (size_t i = 0; i < fit.C * fit.B * N; ++i) {
        double* g = batch.g.data() + i * zonal_lanes + lane;
        hn::Store(hn::IfThenElse(mask, fit.g[i], hn::Load(d, g)), d, g);
      }
    };
    V psi = hn::Zero(d), damping = hn::Set(d, 1e-3);
    keep(hn::Eq(psi, psi), fit.Evaluate(trial, options.iterations > 0), psi);
    auto moved = hn::Eq(psi, psi), done = hn::Ne(psi, psi);
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      for (size_t a = 0; a < angles; ++a) {
        slope.set(a, hn::IfThenElse(moved, fit.gradient[a], slope[a]));
        for (size_t e = 0; e <= a; ++e)
          curve.set(fit.h(a, e), hn::IfThenElse(moved, fit.hessian[fit.h(a, e)], curve[fit.h(a, e)]));
      }
      // (curve + damping) step = -slope by a factorisation L D L' whose D is made positive, so that the step always
      // descends.
      V scale = hn::Set(d, 1e-30);
      for (size_t a = 0; a < angles; ++a)
        scale = hn::MulAdd(hn::Abs(curve[fit.h(a, a)]), hn::Set(d, 1.0 / double(angles)), scale);
      const V shift = hn::Mul(damping, scale), least = hn::Mul(scale, hn::Set(d, 1e-6));
      for (size_t a = 0; a < angles; ++a) {
        for (size_t e = 0; e <= a; ++e) {
          V sum = curve[fit.h(a, e)];
          if (a == e) sum = hn::Add(sum, shift);
          for (size_t k = 0; k < e; ++k) sum = hn::NegMulAdd(hn::Mul(M[fit.h(a, k)], M[fit.h(e, k)]), pivot[k], sum);
          if (a == e) pivot.set(a, hn::Max(hn::Abs(sum), least));
          else M.set(fit.h(a, e), hn::Div(sum, pivot[e]));
        }
        V sum = hn::Neg(slope[a]);
        for (size_t k = 0; k < a; ++k) sum = hn::NegMulAdd(M[fit.h(a, k)], step[k], sum);
        step.set(a, sum);
      }
      V gain = hn::Zero(d), longest = hn::Zero(d);
      for (size_t a = angles; a-- > 0;) {
        V sum = hn::Div(step[a], pivot[a]);
        for (size_t k = a + 1; k < angles; ++k) sum = hn::NegMulAdd(M[fit.h(k, a)], step[k], sum);
        step.set(a, sum);
        gain = hn::NegMulAdd(sum, slope[a], gain);
      }
      for (size_t i = 0; i < N; ++i)
        longest = hn::Max(longest, hn::MulAdd(step[2 * i], step[2 * i], hn::Mul(step[2 * i + 1], step[2 * i + 1])));
      const V enough = hn::MulAdd(psi, hn::Set(d, options.tolerance), hn::Mul(fit.norm, hn::Set(d, 1e-16)));
      done = hn::Or(done, hn::Or(hn::Le(gain, enough), hn::Gt(damping, hn::Set(d, 1e8))));
      if (hn::AllTrue(d, done)) break;

      constexpr double reach = 0.5;  // radians, of the axis that turns most
      const V share =
          hn::Min(hn::Set(d, 1.0), hn::Div(hn::Set(d, reach), hn::Sqrt(hn::Add(longest, hn::Set(d, 1e-30)))));
      fit.EvaluatePairs(best);  // the frames that the step refers to
      for (size_t i = 0; i < N; ++i) {
        const V a = hn::Mul(share, step[2 * i]), b = hn::Mul(share, step[2 * i + 1]);
        V axis[3], length = hn::Zero(d);
        for (size_t k = 0; k < 3; ++k) {
          axis[k] = hn::MulAdd(a, fit.frame[9 * i + k], hn::MulAdd(b, fit.frame[9 * i + 3 + k], best[3 * i + k]));
          length = hn::MulAdd(axis[k], axis[k], length);
        }
        length = hn::Sqrt(length);
        for (size_t k = 0; k < 3; ++k) trial.set(3 * i + k, hn::Div(axis[k], length));
      }
      const V trial_psi = fit.Evaluate(trial, true);
      moved = hn::AndNot(done, hn::Lt(trial_psi, psi));
      keep(moved, trial_psi, psi);
      damping = hn::IfThenElse(moved, hn::Mul(damping, hn::Set(d, 0.15)),
                               hn::Mul(hn::Max(damping, hn::Set(d, 1e-3)), hn::Set(d, 6.0)));
    }
    hn::Store(psi, d, batch.psi.data() + lane);
    for (size_t i = 0; i < 3 * N; ++i) hn::Store(best[i], d, batch.axes.data() + i * zonal_lanes + lane);
  }
}

void Derivatives(ZonalBatch& batch, double ridge, double* psi, double* gradient, double* hessian) {
  const F d;
  const size_t N = size_t(batch.lobes), lanes = hn::Lanes(d);
  for (size_t lane = 0; lane < zonal_lanes; lane += lanes) {
    double* memory = batch.scratch.data();
    Fit fit(batch, lane, ridge, memory);
    const Slots axes{memory};
    for (size_t i = 0; i < 3 * N; ++i) axes.set(i, hn::Load(d, batch.axes.data() + i * zonal_lanes + lane));
    hn::StoreU(fit.Evaluate(axes, true), d, psi + lane);
    for (size_t a = 0; a < 2 * N; ++a) {
      hn::StoreU(hn::Mul(hn::Set(d, 2.0), fit.gradient[a]), d, gradient + a * zonal_lanes + lane);
      for (size_t e = 0; e < 2 * N; ++e)
        hn::StoreU(hn::Mul(hn::Set(d, 2.0), fit.hessian[fit.h(std::max(a, e), std::min(a, e))]), d,
                   hessian + (a * 2 * N + e) * zonal_lanes + lane);
    }
  }
}

// Of each direction in turn, what a single lobe there takes off psi; keeps the best.
void ChooseDirection(ZonalBatch& batch, const double* directions, const double* y, size_t count, double* gain) {
  const F d;
  const size_t C = size_t(sh_count(batch.order)), first = size_t(sh_count(batch.first_band));
  for (size_t lane = 0; lane < zonal_lanes; lane += hn::Lanes(d)) {
    V best = hn::Set(d, -1.0), x = hn::Zero(d), ay = x, z = x;
    for (size_t i = 0; i < count; ++i) {
      V sum = hn::Zero(d);
      for (int c = 0; c < batch.channels; ++c) {
        size_t k = first;
        for (int l = batch.first_band; l < batch.order; ++l) {
          V value = hn::Zero(d);
          for (; k < size_t(sh_count(l + 1)); ++k)
            value = hn::MulAdd(hn::Set(d, y[i * C + k]), hn::Load(d, batch.target(c, int(k)) + lane), value);
          sum = hn::MulAdd(hn::Mul(value, value), hn::Set(d, 1 / band_energy(l)), sum);
        }
      }
      const auto better = hn::Gt(sum, best);
      best = hn::IfThenElse(better, sum, best);
      x = hn::IfThenElse(better, hn::Set(d, directions[3 * i]), x),
      ay = hn::IfThenElse(better, hn::Set(d, directions[3 * i + 1]), ay);
      z = hn::IfThenElse(better, hn::Set(d, directions[3 * i + 2]), z);
    }
    hn::StoreU(best, d, gain + lane);
    hn::Store(x, d, batch.axis(0, 0) + lane), hn::Store(ay, d, batch.axis(0, 1) + lane),
        hn::Store(z, d, batch.axis(0, 2) + lane);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

namespace {
HWY_EXPORT(Refine);
HWY_EXPORT(Derivatives);
HWY_EXPORT(ChooseDirection);
}  // namespace

ZonalBatch make_zonal_batch(int order, int first_band, int channels, int lobes) {
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order && first_band >= 0 && first_band < order && channels >= 1 &&
                channels <= 3);
  LAMBENT_CHECK(lobes >= 1 && lobes <= max_zonal_lobes);
  ZonalBatch b;
  b.order = order, b.first_band = first_band, b.channels = channels, b.lobes = lobes;
  const size_t N = size_t(lobes), B = size_t(b.bands()), C = size_t(channels), n = size_t(order);
  b.t.assign(C * n * n * zonal_lanes, 0.0);
  b.axes.assign(3 * N * zonal_lanes, 0.0), b.g.assign(C * B * N * zonal_lanes, 0.0), b.psi.assign(zonal_lanes, 0.0);
  for (size_t i = 0; i < N * zonal_lanes; ++i)
    b.axes[i / zonal_lanes * 3 * zonal_lanes + 2 * zonal_lanes + i % zonal_lanes] = 1;
  const size_t fit = 2 * (n + 1) + 3 * n * n + N * B * C * 6 + N * 9 + N * N * B * 3 + N * N * 6 + N * N + C * B * N +
                     2 * N + 6 * N * N;
  const size_t search = 6 * N + 3 * 2 * N + 8 * N * N;
  b.scratch.assign((fit + search) * zonal_lanes, 0.0);
  return b;
}

void refine_zonal(ZonalBatch& batch, const ZonalRefineOptions& options) {
  HWY_DYNAMIC_DISPATCH(Refine)(batch, options);
}

ZonalDerivatives differentiate_zonal(ZonalBatch& batch, double ridge) {
  const size_t n = 2 * size_t(batch.lobes);
  ZonalDerivatives r;
  r.psi.resize(zonal_lanes), r.gradient.resize(n * zonal_lanes), r.hessian.resize(n * n * zonal_lanes);
  HWY_DYNAMIC_DISPATCH(Derivatives)(batch, ridge, r.psi.data(), r.gradient.data(), r.hessian.data());
  return r;
}

ZonalStarts make_zonal_starts(int order, int n) {
  ZonalStarts s;
  s.order = order;
  const size_t C = size_t(sh_count(order));
  auto add = [&](Vec3d v) {
    v = normalize(v);
    s.directions.insert(s.directions.end(), {v.x, v.y, v.z});
    s.y.resize(s.y.size() + C);
    evaluate_sh(order, v, std::span(s.y).last(C));
  };
  // The face +z, and of the four side faces the half above z = 0: opposite directions are the same lobe.
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double a = 2 * (i + 0.5) / n - 1, b = 2 * (j + 0.5) / n - 1;
      add({a, b, 1});
      if (b > 0)
        for (double side : {-1.0, 1.0}) add({side, a, b}), add({a, side, b});
    }
  return s;
}

void choose_start(ZonalBatch& batch, const ZonalStarts& starts) {
  LAMBENT_CHECK(starts.order == batch.order);
  double gain[zonal_lanes];
  HWY_DYNAMIC_DISPATCH(ChooseDirection)
  (batch, starts.directions.data(), starts.y.data(), starts.directions.size() / 3, gain);
  if (batch.order < 2) return;
  double y[sh_count(max_sh_order)];
  for (size_t lane = 0; lane < zonal_lanes; ++lane) {
    Vec3d axis(0.0);
    for (int c = 0; c < batch.channels; ++c)
      axis += Vec3d(-batch.target(c, 3)[lane], -batch.target(c, 1)[lane], batch.target(c, 2)[lane]);
    const double length = lambent::length(axis);
    if (!(length > 0)) continue;
    axis /= length;
    evaluate_sh(batch.order, axis, y);
    double sum = 0;
    for (int c = 0; c < batch.channels; ++c)
      for (int l = batch.first_band; l < batch.order; ++l) {
        double value = 0;
        for (int k = sh_count(l); k < sh_count(l + 1); ++k) value += y[k] * batch.target(c, k)[lane];
        sum += value * value / band_energy(l);
      }
    if (sum > gain[lane])
      for (int k = 0; k < 3; ++k) batch.axis(0, k)[lane] = axis[k];
  }
}

void zonal_residual(const ZonalBatch& batch, double* out) {
  std::copy(batch.t.begin(), batch.t.end(), out);
  const size_t C = size_t(sh_count(batch.order));
  double y[sh_count(max_sh_order)];
  for (size_t lane = 0; lane < zonal_lanes; ++lane)
    for (size_t i = 0; i < size_t(batch.lobes); ++i) {
      const double* s = batch.axes.data() + 3 * i * zonal_lanes + lane;
      evaluate_sh(batch.order, Vec3d(s[0], s[zonal_lanes], s[2 * zonal_lanes]), y);
      for (size_t c = 0; c < size_t(batch.channels); ++c)
        for (int l = batch.first_band; l < batch.order; ++l) {
          const size_t band = c * size_t(batch.bands()) + size_t(l - batch.first_band);
          const double g = batch.g[(band * size_t(batch.lobes) + i) * zonal_lanes + lane];
          for (size_t k = size_t(sh_count(l)); k < size_t(sh_count(l + 1)); ++k)
            out[(c * C + k) * zonal_lanes + lane] -= g * y[k];
        }
    }
}

}  // namespace lambent
#endif
