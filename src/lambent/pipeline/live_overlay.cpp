// Looks that are painted over the whole picture: balls of transfer, lobes, the error with its legend.
#include <lambent/basis/sh.h>
#include <lambent/basis/zonal.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/pipeline/live_look.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr int balls_high = 14;       // of a picture's height
constexpr float ball_share = 0.42f;  // of a cell, its radius

// A function of directions that a receiver has, in colour.
using DirectionColor = std::function<Vec3(Vec3)>;

// Harmonics, [channel][order^2], times pi: 1 where all is open and the surface faces it. Below zero it is red.
DirectionColor ball_of(std::vector<float> harmonics, int order, int channels) {
  return [=, harmonics = std::move(harmonics)](Vec3 d) {
    std::vector<float> y(size_t(sh_count(order)));
    evaluate_sh(order, d, y);
    Vec3 value(0.0f);
    for (int c = 0; c < 3; ++c)
      for (size_t k = 0; k < y.size(); ++k)
        value[c] += pi * harmonics[size_t(std::min(c, channels - 1)) * y.size() + k] * y[k];
    const float mean = (value.x + value.y + value.z) / 3;
    return mean < 0 ? Vec3(-mean, 0, 0) : max(value, Vec3(0.0f));
  };
}

// Zonal lobes, each in a colour of its own: what the strongest one there gives.
DirectionColor lobes_of(const ZonalTransfer& t, std::vector<float> values) {
  struct Lobe {
    Vec3 axis;
    std::vector<double> bands;
  };
  std::vector<Lobe> lobes;
  const size_t exact = size_t(t.exact_bands()), higher = size_t(t.order) - exact;
  for (int i = 0; i < t.lobes; ++i) {
    Lobe lobe{lobe_axis(t, values, i), std::vector<double>(size_t(t.order), 0.0)};
    const float* from = values.data() + t.exact_values() + size_t(i) * t.lobe_values() + 3;
    for (size_t l = 0; l < higher; ++l)
      for (int c = 0; c < t.channels; ++c) lobe.bands[exact + l] += double(from[size_t(c) * higher + l]) / t.channels;
    lobes.push_back(std::move(lobe));
  }
  return [lobes = std::move(lobes)](Vec3 d) {
    double most = 0;
    size_t which = 0;
    for (size_t i = 0; i < lobes.size(); ++i)
      if (const double v = double(pi) * evaluate_lobe(lobes[i].bands, double(dot(lobes[i].axis, d))); v > most)
        most = v, which = i;
    static constexpr float hues[][3] = {{1, 0.35f, 0.1f}, {0.2f, 0.6f, 1}, {0.3f, 1, 0.3f}, {1, 0.9f, 0.2f},
                                        {0.8f, 0.3f, 1},  {0.2f, 1, 0.9f}, {1, 0.4f, 0.7f}, {0.7f, 0.7f, 0.7f}};
    const float* hue = hues[which % std::size(hues)];
    return (0.08f + 0.92f * std::min(float(most), 1.0f)) * Vec3(hue[0], hue[1], hue[2]);
  };
}

// Row `number` of a receiver's transfer; nothing where it has no such function.
DirectionColor function_of(const LookAt& at, const Store& store, uint32_t receiver) {
  const auto dense = [&](const auto& t) {
    const size_t columns = t.light.count(), n = size_t(sh_count(t.light.order));
    const std::vector<float> all = load_receiver(t, receiver);
    std::vector<float> out;
    for (int c = 0; c < t.channels; ++c) {
      const auto first = all.begin() + ptrdiff_t((size_t(at.number) * size_t(t.channels) + size_t(c)) * columns);
      out.insert(out.end(), first, first + ptrdiff_t(n));
    }
    return ball_of(std::move(out), t.light.order, t.channels);
  };
  if (const auto* t = std::get_if<Transfer>(&store)) return dense(*t);
  if (const auto* t = std::get_if<CpcaTransfer>(&store)) return dense(*t);
  if (const auto* t = std::get_if<FactoredTransfer>(&store))
    return ball_of(load_receiver(t->visibility, receiver), t->visibility.light.order, t->visibility.channels);
  if (const auto* t = std::get_if<ZonalTransfer>(&store)) {
    const std::vector<float> all = load_receiver(*t, receiver);
    const auto first = all.begin() + ptrdiff_t(size_t(at.number) * t->row_values());
    std::vector<float> row(first, first + ptrdiff_t(t->row_values()));
    return at.look == Look::lobes ? lobes_of(*t, std::move(row))
                                  : ball_of(zonal_harmonics(*t, row), t->order, t->channels);
  }
  return nullptr;
}

uint32_t nearest_receiver(const SpatialBasis& basis, const Hit& hit) {
  uint32_t nearest = none;
  float most = -1;
  std::visit(
      [&](const auto& b) {
        if (const auto* corners = b.find(hit.triangle, hit.front))
          b.spread(*corners, hit.u, hit.v, [&](uint32_t receiver, float weight) {
            if (weight > most) nearest = receiver, most = weight;
          });
      },
      basis);
  return nearest;
}

