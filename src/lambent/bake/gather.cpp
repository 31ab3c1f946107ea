// Follows: general-prt (transfer by the Neumann recursion, interpolated between receivers), radiosity (the same
// operator).
#include <lambent/bake/block_builder.h>
#include <lambent/bake/fan.h>
#include <lambent/bake/gather_ahead.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <array>
#include <span>

namespace lambent {
namespace {

// A handful of sets keeps the tables in cache; the spin makes every receiver's directions its own.
constexpr int set_count = 8;
// Hits are looked up in tables larger than the caches: so many rays ahead.
constexpr size_t lookahead = 16;

bool is_grey(Vec3 c) { return c.x == c.y && c.y == c.z; }

// One receiver's directions in world space, and the sky row of a visibility.
struct Fan {
  const DirectionSets& sets;
  ShZyzRotator rotator;
  AlignedVector<float> x, y, z, lobe;
  std::vector<AlignedVector<float>> visible;  // of each sky channel
  std::vector<float> half, rest, part;
  DirectionChoice choice{};

  Fan(const DirectionSets& s, int sky_channels)
      : sets(s),
        rotator(s.order),
        x(s.stride),
        y(s.stride),
        z(s.stride),
        lobe(s.stride),
        visible(size_t(sky_channels), AlignedVector<float>(s.stride)),
        half(size_t(sh_count(s.order))),
        rest(half.size()) {}

  Directions aim(Vec3 normal, uint32_t seed, size_t receiver) {
    choice = choose_directions(sets, normal, seed, receiver);
    const size_t base = size_t(choice.set) * sets.stride;
    rotate_directions(choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                      x.data(), y.data(), z.data());
    return {x.data(), y.data(), z.data(), size_t(sets.samples)};
  }

  // T0: the mean of V y over cosine-distributed directions, which is the integral of V y cos / pi.
  void project(const float* seen, float* row, float* half_row) {
    const size_t coefficients = half.size();
    if (coefficients == 0) return;  // light of lobes alone
    const float* table = sets.table.data() + size_t(choice.set) * coefficients * sets.stride;
    weighted_rows(table, coefficients, sets.stride, seen, sets.half >= size_t(sets.samples) ? sets.stride : sets.half,
                  half.data());
    std::fill(rest.begin(), rest.end(), 0.0f);
    if (sets.half < size_t(sets.samples))
      weighted_rows(table + sets.half, coefficients, sets.stride, seen + sets.half, sets.stride - sets.half,
                    rest.data());
    const float* excess = sets.excess.empty() ? nullptr : sets.excess.data() + size_t(choice.set) * 2 * coefficients;
    float open = 0;
    for (size_t j = 0; excess && j < size_t(sets.samples); ++j) open += seen[j];
    open /= float(sets.samples);
    const float rays = float(std::min(sets.half, size_t(sets.samples)));
    for (size_t k = 0; k < coefficients; ++k) {
      row[k] = (half[k] + rest[k]) / float(sets.samples) - (excess ? open * excess[k] : 0.0f);
      if (half_row) half_row[k] = half[k] / rays - (excess ? open * excess[coefficients + k] : 0.0f);
    }
    rotator.rotate(choice.a, choice.b, choice.c, {row, coefficients});
    if (half_row) rotator.rotate(choice.a, choice.b, choice.c, {half_row, coefficients});
  }

  // The same for the broad lobes: the mean of V b.
  void project_lobes(const LobeSets& lobes, const float* seen, float* row, float* half_row) {
    const size_t samples = size_t(sets.samples), half_rays = std::min(sets.half, samples);
    for (uint32_t k : lobes.broad) {
      evaluate_on_fan(lobes, k, x.data(), y.data(), z.data(), sets.stride, lobe.data());
      float first = 0, second = 0;
      weighted_rows(lobe.data(), 1, sets.stride, seen, sets.half < samples ? sets.half : sets.stride, &first);
      if (sets.half < samples)
        weighted_rows(lobe.data() + sets.half, 1, sets.stride, seen + sets.half, sets.stride - sets.half, &second);
      row[k] = (first + second) / float(samples);
      if (half_row) half_row[k] = first / float(half_rays);
    }
  }

