#include <lambent/bake/indirect.h>

#include <lambent/bake/directions.h>
#include <lambent/bake/meshless.h>
#include <lambent/core/check.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>

namespace lambent {
namespace {

constexpr size_t rows_a_piece = 16;
constexpr int test_lamps = 4, direction_sets = 8;

// A row as it is gathered: what leaves it met, and the nodes they are taken for.
struct Met {
  uint32_t node, leaf;
  float weight;
};
struct Row {
  std::vector<uint32_t> nodes;
  std::vector<uint8_t> weights;
  float scale = 0;
  size_t strays = 0;
  std::array<double, test_lamps> right{};  // light of test lamps, as gathered
};

struct Gathering {
  const Scene& scene;
  const Tracer& tracer;
  const Surfels& surfels;
  const SurfelSearch& search;
  const IndirectOptions& options;
  const DirectionSets& sets;
  const std::vector<std::array<float, test_lamps>>& test;  // direct light of leaves
  float diagonal;
  std::vector<std::atomic<uint32_t>>& hits;  // of leaves, by all rows

  // The node that a leaf is taken for at a distance.
  uint32_t node_at(uint32_t leaf, float distance) const {
    size_t level = surfels.levels() - 1;
    for (; level > 0 && surfels.spacings[level - 1] <= options.angle * distance; --level)
      leaf = surfels.parents[surfels.first_parent(level) + leaf];
    return uint32_t(surfels.first_node(level)) + leaf;
  }
  // Sends a fan of `set`, turned as for `key` about the pole, but for rays that go below the plane of `above` (0: none
  // do). The share of rays that met backs of one-sided surfaces.
  double send(const DirectionSets& fans, Vec3 origin, Vec3 pole, Vec3 above, uint64_t key, bool counts,
              std::vector<Met>& met, Row& row) const;
  Vec3 true_normal(Vec3 origin, Vec3 n, float lift) const;
  void meet(uint32_t surfel, std::vector<Met>& met, Row& row) const;
  void compress(std::vector<Met>& met, Row& row) const;
};

double Gathering::send(const DirectionSets& fans, Vec3 origin, Vec3 pole, Vec3 above, uint64_t key, bool counts,
                       std::vector<Met>& met, Row& row) const {
  const DirectionChoice choice = choose_directions(fans, pole, options.seed, key);
  const size_t at = size_t(choice.set) * fans.stride;
  size_t backs = 0;
  met.clear();
  for (size_t i = 0; i < size_t(fans.samples); ++i) {
    const Vec3 d = choice.rotation * Vec3(fans.x[at + i], fans.y[at + i], fans.z[at + i]);
    if (dot(d, above) < 0) continue;
    Passage passage;
    const Hit hit = tracer.lets_pass() ? tracer.closest(origin, d, passage) : tracer.closest(origin, d);
    if (hit.triangle == none) continue;
    if (!hit.front && !scene.triangles[hit.triangle].two_sided) {
      ++backs;
      continue;
    }
    const uint32_t leaf = search.leaf(surface_place(scene, hit));
    if (leaf == none) {
      ++row.strays;
      continue;
    }
    if (counts) hits[leaf].fetch_add(1, std::memory_order_relaxed);
    const float weight = tracer.lets_pass() ? (passage.hit.x + passage.hit.y + passage.hit.z) / 3 : 1.0f;
    met.push_back({node_at(leaf, hit.distance), leaf, weight / float(fans.samples)});
  }
  return double(backs) / double(fans.samples);
}

// Of the face that a surfel lies on, whose own normal is interpolated: what lies below the face is the face itself.
Vec3 Gathering::true_normal(Vec3 origin, Vec3 n, float lift) const {
  const Hit under = tracer.closest(origin, -n, 0, 4 * lift);
  if (under.triangle == none) return n;
  const Vec3 face = unit_normal(scene, scene.triangles[under.triangle], n);
  return dot(face, n) < 0 ? -face : face;
}

void Gathering::meet(uint32_t surfel, std::vector<Met>& met, Row& row) const {
  const Vec3 n = surfels.normals[surfel];
  const float lift = receiver_lift(surfels.positions[surfel], surfels.spacings.back(), diagonal);
  const Vec3 origin = surfels.positions[surfel] + n * lift;
  send(sets, origin, n, true_normal(origin, n, lift), surfel, true, met, row);
}

// Merges by node, leaves the smallest out, rounds to bytes.
void Gathering::compress(std::vector<Met>& met, Row& row) const {
  for (const Met& m : met)
    for (size_t k = 0; k < test_lamps; ++k) row.right[k] += double(m.weight) * double(test[m.leaf][k]);
  std::stable_sort(met.begin(), met.end(), [](const Met& a, const Met& b) { return a.node < b.node; });
  std::vector<std::pair<float, uint32_t>> entries;
  double sum = 0;
  for (size_t i = 0; i < met.size(); ++i) {
    if (entries.empty() || entries.back().second != met[i].node) entries.emplace_back(0.0f, met[i].node);
    entries.back().first += met[i].weight, sum += double(met[i].weight);
  }
  std::sort(entries.begin(), entries.end());
  double dropped = 0;
  size_t first = 0;
  while (first < entries.size() && dropped + double(entries[first].first) <= double(options.dropped) * sum)
    dropped += double(entries[first++].first);
  entries.erase(entries.begin(), entries.begin() + ptrdiff_t(first));
  if (entries.empty()) return;
  const float most = entries.back().first;
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  size_t total = 0;
  for (const auto& [weight, node] : entries) {
    const int root = int(std::lround(std::sqrt(weight / most) * 255));
    if (root < 1) continue;
    row.nodes.push_back(node), row.weights.push_back(uint8_t(root)), total += size_t(root * root);
  }
  row.scale = float(std::min(sum, 1.0) / double(total));
}

// Direct light at leaves of lamps that stand somewhere in the scene, each in units of its own mean.
std::vector<std::array<float, test_lamps>> test_light(const Surfels& s, const Tracer& tracer, float diagonal,
                                                      uint32_t seed) {
  std::vector<std::array<float, test_lamps>> out(s.count());
  for (size_t k = 0; k < test_lamps; ++k) {
    Random random(seed, 0x7e57 + k);
    const size_t under = random.next64() % s.count();
    const Vec3 from = s.positions[under] + s.normals[under] * receiver_lift(s.positions[under], 0, diagonal);
    const Hit ceiling = tracer.closest(from, s.normals[under]);
    const float height = ceiling.triangle == none ? 0.1f * diagonal : 0.5f * ceiling.distance;
    const Vec3 lamp = from + s.normals[under] * height;
    parallel_for(s.count(), 256, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Vec3 p = s.positions[i] + s.normals[i] * receiver_lift(s.positions[i], 0, diagonal), way = lamp - p;
        const float far = std::max(length(way), 1e-6f * diagonal), cosine = dot(way, s.normals[i]) / far;
        const bool lit = cosine > 0 && tracer.closest(p, way / far, 0, far).triangle == none;
        out[i][k] = lit ? cosine * height * height / (far * far + 0.01f * height * height) : 0.0f;
      }
    });
  }
  return out;
}

