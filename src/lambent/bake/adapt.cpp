// Follows: radiosity, "Adaptive Refinement". What differs is measured, not guessed from distances: noise is taken off
// the difference, since rays are few.
#include <lambent/bake/adapt.h>
#include <lambent/bake/gather.h>
#include <lambent/core/clock.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/refine.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

namespace lambent {
namespace {

constexpr int most_levels = 10;
constexpr size_t pilot = 16;  // one edge in so many says whether the rest is worth a look
constexpr size_t noise_places = 256;
// Of a parabola that is zero at the ends, the mean square is 8/15 of that at the middle; triangles have three edges.
constexpr double mean_square = 8.0 / 15;
constexpr size_t split_cost = 4;       // triangles that splitting an edge may add, with what close() splits besides
constexpr float inset = 0.01f;         // of an edge, towards the triangle: a wall's foot does not lie in the wall
constexpr float longest_ratio = 1.6f;  // a triangle's longest edge is split too, where so much longer than one that is

uint64_t key_of(Vec3 p) {
  auto bits = [](float f) { return uint64_t(std::bit_cast<uint32_t>(f + 0.0f)); };
  return hash64(hash64(bits(p.x) << 32 | bits(p.y)), bits(p.z));
}
uint64_t edge_key(Vec3 a, Vec3 b) { return hash64(std::min(key_of(a), key_of(b)), std::max(key_of(a), key_of(b))); }
// Good enough to find a place again.
uint64_t place_key(Vec3 p, Vec3 n) {
  return hash64(key_of(p), key_of(Vec3(std::round(256 * n.x), std::round(256 * n.y), std::round(256 * n.z))));
}

double area_of(const Scene& scene, const Triangle& t) {
  const Vec3d a(scene.positions[t.v[0]]), b(scene.positions[t.v[1]]), c(scene.positions[t.v[2]]);
  return 0.5 * length(cross(b - a, c - a));
}

// An edge as one side of a surface sees it, between two receivers.
struct Edge {
  uint64_t receivers;  // the two, less first
  uint32_t a, b;       // vertices
  Vec3 inward{0};      // towards the corners opposite
  double area = 0;     // a third of that of the triangles on it
  float length = 0;
  bool front = true;
};

struct Adapter {
  Scene& scene;
  const AdaptOptions& options;
  Progress* progress;
  AdaptReport& report;
  const Scene original = scene;  // the same surface: what rays meet
  Tracer tracer{};
  Receivers first{};  // of the original
  size_t width = size_t(sh_count(options.order));
  float diagonal = bounds(scene).diagonal();
  std::unordered_map<uint64_t, uint32_t> known{};  // place -> row
  std::vector<float> rows{};                       // [place][width]
  std::unordered_map<uint64_t, float> settled{};   // edge and side -> squared difference
  double noise = 0;                                // squared, of a row
  const Clock::time_point start = Clock::now();

  // Whether what takes so many seconds more would end too late. As the first of the ranks sees it.
  bool late(double more) {
    report.late = this_ranks().from_first(options.seconds >= 0 && seconds_since(start) + more > options.seconds);
    return report.late;
  }

  struct Place {
    Vec3 origin, normal;
  };
  // Direct transfer at places, [place][width].
  Result<std::vector<float>> trace(const std::vector<Place>& places, uint32_t seed, const char* name) {
    Receivers at;
    at.basis = first.basis;
    for (const Place& p : places) at.origins.push_back(p.origin), at.normals.push_back(p.normal);
    GatherSetup setup = make_gather_setup(original, tracer, at, options.order, options.samples, seed);
    setup.progress = progress;
    Pool<GatherScratch, DeleteScratch> scratch([&] { return make_gather_scratch(setup); });
    std::vector<float> out(places.size() * width);
    const Shares shares(places.size(), gather_block);
    ProgressStage stage(progress, name, shares.own());
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      std::vector<float> sky((end - begin) * setup.sky_width());
      std::vector<uint8_t> buried(end - begin);
      trace_sky(setup, *scratch.borrow(), begin, end - begin,
                {sky.data(), nullptr, setup.sky_width(), nullptr, buried.data()});
      for (size_t i = begin; i < end; ++i)  // of coloured glass, the first channel
        std::copy_n(sky.data() + (i - begin) * setup.sky_width(), width, out.data() + i * width);
      if (!stage.cancelled()) stage.advance(end - begin);
    });
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    shares.gather(out.data(), width);
    report.rays += places.size() * size_t(options.samples);
    return out;
  }

