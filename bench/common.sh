# Shared by the benchmarks beside it, which scripts/bench calls.
source "$(dirname "${BASH_SOURCE[0]}")/../scripts/common.sh"
data=${LAMBENT_DATA:-../shared/data}
tool=${LAMBENT:-build/release/bin/lambent}

# exposure_of FILE: stops that bring the mean of a picture, out of `compare --json`, to a fifth.
exposure_of() {
  python3 - "$1" <<'P'
import json, math, sys
print(max(-20, min(20, math.log2(0.2 / json.load(open(sys.argv[1]))["mean_a"]))))
P
}

# number KEY FILE: a number out of JSON.
number() { sed -n "s/.*\"$1\": \([0-9.e+-]*\).*/\1/p" "$2" | head -n 1; }
