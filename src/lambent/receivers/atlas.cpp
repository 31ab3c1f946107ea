// Follows: radiosity, "Discussion" (lightmaps). Charts by charts.h, shelves by pack.cpp.
#include <lambent/receivers/atlas.h>
#include <lambent/receivers/charts.h>
#include <lambent/receivers/islands.h>
#include <lambent/receivers/raster.h>

#include <lambent/scene/gltf.h>

#include <algorithm>

namespace lambent {
namespace {

// A texel is covered twice only where its centre lies this far inside two triangles, in weights: seams of one chart do
// not count.
constexpr float well_inside = 1e-3f;
// What other programs' rounding may leave of a layout that is right: coordinates so far outside of [0, 1], places that
// differ or overlap by so much, and so small a share of a part without a place.
constexpr float rounding = 1e-4f, unplaced = 1e-3f;
// Triangles of one texel are neighbours if they lie within so many texels' widths in space.
constexpr float neighbours_within = 4;
// Rounds of cutting charts that overlap themselves.
constexpr int most_layers = 8;

std::array<Vec2, 3> at_corners(const std::vector<Vec2>& at, const Triangle& t) {
  return {at[t.v[0]], at[t.v[1]], at[t.v[2]]};
}

double area2(const std::array<Vec2, 3>& t) {
  const Vec2d a = Vec2d(t[1]) - Vec2d(t[0]), b = Vec2d(t[2]) - Vec2d(t[0]);
  return std::abs(a.x * b.y - a.y * b.x) / 2;
}

bool is_well_inside(const std::array<Vec2, 3>& t, int i, int j) {
  const ClosestPoint c = closest_point(t, Vec2(float(i) + 0.5f, float(j) + 0.5f));
  return c.distance == 0 && c.u > well_inside && c.v > well_inside && 1 - c.u - c.v > well_inside;
}

// The same for layouts that may overlap by rounding: the centre lies `depth` texels inside.
bool is_deep_inside(const std::array<Vec2, 3>& t, int i, int j, float depth) {
  const Vec2d p(double(i) + 0.5, double(j) + 0.5);
  double nearest[2] = {INFINITY, INFINITY};  // whichever way the triangle winds
  for (size_t k = 0; k < 3; ++k) {
    const Vec2d a(t[k]), edge = Vec2d(t[(k + 1) % 3]) - a, to = p - a;
    const double distance = (edge.x * to.y - edge.y * to.x) / std::max(length(edge), 1e-30);
    nearest[0] = std::min(nearest[0], distance), nearest[1] = std::min(nearest[1], -distance);
  }
  return std::max(nearest[0], nearest[1]) > double(depth);
}

std::string size_text(int64_t w, int64_t h) { return std::to_string(w) + "x" + std::to_string(h); }

double surface_area(const Scene& scene) {
  double sum = 0;
  for (const Triangle& t : scene.triangles) sum += 0.5 * double(area_length(area_normal(scene, t)));
  return sum;
}

bool any_two_sided(const Scene& scene) {
  return std::any_of(scene.triangles.begin(), scene.triangles.end(), [](const Triangle& t) { return t.two_sided; });
}

Result<void> check_texels(int64_t width, int64_t height, const AtlasOptions& o) {
  if (width * height <= max_atlas_texels) return {};
  return Error{
      o.texels_per_unit > 0 ? "--texels-per-unit" : "--atlas",
      "makes an atlas of " + size_text(width, height) + ", more than " + std::to_string(max_atlas_texels) + " texels"};
}

// What speaks against a layout at any size, or ""; adds up the area that it covers and that of the surface.
std::string flaw_of(const Scene& scene, const std::vector<Vec2>& uv, double& covered, double& surface) {
  std::vector<double> whole(scene.parts.size(), 0), lost(scene.parts.size(), 0);
  for (const Triangle& t : scene.triangles) {
    const double area = 0.5 * double(area_length(area_normal(scene, t)));
    if (!(area > 0)) continue;
    for (uint32_t v : t.v)
      if (!(std::max(std::abs(uv[v].x - 0.5f), std::abs(uv[v].y - 0.5f)) <= 0.5f + rounding)) return "it leaves [0, 1]";
    const double place = area2(at_corners(uv, t));
    covered += place, surface += area, whole[t.part] += area, lost[t.part] += place > 0 ? 0 : area;
  }
  for (size_t p = 0; p < scene.parts.size(); ++p)
    if (lost[p] > double(unplaced) * whole[p]) return "some triangles have no area in it";
  return covered > 1.001 ? "triangles overlap in it" : "";
}

// Uses the scene's own coordinates, or says in `remark` why not. Backs, where there are any, get the same layout below.
Result<bool> reuse_texcoords(const Scene& scene, const AtlasOptions& o, Atlas& atlas) {
  const std::vector<Vec2>& uv = scene.texcoords[1];
  if (uv.empty()) return false;
  auto refuse = [&](std::string why) {
    atlas.remark = "TEXCOORD_1 is not used for the lightmap: " + std::move(why);
    return false;
  };
  double covered = 0, surface = 0;
  if (std::string why = flaw_of(scene, uv, covered, surface); !why.empty()) return refuse(std::move(why));
  const int layers = any_two_sided(scene) ? 2 : 1;
  if (o.texels_per_unit > 0) {
    const double side = std::ceil(std::sqrt(surface / covered) * double(o.texels_per_unit));
    if (!(side * layers <= max_atlas_side))
      return Error{"--texels-per-unit",
                   "the scene's TEXCOORD_1 would need an atlas of " +
                       size_text(int64_t(std::min(side, 1e15)), int64_t(std::min(side * layers, 1e15))) +
                       " texels; the limit is " + std::to_string(max_atlas_side) + " a side",
                   true};
    atlas.width = std::max(1, int(side)), atlas.height = atlas.width;
  } else {
    atlas.width = o.width, atlas.height = o.height / layers;
    if (atlas.height < 1) return refuse("the atlas has no room for both sides");
  }
  if (auto ok = check_texels(atlas.width, int64_t(atlas.height) * layers, o); !ok) return ok.error();
  atlas.texels_per_unit = float(std::sqrt(covered * atlas.width * atlas.height / surface));
  std::vector<Vec2> at(uv.size());
  for (size_t v = 0; v < uv.size(); ++v)
    at[v] = clamp(uv[v], Vec2(0), Vec2(1)) * Vec2(float(atlas.width), float(atlas.height));
  // Work is bounded by what slivers touch, which a sheet without overlap keeps near its area.
  double touched = 0;
  for (const Triangle& t : scene.triangles) {
    const auto corners = at_corners(at, t);
    touched += area2(corners) + 2 * double(length(corners[1] - corners[0]) + length(corners[2] - corners[1])) + 9;
  }
  if (touched > 64.0 * atlas.width * atlas.height + 64.0 * double(scene.triangles.size()))
    return refuse("its triangles are too thin for the atlas's texels");
  std::vector<uint8_t> taken(size_t(atlas.width) * size_t(atlas.height), 0);
  const float rounded = rounding * float(std::max(atlas.width, atlas.height)),
              depth = std::clamp(rounded, 1e-3f, 0.25f);
  size_t twice = 0;
  for (const Triangle& t : scene.triangles) {
    const auto corners = at_corners(at, t);
    if (!(area2(corners) > 0)) continue;
    each_texel(corners, 0, atlas.width, atlas.height, [&](int i, int j) {
      uint8_t& texel = taken[size_t(j) * size_t(atlas.width) + size_t(i)];
      if (!is_deep_inside(corners, i, j, depth)) return;
      twice += texel, texel = 1;
    });
  }
  if (twice) return refuse(std::to_string(twice) + " texels are covered twice");
  // Triangles finer than texels cover no centres: those that share a texel must be neighbours in space.
  std::vector<Vec3> place(taken.size(), Vec3(INFINITY));
  size_t apart = 0;
  for (const Triangle& t : scene.triangles) {
    const Vec2 p = (at[t.v[0]] + at[t.v[1]] + at[t.v[2]]) / 3.0f;
    const Vec3 here = (scene.positions[t.v[0]] + scene.positions[t.v[1]] + scene.positions[t.v[2]]) / 3.0f;
    Vec3& first = place[size_t(std::clamp(int(p.y), 0, atlas.height - 1)) * size_t(atlas.width) +
                        size_t(std::clamp(int(p.x), 0, atlas.width - 1))];
    if (!std::isfinite(first.x)) first = here;
    else apart += length(here - first) * atlas.texels_per_unit > neighbours_within;
  }
  if (1000 * apart > scene.triangles.size()) return refuse("the atlas's texels are too coarse for it");
  if (layers == 2) {
    atlas.back = at;
    for (Vec2& p : atlas.back) p.y += float(atlas.height);
    atlas.height *= 2;
  }
  const size_t shared = count_shared_texels(scene, islands_of(scene, at, std::max(rounded, 1e-3f)), at, atlas.back,
                                            atlas.width, atlas.height);
  if (shared) {
    atlas.back.clear();
    return refuse("its islands touch at this size: " + std::to_string(shared) +
                  " texels would light two of them; two texels apart they do not");
  }
  atlas.front = std::move(at);
  return true;
}

// Charts at one density: rectangles of texels, one a chart side.
struct Layout {
  Charts charts;
  FlatCharts flat;
  std::vector<uint8_t> two_sided;  // of each chart
  double area = 0;                 // of all chart boxes, both sides

