# Shared by the scripts beside it: finds the repository, installs what is missing, builds.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build_packages="g++ cmake ninja-build ccache pkg-config libembree-dev libtbb-dev libhwy-dev libeigen3-dev libopenexr-dev
  libstb-dev libxxhash-dev nlohmann-json3-dev libfmt-dev libcli11-dev libgtest-dev
  libdraco-dev libmeshoptimizer-dev libwebp-dev libnanoflann-dev"
mpi_packages="libopenmpi-dev openmpi-bin"  # the tool builds and works without
python_packages="pybind11-dev python3-dev python3-numpy"
# Of `lambent view --window`, and of its tests.
window_packages="libglfw3-dev libimgui-dev libgl-dev xvfb xdotool libgl1-mesa-dri"
sanitize_packages="clang-14 libclang-rt-14-dev"

# Installs the Debian packages named, if any is missing. Needs root or sudo only then.
need() {
  local missing=()
  for p in "$@"; do
    dpkg-query -W -f='${Status}' "$p" 2>/dev/null | grep -q 'ok installed' || missing+=("$p")
  done
  [ ${#missing[@]} -eq 0 ] && return
  echo "Installing: ${missing[*]}" >&2
  local sudo=""
  [ "$(id -u)" -eq 0 ] || sudo=sudo
  if [ -n "$sudo" ] && ! command -v sudo >/dev/null; then
    echo "These packages are missing and this is not root: apt-get install ${missing[*]}" >&2
    exit 1
  fi
  local log
  log=$(mktemp)
  if ! { $sudo apt-get update && DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y \
    --no-install-recommends "${missing[@]}"; } >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    echo "The packages could not be installed; the whole log is $log" >&2
    exit 1
  fi
  rm -f "$log"
}

# build PRESET [TARGET...], configured with $cmake_options
cmake_options=()
build() {
  local preset=$1
  shift
  mkdir -p build
  local log="build/$preset.log"
  echo "Building ($preset)" >&2
  if ! { cmake --preset "$preset" "${cmake_options[@]}" &&
    nice cmake --build --preset "$preset" ${@:+--target "$@"}; } >"$log" 2>&1; then
    tail -n 40 "$log" >&2
    echo "The build failed; the whole log is $log" >&2
    exit 1
  fi
}

# timed NAME COMMAND...: runs it in a shell of its own and keeps what it took, for print_times.
timed() {
  local name=$1
  shift
  mkdir -p build
  (
    took=build/times.$BASHPID begun=$EPOCHREALTIME
    trap '{ times; echo "$begun $EPOCHREALTIME"; } >"$took"; keep_times "$name" "$took"' EXIT
    "$@"
  )
}
# Processor seconds: the user's and the system's, of the shell and of all that it waited for.
keep_times() {
  tr ms '  ' <"$2" | awk -v name="$1" '
    NF == 4 { processor += 60 * ($1 + $3) + $2 + $4 } NF == 2 { wall = $2 - $1 }
    END { printf "%s\t%.1f\t%.1f\n", name, wall, processor }' >>build/times.txt
  rm -f "$2"
}
# Steps that ran beside others take their wall seconds at the same time as those.
print_times() {
  [ ! -s build/times.txt ] || awk -F'\t' '
    BEGIN { printf "%-34s %8s %12s\n", "seconds", "wall", "processor" }
    { printf "%-34s %8.1f %12.1f\n", $1, $2, $3; processor += $3 }
    END { printf "%-34s %8s %12.1f\n", "all", "", processor }' build/times.txt
}
