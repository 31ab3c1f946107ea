#!/usr/bin/env bash
# `lambent view --window` without a screen: Xvfb, OpenGL in software, hands by xdotool. What it shows, once it has
# settled, is the picture that `lambent render` writes, byte for byte, of every kind of file (tests/golden).
#   tests/window.sh LAMBENT
set -euo pipefail
tool=$(readlink -f "$1") golden=$(dirname "$(readlink -f "$0")")/golden
for program in Xvfb xdotool; do
  command -v $program >/dev/null || { echo "window: left out: $program is not installed"; exit 0; }
done
if [[ $("$tool" view --window "$golden/diffuse.glb" 2>&1 </dev/null) == *"this build has no windows"* ]]; then
  echo "window: left out: this build has none"
  exit 0
fi
folder=$(mktemp -d)
trap 'kill $(jobs -pr) 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$folder"' EXIT
cd "$folder"
passed=0
failed() { echo "window: FAILED: $1"; exit 1; }
pass() { passed=$((passed + 1)); }

# Without a display: one line.
env -u DISPLAY -u WAYLAND_DISPLAY "$tool" view --window "$golden/diffuse.glb" 2>error && failed "a window on no display"
grep -q "there is no display" error && [ "$(wc -l <error)" = 1 ] || failed "no display: $(cat error)"
pass

Xvfb -displayfd 3 -screen 0 900x700x24 -nolisten tcp -noreset 3>display >xvfb.log 2>&1 &
for _ in $(seq 100); do [ -s display ] && break; sleep 0.1; done
[ -s display ] || failed "Xvfb did not start: $(cat xvfb.log)"
export DISPLAY=:$(cat display) LIBGL_ALWAYS_SOFTWARE=1
show() { "$tool" view --window "$@"; }

sky=sky:elevation=40,azimuth=20,turbidity=4 camera=3,2,4,1,0.5,1,40
for file in "$golden"/*.glb; do
  name=$(basename "$file" .glb)
  light=(--env $sky) view=(--camera $camera --spp 2) size=(--size 96x72)
  case $name in
    indirect)  # lamps of its own; said, not shown
      show "$file" 2>log && failed "indirect: shown"
      grep -q "not drawn live" log || failed "indirect: $(cat log)"
      pass
      continue
      ;;
    diffuse_fixed_view) view=() size=() ;;
    lightmap | lightmap_directional) light=() ;;
  esac
  printf '%s\n' 'panel off' 'size 96x72' 'frames 2' 'settle' "save $name.window.exr" >script
  show "$file" "${light[@]}" "${view[@]}" --script script 2>log || failed "$name: $(cat log)"
  "$tool" render "$file" "${light[@]}" "${view[@]}" "${size[@]}" -o $name.render.exr >log 2>&1 ||
    failed "$name: $(cat log)"
  cmp -s $name.window.exr $name.render.exr || failed "$name: the window's picture is not render's: $(
    "$tool" compare $name.window.exr $name.render.exr 2>&1)"
  pass
done

# A hand with Shift turns the light: sixty pixels of a window of 240 are 45 degrees.
printf '%s\n' 'panel off' 'size 320x240' 'settle' 'save before.exr' 'wait 6' 'settle' 'save after.exr' >script
show "$golden/diffuse.glb" --env $sky --camera $camera --spp 2 --script script 2>log &
window=$!
for _ in $(seq 100); do [ -s before.exr ] && break; sleep 0.1; done
id=$(xdotool search --sync --onlyvisible --name '^lambent: ' | head -1) || failed "no window was found"
xdotool mousemove --window $id 100 120 keydown shift mousedown 1 sleep 0.2 mousemove --window $id 130 120 sleep 0.2 \
  mousemove --window $id 160 120 sleep 0.2 mouseup 1 keyup shift
wait $window || failed "a drag: $(cat log)"
"$tool" render "$golden/diffuse.glb" --env $sky --camera $camera --spp 2 --size 320x240 --env-rotate -45,0,0 \
  -o turned.exr >log 2>&1
psnr=$("$tool" --json compare after.exr turned.exr | sed -n 's/.*"psnr": *\([0-9.a-z]*\).*/\1/p')
[ "$psnr" = null ] || awk "BEGIN { exit !(0$psnr >= 45) }" || failed "the light turned by hand: $psnr dB"
cmp -s before.exr after.exr && failed "the drag did nothing"
pass

