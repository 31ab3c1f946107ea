#include <lambent/pipeline/view_error.h>

#include <lambent/bake/bake.h>
#include <lambent/bake/gather.h>
#include <lambent/core/aligned.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/pipeline/bake_request.h>
#include <lambent/pipeline/parse.h>

#include <fmt/format.h>
#include <nanoflann.hpp>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr size_t places = 8192;
constexpr int samples = 256;  // of each gather
constexpr int fresh_samples = 512;
constexpr size_t averaged = 24;  // places around a pixel, of those that face as it does
constexpr size_t looked_at = 64;
constexpr float least_facing = 0.5f;
constexpr int legend_height = 26, margin = 6;

struct Cloud {
  const std::vector<MeasuredPlace>& all;
  size_t kdtree_get_point_count() const { return all.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return all[i].at[int(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3, uint32_t>;

void draw_legend(Image& image, int top, double scale) {
  const int left = margin, right = image.width - margin;
  for (int x = left; x < right; ++x)
    for (int y = top + 2; y < top + 11; ++y)
      image.at(x, y) = false_color(float(x - left) / float(std::max(1, right - left - 1)));
  const int ticks = image.width >= 240 ? 4 : 2;
  for (int k = 0; k <= ticks; ++k) {
    const std::string text = fmt::format("{:.3g}%", 100 * scale * k / ticks);
    const int width = int(text.size()) * 6, x = left + (right - left) * k / ticks;
    draw_text(image, std::clamp(x - width / 2, 0, std::max(0, image.width - width)), top + 14, text, Vec3(1));
  }
}

// 1, 2 or 5 times a power of ten, not below.
double rounded_up(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(std::max(value, 1e-6))));
  for (const double step : {1.0, 2.0, 5.0})
    if (value <= step * power) return step * power;
  return 10 * power;
}

struct Asked {
  const Transfer* transfer;
  int bounces;
};
Result<Asked> check(const Baked& baked) {
  const std::string where = "--view-error";
  const auto* transfer = std::get_if<Transfer>(&baked.surface.store);
  if (!transfer || !std::holds_alternative<DiffuseRows>(baked.surface.rows) || !baked.surface.fit_errors.empty() ||
      std::holds_alternative<FixedView>(baked.surface.where))
    return Error{where, "measures plain diffuse transfer on surfaces, and the file holds something else", true};
  if (transfer->light.order < 1 || !transfer->light.lobes.empty() || !transfer->light.groups.empty())
    return Error{where, "measures transfer of harmonics, and the file holds lobes or lamps", true};
  const auto provenance = nlohmann::json::parse(baked.provenance, nullptr, false);
  const auto request = provenance.is_object() ? provenance.find("request") : provenance.end();
  if (!provenance.is_object() || request == provenance.end())
    return Error{where, "does not know by which request the file was baked", true};
  auto read = bake_request_from_json(*request);
  if (!read) return Error{where, "the file's request: " + read.error().text(), true};
  auto asked = resolved(*read);
  if (!asked) return Error{where, "the file's request: " + asked.error().text(), true};
  if (asked->shadows == "off" || !asked->subsurface.empty() || !asked->membrane.empty() || !asked->fix_light.empty() ||
      !asked->rooms.empty())
    return Error{where, "is not for transfer without shadows, through a medium, by rooms or with its light baked in",
                 true};
  return Asked{transfer, std::atoi(asked->bounces.c_str())};
}

// Adds a transfer to rows, [receiver][column][channel].
void add_rows(const Transfer& t, size_t channels, size_t width, AlignedVector<float>& rows) {
  const size_t columns = t.light.count();
  for (size_t r = 0; r * width < rows.size(); ++r) {
    const std::vector<float> row = load_receiver(t, r);
    for (size_t k = 0; k < columns; ++k)
      for (size_t c = 0; c < channels; ++c)
        rows[r * width + k * channels + c] += row[std::min(c, size_t(t.channels) - 1) * columns + k];
  }
}

Result<Certificate> measure(const Baked& baked, const Tracer& tracer, const Asked& asked,
                            std::vector<MeasuredPlace>& measured, Progress* progress) {
  const Scene& scene = baked.scene;
  const Transfer& t = *asked.transfer;
  const Receivers own = make_vertex_receivers(scene);
  const GatherSetup setup = make_gather_setup(scene, tracer, own, t.light.order, samples, 0x7e57);
  const size_t columns = t.light.count();
  const size_t channels = asked.bounces > 0 ? size_t(std::max(setup.channels, setup.sky_channels))
                                            : size_t(setup.sky_channels);
  const size_t width = pad_lanes(columns * channels);
  // A solution from rays of its own, and what surfaces send of it, of a bounce less.
  AlignedVector<float> fresh, met;
  if (asked.bounces > 0) {
    BakeOptions options{.order = t.light.order, .samples = fresh_samples, .bounces = asked.bounces, .seed = 0x7e58};
    options.precision = Precision::single, options.certify = false, options.keep_terms = true;
    BakeReport report;
    if (auto sent = bake(scene, tracer, own, options, &report, progress); !sent) return sent.error();
    met.assign(own.count() * width, 0.0f);
    for (size_t term = 0; term < report.terms.size(); ++term) {
      if (term + 1 == report.terms.size()) fresh = met;
      add_rows(report.terms[term], channels, width, term + 1 == report.terms.size() ? fresh : met);
      report.terms[term] = {};
    }
  }
  Pool<GatherScratch, DeleteScratch> scratch([&] { return make_gather_scratch(setup); });
  const GatherAt gather = [&](Vec3 origin, Vec3 normal, uint64_t key, float* row) {
    std::vector<float> sky(setup.sky_width());
    const bool clear = gather_point(setup, *scratch.borrow(), origin, normal, key,
                                    {sky.data(), nullptr, setup.sky_width(), nullptr, nullptr},
                                    met.empty() ? nullptr : met.data(), width, row);
    for (size_t k = 0; k < columns; ++k)
      for (size_t c = 0; c < channels; ++c) row[k * channels + c] += sky[setup.sky_channel(c) * columns + k];
    return clear;
  };
  const FieldRow field = [&](uint32_t receiver, float* row) {
    const std::vector<float> stored = load_receiver(t, receiver);
    std::fill_n(row, width, 0.0f);
    for (size_t k = 0; k < columns; ++k)
      for (size_t c = 0; c < channels; ++c)
        row[k * channels + c] = stored[std::min(c, size_t(t.channels) - 1) * columns + k];
  };
  Receivers stored;
  stored.basis = baked.basis;
  const FieldRow read = [&](uint32_t r, float* row) { std::copy_n(fresh.data() + size_t(r) * width, width, row); };
  const ReflectedErrors reflected{setup, asked.bounces, asked.bounces > 0 ? &read : nullptr};
  return certify_field(scene, stored, field, width, gather, places, 0x7e59, progress, &reflected, nullptr, &measured);
}

}  // namespace

void paint_error(const Scene& scene, const Tracer& tracer, const View& view, ErrorView& out) {
  out.image = Image(view.width, view.height);
  if (view.height <= legend_height) return;
  const std::vector<MeasuredPlace>& all = out.measured;
  const Cloud cloud{all};
  const Tree tree(3, cloud, {16});
  double truth = 0, weights = 0;
  for (const auto& p : all) truth += p.weight * p.truth2, weights += p.weight;
  truth /= weights;
  const int height = out.image.height - legend_height;
  std::vector<float> local(size_t(view.width) * size_t(height), -1.0f);
  const CameraRays rays(view.camera, view.width, height);
  parallel_for(size_t(height), 1, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y)
      for (int x = 0; x < view.width; ++x) {
        const Vec3 d = rays.direction(float(x) + 0.5f, float(y) + 0.5f);
        const Hit hit = tracer.closest(rays.eye, d);
        if (hit.triangle == none) continue;
        const Vec3 p = rays.eye + hit.distance * d;
        Vec3 n = unit_normal(scene, scene.triangles[hit.triangle], Vec3(0, 1, 0));
        if (dot(n, d) > 0) n = -n;
        uint32_t index[looked_at];
        float distance2[looked_at];
        const float query[3] = {p.x, p.y, p.z};
        const size_t found = tree.knnSearch(query, looked_at, index, distance2);
        double sum = 0, weight = 0;
        size_t count = 0;
        for (size_t q = 0; q < found && count < averaged; ++q)
          if (dot(all[index[q]].normal, n) >= least_facing)
            sum += all[index[q]].weight * all[index[q]].error2, weight += all[index[q]].weight, ++count;
        if (count > 0)
          local[y * size_t(view.width) + size_t(x)] = float(std::sqrt(std::max(0.0, sum / weight) / truth));
      }
  });
  std::vector<float> shown;
  for (float e : local)
    if (e >= 0) shown.push_back(e);
  double top = out.certificate.error;
  if (!shown.empty()) {
    const size_t k = shown.size() * 95 / 100;
    std::nth_element(shown.begin(), shown.begin() + std::ptrdiff_t(k), shown.end());
    top = std::max(top, double(shown[k]));
  }
  out.scale = rounded_up(top);
  for (size_t i = 0; i < local.size(); ++i)
    out.image.rgb[i] = local[i] < 0 ? Vec3(0.1f, 0.2f, 0.3f) : false_color(local[i] / float(out.scale));
  draw_legend(out.image, height, out.scale);
}

Result<void> can_measure_error(const Baked& baked) {
  auto asked = check(baked);
  return asked ? Result<void>() : asked.error();
}

Result<ErrorView> measure_error(const Baked& baked, const Tracer& tracer, const Job& job) {
  auto asked = check(baked);
  if (!asked) return asked.error();
  ErrorView out{{}, {}, {}};
  auto certificate = measure(baked, tracer, *asked, out.measured, job.progress);
  if (!certificate) return certificate.error();
  if (certificate->error < 0) return Error{"--view-error", "found too few places that receive light", false};
  out.certificate = std::move(*certificate);
  return out;
}

Result<ErrorView> view_error(const Baked& baked, const std::string& camera, const std::string& size, const Job& job) {
  if (auto ok = can_measure_error(baked); !ok) return ok.error();
  auto view = parse_view(camera, size, baked.scene);
  if (!view) return view.error();
  if (view->height <= legend_height) return Error{"--size", "leaves no room for the legend", true};
  auto tracer = Tracer::build(baked.scene, job.progress);
  if (!tracer) return tracer.error();
  auto out = measure_error(baked, *tracer, job);
  if (!out) return out.error();
  paint_error(baked.scene, *tracer, *view, *out);
  return out;
}

}  // namespace lambent
