#include <lambent/bake/certify_field.h>
#include <lambent/core/aligned.h>
#include <lambent/core/check.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

namespace lambent {
namespace {

constexpr size_t fewest_of_part = 16;
constexpr size_t piece = 4;
constexpr size_t looked_at = 16;  // places on texels, for one of the certificate

struct ErrorPlace {
  uint32_t triangle;
  float u, v;
  bool front;
  double weight;  // its share of the area over its share of the places
};

bool receives(const Receivers& receivers, uint32_t triangle, bool front) {
  return std::visit([&](const auto& basis) { return basis.find(triangle, front) != nullptr; }, receivers.basis);
}

double area_of(const Scene& scene, const Triangle& t) {
  const Vec3d a(scene.positions[t.v[0]]), b(scene.positions[t.v[1]]), c(scene.positions[t.v[2]]);
  return 0.5 * length(cross(b - a, c - a));
}

void read_row(const Receivers& receivers, const FieldRow& field, uint32_t triangle, bool front, float u, float v,
              AlignedVector<float>& row, AlignedVector<float>& sum) {
  std::fill(sum.begin(), sum.end(), 0.0f);
  std::visit(
      [&](const auto& basis) {
        basis.spread(*basis.find(triangle, front), u, v, [&](uint32_t receiver, float w) {
          field(receiver, row.data());
          for (size_t k = 0; k < sum.size(); ++k) sum[k] += w * row[k];
        });
      },
      receivers.basis);
}

// The receivers that read_row() reads.
void note(const Receivers& receivers, uint32_t triangle, bool front, float u, float v, std::vector<uint8_t>& asked) {
  std::visit(
      [&](const auto& basis) {
        basis.spread(*basis.find(triangle, front), u, v, [&](uint32_t receiver, float) {
          std::atomic_ref(asked[receiver]).store(1, std::memory_order_relaxed);
        });
      },
      receivers.basis);
}

// A side that receives.
struct Side {
  uint32_t triangle;
  bool front;
  double area, varies;  // how much the field differs over it, squared
};
std::vector<Side> find_sides(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                             const AskForRows* ask) {
  std::vector<Side> sides;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t)
    for (const bool front : {true, false})
      if (receives(receivers, t, front)) sides.push_back({t, front, area_of(scene, scene.triangles[t]), 0});
  const Shares shares(sides.size(), 64);
  if (ask) {
    std::vector<uint8_t> asked(receivers.count());
    shares.for_own([&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        for (int c = 0; c < 3; ++c) note(receivers, sides[i].triangle, sides[i].front, c == 1, c == 2, asked);
    });
    ask->field(asked);
  }
  shares.for_own([&](size_t begin, size_t end) {
    AlignedVector<float> corner[3], row(width);
    for (auto& c : corner) c.resize(width);
    for (size_t i = begin; i < end; ++i) {
      Side& side = sides[i];
      for (int c = 0; c < 3; ++c) read_row(receivers, field, side.triangle, side.front, c == 1, c == 2, row, corner[c]);
      for (size_t k = 0; k < width; ++k)
        for (int c = 0; c < 3; ++c) {
          const double d = double(corner[c][k]) - double(corner[(c + 1) % 3][k]);
          side.varies += d * d;
        }
    }
  });
  shares.gather(sides.data());
  return sides;
}

// How much the receivers differ, squared, of which a place has its value.
double varies_at(const Receivers& receivers, const FieldRow& field, const ErrorPlace& p, AlignedVector<float>& row,
                 AlignedVector<float>& mean) {
  double squares = 0;
  std::fill(mean.begin(), mean.end(), 0.0f);
  std::visit(
      [&](const auto& basis) {
        basis.spread(*basis.find(p.triangle, p.front), p.u, p.v, [&](uint32_t receiver, float w) {
          field(receiver, row.data());
          for (size_t k = 0; k < mean.size(); ++k) mean[k] += w * row[k], squares += double(w * row[k] * row[k]);
        });
      },
      receivers.basis);
  for (float m : mean) squares -= double(m) * double(m);
  return std::max(squares, 0.0);
}

// Of texels, which are many on a triangle: `count` of these, half of them evenly, half by how much texels differ there.
std::vector<ErrorPlace> choose_places(const Receivers& receivers, const FieldRow& field, size_t width, size_t count,
                                      uint32_t seed, const std::vector<ErrorPlace>& from) {
  std::vector<double> varies(from.size());
  const Shares shares(from.size(), 64);
  shares.for_own([&](size_t begin, size_t end) {
    AlignedVector<float> row(width), mean(width);
    for (size_t i = begin; i < end; ++i) varies[i] = varies_at(receivers, field, from[i], row, mean);
  });
  shares.gather(varies.data());
  double all = 0, weights = 0;
  for (size_t i = 0; i < from.size(); ++i) all += from[i].weight * varies[i], weights += from[i].weight;
  if (!(all > 0)) return from;
  std::vector<ErrorPlace> places;
  Random random(seed, 0xce48);
  const double apart = weights / double(count);
  double passed = apart * double(random.next());
  for (size_t i = 0; i < from.size(); ++i) {
    const double density = 0.5 + 0.5 * varies[i] * weights / all, share = from[i].weight * density / apart;
    const double before = std::floor(passed / apart);
    passed += from[i].weight * density;
    if (std::floor(passed / apart) == before) continue;
    places.push_back(from[i]);
    places.back().weight = from[i].weight / std::min(share, 1.0);
  }
  return places;
}

// One place in each of `count` equal shares, in the order of triangles: half of them by area alone, half by how much
// the field differs over a triangle as well. Errors gather where it does, in few places, which area alone seldom meets.
std::vector<ErrorPlace> draw_places(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                                    size_t count, uint32_t seed, const AskForRows* ask) {
  std::vector<Side> sides = find_sides(scene, receivers, field, width, ask);
  double area = 0, varies = 0;
  for (const Side& s : sides) area += s.area, varies += s.area * s.varies;
  std::vector<ErrorPlace> places;
  if (!(area > 0)) return places;
  auto density = [&](const Side& s) { return varies > 0 ? 0.5 + 0.5 * s.varies * area / varies : 1.0; };
  Random random(seed, 0xce47);
  double passed = 0, next = area / double(count) * double(random.next());
  for (const Side& s : sides)
    for (passed += s.area * density(s); next < passed && places.size() < count;) {
      const Vec2 r = random.next2();
      const float root = std::sqrt(r.x);
      places.push_back({s.triangle, root * (1 - r.y), root * r.y, s.front, 1 / density(s)});
      next = area / double(count) * (double(places.size()) + double(random.next()));
    }
  return places;
}

// Where rays of a place start, and its normal.
std::pair<Vec3, Vec3> start_of(const Scene& scene, const ErrorPlace& at, float diagonal) {
  const Triangle& t = scene.triangles[at.triangle];
  const Vec3 weight(1 - at.u - at.v, at.u, at.v);
  Vec3 p(0), n(0);
  for (int k = 0; k < 3; ++k) p += weight[k] * scene.positions[t.v[k]], n += weight[k] * scene.normals[t.v[k]];
  Vec3 face = normalize(
      cross(scene.positions[t.v[1]] - scene.positions[t.v[0]], scene.positions[t.v[2]] - scene.positions[t.v[0]]));
  n = normalize_or(n, face);
  if (dot(n, face) < 0) n = -n;
  if (!at.front) n = -n, face = -face;
  return {p + face * receiver_lift(p, float(std::sqrt(area_of(scene, t))), diagonal), n};
}

// Both gathers of each own place, once ahead, and what they and the place itself read.
void ask_for_places(const Scene& scene, const Receivers& receivers, const std::vector<ErrorPlace>& places,
                    const GatherAt& gather, size_t width, uint32_t seed, const Shares& shares, const AskForRows& ask,
                    const Progress* progress) {
  const float diagonal = bounds(scene).diagonal();
  std::vector<uint8_t> asked(receivers.count());
  shares.for_own([&](size_t begin, size_t end) {
    std::vector<float> row(width);
    for (size_t i = begin; i < end && !is_cancelled(progress); ++i) {
      const ErrorPlace& at = places[i];
      const auto [origin, normal] = start_of(scene, at, diagonal);
      for (uint32_t k = 0; k < 2; ++k) gather(origin, normal, hash64(seed, 2 * i + k), row.data());
      note(receivers, at.triangle, at.front, at.u, at.v, asked);
    }
  });
  ask.field(asked), ask.met();
}

struct PlaceError {
  double error2 = 0, truth2 = 0, noise2 = 0;
  bool counts = false;
  Vec3 at{0}, normal{0};
};

// The squared errors at all places, from two residuals at each. `beside`: what the field that these are of has more
// than the one that is measured; empty where it is that.
Result<void> measure_errors(const std::vector<ErrorPlace>& places, const ReflectedErrors* reflected, size_t width,
                            uint32_t seed, std::vector<float> (&residuals)[2], const std::vector<float>& beside,
                            std::vector<PlaceError>& measured, Progress* progress) {
  std::vector<size_t> counting;
  ResidualPlaces at;
  for (size_t i = 0; i < places.size(); ++i) {
    if (!measured[i].counts) continue;
    for (auto& rows : residuals) std::copy_n(rows.data() + i * width, width, rows.data() + counting.size() * width);
    counting.push_back(i);
    at.at.push_back(measured[i].at), at.normal.push_back(measured[i].normal), at.weight.push_back(places[i].weight);
  }
  for (uint32_t k = 0; k < 2 && reflected; ++k) {
    auto ok =
        add_reflected_errors(*reflected, at, uint32_t(hash64(seed, 0x2ef1 + k)), width, residuals[k].data(), progress);
    if (!ok) return ok;
  }
  for (size_t j = 0; j < counting.size() && !beside.empty(); ++j)
    for (auto& rows : residuals)
      for (size_t k = 0; k < width; ++k) rows[j * width + k] += beside[counting[j] * width + k];
  for (size_t j = 0; j < counting.size(); ++j)
    for (size_t k = 0; k < width; ++k)
      measured[counting[j]].error2 += double(residuals[0][j * width + k]) * double(residuals[1][j * width + k]);
  return {};
}

Certificate sum_up(const Scene& scene, const std::vector<ErrorPlace>& places, const std::vector<PlaceError>& measured,
                   std::vector<MeasuredPlace>* kept) {
  Certificate c;
  if (kept) kept->clear();
  double error2 = 0, truth2 = 0, noise2 = 0;
  std::vector<PlaceError> parts(scene.parts.size());
  std::vector<size_t> counts(scene.parts.size(), 0);
  for (size_t i = 0; i < places.size(); ++i) {
    if (!measured[i].counts) continue;
    const uint32_t part = scene.triangles[places[i].triangle].part;
    ++c.places, ++counts[part];
    const PlaceError& m = measured[i];
    const double w = places[i].weight;
    if (kept) kept->push_back({m.at, m.normal, m.error2, m.truth2, w});
    error2 += w * m.error2, truth2 += w * m.truth2, noise2 += w * m.noise2;
    parts[part].error2 += w * m.error2, parts[part].truth2 += w * m.truth2;
  }
  for (size_t p = 0; p < parts.size(); ++p)
    c.parts.push_back(counts[p] < fewest_of_part || !(parts[p].truth2 > 0)
                          ? -1
                          : std::sqrt(std::max(0.0, parts[p].error2) / parts[p].truth2));
  if (c.places < fewest_of_part || !(truth2 > 0)) return c;
  c.error = std::sqrt(std::max(0.0, error2) / truth2), c.noise = std::sqrt(noise2 / truth2);
  double spread = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    if (!measured[i].counts) continue;
    const double off = places[i].weight * (measured[i].error2 - error2 / truth2 * measured[i].truth2);
    spread += off * off;
  }
  c.uncertain = std::sqrt(spread) / truth2 / std::max(2 * c.error, 1e-12);
  return c;
}

}  // namespace

