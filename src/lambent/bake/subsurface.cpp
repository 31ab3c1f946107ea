// Follows: local-deformable-prt, section 6, by analogue random walks run backwards: from the receiver into the medium
// and out to the light. Radiance over the square of the index is what keeps along a path through boundaries, so that no
// other factor stands at them than what is let through, and a walk that is chosen by it carries weight 1.
#include <lambent/bake/gather.h>
#include <lambent/bake/subsurface.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <atomic>
#include <chrono>

namespace lambent {
namespace {

constexpr size_t walk_grain = 4;  // receivers: walks are long
constexpr size_t burial_rays = 64;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

bool is_grey(Vec3 c) { return c.x == c.y && c.y == c.z; }

// The direction of light that goes on through a boundary of normal n, which d points along, into a relative index of 1
// / ratio.
Vec3 refract(Vec3 d, Vec3 n, float ratio) {
  const float cosine = dot(d, n);
  const Vec3 along = ratio * (d - cosine * n);
  return normalize(along + std::sqrt(std::max(0.0f, 1 - dot(along, along))) * n);
}

Vec3 scatter(Vec3 d, float g, Random& random) {
  const Vec2 u = random.next2();
  const float q = (1 - g * g) / (1 - g + 2 * g * u.x);
  const float cosine = std::clamp(std::abs(g) < 1e-3f ? 1 - 2 * u.x : (1 + g * g - q * q) / (2 * g), -1.0f, 1.0f);
  const float sine = std::sqrt(1 - cosine * cosine);
  return normalize(frame_about(d) * Vec3(sine * std::cos(2 * pi * u.y), sine * std::sin(2 * pi * u.y), cosine));
}

struct WalkEnd {
  enum { left, absorbed, lost } how;
  Vec3 position, direction;  // of one that left: just outside
};

struct Walker {
  const Scene& scene;
  const Tracer& tracer;
  const SubsurfaceOptions& options;
  float sigma_t, albedo;
  Bounds box;

  // A point of the surface moved along its normal by more than its rounding: up > 0 is outside.
  Vec3 beside(const Hit& hit, Vec3 normal, float up) const {
    const Triangle& t = scene.triangles[hit.triangle];
    const Vec3 p = interpolate(scene.positions, t, hit.u, hit.v);
    const Vec3 size = abs(p) + abs(scene.positions[t.v[1]] - p) + abs(scene.positions[t.v[2]] - p);
    return p + normal * (up * 1e-5f * largest(size));
  }
  Vec3 normal(const Hit& hit) const { return normalize_or(area_normal(scene, scene.triangles[hit.triangle]), Vec3(0)); }

  // Back into the middle of a scene that repeats; false for what wandered off, through a hole or where floats round.
  bool keep(Vec3& p) const {
    if (options.period > 0) {
      p.x -= options.period * std::floor(p.x / options.period), p.y -= options.period * std::ceil(p.y / options.period);
      return p.z <= box.max.z;
    }
    return all_at_most(box.min, p) && all_at_most(p, box.max);
  }