// Means over the tree, of what leaves have.
std::vector<std::array<float, test_lamps>> at_nodes(const Surfels& s,
                                                    const std::vector<std::array<float, test_lamps>>& leaves) {
  std::vector<std::array<float, test_lamps>> nodes(s.nodes());
  std::vector<float> areas(s.nodes(), 0.0f);
  const size_t last = s.levels() - 1;
  std::copy(leaves.begin(), leaves.end(), nodes.begin() + ptrdiff_t(s.first_node(last)));
  std::copy(s.areas.begin(), s.areas.end(), areas.begin() + ptrdiff_t(s.first_node(last)));
  for (size_t l = last; l > 0; --l) {
    const size_t below = s.first_node(l), above = s.first_node(l - 1);
    for (size_t i = 0; i < s.counts[l]; ++i) {
      const size_t p = above + s.parents[s.first_parent(l) + i];
      areas[p] += areas[below + i];
      for (size_t k = 0; k < test_lamps; ++k) nodes[p][k] += areas[below + i] * nodes[below + i][k];
    }
    for (size_t i = above; i < above + s.counts[l - 1]; ++i)
      for (float& v : nodes[i]) v /= areas[i];
  }
  return nodes;
}

// What a leaf weighs in the means of the tree: how often it was met, so that what is hidden from all rows, under a
// plate or in a gap, does not darken what is seen beside it. All rows together then gather what was met, exactly.
void weigh_leaves(Surfels& s, const std::vector<std::atomic<uint32_t>>& hits) {
  double all = 0, area = 0;
  for (const auto& h : hits) all += h;
  for (float a : s.areas) area += double(a);
  constexpr double unseen = 1e-3;  // of its area's share, where it is never met
  for (size_t i = 0; i < s.count(); ++i)
    s.areas[i] = float((double(hits[i]) + unseen * all * double(s.areas[i]) / area) / std::max(all, 1.0) + 1e-12);
}