  void cut(const Scene& scene, const std::vector<uint8_t>& layers) {
    charts = make_charts(scene, layers), flat = flatten(scene, charts);
    two_sided.assign(charts.count, 0);
    for (size_t i = 0; i < scene.triangles.size(); ++i)
      if (charts.of_triangle[i] != none) two_sided[charts.of_triangle[i]] = scene.triangles[i].two_sided;
    area = 0;
    for (uint32_t c = 0; c < charts.count; ++c)
      area += double(flat.size[c].x) * double(flat.size[c].y) * (1 + two_sided[c]);
  }

  // Tents reach one texel beyond the chart, on all sides. False if one rectangle alone is wider than `most`.
  bool rectangles(double density, int padding, int most, std::vector<std::array<int, 2>>& out) const {
    out.clear();
    for (uint32_t c = 0; c < charts.count; ++c) {
      const double w = std::ceil(double(flat.size[c].x) * density) + 2 + padding,
                   h = std::ceil(double(flat.size[c].y) * density) + 2 + padding;
      if (!(w <= most && h <= max_atlas_side)) return false;
      for (int side = 0; side <= two_sided[c]; ++side) out.push_back({int(w), int(h)});
    }
    return true;
  }
};

// A packed size, and the density it holds.
struct Fit {
  double density = 0;
  int width = 0;
  Packing packing;
};

// The widest rectangle and the square root of all area decide the width.
Result<Fit> fit_density(const Layout& layout, const AtlasOptions& o) {
  Fit fit;
  fit.density = double(o.texels_per_unit);
  std::vector<std::array<int, 2>> rectangles;
  const double guess = std::sqrt(std::max(layout.area, 0.0)) * fit.density;
  auto too_large = [&] {
    return Error{"--texels-per-unit",
                 "would need an atlas of about " +
                     size_text(int64_t(std::min(guess, 1e15)), int64_t(std::min(guess, 1e15))) +
                     " texels; the limit is " + std::to_string(max_atlas_side) + " a side",
                 true};
  };
  if (!layout.rectangles(fit.density, o.padding, max_atlas_side, rectangles)) return too_large();
  double area = 0;
  int widest = 1;
  for (auto [w, h] : rectangles) area += double(w) * h, widest = std::max(widest, w);
  const double side = std::max(double(widest), std::ceil(std::sqrt(area * 1.05)));
  if (side > max_atlas_side) return too_large();
  fit.width = (int(side) + 3) / 4 * 4;
  fit.packing = pack_shelves(rectangles, fit.width);
  if (fit.packing.height > max_atlas_side) return too_large();
  return fit;
}

// The greatest density with which the charts fit the given size, by bisection.
Result<Fit> fit_size(const Layout& layout, const AtlasOptions& o) {
  Fit best;
  std::vector<std::array<int, 2>> rectangles;
  auto fits = [&](double density) {
    if (!layout.rectangles(density, o.padding, o.width, rectangles)) return false;
    Packing packing = pack_shelves(rectangles, o.width);
    if (packing.height > o.height) return false;
    best = {density, o.width, std::move(packing)};
    return true;
  };
  double low = 0, high = layout.area > 0 ? std::sqrt(double(o.width) * o.height / layout.area) : 1;
  if (!fits(0)) {
    AtlasOptions any = o;
    any.texels_per_unit = 1e-30f;
    auto needed = fit_density(layout, any);
    const std::string size = needed ? size_text(needed->width, needed->packing.height)
                                    : "one beyond " + size_text(max_atlas_side, max_atlas_side);
    return Error{"--atlas",
                 size_text(o.width, o.height) + " is too small for " + std::to_string(layout.charts.count) +
                     " charts: they need at least " + size + ", better several times that",
                 true};
  }
  for (int step = 0; step < 16 && !fits(high); ++step) {
    const double middle = (low + high) / 2;
    if (fits(middle)) low = middle;
    else high = middle;
    if (high - low < 1e-3 * high) break;
  }
  return best;
}

// Triangles that cover texels of their chart which others cover already, at this density; they move one layer up.
size_t part_overlaps(const Layout& layout, double density, std::vector<uint8_t>& layers, ProgressStage& stage) {
  const size_t triangles = layout.charts.of_triangle.size();
  std::vector<uint32_t> first(layout.charts.count + 1, 0), members(triangles);
  for (uint32_t c : layout.charts.of_triangle)
    if (c != none) ++first[c + 1];
  for (size_t c = 1; c < first.size(); ++c) first[c] += first[c - 1];
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (uint32_t t = 0; t < triangles; ++t)
    if (layout.charts.of_triangle[t] != none) members[next[layout.charts.of_triangle[t]]++] = t;
  size_t moved = 0;
  std::vector<uint8_t> taken;
  for (uint32_t c = 0; c < layout.charts.count && !stage.cancelled(); ++c) {
    stage.advance(first[c + 1] - first[c]);
    if (first[c + 1] - first[c] < 2) continue;
    const int w = int(std::ceil(double(layout.flat.size[c].x) * density)) + 1,
              h = int(std::ceil(double(layout.flat.size[c].y) * density)) + 1;
    taken.assign(size_t(w) * size_t(h), 0);
    for (uint32_t k = first[c]; k < first[c + 1]; ++k) {
      std::array<Vec2, 3> at = layout.flat.corners[members[k]];
      for (Vec2& p : at) p *= float(density);
      bool clash = false;
      each_texel(at, 0, w, h,
                 [&](int i, int j) { clash |= taken[size_t(j) * size_t(w) + size_t(i)] && is_well_inside(at, i, j); });
      if (clash) {
        ++layers[members[k]], ++moved;
        continue;
      }
      each_texel(at, 0, w, h, [&](int i, int j) {
        if (is_well_inside(at, i, j)) taken[size_t(j) * size_t(w) + size_t(i)] = 1;
      });
    }
  }
  return moved;
}

// Whether the document has the part's vertices as they stand, and they stay where they are: then new ones may be copies
// of those, with whatever attributes they have.
bool stands(const Scene& scene, const Part& part) {
  if (!scene.document || part.node < 0 || (part.changed && part.source.empty())) return false;
  const nlohmann::json& node = scene.document->json["nodes"][size_t(part.node)];
  if (node.contains("skin")) return false;
  const nlohmann::json& mesh = scene.document->json["meshes"][node["mesh"].get<size_t>()];
  return !mesh["primitives"][size_t(part.primitive)].contains("targets");
}

// Gives every (vertex, chart) a vertex of its own, and its place.
void split_vertices(Scene& scene, const Charts& charts, const std::vector<std::array<Vec2, 3>>& corners,
                    const std::vector<Vec2>& front_shift, const std::vector<Vec2>& back_shift, Atlas& atlas) {
  struct {
    std::vector<Vec3> positions, normals, colors;
    std::vector<std::vector<Vec2>> texcoords;
    std::vector<Vec4> tangents;
    std::vector<uint32_t> input;
    std::vector<Triangle> triangles;
  } old{std::move(scene.positions), std::move(scene.normals), std::move(scene.colors), std::move(scene.texcoords),
        std::move(scene.tangents),  std::move(scene.input),   scene.triangles};
  scene.positions.clear(), scene.normals.clear(), scene.colors.clear(), scene.tangents.clear();
  scene.input.clear();
  scene.texcoords.assign(old.texcoords.size(), {});
  const bool backs = any_two_sided(scene);
  struct Key {
    uint32_t vertex, chart;
    bool operator==(const Key&) const = default;
    auto operator<=>(const Key&) const = default;
  };
  std::vector<Key> keys;
  for (Part& part : scene.parts) {
    keys.clear();
    for (uint32_t i = part.first_triangle; i < part.first_triangle + part.triangle_count; ++i)
      for (uint32_t v : old.triangles[i].v) keys.push_back({v, charts.of_triangle[i]});
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    const bool copies = stands(scene, part);
    const uint32_t old_first = part.first_vertex;
    const std::vector<uint32_t> source = std::move(part.source);
    part.first_vertex = uint32_t(scene.positions.size()), part.vertex_count = uint32_t(keys.size());
    part.changed = true, part.source.clear();
    for (const Key& key : keys) {
      if (copies) part.source.push_back(source.empty() ? key.vertex - old_first : source[key.vertex - old_first]);
      scene.positions.push_back(old.positions[key.vertex]), scene.normals.push_back(old.normals[key.vertex]);
      for (size_t set = 0; set < old.texcoords.size(); ++set)
        if (!old.texcoords[set].empty()) scene.texcoords[set].push_back(old.texcoords[set][key.vertex]);
      if (!old.colors.empty()) scene.colors.push_back(old.colors[key.vertex]);
      if (!old.tangents.empty()) scene.tangents.push_back(old.tangents[key.vertex]);
      if (!old.input.empty()) scene.input.push_back(old.input[key.vertex]);
    }
    atlas.front.resize(scene.positions.size(), Vec2(0));
    if (backs) atlas.back.resize(scene.positions.size(), Vec2(0));
    for (uint32_t i = part.first_triangle; i < part.first_triangle + part.triangle_count; ++i)
      for (size_t k = 0; k < 3; ++k) {
        const Key key{old.triangles[i].v[k], charts.of_triangle[i]};
        const uint32_t v = part.first_vertex + uint32_t(std::lower_bound(keys.begin(), keys.end(), key) - keys.begin());
        scene.triangles[i].v[k] = v;
        if (key.chart == none) continue;
        atlas.front[v] = corners[i][k] + front_shift[key.chart];
        if (old.triangles[i].two_sided) atlas.back[v] = corners[i][k] + back_shift[key.chart];
      }
  }
}

Result<void> check_options(const Scene& scene, const AtlasOptions& o) {
  const bool by_size = o.width != 0 || o.height != 0;
  if (by_size == (o.texels_per_unit != 0))
    return Error{"atlas", "needs either a density in texels or a size, and not both"};
  if (!by_size && !(o.texels_per_unit > 0 && std::isfinite(o.texels_per_unit)))
    return Error{"--texels-per-unit", "must be positive", true};
  if (by_size && (o.width < 1 || o.height < 1 || o.width > max_atlas_side || o.height > max_atlas_side))
    return Error{"--atlas", "each side must lie between 1 and " + std::to_string(max_atlas_side), true};
  if (o.padding < 1 || o.padding > 16) return Error{"--padding", "must lie between 1 and 16", true};
  if (!(surface_area(scene) > 0)) return Error{scene.path, "nothing to bake: no triangle has an area"};
  return {};
}

}  // namespace

Result<Atlas> make_atlas(Scene& scene, const AtlasOptions& o, Progress* progress) {
  if (auto ok = check_options(scene, o); !ok) return ok.error();
  Atlas atlas;
  if (o.reuse) {
    auto reused = reuse_texcoords(scene, o, atlas);
    if (!reused) return reused.error();
    if (*reused) return atlas;
  }
  Layout layout;
  std::vector<uint8_t> layers(scene.triangles.size(), 0);
  Fit fit;
  for (int round = 0;; ++round) {
    ProgressStage stage(progress, "charts, round " + std::to_string(round + 1), scene.triangles.size());
    layout.cut(scene, layers);
    if (stage.cancelled()) return Error{"", "cancelled"};
    auto fitted = o.texels_per_unit > 0 ? fit_density(layout, o) : fit_size(layout, o);
    if (!fitted) return fitted.error();
    fit = std::move(*fitted);
    if (auto ok = check_texels(fit.width, o.height ? o.height : fit.packing.height, o); !ok) return ok.error();
    const size_t parted = round == most_layers ? 0 : part_overlaps(layout, fit.density, layers, stage);
    if (stage.cancelled()) return Error{"", "cancelled"};
    if (parted == 0) break;
  }
  atlas.charts = layout.charts.count, atlas.texels_per_unit = float(fit.density);
  atlas.width = fit.width;
  atlas.height = o.height ? o.height : (int(fit.packing.height) + 3) / 4 * 4;
  std::vector<Vec2> front_shift(layout.charts.count), back_shift(layout.charts.count);
  size_t rectangle = 0;
  for (uint32_t c = 0; c < layout.charts.count; ++c) {
    auto place = [&] {
      const auto [x, y] = fit.packing.places[rectangle++];
      return Vec2(float(x + 1), float(y + 1));
    };
    front_shift[c] = place();
    if (layout.two_sided[c]) back_shift[c] = place();
  }
  for (auto& corners : layout.flat.corners)
    for (Vec2& p : corners) p *= atlas.texels_per_unit;
  split_vertices(scene, layout.charts, layout.flat.corners, front_shift, back_shift, atlas);
  return atlas;
}

}  // namespace lambent