  WalkEnd walk(Vec3 p, Vec3 d, Random& random, size_t& events) const {
    int depth = 1;  // how many bodies are around p
    const float eta = options.medium.eta;
    for (int event = 0; event < options.most_events;) {
      float flight = sigma_t > 0 ? -std::log1p(-random.next()) / sigma_t : INFINITY;
      for (bool on_flight = true; on_flight;) {
        if (++event > options.most_events) break;
        ++events;
        const float reach = options.period > 0 ? std::min(flight, options.period) : flight;
        const Hit hit = tracer.closest(p, d, 0, reach);
        if (hit.triangle == none) {
          if (!(reach < INFINITY)) return {WalkEnd::lost, {}, {}};
          p += reach * d, on_flight = reach < flight, flight -= reach;
          if (!keep(p)) return {WalkEnd::lost, {}, {}};
          continue;
        }
        flight -= hit.distance;
        const Vec3 n = normal(hit);
        if (hit.front) {
          ++depth, p = beside(hit, n, -1);
        } else if (--depth > 0) {
          p = beside(hit, n, 1);
        } else if (eta > 1 && random.next() < fresnel_reflectance(dot(d, n), 1 / eta)) {
          depth = 1, d = normalize(d - 2 * dot(d, n) * n), p = beside(hit, n, -1);
        } else {
          return {WalkEnd::left, beside(hit, n, 1), eta > 1 ? refract(d, n, eta) : d};
        }
        if (options.period > 0) keep(p);
        on_flight = flight > 0;
      }
      if (random.next() >= albedo) return {WalkEnd::absorbed, {}, {}};
      d = scatter(d, options.medium.g, random);
    }
    return {WalkEnd::lost, {}, {}};
  }
};

struct HitEntry {
  uint32_t receiver;
  Vec3 weight;
};

// What `count` receivers' walks bring.
struct WalkSums {
  std::vector<HitEntry> entries;
  std::vector<uint32_t> ends;
  size_t walks = 0, lost = 0, events = 0;
  double difference = 0, total = 0;
};

void merge(std::vector<HitEntry>& entries, size_t from) {
  std::stable_sort(entries.begin() + ptrdiff_t(from), entries.end(),
                   [](const HitEntry& a, const HitEntry& b) { return a.receiver < b.receiver; });
  size_t end = from;
  for (size_t i = from; i < entries.size(); ++i)
    if (end > from && entries[end - 1].receiver == entries[i].receiver) entries[end - 1].weight += entries[i].weight;
    else entries[end++] = entries[i];
  entries.resize(end);
}

}  // namespace

Result<Transfer> bake_subsurface(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                 const BakeOptions& options, const SubsurfaceOptions& subsurface,
                                 BakeReport* report_out, SubsurfaceReport* walks_out, Progress* progress) {
  const Medium& medium = subsurface.medium;
  if (auto ok = check_light_basis(options, 1); !ok) return ok.error();
  if (!options.lobes.empty()) return Error{"light", "lobes do not go with a medium: its light is of harmonics alone"};
  if (auto ok = check_medium(medium); !ok) return ok.error();
  if (options.samples < 1 || options.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(options.samples)};
  if (options.bounces < 0 || options.bounces > 64)
    return Error{"bounces", "must lie between 0 and 64, not " + std::to_string(options.bounces)};

  auto start = Clock::now();
  const GatherSetup setup =
      make_gather_setup(scene, tracer, receivers, 1, 16, options.seed);  // for what it knows of albedos
  const bool one_medium = is_grey(medium.sigma_s) && is_grey(medium.sigma_a);
  const size_t channels = !one_medium || (options.bounces > 0 && setup.channels == 3) ? 3 : 1,
               media = one_medium ? 1 : 3;
  const size_t n = receivers.count(), C = size_t(sh_count(options.order)), width = C * channels;
  const size_t samples = size_t(options.samples), half = samples / 2;
  const size_t fixed = 3 * n * width * sizeof(float);
  auto too_small = [](size_t needed) {
    return Error{"memory", "is too small: this takes " + std::to_string(needed >> 20) + " MiB or more"};
  };
  if (fixed > options.memory) return too_small(fixed);

  const Bounds box = bounds(scene);
  const Vec3 margin(1e-3f * box.diagonal());
  std::vector<Walker> walkers;
  for (size_t m = 0; m < media; ++m) {
    const float s = medium.sigma_s[int(m)], t = s + medium.sigma_a[int(m)];
    walkers.push_back({scene, tracer, subsurface, t, t > 0 ? s / t : 1.0f, {box.min - margin, box.max + margin}});
  }

  std::vector<float> T0(n * width);  // [receiver][channel][coefficient]
  std::vector<uint8_t> buried(n);
  std::vector<WalkSums> sums((n + walk_grain - 1) / walk_grain);
  std::atomic<size_t> entry_count{0};
  {
    ProgressStage stage(progress, "walking", n);
    parallel_for(n, walk_grain, [&](size_t begin, size_t end) {
      WalkSums& sum = sums[begin / walk_grain];
      std::vector<float> y(C), half_row(width);
      for (size_t r = begin; r < end; ++r) {
        if (stage.cancelled() || fixed + entry_count * sizeof(HitEntry) > options.memory) return;
        const Vec3 origin = receivers.origins[r], up = receivers.normals[r];
        const Mat3 frame = frame_about(up);
        const uint64_t key = hash64(options.seed, r);
        auto sample = [&](uint32_t i) { return square_to_cosine_hemisphere(sobol_owen(i, uint32_t(key >> 32))); };
        float x[burial_rays], z[burial_rays], w[burial_rays];
        for (uint32_t i = 0; i < burial_rays; ++i) {
          const Vec3 d = frame * sample(i);
          x[i] = d.x, w[i] = d.y, z[i] = d.z;
        }
        buried[r] = is_buried(tracer, receivers.basis, origin, {x, w, z, burial_rays});
        // The surface that the receiver lies on; one that lies on a back has no medium behind it, and stays dark.
        // A ray straight down a vertex may slip between its triangles, hence others beside it.
        Hit below = tracer.closest(origin, -up);
        for (int side = 0; side < 8 && (below.triangle == none || !below.front); ++side)
          below = tracer.closest(
              origin, normalize(frame * Vec3(0.05f * std::cos(float(side)), 0.05f * std::sin(float(side)), -1)));
        const size_t first_entry = sum.entries.size();
        if (!buried[r] && below.triangle != none && below.front) {
          const Vec3 start_at = walkers[0].beside(below, walkers[0].normal(below), -1);
          float* row = T0.data() + r * width;
          for (size_t i = 0; i < samples; ++i) {
            if (i == half) half_row.assign(row, row + width);
            const Vec3 local = sample(uint32_t(i)), out = frame * local;
            const float through = medium.eta > 1 ? 1 - float(fresnel_reflectance(local.z, medium.eta)) : 1.0f;
            const Vec3 into = medium.eta > 1 ? refract(-out, -up, 1 / medium.eta) : -out;
            for (size_t m = 0; m < media; ++m) {
              Random random(key, i);  // alike for all colours, so that their noise is
              const WalkEnd end_of_walk = walkers[m].walk(start_at, into, random, sum.events);
              ++sum.walks, sum.lost += end_of_walk.how == WalkEnd::lost;
              if (end_of_walk.how != WalkEnd::left) continue;
              const Hit hit = tracer.closest(end_of_walk.position, end_of_walk.direction);
              const size_t from = media == 3 ? m : 0, to = media == 3 ? m + 1 : channels;
              if (hit.triangle == none) {
                evaluate_sh(options.order, end_of_walk.direction, y);
                for (size_t c = from; c < to; ++c)
                  for (size_t k = 0; k < C; ++k) row[c * C + k] += through * y[k];
              } else if (options.bounces > 0) {
                Vec3 weight(0);
                for (size_t c = from; c < to; ++c) weight[int(c)] = through / float(samples);
                weight *= albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v);
                std::visit(
                    [&](const auto& basis) {
                      if (const auto* at = basis.find(hit.triangle, hit.front))
                        basis.spread(*at, hit.u, hit.v, [&](uint32_t q, float share) {
                          sum.entries.push_back({q, share * weight});
                        });
                    },
                    receivers.basis);
              }
            }
          }
          merge(sum.entries, first_entry);
          for (size_t j = 0; j < width; ++j) row[j] /= float(samples);
          if (half > 0 && r % check_every == 0)
            for (size_t j = 0; j < width; ++j) {
              const double d = half_row[j] / float(half) - row[j];
              sum.difference += d * d, sum.total += double(row[j]) * row[j];
            }
        }
        sum.ends.push_back(uint32_t(sum.entries.size()));
        entry_count += sum.entries.size() - first_entry;
      }
      stage.advance(end - begin);
    });
    if (stage.cancelled()) return Error{"", "cancelled"};
    if (fixed + entry_count * sizeof(HitEntry) > options.memory)
      return too_small(fixed + entry_count * sizeof(HitEntry));
  }
  BakeReport report;
  SubsurfaceReport walks;
  double difference = 0, total = 0, lost = 0, events = 0, walk_count = 0;
  for (const WalkSums& s : sums)
    difference += s.difference, total += s.total, lost += double(s.lost), events += double(s.events),
        walk_count += double(s.walks);
  walks.lost = walk_count > 0 ? lost / walk_count : 0, walks.events = walk_count > 0 ? events / walk_count : 0;
  for (uint8_t b : buried) report.buried += b;
  report.receivers = n, report.rays = size_t(events);
  report.error = half > 0 && total > 0 ? std::sqrt(difference / total) : -1;
  report.operator_bytes = entry_count * sizeof(HitEntry), report.working_memory = fixed + report.operator_bytes;
  const auto fill = make_fill_steps(scene, receivers.basis, buried);
  fill_buried(fill, T0.data(), width, width);
  report.trace_seconds = seconds_since(start);
  start = Clock::now();