// Of e = G d as stored, over test lamps.
double compression_error(const NodeRows& t, const std::vector<Row>& rows,
                         const std::vector<std::array<float, test_lamps>>& node) {
  double wrong = 0, right = 0;
  for (size_t r = 0; r < rows.size(); ++r)
    for (size_t k = 0; k < test_lamps; ++k) {
      double sum = 0;
      for (size_t e = t.first[r]; e < t.first[r + 1]; ++e) sum += share(t.weights[e]) * double(node[t.nodes[e]][k]);
      const double difference = sum * double(t.scales[r]) - rows[r].right[k];
      wrong += difference * difference, right += rows[r].right[k] * rows[r].right[k];
    }
  return right > 0 ? std::sqrt(wrong / right) : 0;
}

// A piece of rows as it is kept.
struct RowPiece {
  std::vector<uint32_t> sizes, nodes, leaves;  // leaves: of all hits
  std::vector<uint8_t> weights;
  std::vector<float> scales;
  std::vector<uint64_t> strays;
  std::vector<std::array<double, test_lamps>> right;

  void add(const Row& row) {
    sizes.push_back(uint32_t(row.nodes.size())), scales.push_back(row.scale), strays.push_back(row.strays);
    nodes.insert(nodes.end(), row.nodes.begin(), row.nodes.end()), right.push_back(row.right);
    weights.insert(weights.end(), row.weights.begin(), row.weights.end());
  }
  bool fits(size_t rows, const Surfels& s) const {
    size_t all = 0;
    for (const uint32_t size : sizes) all += size;
    const auto below = [](const std::vector<uint32_t>& v, size_t end) {
      return std::all_of(v.begin(), v.end(), [end](uint32_t k) { return k < end; });
    };
    return sizes.size() == rows && scales.size() == rows && strays.size() == rows && right.size() == rows &&
           nodes.size() == all && weights.size() == all && below(nodes, s.nodes()) && below(leaves, s.count());
  }
  void take(Row* rows) const {
    for (size_t i = 0, at = 0; i < sizes.size(); at += sizes[i++]) {
      const auto from = ptrdiff_t(at), to = ptrdiff_t(at + sizes[i]);
      rows[i] = {{nodes.begin() + from, nodes.begin() + to},
                 {weights.begin() + from, weights.begin() + to},
                 scales[i],
                 size_t(strays[i]),
                 right[i]};
    }
  }
};

NodeRows rows_of(const std::vector<Row>& rows) {
  NodeRows out;
  for (const Row& row : rows) {
    out.nodes.insert(out.nodes.end(), row.nodes.begin(), row.nodes.end());
    out.weights.insert(out.weights.end(), row.weights.begin(), row.weights.end());
    out.scales.push_back(row.scale), out.first.push_back(uint32_t(out.nodes.size()));
  }
  return out;
}