# Objects: one inserted, one of a field, as `render` draws them; a hand with Ctrl carries it away; one is taken out.
printf 'v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0.3 0.8 0.3\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n' >pyramid.obj
lattice=$golden/diffuse_lattice.glb
for object in "--insert pyramid.obj@0.8,0.2,0.8,1.2" "--place a=$golden/diffuse_field.glb@0.6,0.9,0.4,20,0,0,0.6"; do
  printf '%s\n' 'panel off' 'size 320x240' 'settle' 'save before.exr' 'wait 6' 'settle' 'save after.exr' \
    "set ${object#--}" 'settle' 'save back.exr' >script
  rm -f before.exr
  show "$lattice" $object --env $sky --camera $camera --spp 1 --script script 2>log &
  window=$!
  for _ in $(seq 200); do [ -s before.exr ] && break; sleep 0.1; done
  id=$(xdotool search --sync --onlyvisible --name '^lambent: ' | head -1) || failed "no window was found"
  read -r x y <<<"$(case $object in --insert*) echo 130 115 ;; *) echo 125 122 ;; esac)"
  xdotool mousemove --window $id $x $y keydown ctrl mousedown 1 sleep 0.2 mousemove --window $id $((x - 30)) $y \
    sleep 0.3 mouseup 1 keyup ctrl
  wait $window || failed "$object: $(cat log)"
  "$tool" render "$lattice" $object --env $sky --camera $camera --spp 1 --size 320x240 -o object.exr >log 2>&1 ||
    failed "$object: $(cat log)"
  cmp -s before.exr object.exr || failed "$object: the window's picture is not render's"
  cmp -s before.exr after.exr && failed "$object: a hand with Ctrl did nothing"
  cmp -s before.exr back.exr || failed "$object: put back it is not where it was"
  pass
done
printf '%s\n' 'panel off' 'size 320x240' 'set insert pyramid.obj@' 'settle' 'save without.exr' >script
show "$lattice" --insert pyramid.obj@0.8,0.2,0.8,1.2 --env $sky --camera $camera --spp 1 --script script 2>log ||
  failed "an object taken out: $(cat log)"
"$tool" render "$lattice" --env $sky --camera $camera --spp 1 --size 320x240 -o plain.exr >log 2>&1
cmp -s without.exr plain.exr || failed "an object that was taken out is still there"
pass

# Beside the path tracer, another bake, a difference; a window of one pixel; what cannot be dropped.
printf '%s\n' 'compare reference' 'settle' 'wait 2' 'screenshot wipe.png' 'compare bake' 'difference on' 'settle' \
  'screenshot difference.png' 'difference off' 'compare nothing' 'look receivers' 'settle' 'look density' 'settle' \
  'look coefficient 3' 'settle' 'look picture' 'turn-light 20' 'orbit 10 5' 'pan 0.1 0.1' 'dolly 0.9' 'settle' \
  'set exposure 1' 'set tone agx' 'settle' 'size 1x1' 'settle' 'size 200x150' 'settle' 'film light 3 film%d.png' >script
show "$golden/diffuse.glb" "$golden/diffuse_grey_single.glb" --env $sky --camera $camera --spp 1 --size 600x300 \
  --script script 2>log || failed "a script: $(cat log)"
for picture in wipe.png difference.png film000.png film002.png; do [ -s $picture ] || failed "$picture is missing"; done
pass
while IFS='|' read -r action message; do
  printf '%s\n' "$action" >script
  show "$golden/diffuse.glb" --env $sky --script script 2>error && failed "\"$action\" went through"
  grep -q "$message" error && [ "$(wc -l <error)" = 1 ] || failed "\"$action\": $(cat error)"
  pass
done <<'ACTIONS'
jump|there is no action "jump"
set exposure|set wants 2 words
set exposure bright|exposure
set nonsense 3|is no option
drop script|script
compare bake 7|no such bake
look coefficient 400|coefficients 0 to
save picture.bmp|bmp
wipe x|wipe
ACTIONS
show "$golden/diffuse.glb" --port 80 2>error && failed "--port went through"
grep -q -e "--port" error || failed "$(cat error)"
"$tool" view "$golden/diffuse.glb" --script script 2>error && failed "--script without --window went through"
grep -q -e "--script" error || failed "$(cat error)"
pass
echo "window: $passed passed"