  // What leaves where a walk comes out and meets a surface again is that receiver's own transfer: X = T0 + B X.
  std::vector<float> X = T0, next(options.bounces > 0 ? n * width : 0);
  for (int bounce = 1; bounce <= options.bounces; ++bounce) {
    ProgressStage stage(progress, "bounce " + std::to_string(bounce), n);
    parallel_for(n, walk_grain, [&](size_t begin, size_t end) {
      const WalkSums& sum = sums[begin / walk_grain];
      for (size_t r = begin; r < end; ++r) {
        float* row = next.data() + r * width;
        std::copy_n(T0.data() + r * width, width, row);
        for (size_t e = r == begin ? 0 : sum.ends[r - begin - 1]; e < sum.ends[r - begin]; ++e)
          for (size_t c = 0; c < channels; ++c) {
            const float* from = X.data() + size_t(sum.entries[e].receiver) * width + c * C;
            for (size_t k = 0; k < C; ++k) row[c * C + k] += sum.entries[e].weight[int(c)] * from[k];
          }
      }
      stage.advance(end - begin);
    });
    if (stage.cancelled()) return Error{"", "cancelled"};
    fill_buried(fill, next.data(), width, width);
    std::swap(X, next);
  }
  WritableTransfer out = make_transfer(options.light(), 1, int(channels), n, options.precision);
  for (size_t r = 0; r < n; ++r) store_receiver(out, r, {X.data() + r * width, width});
  report.bounce_seconds = seconds_since(start), report.bytes = out.transfer.bytes();
  if (report_out) *report_out = report;
  if (walks_out) *walks_out = walks;
  return std::move(out.transfer);
}

}  // namespace lambent
