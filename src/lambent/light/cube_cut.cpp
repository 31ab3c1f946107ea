// Follows: locally-adaptive-products, section 4 (cubemap texels weighted by their solid angles). What of a polygon lies
// below a line, its area and moments, are line integrals along its sides where those beyond the line are moved onto it.
#include <lambent/light/cube_cut.h>
#include <lambent/light/cube_parts.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/light/cube_cut.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;
using I = hn::RebindToSigned<F>;
using V = hn::Vec<F>;
using VI = hn::Vec<I>;

HWY_INLINE V Fill(float x) { return hn::Set(F(), x); }
HWY_INLINE VI FillI(int x) { return hn::Set(I(), x); }

// As cube_corner().
void PlaceCorners(int size, size_t padded, CornerRow& c) {
  const F d;
  const I di;
  const V half = Fill(0.5f * float(size)), one = Fill(1.0f), zero = hn::Zero(d);
  const VI last = FillI(size - 1);
  for (size_t i = 0; i < padded; i += hn::Lanes(d)) {
    const V x = hn::Load(d, &c.x[i]), y = hn::Load(d, &c.y[i]), z = hn::Load(d, &c.z[i]);
    const V ax = hn::Abs(x), ay = hn::Abs(y), az = hn::Abs(z);
    const auto on_x = hn::And(hn::Ge(ax, ay), hn::Ge(ax, az)), on_y = hn::AndNot(on_x, hn::Ge(ay, az));
    const V most = hn::IfThenElse(on_x, ax, hn::IfThenElse(on_y, ay, az));
    const V along = hn::IfThenElse(on_x, x, hn::IfThenElse(on_y, y, z));
    const auto ahead = hn::Gt(along, zero);
    // cube_point() the other way round: u and v by face.
    const V u =
        hn::IfThenElse(on_x, hn::IfThenElse(ahead, hn::Neg(z), z), hn::IfThenElse(hn::Or(on_y, ahead), x, hn::Neg(x)));
    const V v = hn::IfThenElse(on_y, hn::IfThenElse(ahead, z, hn::Neg(z)), hn::Neg(y));
    const V pu = hn::Mul(hn::Add(hn::Div(u, most), one), half), pv = hn::Mul(hn::Add(hn::Div(v, most), one), half);
    const V face = hn::Add(hn::IfThenElse(on_x, zero, hn::IfThenElse(on_y, Fill(2.0f), Fill(4.0f))),
                           hn::IfThenElse(ahead, zero, one));
    hn::Store(pu, d, &c.u[i]), hn::Store(pv, d, &c.v[i]);
    hn::Store(hn::ConvertTo(di, face), di, &c.face[i]);
    hn::Store(hn::Min(hn::ConvertTo(di, pu), last), di, &c.column[i]);
    hn::Store(hn::Min(hn::ConvertTo(di, pv), last), di, &c.row[i]);
  }
}

// Area and first moments of a part of a polygon.
struct Moments {
  V area, x, y;
};
HWY_INLINE void AddSide(Moments& m, V xa, V ya, V xb, V yb) {
  const V dy = hn::Sub(yb, ya), sum = hn::Add(xa, xb), sixth = hn::Mul(dy, Fill(1.0f / 6));
  m.area = hn::MulAdd(hn::Mul(Fill(0.5f), dy), sum, m.area);
  m.x = hn::MulAdd(sixth, hn::NegMulAdd(xa, xb, hn::Mul(sum, sum)), m.x);
  m.y = hn::MulAdd(sixth, hn::MulAdd(sum, hn::Add(ya, yb), hn::MulAdd(xa, ya, hn::Mul(xb, yb))), m.y);
}
HWY_INLINE Moments Less(const Moments& a, const Moments& b) {
  return {hn::Sub(a.area, b.area), hn::Sub(a.x, b.x), hn::Sub(a.y, b.y)};
}

