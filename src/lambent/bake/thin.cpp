#include <lambent/bake/spread.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <unordered_map>

namespace lambent {
namespace {

constexpr size_t smoothed = 6;         // neighbours whose differences are averaged with one's own
constexpr size_t leaf = 6;             // a cell of so few that is to be split is traced whole
constexpr double left_out_more = 0.5;  // what leaving one out loses is more than what is lost between: squared
constexpr size_t held_out = 512;
constexpr uint32_t test_passes = 4;
constexpr double surely = 1.05;  // more expected than is worth it by so much: no more is looked at
constexpr int most_levels = 16, most_corrections = 10;
constexpr size_t piece = 64;

struct Thinner {
  const Receivers& r;
  const ThinOptions& options;
  const PilotRows& pilot;
  size_t width;
  std::vector<float> areas;
  Vec3 corner{0};
  size_t n = r.count();
  std::vector<uint32_t> chosen{};  // in the order of choosing
  std::vector<float> sizes{};      // of the cells of `chosen`; 0: a cell of one, and nothing is left to choose
  std::vector<uint32_t> of = std::vector<uint32_t>(n, none);
  // Of those that the pilot has looked at: receivers, [i][pass][width], inside.
  std::vector<uint32_t> looked{};
  std::vector<float> rows{};
  std::vector<uint8_t> inside{};
  std::vector<uint32_t> at = {};  // of chosen: index into looked, or none
  std::vector<double> lost{};     // of looked: squared difference when left out
  std::vector<uint8_t> alone{};   // of looked: too few neighbours to tell
  std::vector<float> border{};    // of looked, inside something: the distance to what is not
  size_t tried = 0;

  struct Group {
    uint32_t anchor, chosen;  // a member; the one chosen (index into `chosen`), or none
    uint32_t count = 0;
    Vec3d sum{0};
    float nearest = INFINITY;
    uint32_t best = none;
  };

  // Cells of those flagged, of half their size; with none chosen yet, of all, of this size.
  void split(const std::vector<uint8_t>& flagged, float first_size) {
    std::vector<uint32_t> members(chosen.size(), 0);
    for (uint32_t c : of)
      if (c != none) ++members[c];
    std::unordered_map<uint64_t, std::vector<uint32_t>> cells;
    std::vector<Group> groups;
    std::vector<uint32_t> group_of(n, none);
    const size_t before = chosen.size();
    auto size_at = [&](uint32_t c) { return c == none ? first_size : 0.5f * sizes[c]; };
    auto place = [&](uint32_t v, float size) -> uint32_t {
      const Vec3 p = (r.origins[v] - corner) / size;
      auto coordinate = [](float f) { return uint64_t(int64_t(std::floor(double(f)))) & 0x1fffff; };
      const uint64_t key =
          hash64(coordinate(p.x) << 42 | coordinate(p.y) << 21 | coordinate(p.z), uint64_t(size_level(size)));
      auto& list = cells[key];
      for (uint32_t g : list)
        if (on_one_surface(r, groups[g].anchor, v)) return g;
      list.push_back(uint32_t(groups.size()));
      groups.push_back({v, none});
      return uint32_t(groups.size() - 1);
    };
    auto wanted = [&](uint32_t v) { return of[v] == none || (flagged[of[v]] && sizes[of[v]] > 0); };
    for (uint32_t c = 0; c < before; ++c) {
      if (!flagged[c] || !(sizes[c] > 0)) continue;
      if (members[c] <= leaf) continue;
      const uint32_t v = chosen[c], g = place(v, size_at(c));
      if (groups[g].chosen == none) groups[g].chosen = c;
      group_of[v] = g;
    }
    for (uint32_t v = 0; v < n; ++v) {
      if (!wanted(v)) continue;
      const uint32_t c = of[v];
      if (c != none && members[c] <= leaf) {  // all of it
        if (chosen[c] == v) continue;
        of[v] = uint32_t(chosen.size()), chosen.push_back(v), sizes.push_back(0), at.push_back(none);
        continue;
      }
      if (c != none && chosen[c] == v) continue;
      const uint32_t g = place(v, size_at(c));
      group_of[v] = g, ++groups[g].count, groups[g].sum += Vec3d(r.origins[v]);
    }
    for (uint32_t v = 0; v < n; ++v) {
      if (group_of[v] == none || groups[group_of[v]].count == 0) continue;
      Group& g = groups[group_of[v]];
      const Vec3d d = Vec3d(r.origins[v]) - g.sum / double(g.count);
      if (const float distance = float(dot(d, d)); distance < g.nearest) g.nearest = distance, g.best = v;
    }
    for (Group& g : groups) {
      if (g.chosen != none) continue;
      const float size = size_at(of[g.best]);
      g.chosen = uint32_t(chosen.size());
      chosen.push_back(g.best), sizes.push_back(size), at.push_back(none);
    }
    for (uint32_t c = 0; c < before; ++c)
      if (flagged[c]) sizes[c] = members[c] <= leaf ? 0 : size_at(c);
    for (uint32_t v = 0; v < n; ++v)
      if (group_of[v] != none) of[v] = groups[group_of[v]].chosen;
    for (uint32_t c = 0; c < chosen.size(); ++c) of[chosen[c]] = c;
  }
  float level_size = 1;
  int size_level(float size) const { return int(std::lround(std::log2(level_size / size))); }

