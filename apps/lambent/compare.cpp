#include "commands.h"
#include "options.h"

#include <lambent/image/compare.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct CompareCommand {
  std::string a, b, output;
  DisplayOptions display{"0", "none"};
  bool mean = false;
};

int run_compare(Context& context, const CompareCommand& o) {
  if (!o.output.empty())
    if (auto ok = check_output(o.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto a = load_image(o.a);
  if (!a) return fail(a.error());
  auto b = load_image(o.b);
  if (!b) return fail(b.error());
  auto display = parse_display(o.display.exposure, o.display.tone, {&*b, 1});
  if (!display) return fail(display.error());
  auto d = compare_images(*a, *b, *display);
  if (!d) return fail(d.error());
  if (o.mean && a->alpha.size() != b->alpha.size())
    return fail({o.b, "--mean needs both pictures with alpha, or both without"});
  if (!o.output.empty())
    if (auto ok = save_image(o.output, o.mean ? mean_of(*a, *b) : difference_picture(*a, *b, *display),
                             o.mean ? *display : Display());
        !ok)
      return fail(ok.error());
  if (context.json) {
    print_json({{"a", o.a},
                {"b", o.b},
                {"pixels", d->pixels},
                {"rmse", d->rmse},
                {"relative_mse", d->relative_mse},
                {"psnr", std::isfinite(d->psnr) ? nlohmann::json(d->psnr) : nlohmann::json()},
                {"flip", d->flip},
                {"mean_a", d->mean_a},
                {"mean_b", d->mean_b}});
  } else {
    fmt::print(
        "{} pixels\n  RMSE          {:.5f}\n  relative MSE  {:.3g}\n  PSNR          {:.2f} dB\n  FLIP          {:.4f}\n"
        "  mean          {:.5f} against {:.5f}\n",
        human_count(d->pixels), d->rmse, d->relative_mse, d->psnr, d->flip, d->mean_a, d->mean_b);
    if (!o.output.empty()) fmt::print("{}\n", o.output);
  }
  return success;
}

}  // namespace

void add_compare(CLI::App& app, Run& run) {
  auto o = std::make_shared<CompareCommand>();
  CLI::App* c = app.add_subcommand("compare", "Measure how far picture A is from reference B");
  c->add_option("a", o->a, "Picture")->required();
  c->add_option("b", o->b, "Reference picture")->required();
  c->add_option("-o,--output", o->output, "Picture to write: A, B and the false-colour difference");
  c->add_flag("--mean", o->mean,
              "Write the mean of A and B instead: two references with different seeds make one of twice the paths");
  o->display.add_to(*c);  // for PSNR, FLIP and the picture
  c->callback([o, &run] { run = [o](Context& context) { return run_compare(context, *o); }; });
}

}  // namespace lambent::tool