Result<Certificate> certify_field(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                                  const GatherAt& gather, size_t count, uint32_t seed, Progress* progress,
                                  const ReflectedErrors* reflected, const FieldRow* again,
                                  std::vector<MeasuredPlace>* kept, const AskForRows* ask) {
  const bool texels = std::holds_alternative<TexelReceivers>(receivers.basis);
  std::vector<ErrorPlace> places =
      draw_places(scene, receivers, field, width, texels ? looked_at * count : count, seed, ask);
  if (texels) places = choose_places(receivers, field, width, count, seed, places);
  const float diagonal = bounds(scene).diagonal();
  std::vector<PlaceError> measured(places.size());
  std::vector<float> residuals[2];  // [place][width]
  for (auto& rows : residuals) rows.resize(places.size() * width);
  // e = (truth - read) + (read - field), of which the gathers' residuals and what comes back make the first.
  const FieldRow* read = reflected ? reflected->read : nullptr;
  LAMBENT_CHECK((!read || !again) && (!ask || !(read || again || texels)));
  std::vector<float> beside(read ? places.size() * width : 0);
  const Shares shares(places.size(), piece);
  ProgressStage stage(progress, "measuring the error", shares.own());
  if (ask) ask_for_places(scene, receivers, places, gather, width, seed, shares, *ask, progress);
  shares.for_own([&](size_t begin, size_t end) {
    AlignedVector<float> a(width), b(width), s(width), s2(width), row(width);
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
      const ErrorPlace& at = places[i];
      const auto [origin, n] = start_of(scene, at, diagonal);
      if (!gather(origin, n, hash64(seed, 2 * i), a.data()) || !gather(origin, n, hash64(seed, 2 * i + 1), b.data()))
        continue;
      read_row(receivers, field, at.triangle, at.front, at.u, at.v, row, s);
      if (again) read_row(receivers, *again, at.triangle, at.front, at.u, at.v, row, s2);
      if (read) {
        read_row(receivers, *read, at.triangle, at.front, at.u, at.v, row, s2);
        for (size_t k = 0; k < width; ++k) beside[i * width + k] = s2[k] - s[k];
        s = s2;
      }
      const AlignedVector<float>& other = again ? s2 : s;
      PlaceError& m = measured[i];
      m.counts = true, m.at = origin, m.normal = n;
      for (size_t k = 0; k < width; ++k) {
        residuals[0][i * width + k] = a[k] - s[k], residuals[1][i * width + k] = b[k] - other[k];
        m.truth2 += double(a[k]) * double(b[k]);
        m.noise2 += 0.5 * double(a[k] - b[k]) * double(a[k] - b[k]);
      }
    }
    if (!stage.cancelled()) stage.advance(end - begin);
  });
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares.gather(measured.data());
  for (auto& rows : residuals) shares.gather(rows.data(), width);
  if (read) shares.gather(beside.data(), width);
  if (auto ok = measure_errors(places, reflected, width, seed, residuals, beside, measured, progress); !ok)
    return ok.error();

  return sum_up(scene, places, measured, kept);
}

Result<Certificate> certify(const Scene& scene, const Receivers& receivers, const float* rows, size_t width,
                            const GatherAt& gather, size_t places, uint32_t seed, Progress* progress) {
  const FieldRow field = [&](uint32_t r, float* row) { std::copy_n(rows + size_t(r) * width, width, row); };
  return certify_field(scene, receivers, field, width, gather, places, seed, progress);
}

}  // namespace lambent