  Result<void> look(std::span<const uint32_t> which, uint32_t pass, std::vector<float>& two,
                    std::vector<uint8_t>& inner) {
    const size_t count = which.size();
    std::vector<float> once(count * width);
    two.assign(2 * count * width, 0.0f), inner.assign(count, 0);
    for (uint32_t k = 0; k < 2; ++k) {
      std::vector<uint8_t> here(count, 0);
      if (auto ok = pilot(which, pass + k, once.data(), here.data()); !ok) return ok;
      for (size_t i = 0; i < count; ++i) {
        std::copy_n(once.data() + i * width, width, two.data() + (2 * i + k) * width);
        inner[i] |= here[i];
      }
    }
    tried += 2 * count;
    return {};
  }

  // The pilot's rows of those that it has not looked at and that have more to choose.
  Result<void> look_at_new() {
    std::vector<uint32_t> fresh;
    for (uint32_t c = 0; c < chosen.size(); ++c)
      if (sizes[c] > 0 && at[c] == none) fresh.push_back(c);
    return look_at(fresh);
  }
  // The same for all that Spread would ask for these receivers.
  Result<void> look_near(std::span<const uint32_t> receivers) {
    const PointCloud cloud{r.origins, chosen};
    const PointTree tree(3, cloud, {16});
    std::vector<uint8_t> wanted(chosen.size(), 0);
    for (uint32_t v : receivers) {
      uint32_t found[Spread::most];
      const size_t count = find_neighbours(tree, r, chosen, chosen[of[v]], SIZE_MAX, Spread::most, found);
      for (size_t q = 0; q < count; ++q) wanted[found[q]] = at[found[q]] == none;
    }
    std::vector<uint32_t> fresh;
    for (uint32_t c = 0; c < chosen.size(); ++c)
      if (wanted[c]) fresh.push_back(c);
    return look_at(fresh);
  }
  Result<void> look_at(std::vector<uint32_t> fresh) {
    for (uint32_t& c : fresh) {
      at[c] = uint32_t(looked.size() + size_t(&c - fresh.data()));
      c = chosen[c];
    }
    std::vector<float> two;
    std::vector<uint8_t> inner;
    if (auto ok = look(fresh, 2 * uint32_t(looked.size() % 0x7fffff), two, inner); !ok) return ok;
    looked.insert(looked.end(), fresh.begin(), fresh.end());
    rows.insert(rows.end(), two.begin(), two.end());
    inside.insert(inside.end(), inner.begin(), inner.end());
    return {};
  }

