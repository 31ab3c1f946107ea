#!/usr/bin/env bash
# Highway 1.0.3 with GCC 12.2 (Debian 12) and a precompiled header: -ffp-contract=off is lost.
#
# Highway compiles a function once for each instruction set, between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE, by
# "#pragma GCC target". A source that is compiled with -ffp-contract=off has products and sums rounded one by one in all
# of them. With a header precompiled *without* that option in front of it, which GCC takes without a warning
# (-Winvalid-pch says nothing), the same source and option give fused multiply-adds in the functions for AVX2 and
# AVX-512: their results differ in the last bit from the scalar code beside them. CMake precompiles a header once a
# target and uses it for sources that have options of their own, so that setting the option for one source is not
# enough; SKIP_PRECOMPILE_HEADERS for it is.
#
# Seen: 0 fused instructions without a precompiled header, some behind one made without the option, 0 behind one made
# with it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for package in g++-12=12.2.0-14+deb12u1 libhwy-dev=1.0.3-3+deb12u1; do
  [ "$(dpkg-query -W -f='${Version}' "${package%%=*}" 2>/dev/null)" = "${package#*=}" ] && continue
  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$package"
done
cat >probe.cpp <<'O'
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "probe.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
HWY_BEFORE_NAMESPACE();
namespace probe::HWY_NAMESPACE {
void product_and_sum(const float* a, const float* b, float* c) {
  const hwy::HWY_NAMESPACE::ScalableTag<float> d;
  Store(Load(d, a) * Load(d, b) + Load(d, c), d, c);
}
}
HWY_AFTER_NAMESPACE();
O
echo '#include <cmath>' >common.h
fused() {
  g++-12 -std=c++20 -O2 -ffp-contract=off -DHWY_SHARED_DEFINE -I. "$@" -S probe.cpp -o probe.s
  grep -cE 'vfn?m(add|sub)' probe.s || true
}
without=$(fused)
g++-12 -std=c++20 -O2 -x c++-header common.h -o common.h.gch
behind=$(fused -Winvalid-pch -include common.h 2>warnings)
g++-12 -std=c++20 -O2 -ffp-contract=off -x c++-header common.h -o common.h.gch
behind_own=$(fused -Winvalid-pch -include common.h)
echo "fused instructions: $without without, $behind behind a header precompiled without the option, $behind_own with it"
[ "$without" = 0 ] && [ "$behind" -gt 0 ] && [ ! -s warnings ] && [ "$behind_own" = 0 ] ||
  { echo "the behaviour has changed"; exit 1; }
echo "as described"
