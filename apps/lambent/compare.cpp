#include "commands.h"
#include "options.h"

#include <lambent/image/compare.h>

#include <fmt/format.h>

#include <optional>

namespace lambent::tool {
namespace {

struct CompareCommand {
  std::string a, b, half, output;
  DisplayOptions display{"0", "none"};
  bool mean = false, all = false;
};

int run_compare(Context& context, const CompareCommand& o) {
  if (!o.output.empty())
    if (auto ok = check_output(o.output, {"png", "exr"}); !ok) return fail(ok.error());
  std::vector<std::string> warnings;
  auto a = load_image(o.a, &warnings);
  if (!a) return fail(a.error());
  auto b = load_image(o.b, &warnings);
  if (!b) return fail(b.error());
  std::optional<Image> first, half;
  if (!o.half.empty()) {
    auto other = load_image(o.half, &warnings);
    if (!other) return fail(other.error());
    if (other->width != b->width || other->height != b->height || other->alpha.size() != b->alpha.size())
      return fail({o.half, "is not like " + o.b + ": its size or its alpha differs"});
    first = std::move(*b), half = std::move(*other), b = mean_of(*first, *half);
  }
  warn(warnings);
  auto display = parse_display(o.display.exposure, o.display.tone, {&*b, 1});
  if (!display) return fail(display.error());
  auto d = compare_images(*a, *b, *display, o.all);
  if (!d) return fail(d.error());
  std::optional<UnnoisyDifference> unnoisy;
  if (half) {
    auto found = compare_to_two(*a, *first, *half, *display, o.all);
    if (!found) return fail(found.error());
    unnoisy = *found;
  }
  if (o.mean && a->alpha.size() != b->alpha.size())
    return fail({o.b, "--mean needs both pictures with alpha, or both without"});
  if (!o.output.empty())
    if (auto ok = save_image(o.output, o.mean ? mean_of(*a, *b) : difference_picture(*a, *b, *display),
                             o.mean ? *display : Display());
        !ok)
      return fail(ok.error());
  const size_t size = a->rgb.size();
  auto number = [](double v) { return std::isfinite(v) ? nlohmann::json(v) : nlohmann::json(); };
  if (context.json) {
    nlohmann::json out = {{"a", o.a},
                          {"b", o.b},
                          {"pixels", d->pixels},
                          {"of_pixels", size},
                          {"rmse", d->rmse},
                          {"relative_mse", d->relative_mse},
                          {"psnr", number(d->psnr)},
                          {"flip", d->flip},
                          {"black", d->black},
                          {"mean_a", d->mean_a},
                          {"mean_b", d->mean_b}};
    if (unnoisy)
      out["without_noise"] = {{"psnr", number(unnoisy->psnr)},
                              {"least", number(unnoisy->least)},
                              {"most", number(unnoisy->most)},
                              {"sloped", number(unnoisy->sloped)},
                              {"noise", number(unnoisy->noise)}};
    print_json(out);
  } else {
    fmt::print(
        "{}\n  RMSE          {:.5f}\n  relative MSE  {:.3g}\n  PSNR          {:.2f} dB\n  FLIP          {:.4f}\n"
        "  mean          {:.5f} against {:.5f}\n  black         {:.2f} % of what B shows lit\n",
        d->pixels == size ? human_count(size) + " pixels"
                          : fmt::format("{} covered pixels of {} (--all counts every one)", human_count(d->pixels),
                                        human_count(size)),
        d->rmse, d->relative_mse, d->psnr, d->flip, d->mean_a, d->mean_b, 100 * d->black);
    if (unnoisy)
      fmt::print(
          "  without noise {:.2f} dB ({:.2f} to {:.2f}; {:.2f} by the display's slope); the references' own "
          "allows {:.2f} dB\n",
          unnoisy->psnr, unnoisy->least, unnoisy->most, unnoisy->sloped, unnoisy->noise);
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
  c->add_flag("--all", o->all,
              "Count every pixel; without it, where a picture has alpha, those that either covers, of which the other "
              "may be empty");
  c->add_option("--half", o->half,
                "The reference again with another seed: B is then the mean of both, and a PSNR is said in which their "
                "noise is not");
  c->add_flag("--mean", o->mean,
              "Write the mean of A and B instead: two references with different seeds make one of twice the paths");
  o->display.add_to(*c);  // for PSNR, FLIP and the picture
  c->callback([o, &run] { run = [o](Context& context) { return run_compare(context, *o); }; });
}

}  // namespace lambent::tool