  // (a - sum of shares a_q) . (b - sum of shares b_q)
  double difference(const float* two, const uint32_t* neighbour, const float* share, size_t count) const {
    double sum = 0;
    for (size_t k = 0; k < width; ++k) {
      float a = two[k], b = two[width + k];
      for (size_t q = 0; q < count; ++q) {
        const float* row = rows.data() + 2 * size_t(neighbour[q]) * width;
        a -= share[q] * row[k], b -= share[q] * row[width + k];
      }
      sum += double(a) * double(b);
    }
    return sum;
  }

  std::vector<uint32_t> clear() const {
    std::vector<uint32_t> out;
    for (uint32_t i = 0; i < looked.size(); ++i)
      if (!inside[i]) out.push_back(i);
    return out;
  }

  // Of receiver i from those looked at around `about`, without `skip`; its shares, indices into looked. At most
  // Spread::most.
  size_t neighbours(const PointTree& tree, std::span<const uint32_t> open, std::span<const uint32_t> receivers,
                    size_t i, size_t about, size_t skip, uint32_t* index, float* share) const {
    uint32_t found[Spread::most], places[Spread::most];
    const size_t count = find_neighbours(tree, r, receivers, about, skip, Spread::most, found);
    for (size_t q = 0; q < count; ++q) index[q] = open[found[q]], places[q] = receivers[found[q]];
    if (count > 0) regress(r, i, places, count, share);
    return count;
  }

  // What each loses when left out.
  void compare() {
    const std::vector<uint32_t> open = clear();
    std::vector<uint32_t> receivers;
    for (uint32_t i : open) receivers.push_back(looked[i]);
    const PointCloud cloud{r.origins, receivers};
    const PointTree tree(3, cloud, {16});
    struct Own {
      double difference = 0;
      std::array<uint32_t, smoothed> near{};
      uint32_t nears = 0, count = 0;
    };
    std::vector<Own> compared(open.size()), own(looked.size());
    const Shares shares(open.size(), piece);
    shares.for_own([&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        const uint32_t i = open[k];
        uint32_t index[Spread::most];
        float share[Spread::most];
        Own& mine = compared[k];
        mine.count = uint32_t(neighbours(tree, open, receivers, looked[i], looked[i], looked[i], index, share));
        mine.difference = difference(rows.data() + 2 * size_t(i) * width, index, share, mine.count);
        mine.nears = std::min(mine.count, uint32_t(smoothed));
        std::copy_n(index, mine.nears, mine.near.begin());
      }
    });
    shares.gather(compared.data());
    alone.assign(looked.size(), 0), border.assign(looked.size(), INFINITY);
    for (size_t k = 0; k < open.size(); ++k)
      own[open[k]] = compared[k], alone[open[k]] = compared[k].count < fewest_neighbours;
    // Those inside something, but near what is not: where the border runs is not known.
    for (uint32_t i = 0; i < looked.size() && !open.empty(); ++i) {
      if (!inside[i]) continue;
      uint32_t found;
      const Vec3 p = r.origins[looked[i]];
      const float query[3] = {p.x, p.y, p.z};
      float distance2;
      tree.knnSearch(query, 1, &found, &distance2);
      border[i] = std::sqrt(distance2);
    }
    lost.assign(looked.size(), 0.0);
    for (uint32_t i : open) {
      const Own& mine = own[i];
      double sum = mine.difference;
      for (size_t q = 0; q < mine.nears; ++q) sum += own[mine.near[q]].difference;
      lost[i] = sum / double(1 + mine.nears);
    }
  }

  // mean |row|^2 of those looked at, by the area they stand for; the same of their noise.
  double square(double& noise) const {
    double sum = 0, area = 0, noises = 0;
    std::vector<double> cell(chosen.size(), 0.0);
    for (uint32_t v = 0; v < n; ++v) cell[of[v]] += double(areas[v]);
    for (size_t c = 0; c < chosen.size(); ++c) {
      if (at[c] == none || inside[at[c]]) continue;
      const float* two = rows.data() + 2 * size_t(at[c]) * width;
      double product = 0;
      for (size_t k = 0; k < width; ++k) {
        product += double(two[k]) * double(two[width + k]);
        noises += 0.5 * cell[c] * double(two[k] - two[width + k]) * double(two[k] - two[width + k]);
      }
      sum += cell[c] * product, area += cell[c];
    }
    noise = area > 0 ? noises / area : 0;
    return area > 0 ? std::max(sum / area, 0.0) : 0.0;
  }