// The four parts of quads that the lines x = 0 and y = 0 cut: left and right below, left and right above.
HWY_INLINE void CutQuads(const V (&x)[4], const V (&y)[4], Moments (&part)[4]) {
  const V zero = hn::Zero(F()), one = Fill(1.0f);
  Moments all{zero, zero, zero}, left = all, below = all, both = all;
  for (size_t i = 0; i < 4; ++i) {
    const size_t j = (i + 1) % 4;
    const V dx = hn::Sub(x[j], x[i]), dy = hn::Sub(y[j], y[i]);
    // Where the side meets the lines; at its end where it does not.
    auto meet = [&](V a, V b, V step) HWY_ATTR {
      const auto crosses = hn::Lt(hn::Mul(a, b), zero);
      return hn::IfThenElse(crosses, hn::Div(hn::Neg(a), hn::IfThenElse(crosses, step, one)), one);
    };
    const V tx = meet(x[i], x[j], dx), ty = meet(y[i], y[j], dy);
    const V t1 = hn::Min(tx, ty), t2 = hn::Max(tx, ty);
    const V x1 = hn::MulAdd(t1, dx, x[i]), y1 = hn::MulAdd(t1, dy, y[i]), x2 = hn::MulAdd(t2, dx, x[i]),
            y2 = hn::MulAdd(t2, dy, y[i]);
    const V at_x[4] = {x[i], hn::IfThenElse(hn::Lt(t1, one), x1, x[j]), hn::IfThenElse(hn::Lt(t2, one), x2, x[j]),
                       x[j]};
    const V at_y[4] = {y[i], hn::IfThenElse(hn::Lt(t1, one), y1, y[j]), hn::IfThenElse(hn::Lt(t2, one), y2, y[j]),
                       y[j]};
    AddSide(all, x[i], y[i], x[j], y[j]);
    for (size_t k = 0; k < 3; ++k) {
      const V xa = at_x[k], ya = at_y[k], xb = at_x[k + 1], yb = at_y[k + 1];
      const V la = hn::Min(xa, zero), lb = hn::Min(xb, zero), ba = hn::Min(ya, zero), bb = hn::Min(yb, zero);
      AddSide(left, la, ya, lb, yb), AddSide(below, xa, ba, xb, bb), AddSide(both, la, ba, lb, bb);
    }
  }
  part[0] = both, part[1] = Less(below, both), part[2] = Less(left, both), part[3] = Less(Less(all, left), part[1]);
}

// Lanes of texels that are cut in four parts at most, and what of them lies where.
struct Cut {
  alignas(64) float share[4][16], x[4][16], y[4][16], z[4][16];
  alignas(64) int32_t texel[4][16], simple[16];
};

HWY_INLINE VI CubeTexel(int size, VI face, VI column, VI row) {
  const VI side = FillI(size / block_side), low = FillI(block_side - 1);
  const VI block =
      hn::Add(hn::Mul(hn::Add(hn::Mul(face, side), hn::ShiftRight<4>(row)), side), hn::ShiftRight<4>(column));
  return hn::Add(hn::ShiftLeft<8>(block), hn::Add(hn::ShiftLeft<4>(hn::And(row, low)), hn::And(column, low)));
}

// As cut_texel() where a texel meets one face, and two columns and two rows of it at most.
void CutLanes(int size, const CornerRow& above, const CornerRow& below, size_t i, Cut& out) {
  const F d;
  const I di;
  const CornerRow* rows[4] = {&above, &above, &below, &below};
  const size_t at[4] = {i, i + 1, i + 1, i};
  V u[4], v[4];
  VI face = hn::LoadU(di, &above.face[i]), c0 = hn::LoadU(di, &above.column[i]), c1 = c0,
     r0 = hn::LoadU(di, &above.row[i]), r1 = r0;
  auto simple = hn::Eq(face, face);
  for (size_t k = 0; k < 4; ++k) {
    u[k] = hn::LoadU(d, &rows[k]->u[at[k]]), v[k] = hn::LoadU(d, &rows[k]->v[at[k]]);
    const VI c = hn::LoadU(di, &rows[k]->column[at[k]]), r = hn::LoadU(di, &rows[k]->row[at[k]]);
    simple = hn::And(simple, hn::Eq(face, hn::LoadU(di, &rows[k]->face[at[k]])));
    c0 = hn::Min(c0, c), c1 = hn::Max(c1, c), r0 = hn::Min(r0, r), r1 = hn::Max(r1, r);
  }
  const VI one = FillI(1), two = FillI(2);
  simple = hn::And(simple, hn::And(hn::Lt(hn::Sub(c1, c0), two), hn::Lt(hn::Sub(r1, r0), two)));
  const V cx = hn::ConvertTo(d, c1), cy = hn::ConvertTo(d, r1);
  for (size_t k = 0; k < 4; ++k) u[k] = hn::Sub(u[k], cx), v[k] = hn::Sub(v[k], cy);
  Moments part[4];
  CutQuads(u, v, part);
  const V zero = hn::Zero(d), all = hn::Add(hn::Add(part[0].area, part[1].area), hn::Add(part[2].area, part[3].area));
  const V sign = hn::IfThenElse(hn::Lt(all, zero), Fill(-1.0f), Fill(1.0f)), least = hn::Mul(Fill(1e-6f), hn::Abs(all));
  simple = hn::And(simple, hn::RebindMask(di, hn::Gt(hn::Abs(all), Fill(1e-12f))));
  const V scale = Fill(2 / float(size)), unit = Fill(1.0f);
  V solid[4], total = zero;
  const V face_f = hn::ConvertTo(d, face);
  const auto is = [&](float f) HWY_ATTR { return hn::Eq(face_f, Fill(f)); };
  for (size_t k = 0; k < 4; ++k) {
    const V area = hn::Mul(part[k].area, sign);
    const auto there = hn::Gt(area, least);
    const V by = hn::Div(unit, hn::IfThenElse(there, part[k].area, unit));
    const V pu = hn::Sub(hn::Mul(hn::MulAdd(part[k].x, by, cx), scale), unit),
            pv = hn::Sub(hn::Mul(hn::MulAdd(part[k].y, by, cy), scale), unit);
    const V inverse = hn::Div(unit, hn::Sqrt(hn::MulAdd(pu, pu, hn::MulAdd(pv, pv, unit))));
    solid[k] = hn::IfThenElseZero(there, hn::Mul(area, hn::Mul(inverse, hn::Mul(inverse, inverse))));
    total = hn::Add(total, solid[k]);
    // cube_point(), by face.
    const V a = hn::Mul(pu, inverse), b = hn::Mul(pv, inverse), na = hn::Neg(a), nb = hn::Neg(b), nc = hn::Neg(inverse);
    const V x = hn::IfThenElse(is(0), inverse, hn::IfThenElse(is(1), nc, hn::IfThenElse(is(5), na, a)));
    const V y = hn::IfThenElse(is(2), inverse, hn::IfThenElse(is(3), nc, nb));
    const V z = hn::IfThenElse(
        is(0), na,
        hn::IfThenElse(is(1), a,
                       hn::IfThenElse(is(2), b, hn::IfThenElse(is(3), nb, hn::IfThenElse(is(4), inverse, nc)))));
    hn::Store(x, d, out.x[k]), hn::Store(y, d, out.y[k]), hn::Store(z, d, out.z[k]);
    const VI column = hn::Sub(c1, FillI(k % 2 ? 0 : 1)), row = hn::Sub(r1, FillI(k < 2 ? 1 : 0));
    hn::Store(CubeTexel(size, face, column, row), di, out.texel[k]);
  }
  const V by = hn::Div(unit, hn::IfThenElse(hn::Gt(total, zero), total, unit));
  for (size_t k = 0; k < 4; ++k) hn::Store(hn::Mul(solid[k], by), d, out.share[k]);
  hn::Store(hn::IfThenElseZero(simple, one), di, out.simple);
}