// What the first ray of a pixel met.
const ViewRay* met_at(const ViewRays& pass, int x, int y) {
  const size_t pixel = size_t(y) * size_t(pass.width) + size_t(x);
  if (pass.begin[pixel] == pass.begin[pixel + 1]) return nullptr;
  const ViewRay& ray = pass.rays[pass.begin[pixel]];
  return ray.hit.triangle == none ? nullptr : &ray;
}

// A ball of directions as the eye sees it: its middle is the direction towards the eye.
void paint_ball(Image& image, int cx, int cy, float radius, Vec3 toward, const CameraRays& camera,
                const DirectionColor& color) {
  const Vec3 right = normalize(camera.dx - toward * dot(camera.dx, toward)), up = cross(toward, right);
  const int r = int(radius);
  for (int y = std::max(0, cy - r); y <= std::min(image.height - 1, cy + r); ++y)
    for (int x = std::max(0, cx - r); x <= std::min(image.width - 1, cx + r); ++x) {
      const Vec2 at(float(x - cx) / radius, float(cy - y) / radius);
      const float rest = 1 - dot(at, at);
      if (rest >= 0) image.at(x, y) = color(at.x * right + at.y * up + std::sqrt(rest) * toward);
    }
}

Image paint_balls(const LookAt& at, const Baked& baked, const ViewRays& pass, const View& view) {
  Image image(pass.width, pass.height);
  image.coverage.assign(image.rgb.size(), 0.0f);
  const CameraRays camera(view.camera, pass.width, pass.height);
  parallel_for(size_t(pass.height), 8, [&](size_t begin, size_t end) {
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < pass.width; ++x)
        if (const ViewRay* ray = met_at(pass, x, y)) {
          const Vec3 n = unit_normal(at.scene, at.scene.triangles[ray->hit.triangle], ray->direction);
          image.at(x, y) = Vec3(0.03f + 0.2f * std::abs(dot(n, ray->direction)));
          image.coverage[size_t(y) * size_t(pass.width) + size_t(x)] = 1;
        }
  });
  const int cell = std::max(4, pass.height / balls_high), across = pass.width / cell, down = pass.height / cell;
  parallel_for(size_t(across) * size_t(down), 4, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const int x = int(i % size_t(across)) * cell + cell / 2, y = int(i / size_t(across)) * cell + cell / 2;
      const ViewRay* ray = met_at(pass, x, y);
      const uint32_t receiver = ray ? nearest_receiver(at.basis, ray->hit) : none;
      if (receiver == none) continue;
      if (const DirectionColor color = function_of(at, baked.surface.store, receiver))
        paint_ball(image, x, y, ball_share * float(cell), -ray->direction, camera, color);
    }
  });
  image.alpha = image.coverage;
  return image;
}

}  // namespace

bool is_overlay(Look look) { return look == Look::balls || look == Look::lobes || look == Look::error; }

Image paint_look(const LookAt& at, const Baked& baked, const Tracer& tracer, const ViewRays& pass, const View& view) {
  if (at.look != Look::error) return paint_balls(at, baked, pass, view);
  ErrorView error{{}, at.measured.error().certificate, at.measured.error().measured};
  paint_error(at.scene, tracer, View{view.camera, pass.width, pass.height}, error);
  return std::move(error.image);
}

Result<void> check_look(Look look, int number, const Baked& baked, const Rows& rows) {
  const Store& store = baked.surface.store;
  const auto wrong = [](const std::string& message) { return Error{"look", message, true}; };
  if (look == Look::picture) return {};
  if (std::holds_alternative<FixedView>(baked.surface.where)) return wrong("a fixed view has its picture alone");
  if (LookMeasure::is_for(look)) return LookMeasure::check(look, baked);
  const size_t columns = light_of(store).count();
  if (look == Look::coefficient) {
    if (columns == 0) return wrong("the file has no coefficients to show: it takes light by places or on a cube");
    if (number < 0 || size_t(number) >= columns)
      return wrong("the file has coefficients 0 to " + std::to_string(columns - 1));
    if (!std::holds_alternative<DiffuseRows>(rows)) return wrong("one coefficient is of diffuse transfer");
  }
  if (look == Look::lobes && !std::holds_alternative<ZonalTransfer>(store))
    return wrong("the file has no zonal lobes: `lambent compress --zonal` makes files that do");
  if (look == Look::balls && light_of(store).order == 0 && !std::holds_alternative<FactoredTransfer>(store))
    return wrong("the file has no harmonics to show as balls");
  if (look == Look::rows || look == Look::balls || look == Look::lobes) {
    if (kind_of(baked.surface) == DrawKind::indirect || kind_of(baked.surface) == DrawKind::blocks)
      return wrong("the file has no rows to show");
    const int count = look == Look::rows                              ? rows_relit(store)
                    : std::holds_alternative<FactoredTransfer>(store) ? 1
                                                                      : rows_of(store);
    if (number < 0 || number >= count) return wrong("the file has rows 0 to " + std::to_string(count - 1));
  }
  return {};
}

}  // namespace lambent
