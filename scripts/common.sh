# Shared by the scripts beside it: finds the repository, installs what is missing, builds.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build_packages="g++ cmake ninja-build ccache pkg-config libembree-dev libtbb-dev libhwy-dev libeigen3-dev libopenexr-dev
  libstb-dev libxxhash-dev nlohmann-json3-dev libfmt-dev libcli11-dev libgtest-dev
  libdraco-dev libmeshoptimizer-dev libwebp-dev libnanoflann-dev"
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