HWY_INLINE void Add(CubeSum& to, float share, Vec3 radiance, float channels, Vec3 direction) {
  const hn::CappedTag<float, 4> d;
  alignas(16) const float e[4] = {share * radiance.x, share * radiance.y, share * radiance.z, 0};
  const float m = share * channels;
  alignas(16) const float v[4] = {m * direction.x, m * direction.y, m * direction.z, 0};
  for (size_t i = 0; i < 4; i += hn::Lanes(d)) {
    hn::Store(hn::Add(hn::Load(d, to.energy + i), hn::Load(d, e + i)), d, to.energy + i);
    hn::Store(hn::Add(hn::Load(d, to.moment + i), hn::Load(d, v + i)), d, to.moment + i);
  }
}

// One of those that are left.
void AddOne(int size, const CornerRow& above, const CornerRow& below, size_t i, Vec3 radiance, float channels,
            float solid_angle, CubeParts& parts, CubeSum* sums) {
  auto corner = [](const CornerRow& c, size_t k) {
    return CubeCorner{{c.x[k], c.y[k], c.z[k]}, c.face[k], {c.u[k], c.v[k]}, c.column[k], c.row[k]};
  };
  const CubeCorner a = corner(above, i), b = corner(above, i + 1), c = corner(below, i + 1), d = corner(below, i);
  cut_texel(size, {&a, &b, &c, &d}, parts);
  for (int k = 0; k < parts.count; ++k) {
    const CubePart& p = parts.at[k];
    Add(sums[cube_texel(size, p.face, p.column, p.row)], p.solid_angle * solid_angle / parts.total, radiance, channels,
        p.direction);
  }
}

void AddTexels(int size, const CornerRow& above, const CornerRow& below, const Vec3* radiance, int split, int count,
               float solid_angle, CubeSum* sums) {
  const size_t lanes = hn::Lanes(F()), n = size_t(count);
  Cut cut;
  CubeParts parts;
  for (size_t i = 0; i < n; i += lanes) {
    CutLanes(size, above, below, i, cut);
    for (size_t lane = 0; lane < std::min(lanes, n - i); ++lane) {
      const Vec3 of = radiance[(i + lane) / size_t(split)];
      if (of == Vec3(0)) continue;
      const float channels = of.x + of.y + of.z;
      if (!cut.simple[lane]) {
        AddOne(size, above, below, i + lane, of, channels, solid_angle, parts, sums);
        continue;
      }
      for (int k = 0; k < 4; ++k)
        if (const float share = cut.share[k][lane]; share > 0)
          Add(sums[cut.texel[k][lane]], share * solid_angle, of, channels,
              {cut.x[k][lane], cut.y[k][lane], cut.z[k][lane]});
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(PlaceCorners);
HWY_EXPORT(AddTexels);

}  // namespace

void place_corners(int size, size_t padded, CornerRow& corners) {
  HWY_DYNAMIC_DISPATCH(PlaceCorners)(size, padded, corners);
}

void add_texels(int size, const CornerRow& above, const CornerRow& below, const Vec3* radiance, int split, int count,
                float solid_angle, CubeSum* sums) {
  HWY_DYNAMIC_DISPATCH(AddTexels)(size, above, below, radiance, split, count, solid_angle, sums);
}

}  // namespace lambent
#endif