  // Those whose cells are to be split; empty: enough. `budget`: of the mean square lost.
  std::vector<uint8_t> choose(double budget) {
    std::vector<double> cell(chosen.size(), 0.0);
    std::vector<uint32_t> members(chosen.size(), 0);
    double all = 0;
    for (uint32_t v = 0; v < n; ++v) cell[of[v]] += double(areas[v]), ++members[of[v]], all += double(areas[v]);
    std::vector<std::pair<double, uint32_t>> order;
    std::vector<uint8_t> flagged(chosen.size(), 0);
    bool any = false;
    double left = 0;
    for (uint32_t c = 0; c < chosen.size(); ++c) {
      if (members[c] < 2 || at[c] == none || !(sizes[c] > 0)) continue;
      if (inside[at[c]]) {
        if (border[at[c]] < 2 * sizes[c]) flagged[c] = 1, any = true;
      } else if (alone[at[c]]) flagged[c] = 1, any = true;
      else order.push_back({left_out_more * cell[c] * lost[at[c]], c}), left += order.back().first;
    }
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    if (left > budget * all)
      for (const auto& [share, c] : order) {
        if (left <= 0.5 * budget * all || share <= 0) break;
        left -= share, flagged[c] = 1, any = true;
      }
    return any ? flagged : std::vector<uint8_t>();
  }

  // How many would be traced in the end, for this budget of the mean square lost, if squares of what a cell loses fell
  // as the area of its pieces: as at edges and where all is detail, and more slowly than where light is smooth. Pieces
  // as they are fewest.
  double expected(double budget) const {
    std::vector<double> cell(chosen.size(), 0.0);
    std::vector<uint32_t> members(chosen.size(), 0);
    double all = 0, roots = 0, sum = 0;
    for (uint32_t v = 0; v < n; ++v) cell[of[v]] += double(areas[v]), ++members[of[v]], all += double(areas[v]);
    auto root = [&](uint32_t c) {
      if (members[c] < 2 || at[c] == none || inside[at[c]] || !(sizes[c] > 0)) return 0.0;
      return std::sqrt(left_out_more * cell[c] * std::max(0.0, lost[at[c]]));
    };
    for (uint32_t c = 0; c < chosen.size(); ++c) roots += root(c);
    for (uint32_t c = 0; c < chosen.size(); ++c)
      sum += root(c) > 0 ? std::clamp(root(c) * roots / (budget * all), 1.0, double(members[c])) : 1.0;
    return sum;
  }

  // How often receivers that are not chosen are looked at: half by area, half by what their cells seem to lose as well,
  // since most is lost in few places. [receiver], 0: chosen.
  std::vector<double> test_densities() const {
    std::vector<double> out(n, 0.0), loses(n, 0.0);
    double area = 0, all = 0;
    for (uint32_t v = 0; v < n; ++v) {
      const uint32_t c = of[v];
      if (chosen[c] == v) continue;
      // A cell of one that is looked at no more has what was lost there when it was split.
      if (at[c] != none && !inside[at[c]]) loses[v] = double(areas[v]) * std::max(0.0, lost[at[c]]);
      out[v] = double(areas[v]), area += out[v], all += loses[v];
    }
    for (uint32_t v = 0; v < n && all > 0; ++v) out[v] = 0.5 * out[v] + 0.5 * loses[v] * area / all;
    return out;
  }