  std::vector<Edge> edges_of(const Receivers& receivers) const {
    std::vector<Edge> edges;
    const float least = 2 * options.shortest * diagonal;
    const auto& corners = std::get<CornerReceivers>(receivers.basis);
    for (uint32_t t = 0; t < scene.triangles.size(); ++t)
      for (const bool front : {true, false}) {
        const Corners* at = corners.find(t, front);
        if (!at) continue;
        const Triangle& triangle = scene.triangles[t];
        const double share = area_of(scene, triangle) / 3;
        for (size_t k = 0; k < 3; ++k) {
          const uint32_t a = triangle.v[k], b = triangle.v[(k + 1) % 3];
          const Vec3 pa = scene.positions[a], pb = scene.positions[b];
          const float size = length(pb - pa);
          if (!(size > least)) continue;
          const uint64_t ra = at->receiver[k], rb = at->receiver[(k + 1) % 3];
          if (ra == rb) continue;
          const Vec3 inward = scene.positions[triangle.v[(k + 2) % 3]] - 0.5f * (pa + pb);
          edges.push_back(
              {std::min(ra, rb) << 32 | std::max(ra, rb), a, b, normalize_or(inward, Vec3(0)), share, size, front});
        }
      }
    std::stable_sort(edges.begin(), edges.end(),
                     [](const Edge& a, const Edge& b) { return a.receivers < b.receivers; });
    size_t kept = 0;
    for (size_t i = 0; i < edges.size(); ++i) {
      if (kept > 0 && edges[kept - 1].receivers == edges[i].receivers)
        edges[kept - 1].inward += edges[i].inward, edges[kept - 1].area += edges[i].area;
      else edges[kept++] = edges[i];
    }
    edges.resize(kept);
    return edges;
  }

  // Rows of the receivers that edges end at; an index a receiver.
  Result<std::vector<uint32_t>> rows_of(const Receivers& receivers, const std::vector<Edge>& edges) {
    std::vector<uint32_t> row(receivers.count(), none);
    std::vector<Place> missing;
    const uint32_t there = uint32_t(rows.size() / width);
    for (const Edge& e : edges)
      for (const uint32_t v : {e.a, e.b}) {
        const uint32_t r = (e.front ? receivers.front : receivers.back)[v];
        if (row[r] != none) continue;
        const auto [at, is_new] =
            known.try_emplace(place_key(scene.positions[v], receivers.normals[r]), there + uint32_t(missing.size()));
        if (is_new) missing.push_back({receivers.origins[r], receivers.normals[r]});
        row[r] = at->second;
      }
    auto traced = trace(missing, uint32_t(hash64(options.seed, rows.size())), "looking where light changes");
    if (!traced) return traced.error();
    rows.insert(rows.end(), traced->begin(), traced->end());
    if (noise == 0) {
      missing.resize(std::min(missing.size(), noise_places));
      auto again = trace(missing, uint32_t(hash64(options.seed, 0x4e)), "looking where light changes");
      if (!again) return again.error();
      for (size_t i = 0; i < again->size(); ++i)
        noise += 0.5 * double((*again)[i] - (*traced)[i]) * double((*again)[i] - (*traced)[i]);
      noise /= double(std::max<size_t>(missing.size(), 1));
    }
    return row;
  }

  uint64_t settled_key(const Edge& e) const {
    return hash64(edge_key(scene.positions[e.a], scene.positions[e.b]), e.front);
  }

  // Squared differences of the middles from the mean of the ends, less the noise.
  Result<void> test(const Receivers& receivers, const std::vector<Edge>& edges) {
    std::vector<Edge> open;
    for (const Edge& e : edges)
      if (!settled.contains(settled_key(e))) open.push_back(e);
    auto row = rows_of(receivers, open);
    if (!row) return row.error();
    std::vector<Place> middles;
    for (const Edge& e : open) {
      const Vec3 p = 0.5f * scene.positions[e.a] + 0.5f * scene.positions[e.b];
      const Vec3 na = receivers.normals[(e.front ? receivers.front : receivers.back)[e.a]],
                 nb = receivers.normals[(e.front ? receivers.front : receivers.back)[e.b]],
                 n = normalize_or(na + nb, na);
      const Vec3 inward = e.inward - n * dot(e.inward, n);
      middles.push_back({p + n * receiver_lift(p, e.length, diagonal) + inward * (inset * e.length), n});
    }
    auto traced = trace(middles, uint32_t(hash64(options.seed, 0x6d + middles.size())), "looking where light changes");
    if (!traced) return traced.error();
    for (size_t i = 0; i < open.size(); ++i) {
      const Edge& e = open[i];
      const float *a = rows.data() + size_t((*row)[e.receivers >> 32]) * width,
                  *b = rows.data() + size_t((*row)[e.receivers & 0xffffffffu]) * width, *m = traced->data() + i * width;
      double d2 = -1.5 * noise;
      for (size_t k = 0; k < width; ++k)
        d2 += double(m[k] - 0.5f * (a[k] + b[k])) * double(m[k] - 0.5f * (a[k] + b[k]));
      settled[settled_key(e)] = float(d2);
    }
    return {};
  }

  // mean |T|^2 of an unshadowed plane times the area: what errors are relative to, until rows are known.
  double norm(const std::vector<Edge>& edges, const std::vector<uint32_t>& row) const {
    double sum = 0;
    for (const Edge& e : edges)
      for (const uint64_t r : {e.receivers >> 32, e.receivers & 0xffffffffu}) {
        if (row[r] == none) continue;
        const float* x = rows.data() + size_t(row[r]) * width;
        double square = -noise;
        for (size_t k = 0; k < width; ++k) square += double(x[k]) * double(x[k]);
        sum += 0.5 * e.area * square;
      }
    return sum;
  }

