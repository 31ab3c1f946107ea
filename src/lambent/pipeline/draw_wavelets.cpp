#include <lambent/pipeline/draw_wavelets.h>

#include <lambent/compress/haar_fit.h>
#include <lambent/light/cube_light.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/relight_haar.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent {
namespace {

Result<HaarFitOptions> parse_columns(const std::string& method) {
  HaarFitOptions options;
  if (method == "columns") return options;
  auto n = parse_numbers(method.substr(8), 1, "--method");
  if (!n || !((*n)[0] >= 0 && (*n)[0] < 1))
    return Error{"--method", "columns:ERROR takes an error from 0 and below 1, not \"" + method + "\"", true};
  options.error = double((*n)[0]);
  return options;
}

void describe_columns(const Baked& baked, const HaarTransfer& t, const HaarFitReport& fit, size_t terms, size_t read,
                      double seconds, Summary& out) {
  out.json = {{"receivers", t.receivers},
              {"frames", 1},
              {"terms", terms},
              {"error", fit.error},
              {"coefficients_per_receiver", fit.entries},
              {"bytes", t.bytes()},
              {"bytes_read", read},
              {"blocks_bytes", bytes_of(baked.surface.store)},
              {"relight_seconds", seconds}};
  out.lines.emplace_back("columns", fmt::format("{:.0f} wavelets a receiver, to {:.2f} % RMS; {} in all", fit.entries,
                                                100 * fit.error, human_bytes(double(t.bytes()))));
  out.lines.emplace_back("relit",
                         fmt::format("{} receivers by {} terms in {:.2f} ms, which read {}", human_count(t.receivers),
                                     human_count(terms), 1e3 * seconds, human_bytes(double(read))));
}

}  // namespace

bool is_columns_method(const std::string& method) { return method == "columns" || method.starts_with("columns:"); }

Result<Drawing> draw_wavelets(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto options = parse_columns(request.method);
  if (!options) return options.error();
  auto view = parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  const auto& visibility = std::get<Visibility>(baked.surface.store);
  const VertexPlacement* at = vertices_of(baked);
  if (!at) return Error{request.baked, "has visibility elsewhere than at vertices"};
  const Receivers receivers = make_vertex_receivers(baked.scene);
  if (receivers.front != at->front || receivers.back != at->back)
    return Error{"--method", "the file's receivers are not those of its scene", true};
  HaarFitReport fit;
  auto transfer = fit_haar(visibility, receivers.normals, *options, &fit, job.progress);
  if (!transfer) return Error{request.baked, transfer.error().message};
  const CubeLight light = cube_light(*around->env, visibility.size, around->rotation);
  const HaarTerms terms = haar_terms(*transfer, haar_column_norms(*transfer), light, size_t(request.terms));
  Relit relit;
  size_t read = 0;
  const auto start = std::chrono::steady_clock::now();
  relight(*transfer, terms, relit, &read);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (float& v : relit.values) v = std::max(v, 0.0f);  // few terms ring
  auto tracer = Tracer::build(baked.scene);
  if (!tracer) return tracer.error();
  RenderOptions drawn;
  drawn.width = view->width, drawn.height = view->height, drawn.samples = request.spp;
  drawn.background = around->background();
  auto image = render(baked.scene, *tracer, baked.basis, relit, view->camera, drawn, job.progress);
  if (!image) return image.error();
  Drawing drawing;
  drawing.frames.push_back(std::move(*image));
  describe_columns(baked, *transfer, fit, terms.columns.size(), read, seconds, drawing.summary);
  return drawing;
}

}  // namespace lambent