  // What the rays of each place see, every places-th of the fan, by the way that its fan is turned.
  void project_places(const GatherSky& sky, size_t first, size_t receiver, std::span<const DirectionChoice> turned) {
    const size_t width = sky.stride;
    float *row = sky.rows + (receiver - first) * width, *half_row = checked_row(sky, first, receiver);
    std::fill_n(row, width, 0.0f);
    if (half_row) std::fill_n(half_row, width, 0.0f);
    std::vector<AlignedVector<float>> all = visible;
    for (size_t place = 0; place < turned.size(); ++place) {
      choice = turned[place];
      for (size_t c = 0; c < visible.size(); ++c)
        for (size_t j = 0; j < size_t(sets.samples); ++j) visible[c][j] = j % turned.size() == place ? all[c][j] : 0.0f;
      part.assign(2 * width, 0.0f);
      project_into(sky, part.data(), half_row ? part.data() + width : nullptr);
      for (size_t k = 0; k < width; ++k) row[k] += part[k];
      for (size_t k = 0; half_row && k < width; ++k) half_row[k] += part[width + k];
    }
  }
  void project(const GatherSky& sky, size_t first, size_t receiver) {
    project_into(sky, sky.rows + (receiver - first) * sky.stride, checked_row(sky, first, receiver));
  }
  void project_into(const GatherSky& sky, float* row, float* half_row) {
    for (const AlignedVector<float>& seen : visible) {
      project(seen.data(), row, half_row);
      if (sky.lobes)
        project_lobes(*sky.lobes, seen.data(), row + half.size(), half_row ? half_row + half.size() : nullptr);
      row += sky.stride / visible.size();
      if (half_row) half_row += sky.stride / visible.size();
    }
  }
};

}  // namespace

// A first packet settles it for all but those near something of the kind.
bool is_buried(const Tracer& tracer, const Receivers& receivers, size_t receiver) {
  constexpr size_t n = FixedFan::count, packet = 16;
  const FixedFan fan(receivers.normals[receiver]);
  float x[packet], y[packet], z[packet];
  Hit hits[packet];
  size_t backs = 0;
  for (size_t begin = 0; begin < n; begin += packet) {
    for (size_t k = 0; k < packet; ++k) {  // every packet is spread over the whole fan
      const size_t j = (begin + k) * 37 % n;
      x[k] = fan.x[j], y[k] = fan.y[j], z[k] = fan.z[j];
    }
    tracer.closest_fan(receivers.origins[receiver], {x, y, z, packet}, hits);
    std::visit(
        [&](const auto& b) {
          for (const Hit& h : hits)
            backs += h.triangle != none && !b.find(h.triangle, h.front) && !tracer.lets_pass(h.triangle);
        },
        receivers.basis);
    if (backs == 0) return false;
  }
  return 2 * backs > n;
}

bool is_buried(const Tracer& tracer, const Receivers& receivers, size_t receiver, size_t backs, size_t rays) {
  if (4 * backs < rays || 4 * backs > 3 * rays) return 2 * backs > rays;
  return is_buried(tracer, receivers, receiver);
}

float* checked_row(const GatherSky& sky, size_t first, size_t receiver) {
  if (!sky.half_rows || receiver % check_every) return nullptr;
  return sky.half_rows + (receiver / check_every - (first + check_every - 1) / check_every) * sky.stride;
}

struct GatherScratch {
  Fan fan;
  std::vector<Hit> hits;
  std::vector<Passage> passages;  // of the hits; empty where all surfaces are solid
  BlockBuilder rows, half_rows;
  std::vector<LampLight> lights;
  // Of least squares: a place's own rays and what they met, and all of the fan's as they were aimed.
  AlignedVector<float> own[3], aimed[3];
  std::vector<Hit> own_hits;
  std::vector<Passage> own_passages;
  std::vector<MetRow> met;  // by gather_point()
  explicit GatherScratch(const GatherSetup& setup)
      : fan(setup.sets, setup.sky_channels),
        hits(size_t(setup.sets.samples)),
        passages(setup.tracer.lets_pass() ? hits.size() : 0),
        rows(setup.receivers.count()),
        half_rows(rows) {}
};
void DeleteScratch::operator()(GatherScratch* scratch) const { delete scratch; }
ScratchPointer make_gather_scratch(const GatherSetup& setup) { return ScratchPointer(new GatherScratch(setup)); }

bool has_coloured_albedo(const Scene& scene) {
  return std::any_of(scene.parts.begin(), scene.parts.end(), [&](const Part& part) {
    const Material& m = scene.materials[part.material];
    return m.base_color_texture >= 0 || !scene.colors.empty() || !is_grey(m.base_color);
  });
}

GatherSetup make_gather_setup(const Scene& scene, const Tracer& tracer, const Receivers& receivers, int order,
                              int samples, uint32_t seed, DirectionWarp warp, Progress* progress) {
  GatherSetup setup{scene, tracer, receivers, make_direction_sets(order, samples, set_count, seed, warp, progress),
                    seed,  1,      1,         1.0f,
                    {},    {},     progress};
  // Weights are sums over rays: halves hold 65504.
  setup.weight_unit = std::min(1.0f, 16384.0f / float(samples));
  for (const Part& part : scene.parts) {
    const Material& m = scene.materials[part.material];
    setup.part_albedo.push_back(m.base_color);
    setup.part_varies.push_back(m.base_color_texture >= 0 || !scene.colors.empty() || m.transmission > 0);
  }
  setup.channels = has_coloured_albedo(scene) ? 3 : 1;
  setup.sky_channels = tracer.colours() ? 3 : 1;
  return setup;
}

namespace {

// All of a hit's receivers, or, of bilinear texels, one drawn by its weight.
template <class Basis, class At, class Add>
void scatter(const Basis& basis, const At& at, const Hit& h, uint64_t, Add add) {
  basis.spread(at, h.u, h.v, add);
}
template <class Add>
void scatter(const TexelReceivers& basis, const TexelTriangle& at, const Hit& h, uint64_t key, Add add) {
  float left = to_unit_float(uint32_t(hash64(key)));
  uint32_t chosen = none;
  basis.spread(at, h.u, h.v, [&](uint32_t receiver, float weight) {
    if (left >= 0) chosen = receiver;
    left -= weight;
  });
  if (chosen != none) add(chosen, 1.0f);
}

// Asks the caches for where a hit to come will be entered.
template <class Basis>
void prefetch_places(const Basis&, const Hit&, const BlockBuilder&) {}
void prefetch_places(const CornerReceivers& basis, const Hit& h, const BlockBuilder& rows) {
  const Corners* at = h.triangle == none ? nullptr : basis.find(h.triangle, h.front);
  if (!at) return;
  for (uint32_t receiver : at->receiver) rows.prefetch(receiver);
}

// What lamps send to one receiver, by samples towards them from each of its places and by what the fan's rays meet.
struct LampSum {
  const GatherSetup& setup;
  const GatherDirect* direct;  // null: nothing
  float* row;
  size_t places = 1;
  size_t rays = std::max<size_t>(size_t(setup.sets.samples) / places, 1);  // from a place
  int samples = direct ? std::max(direct->samples / int(places), 1) : 0;   // a group, from a place