  // What is left of an edge's error, times its area.
  double share_of(const Edge& e) const {
    const auto at = settled.find(settled_key(e));
    return at == settled.end() ? 0 : mean_square * e.area * double(at->second);
  }

  // The edges to split, by key of their ends; none: done.
  Result<std::unordered_set<uint64_t>> choose(const Receivers& receivers) {
    const std::vector<Edge> edges = edges_of(receivers);
    std::unordered_set<uint64_t> wanted;
    if (edges.empty()) return wanted;
    std::vector<Edge> some;
    for (size_t i = 0; i < edges.size(); i += pilot) some.push_back(edges[i]);
    const auto look = Clock::now();
    if (auto ok = test(receivers, some); !ok) return ok.error();
    const double took = seconds_since(look);
    auto relative = [&](const std::vector<Edge>& of) -> Result<double> {
      auto row = rows_of(receivers, of);
      if (!row) return row.error();
      double left = 0;
      for (const Edge& e : of) left += share_of(e);
      const double all = norm(of, *row);
      return all > 0 ? std::sqrt(std::max(0.0, left) / all) : 0.0;
    };
    auto error = relative(some);
    if (!error) return error.error();
    if (*error > 0.7 * options.error && late(took * (pilot - 1))) {
      if (report.first < 0) report.first = *error;
      report.last = *error;
      return wanted;
    }
    if (*error > 0.7 * options.error) {
      if (auto ok = test(receivers, edges); !ok) return ok.error();
      error = relative(edges);
      if (!error) return error.error();
    }
    if (report.first < 0) report.first = *error;
    report.last = *error;
    if (*error <= options.error) return wanted;
    auto row = rows_of(receivers, edges);
    if (!row) return row.error();
    const double budget = options.error * options.error * norm(edges, *row);
    std::vector<std::pair<double, size_t>> order;
    double left = 0;
    for (size_t i = 0; i < edges.size(); ++i) order.push_back({share_of(edges[i]), i}), left += order.back().first;
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    // Half of it, since halves have errors of their own.
    const size_t room = (limit() - std::min(limit(), scene.triangles.size())) / split_cost;
    for (const auto& [share, i] : order) {
      if (left <= 0.5 * budget || share <= 0) break;
      if (wanted.size() >= room) {
        report.limited = true;
        break;
      }
      left -= share;
      wanted.insert(edge_key(scene.positions[edges[i].a], scene.positions[edges[i].b]));
    }
    return wanted;
  }

  // No triangle keeps an edge much longer than one that it loses: slivers interpolate badly.
  void close(std::unordered_set<uint64_t>& wanted) const {
    for (bool grew = true; grew;) {
      grew = false;
      for (const Triangle& t : scene.triangles) {
        float sizes[3], least = INFINITY;
        uint64_t keys[3];
        size_t longest = 0;
        for (size_t k = 0; k < 3; ++k) {
          const Vec3 a = scene.positions[t.v[k]], b = scene.positions[t.v[(k + 1) % 3]];
          sizes[k] = length(b - a), keys[k] = edge_key(a, b);
          if (sizes[k] > sizes[longest]) longest = k;
          if (wanted.contains(keys[k])) least = std::min(least, sizes[k]);
        }
        if (sizes[longest] > longest_ratio * least && wanted.insert(keys[longest]).second) grew = true;
      }
    }
  }

  size_t limit() const {
    return report.before + std::max(options.triangles, size_t(options.more * double(report.before)));
  }

  Result<void> run() {
    if (auto ok = split_long_edges(scene, options.longest * diagonal, limit()); !ok) {
      report.limited = true;
      return {};
    }
    auto built = Tracer::build(original, progress);
    if (!built) return built.error();
    tracer = std::move(*built), first = make_vertex_receivers(original);
    for (; report.levels < most_levels; ++report.levels) {
      if (report.levels > 0 && late(0)) return {};
      const Receivers receivers = make_vertex_receivers(scene);
      auto wanted = choose(receivers);
      if (!wanted) return wanted.error();
      if (wanted->empty()) return {};
      close(*wanted);
      if (scene.triangles.size() + 2 * wanted->size() > limit()) {
        report.limited = true;
        return {};
      }
      split_edges(scene, [&](Vec3 a, Vec3 b) { return wanted->contains(edge_key(a, b)); });
    }
    return {};
  }
};

}  // namespace

Result<AdaptReport> adapt(Scene& scene, const AdaptOptions& options, Progress* progress) {
  const auto start = Clock::now();
  AdaptReport report;
  report.before = scene.triangles.size();
  Adapter adapter{scene, options, progress, report};
  if (auto ok = adapter.run(); !ok) return ok.error();
  report.after = scene.triangles.size();
  report.seconds = seconds_since(start);
  return report;
}

}  // namespace lambent
