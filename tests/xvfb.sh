# Sourced by tests of `lambent view --window`: bash THIS LAMBENT. A folder of their own, and a screen without one: Xvfb,
# OpenGL in software. Left out, with a line, where something is missing.
tool=$(readlink -f "$1") golden=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/golden
for program in Xvfb xdotool; do
  command -v $program >/dev/null || { echo "window: left out: $program is not installed"; exit 0; }
done
says=$(env -u DISPLAY -u WAYLAND_DISPLAY "$tool" view --window "$golden/diffuse.glb" 2>&1 </dev/null || true)
if [[ $says == *"this build has no windows"* ]]; then
  echo "window: left out: this build has none"
  exit 0
fi
folder=$(mktemp -d)
trap 'kill $(jobs -pr) 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$folder"' EXIT
cd "$folder"
passed=0
failed() { echo "window: FAILED: $1"; exit 1; }
pass() { passed=$((passed + 1)); }
show() { "$tool" view --window "$@"; }
# The screen, from here on.
begin_screen() {
  Xvfb -displayfd 3 -screen 0 900x700x24 -nolisten tcp -noreset 3>display >xvfb.log 2>&1 &
  for _ in $(seq 300); do [ -s display ] && break; sleep 0.1; done
  [ -s display ] || failed "Xvfb did not start: $(cat xvfb.log)"
  DISPLAY=:$(cat display) LIBGL_ALWAYS_SOFTWARE=1
  export DISPLAY LIBGL_ALWAYS_SOFTWARE
}