  void add(const LampLight& light, float share) {
    for (int c = 0; c < 3; ++c) row[size_t(light.group) * 3 + size_t(c)] += share * light.value[c];
  }
  void sample(std::vector<LampLight>& lights, Vec3 origin, Vec3 normal, size_t key) {
    if (!direct) return;
    lights.clear();
    sample_lamps(setup.scene, setup.tracer, direct->lamps, origin, normal, samples, rays, setup.seed, key, lights,
                 setup.progress);
    for (const LampLight& light : lights) add(light, 1 / float(places));
  }
  void meet(const Hit& h, Vec3 direction, Vec3 normal, Vec3 open, Vec3 passed, float share) {
    const Lamps& lamps = direct->lamps;
    share /= float(places);
    if (lamps.sky && open != Vec3(0)) {
      LampLight light = met_sky(lamps, direction, dot(normal, direction), samples, rays);
      light.value *= open;
      add(light, share);
    }
    if (h.triangle == none || lamps.of_triangle.empty()) return;
    const uint32_t lamp = lamps.of_triangle[h.triangle];
    if (lamp == none || !emits(setup.scene, setup.scene.triangles[h.triangle], h.front)) return;
    LampLight light = met_lamp(setup.scene, lamps, lamp, h, direction, dot(normal, direction), samples, rays);
    light.value *= passed;
    add(light, share);
  }
};

// Where the rays of a receiver start, ray j at place j % places; and how the fan is turned there.
struct Starts {
  std::array<Vec3, most_places> origin, normal;
  std::array<DirectionChoice, most_places> turned;
  size_t places = 1;
};

// Of a fan's rays from one place, most met backs.
template <class Basis>
bool sees_backs(const GatherSetup& setup, const Basis& basis, const std::vector<Hit>& hits) {
  size_t backs = 0;
  for (const Hit& h : hits)
    backs += h.triangle != none && !basis.find(h.triangle, h.front) && !setup.tracer.lets_pass(h.triangle);
  return 2 * backs > hits.size();
}

// The fan's rays as they are shared out to a receiver's places, those inside something passed over for others.
template <class Basis>
void trace_places(const GatherSetup& setup, const Basis& basis, GatherScratch& s, size_t r, Starts& starts) {
  const SpreadPlaces& all = setup.projection->places;
  const size_t places = starts.places = all.each, rays = size_t(setup.sets.samples);
  for (auto& lane : s.aimed) lane.resize(s.fan.x.size(), 0.0f);
  for (size_t place = 0; place < places && !is_cancelled(setup.progress); ++place) {
    const size_t own = (rays - place + places - 1) / places;
    for (auto& lane : s.own) lane.assign(pad_lanes(own), 0.0f);
    s.own_hits.resize(own), s.own_passages.resize(s.passages.empty() ? 0 : own);
    for (size_t tried = 0; tried < places; ++tried) {
      const size_t at = r * places + (place + tried) % places;
      starts.origin[place] = all.origins[at], starts.normal[place] = all.normals[at];
      s.fan.aim(all.normals[at], setup.seed, r);
      starts.turned[place] = s.fan.choice;
      for (size_t i = 0, j = place; j < rays; ++i, j += places)
        s.own[0][i] = s.fan.x[j], s.own[1][i] = s.fan.y[j], s.own[2][i] = s.fan.z[j];
      trace_hits(setup.tracer, all.origins[at], {s.own[0].data(), s.own[1].data(), s.own[2].data(), own},
                 s.own_hits.data(), s.own_passages, setup.progress);
      if (is_cancelled(setup.progress) || !sees_backs(setup, basis, s.own_hits)) break;
    }
    for (size_t i = 0, j = place; j < rays; ++i, j += places) {
      for (size_t c = 0; c < 3; ++c) s.aimed[c][j] = s.own[c][i];
      s.hits[j] = s.own_hits[i];
      if (!s.passages.empty()) s.passages[j] = s.own_passages[i];
    }
  }
  s.fan.x.swap(s.aimed[0]), s.fan.y.swap(s.aimed[1]), s.fan.z.swap(s.aimed[2]);
}

template <class Basis>
Starts trace_receiver(const GatherSetup& setup, const Basis& basis, GatherScratch& scratch, size_t r) {
  Starts starts;
  starts.origin[0] = setup.receivers.origins[r], starts.normal[0] = setup.receivers.normals[r];
  if (setup.projection) {
    trace_places(setup, basis, scratch, r, starts);
  } else {
    const Directions directions = scratch.fan.aim(starts.normal[0], setup.seed, r);
    trace_hits(setup.tracer, starts.origin[0], directions, scratch.hits.data(), scratch.passages, setup.progress);
  }
  return starts;
}

// What the fan's rays met, into the rows that have begun. How many met backs.
template <class Basis>
size_t add_hits(const GatherSetup& setup, const Basis& basis, GatherScratch& scratch, size_t r, const Starts& starts,
                bool rows, const GatherDirect* direct, float* lamp_row) {
  const DirectionSets& sets = setup.sets;
  const size_t rays = size_t(sets.samples), half = std::min(sets.half, rays);
  const bool checked = rows && r % check_every == 0;
  Fan& fan = scratch.fan;
  const std::vector<Hit>& hits = scratch.hits;
  std::vector<Passage>& passages = scratch.passages;
  const bool passes = !passages.empty();
  size_t backs = 0;
  auto direction = [&](size_t j) { return Vec3(fan.x[j], fan.y[j], fan.z[j]); };
  LampSum lamps{setup, direct, lamp_row, starts.places};
  for (size_t place = 0; place < starts.places; ++place)
    lamps.sample(scratch.lights, starts.origin[place], starts.normal[place], r * starts.places + place);
  for (size_t j = 0; j < rays; ++j) {
    if (ends_fan(j, setup.progress)) break;
    if (j + lookahead < rays) basis.prefetch(hits[j + lookahead].triangle, hits[j + lookahead].front);
    if (rows && j + lookahead / 2 < rays) prefetch_places(basis, hits[j + lookahead / 2], scratch.rows);
    const Hit& h = hits[j];
    const float share = sets.weights.empty() ? 1.0f : sets.weights[j];
    const Vec3 open = passes ? passages[j].sky : Vec3(h.triangle == none ? 1.0f : 0.0f);
    for (size_t c = 0; c < fan.visible.size(); ++c) fan.visible[c][j] = share * open[int(c)];
    if (direct)
      lamps.meet(h, direction(j), starts.normal[j % starts.places], open, passes ? passages[j].hit : Vec3(1), share);
    if (h.triangle == none) continue;
    const auto* at = basis.find(h.triangle, h.front);
    if (!at) {
      backs += !setup.tracer.lets_pass(h.triangle);
      continue;
    }
    if (!rows) continue;
    Vec3 rho = setup.albedo_at(at->part, h);
    if (passes) rho *= passages[j].hit;
    scatter(basis, *at, h, r * rays + j,
            [&](uint32_t receiver, float weight) { scratch.rows.add(receiver, rho * (weight * share)); });
    if (checked && j < half)
      scatter(basis, *at, h, r * rays + j,
              [&](uint32_t receiver, float weight) { scratch.half_rows.add(receiver, rho * (weight * share)); });
  }
  return backs;
}

template <class Basis>
void trace_gather_on(const GatherSetup& setup, const Basis& basis, GatherScratch& scratch, size_t first, size_t count,
                     GatherBlock* block, const GatherSky* sky, const GatherDirect* direct) {
  scratch.rows.begin_block(), scratch.half_rows.begin_block();
  for (size_t i = 0; i < count && !is_cancelled(setup.progress); ++i) {
    const size_t r = first + i;
    const Starts starts = trace_receiver(setup, basis, scratch, r);
    if (is_cancelled(setup.progress)) break;
    scratch.rows.begin_row(), scratch.half_rows.begin_row();  // the second ends where it is checked
    const size_t backs = add_hits(setup, basis, scratch, r, starts, block != nullptr, direct,
                                  direct ? direct->rows + i * direct->width : nullptr);
    scratch.rows.end_row();
    if (block && r % check_every == 0) scratch.half_rows.end_row();
    if (!sky) continue;
    if (setup.projection) scratch.fan.project_places(*sky, first, r, {starts.turned.data(), starts.places});
    else scratch.fan.project(*sky, first, r);
    const size_t rays = size_t(setup.sets.samples);
    sky->buried[i] = setup.projection ? 2 * backs > rays : is_buried(setup.tracer, setup.receivers, r, backs, rays);
  }
  if (block) {
    scratch.rows.finish(setup.channels, setup.weight_unit, block->rows);
    scratch.half_rows.finish(setup.channels, setup.weight_unit, block->half_rows);
  }
}

}  // namespace

// The kind of basis is asked for once a block, so that the loop over rays is compiled for each.
void trace_gather(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, GatherBlock* block,
                  const GatherSky* sky, const GatherDirect* direct) {
  LAMBENT_CHECK(count <= gather_block);
  std::visit([&](const auto& basis) { trace_gather_on(setup, basis, scratch, first, count, block, sky, direct); },
             setup.receivers.basis);
}

bool trace_point(const GatherSetup& setup, GatherScratch& scratch, Vec3 origin, Vec3 normal, uint64_t key,
                 const GatherSky& sky, std::vector<MetRow>* met, const GatherDirect* direct) {
  const size_t rays = size_t(setup.sets.samples);
  Fan& fan = scratch.fan;
  const bool passes = !scratch.passages.empty();
  const Directions directions = fan.aim(normal, setup.seed, key);
  trace_hits(setup.tracer, origin, directions, scratch.hits.data(), scratch.passages, setup.progress);
  if (met) met->clear();
  size_t backs = 0;
  LampSum lamps{setup, direct, direct ? direct->rows : nullptr};
  lamps.sample(scratch.lights, origin, normal, size_t(key));
  std::visit(
      [&](const auto& basis) {
        for (size_t j = 0; j < rays; ++j) {
          const Hit& h = scratch.hits[j];
          const Vec3 open = passes ? scratch.passages[j].sky : Vec3(h.triangle == none ? 1.0f : 0.0f);
          for (size_t c = 0; c < fan.visible.size(); ++c) fan.visible[c][j] = open[int(c)];
          if (direct)
            lamps.meet(h, Vec3(fan.x[j], fan.y[j], fan.z[j]), normal, open, passes ? scratch.passages[j].hit : Vec3(1),
                       1);
          if (h.triangle == none) continue;
          const auto* at = basis.find(h.triangle, h.front);
          if (!at) backs += !setup.tracer.lets_pass(h.triangle);
          if (!at || !met) continue;
          Vec3 rho = setup.albedo_at(at->part, h) / float(rays);
          if (passes) rho *= scratch.passages[j].hit;
          scatter(basis, *at, h, hash64(key, j), [&](uint32_t receiver, float weight) {
            met->push_back({receiver, rho * weight});
          });
        }
      },
      setup.receivers.basis);
  fan.project(sky, 0, 0);
  return 2 * backs <= rays;
}

void add_up(const std::vector<MetRow>& met, size_t channels, const float* x, size_t width, float* reflected) {
  std::fill_n(reflected, width, 0.0f);
  for (const MetRow& m : met) {
    const float* from = x + size_t(m.receiver) * width;
    if (channels == 1)
      for (size_t k = 0; k < width; ++k) reflected[k] += m.weight.x * from[k];
    else
      for (size_t k = 0; k + 2 < width; k += 3)
        for (int c = 0; c < 3; ++c) reflected[k + size_t(c)] += m.weight[c] * from[k + size_t(c)];
  }
}

bool gather_point(const GatherSetup& setup, GatherScratch& scratch, Vec3 origin, Vec3 normal, uint64_t key,
                  const GatherSky& sky, const float* x, size_t width, float* reflected, const GatherDirect* direct) {
  const bool clear = trace_point(setup, scratch, origin, normal, key, sky, x ? &scratch.met : nullptr, direct);
  if (!x) scratch.met.clear();
  add_up(scratch.met, size_t(setup.channels), x, width, reflected);
  return clear;
}

void trace_sky(const GatherSetup& setup, GatherScratch& scratch, size_t first, size_t count, const GatherSky& sky) {
  const DirectionSets& sets = setup.sets;
  const size_t rays = size_t(sets.samples);
  Fan& fan = scratch.fan;
  for (size_t i = 0; i < count && !is_cancelled(setup.progress); ++i) {
    const size_t r = first + i;
    const Vec3 origin = setup.receivers.origins[r];
    const Directions directions = fan.aim(setup.receivers.normals[r], setup.seed, r);
    std::vector<AlignedVector<float>>& v = fan.visible;
    trace_visible(setup.tracer, origin, directions, std::span(v), setup.progress);
    if (is_cancelled(setup.progress)) return;
    fan.project(sky, first, r);
    size_t seen = 0;
    for (size_t j = 0; j < rays; ++j) seen += v[0][j] > 0 || (v.size() == 3 && v[1][j] + v[2][j] > 0);
    sky.buried[i] = 2 * seen < rays && is_buried(setup.tracer, setup.receivers, r);
  }
}

}  // namespace lambent