  // Mean square lost at receivers that are not chosen, times their part of the area, as Spread will have them: from the
  // neighbours of the one that stands for them.
  Result<double> measure(uint32_t pass) {
    double all = 0, density = 0, passed = 0;
    for (float a : areas) all += double(a);
    const std::vector<double> densities = test_densities();
    for (double d : densities) density += d;
    const double apart = density / double(held_out);
    std::vector<uint32_t> tests;
    for (uint32_t v = 0; v < n; ++v) {
      const double before = std::floor(passed / apart + 0.5);
      passed += densities[v];
      if (densities[v] > 0 && std::floor(passed / apart + 0.5) > before) tests.push_back(v);
    }
    if (tests.empty()) return 0.0;
    // Means of several passes, since their noise has to lie below what is lost.
    std::vector<float> two(2 * tests.size() * width, 0.0f), once;
    std::vector<uint8_t> inner(tests.size(), 0), there;
    for (uint32_t k = 0; k < test_passes; ++k) {
      if (auto ok = look(tests, pass + 2 * k, once, there); !ok) return ok.error();
      for (size_t i = 0; i < two.size(); ++i) two[i] += once[i] / float(test_passes);
      for (size_t i = 0; i < inner.size(); ++i) inner[i] |= there[i];
    }
    if (auto ok = look_near(tests); !ok) return ok.error();
    const std::vector<uint32_t> open = clear();
    std::vector<uint32_t> receivers;
    for (uint32_t i : open) receivers.push_back(looked[i]);
    const PointCloud cloud{r.origins, receivers};
    const PointTree tree(3, cloud, {16});
    double sum = 0;
    for (size_t t = 0; t < tests.size(); ++t) {
      if (inner[t]) continue;
      uint32_t index[Spread::most];
      float share[Spread::most];
      const uint32_t v = tests[t];
      const size_t found = neighbours(tree, open, receivers, v, chosen[of[v]], SIZE_MAX, index, share);
      sum += double(areas[v]) / std::min(1.0, densities[v] / apart) *
             difference(two.data() + 2 * t * width, index, share, found);
    }
    return std::max(0.0, sum) / all;
  }

  Thinned result() {
    Thinned out;
    std::vector<uint32_t> order(chosen.size()), rank(chosen.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return chosen[a] < chosen[b]; });
    for (uint32_t k = 0; k < order.size(); ++k) rank[order[k]] = k, out.chosen.push_back(chosen[order[k]]);
    out.of.resize(n);
    for (uint32_t v = 0; v < n; ++v) out.of[v] = rank[of[v]];
    return out;
  }
};

}  // namespace

Result<Thinned> thin(const Scene& scene, const Receivers& receivers, size_t width, const PilotRows& pilot,
                     const ThinOptions& options) {
  const size_t n = receivers.count();
  if (n < 2 * options.fewest) return keep_all(n);
  Thinner t{receivers, options, pilot, width, receiver_areas(scene, receivers), bounds(scene).min};
  double area = 0;
  for (float a : t.areas) area += double(a);
  if (!(area > 0)) return keep_all(n);
  t.level_size = float(std::sqrt(area / double(options.fewest)));
  t.split({}, t.level_size);
  double scale = 1, lost = 0, square = 0, noise = 0;
  int corrections = 0;
  bool pays = true;
  for (int level = 0; level < most_levels; ++level) {
    pays = double(t.chosen.size()) <= options.worth * double(n);
    if (!pays) break;
    if (auto ok = t.look_at_new(); !ok) return ok.error();
    t.compare();
    square = std::max(options.square, t.square(noise));
    const double budget = options.error * options.error * square;
    if (level == 0 && t.expected(budget) > surely * options.worth * double(n)) {
      pays = false;
      break;
    }
    std::vector<uint8_t> flagged = t.choose(scale * budget);
    if (flagged.empty()) {
      auto measured = t.measure(0xffff0000u + 2 * test_passes * uint32_t(corrections));
      if (!measured) return measured.error();
      lost = *measured;
      if (lost <= budget || corrections == most_corrections) break;
      scale *= std::clamp(0.7 * budget / lost, 0.1, 0.7), ++corrections;
      flagged = t.choose(scale * budget);
      if (flagged.empty()) continue;
    }
    t.split(flagged, t.level_size);
  }
  pays = pays && double(t.chosen.size()) <= options.worth * double(n);
  Thinned out = pays ? t.result() : keep_all(n);
  out.tried = t.tried, out.noise = square > 0 ? std::sqrt(noise / square) : 0;
  out.error = out.all() || !(square > 0) ? 0 : std::sqrt(lost / square);
  return out;
}

}  // namespace lambent
