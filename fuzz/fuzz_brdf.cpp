// Any bytes given as measured reflection, and as the text of a model, end in an error of one line or in values that are
// finite, not negative and reciprocal.
#include <lambent/brdf/load_measured.h>
#include <lambent/brdf/parse_brdf.h>
#include <lambent/core/check.h>

namespace {

using namespace lambent;

void check_brdf(const Brdf& brdf) {
  const Vec3 a = normalize(Vec3(0.3f, -0.5f, 0.4f)), b = normalize(Vec3(-0.9f, 0.2f, 0.1f));
  for (Vec3 wo : {a, b, Vec3(0, 0, 1)}) {
    const BrdfSample s = sample(brdf, wo, Vec2(0.7f, 0.2f));
    LAMBENT_CHECK(is_finite(s.wi) && is_finite(s.weight) && std::isfinite(s.pdf));
    const BrdfValue v = evaluate_with_pdf(brdf, a, wo);
    LAMBENT_CHECK(is_finite(v.f) && std::isfinite(v.pdf) && std::min({v.f.x, v.f.y, v.f.z, v.pdf}) >= 0);
    LAMBENT_CHECK(length(v.f - evaluate(brdf, wo, a)) <= 1e-3f * length(v.f));
  }
}

void check_error(const Error& error) {
  const std::string text = error.text();
  LAMBENT_CHECK(!text.empty() && text.find('\n') == std::string::npos);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (auto table = load_measured({data, size}, "fuzz.brdf"))
    check_brdf(Measured{std::make_shared<const MeasuredTable>(std::move(*table))});
  else check_error(table.error());
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (text.starts_with("measured")) return 0;  // names files
  if (auto brdf = parse_brdf(text)) check_brdf(*brdf);
  else check_error(brdf.error());
  return 0;
}