Result<void> gather_rows(IndirectTransfer& t, const Gathering& g, IndirectReport& report, Progress* progress) {
  const size_t count = t.gathering();
  std::vector<Row> rows(count);
  const KeptPieces pieces(progress, "gathering", (count + rows_a_piece - 1) / rows_a_piece);
  ProgressStage stage(progress, "gathering", count);
  parallel_for(count, rows_a_piece, [&](size_t begin, size_t end) {
    const size_t number = begin / rows_a_piece;
    RowPiece piece;
    if (pieces.load(number, piece.sizes, piece.nodes, piece.leaves, piece.weights, piece.scales, piece.strays,
                    piece.right)) {
      if (piece.fits(end - begin, t.surfels)) {
        piece.take(rows.data() + begin);
        for (const uint32_t leaf : piece.leaves) g.hits[leaf].fetch_add(1, std::memory_order_relaxed);
        stage.advance(end - begin);
        return;
      }
      pieces.refuse(), piece = {};
    }
    std::vector<Met> met;
    for (size_t r = begin; r < end && !stage.cancelled(); ++r) {
      g.meet(uint32_t(r), met, rows[r]);
      for (size_t k = 0; pieces && k < met.size(); ++k) piece.leaves.push_back(met[k].leaf);
      g.compress(met, rows[r]), piece.add(rows[r]), stage.advance();
    }
    pieces.save(number, piece.sizes, piece.nodes, piece.leaves, piece.weights, piece.scales, piece.strays, piece.right);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  t.gather = rows_of(rows);
  for (const Row& row : rows) report.strays += row.strays;
  weigh_leaves(t.surfels, g.hits);
  round_surfels(t.surfels);
  t.error = compression_error(t.gather, rows, at_nodes(t.surfels, g.test));
  report.rays = count * size_t(g.sets.samples);
  return {};
}

// Light in free space, by the same leaves.
Result<void> gather_lattice(IndirectTransfer& t, const Gathering& g, IndirectReport& report, Progress* progress) {
  IndirectLattice f{*g.options.lattice, g.options.lattice_order, {}, {}};
  const size_t points = f.lattice.count();
  const DirectionSets sets =
      make_direction_sets(1, g.options.samples, direction_sets, g.options.seed, square_to_sphere, progress);
  std::vector<Row> rows(points);
  f.valid.assign(points, 1);
  ProgressStage stage(progress, "gathering in free space", points);
  parallel_for(points, rows_a_piece, [&](size_t begin, size_t end) {
    std::vector<Met> met;
    for (size_t p = begin; p < end && !stage.cancelled(); ++p, stage.advance()) {
      // A pole of its own and a spin about it: every point's directions are turned at random.
      const uint64_t bits = hash64(hash64(g.options.seed, 0x1a771ce), p);
      const Vec3 pole = square_to_sphere({to_unit_float(uint32_t(bits >> 32)), to_unit_float(uint32_t(bits))});
      f.valid[p] = g.send(sets, f.lattice.position(p), pole, Vec3(0.0f), p, false, met, rows[p]) <= 0.5;
      if (f.valid[p]) g.compress(met, rows[p]);
    }
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  report.invalid = size_t(std::count(f.valid.begin(), f.valid.end(), uint8_t(0)));
  if (report.invalid == points) return Error{"lattice", "every point lies inside something"};
  f.rows = rows_of(rows), report.rays += points * size_t(sets.samples);
  t.lattice = std::move(f);
  return {};
}

void set_reader(IndirectTransfer& t, size_t r, Kernels k) {
  round_kernels(k);
  for (size_t i = 0; i < k.count; ++i) {
    t.reader_surfels[r * kernel_slots + i] = k.surfel[i];
    t.reader_weights[r * kernel_slots + i] = float_to_half(k.weight[i]);
  }
}

void set_readers(IndirectTransfer& t, const Scene& scene, const SurfelSearch& search, const Receivers& receivers,
                 IndirectReport& report) {
  t.receivers = receivers.count();
  t.reader_surfels.assign(t.receivers * kernel_slots, 0), t.reader_weights.assign(t.receivers * kernel_slots, 0);
  const ReadKernels read = read_kernels(scene, search, receivers);
  for (size_t r = 0; r < t.receivers; ++r) set_reader(t, r, read.kernels[r]);
  report.buried = read.buried, report.unread = read.unread;
  // In the order in which a file has them.
  const auto ok = unpack_kernels(pack_kernels(t), t, "");
  LAMBENT_CHECK(ok);
}

// Surfels, and what gathers over them.
struct Begun {
  IndirectTransfer t;
  std::unique_ptr<const SurfelSearch> search;
  DirectionSets sets;
  std::vector<std::array<float, test_lamps>> test;
  std::vector<std::atomic<uint32_t>> hits;

  Gathering gathering(const Scene& scene, const Tracer& tracer, const IndirectOptions& options) {
    return {scene, tracer, t.surfels, *search, options, sets, test, bounds(scene).diagonal(), hits};
  }
};

Result<std::unique_ptr<Begun>> begin(const Scene& scene, const Tracer& tracer, const IndirectOptions& options,
                                     IndirectReport& told, Progress* progress) {
  const auto start = Clock::now();
  auto surfels = make_surfels(scene, tracer, {options.surfels, options.seed}, progress);
  if (!surfels) return surfels.error();
  auto b = std::make_unique<Begun>();
  Surfels& s = b->t.surfels = std::move(*surfels);
  for (const Material& m : scene.materials) s.names.push_back(m.name);
  round_surfels(s);
  const size_t leaves = s.levels() - 1;
  b->t.gather_level = uint32_t(options.all_gather || leaves == 0 ? leaves : leaves - 1);
  b->search = std::make_unique<const SurfelSearch>(s, tracer, b->t.gather_level);
  told.surfel_seconds = seconds_since(start);
  b->sets =
      make_direction_sets(1, options.samples, direction_sets, options.seed, square_to_cosine_hemisphere, progress);
  b->test = test_light(s, tracer, bounds(scene).diagonal(), options.seed);
  b->hits = std::vector<std::atomic<uint32_t>>(s.count());
  return b;
}

// Runs of `run` out of `count`, evenly apart, `most` in all: f(index).
void each_of_runs(size_t count, size_t run, size_t most, auto f) {
  const size_t pieces = (count + run - 1) / run, taken = std::min(pieces, most / run);
  for (size_t k = 0; k < taken; ++k)
    for (size_t i = k * pieces / taken * run; i < std::min(count, (k * pieces / taken + 1) * run); ++i) f(i);
}

}  // namespace

Result<IndirectTransfer> bake_indirect(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                       const IndirectOptions& options, IndirectReport* report, Progress* progress) {
  IndirectReport unasked;
  IndirectReport& told = report ? *report : unasked;
  told = {};
  auto begun = begin(scene, tracer, options, told, progress);
  if (!begun) return begun.error();
  auto start = Clock::now();
  IndirectTransfer& t = (*begun)->t;
  const Gathering g = (*begun)->gathering(scene, tracer, options);
  if (auto ok = gather_rows(t, g, told, progress); !ok) return ok.error();
  if (options.lattice)
    if (auto ok = gather_lattice(t, g, told, progress); !ok) return ok.error();
  t.rows = directional_rows(options.directional);
  told.trace_seconds = seconds_since(start), start = Clock::now();
  set_readers(t, scene, g.search, receivers, told);
  told.reader_seconds = seconds_since(start);
  return std::move(t);
}

Result<IndirectExpected> expect_indirect(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                         const IndirectOptions& options, Progress* progress) {
  constexpr size_t most_rows = 512, most_readers = 4096, most_points = 4;
  IndirectReport told;
  auto begun = begin(scene, tracer, options, told, progress);
  if (!begun) return begun.error();
  const auto start = Clock::now();
  IndirectTransfer& t = (*begun)->t;
  const Gathering g = (*begun)->gathering(scene, tracer, options);
  std::vector<uint32_t> which;
  each_of_runs(t.gathering(), rows_a_piece, most_rows, [&](size_t i) { which.push_back(uint32_t(i)); });
  std::vector<Row> rows(which.size());
  parallel_for(which.size(), rows_a_piece, [&](size_t begin, size_t end) {
    std::vector<Met> met;
    for (size_t i = begin; i < end && !is_cancelled(progress); ++i)
      g.meet(which[i], met, rows[i]), g.compress(met, rows[i]);
  });
  t.gather = rows_of(rows);
  const double rows_of_all = double(t.gathering()) / double(std::max<size_t>(which.size(), 1));
  double points_of_all = 0;
  if (options.lattice) {
    IndirectOptions few = options;
    Lattice& l = *few.lattice;
    for (int* n : {&l.nx, &l.ny, &l.nz}) *n = std::min(*n, int(most_points));
    if (auto ok = gather_lattice(t, (*begun)->gathering(scene, tracer, few), told, progress); !ok) return ok.error();
    points_of_all = double(options.lattice->count()) / double(l.count());
  }
  which.clear();
  each_of_runs(receivers.count(), 1024, most_readers, [&](size_t r) { which.push_back(uint32_t(r)); });
  t.receivers = which.size();
  t.reader_surfels.assign(t.receivers * kernel_slots, 0), t.reader_weights.assign(t.receivers * kernel_slots, 0);
  for (size_t i = 0; i < which.size(); ++i)
    set_reader(t, i, g.search.kernels({receivers.origins[which[i]], receivers.normals[which[i]]}));
  if (is_cancelled(progress)) return Error{"", "cancelled"};
  IndirectExpected out{t.bytes_of_parts(), told.surfel_seconds};
  out.seconds += seconds_since(start) * std::max(rows_of_all, points_of_all);
  out.bytes.gather = size_t(double(out.bytes.gather) * rows_of_all);
  out.bytes.lattice = size_t(double(out.bytes.lattice) * points_of_all);
  out.bytes.kernels =
      size_t(double(out.bytes.kernels) * double(receivers.count()) / double(std::max<size_t>(which.size(), 1)));
  return out;
}

}  // namespace lambent
