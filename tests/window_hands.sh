#!/usr/bin/env bash
# Hands at the window of `lambent view --window`, by events as a mouse and keys make them (xdotool; drops by
# tests/drop.c): after each the picture is `lambent render`'s of what was asked for. What goes wrong: a context that is
# lost, a file that is replaced, drops of other things; and that a window that rests takes no processor.
#   tests/window_hands.sh LAMBENT
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
source "$here/xvfb.sh"
begin_screen
sky=sky:elevation=40,azimuth=20,turbidity=4,width=128 camera=3,2,4,1,0.5,1,40
width=240 height=560 panel=320  # of the picture; the panel is at its right
plain=(--exposure 0 --tone none --camera $camera --spp 1)

# Opens a window over these arguments and waits for it.
open() {
  "$tool" view --window "$@" --size $((width + panel))x$height "${plain[@]}" 2>log &
  window=$!
  id=$(timeout 120 xdotool search --sync --onlyvisible --all --pid $window --name '^lambent: ' | head -1) ||
    failed "no window over $*: $(cat log)"
  xdotool mousemove --window $id 20 20
}
close() {
  xdotool mousemove --window $id 20 20 key --clearmodifiers ctrl+q
  wait $window || failed "closing: $(cat log)"
}
alive() { kill -0 $window 2>/dev/null || failed "$1: the window is gone: $(cat log)"; }
# What the window shows, by its key S.
shoot() {
  local saved
  for _ in $(seq 20); do
    alive "S"
    xdotool mousemove --window $id 20 20 key s
    for _ in $(seq 50); do
      saved=$(compgen -G 'lambent_*.png' | head -1) && [ -s "$saved" ] && sleep 0.1 && mv "$saved" "$1" &&
        rm -f lambent_*.png && return
      sleep 0.1
    done
  done
  failed "the key S saved no picture"
}
# render's picture; of an option that is given twice the latter counts.
drawn() {
  local -A last=()
  local words=("$1") materials=()
  shift
  for (( ; $#; )); do
    if [ "$1" = --material ]; then materials+=("$1" "$2"); else last[$1]=$2; fi
    shift 2
  done
  for option in "${!last[@]}"; do words+=("$option" "${last[$option]}"); done
  "$tool" render "${words[@]}" "${materials[@]}" --size ${width}x$height -o drawn.png >render.log 2>&1 ||
    failed "$(cat render.log)"
}
psnr() { "$tool" --json compare "$1" "$2" 2>/dev/null | sed -n 's/.*"psnr": *\([0-9.a-z]*\).*/\1/p'; }
is_like() { local apart; apart=$(psnr "$1" "$2") && { [ "$apart" = null ] || awk "BEGIN { exit !(0$apart >= 45) }"; }; }
# The window comes to show what render draws with these arguments, and what it showed before was something else. What a
# hand does that finds its number was not taken, on a machine that draws a frame a second: it types again (`again`).
again=
becomes() {
  local what=$1
  shift
  drawn "$@"
  is_like before.png drawn.png && failed "$what: there is nothing to see of it"
  for k in $(seq 60); do
    shoot now.png
    is_like now.png drawn.png && cp now.png before.png && pass && return
    [ $((k % 20)) -ne 0 ] || eval "$again"
    sleep 0.3
  done
  failed "$what: the window does not show it: $(psnr now.png drawn.png) dB from render $*"
}
# A number into a slider of the panel, as Ctrl-click lets one type it.
type_into() {
  xdotool mousemove --window $id $((width + 90)) "$1" sleep 0.2 keydown ctrl click 1 keyup ctrl sleep 0.3 \
    key ctrl+a sleep 0.1 type --delay 60 "$2"
  xdotool sleep 0.2 key Return sleep 0.2
}

file=$golden/diffuse.glb
open "$file" --env $sky
shoot before.png
drawn "$file" --env $sky "${plain[@]}"
for _ in $(seq 30); do is_like before.png drawn.png && break; sleep 0.3; shoot before.png; done
is_like before.png drawn.png || failed "the window does not open with render's picture"
cp before.png first.png

# It rests: no processor, but for a look at the file a second.
ticks() { awk '{ print $14 + $15 }' /proc/$window/stat; }
sleep 1
begin=$(ticks)
sleep 3
awk "BEGIN { exit !(($(ticks) - $begin) / $(getconf CLK_TCK) < 0.3) }" ||
  failed "a window that rests took $(($(ticks) - begin)) ticks of processor in 3 s"
pass

# Sliders of the panel; the wheel; arrows, once around.
again='type_into 328 1.50'
eval "$again"
becomes "exposure" "$file" --env $sky "${plain[@]}" --exposure 1.5
again='type_into 121 12'
eval "$again"
becomes "the sun's height" "$file" --env sky:elevation=12,azimuth=20,turbidity=4,width=128 "${plain[@]}" --exposure 1.5
again='type_into 121 40; type_into 328 0'
eval "$again"
becomes "both put back" "$file" --env $sky "${plain[@]}"
again=
xdotool mousemove --window $id 100 100 click 4
becomes "the wheel" "$file" --env $sky "${plain[@]}" --camera 2.8,1.85,3.7,1,0.5,1,40
xdotool mousemove --window $id 100 100 keydown shift
for _ in $(seq 18); do xdotool key Right; done
xdotool keyup shift
becomes "the light turned by keys" "$file" --env $sky "${plain[@]}" --camera 2.8,1.85,3.7,1,0.5,1,40 \
  --env-rotate 90,0,0
cp drawn.png quarter.png
xdotool mousemove --window $id 100 100 keydown shift
for _ in $(seq 54); do xdotool key Right; done
xdotool keyup shift
becomes "the light turned once around" "$file" --env $sky "${plain[@]}" --camera 2.8,1.85,3.7,1,0.5,1,40
xdotool mousemove --window $id 100 100 click 5
shoot before.png
for _ in $(seq 30); do cmp -s before.png first.png && break; sleep 0.3; shoot before.png; done
is_like before.png first.png || failed "nearer and farther again is somewhere else"
cp before.png first.png
xdotool mousemove --window $id 100 100 keydown shift
for _ in $(seq 72); do xdotool key Left; done
xdotool keyup shift
sleep 0.5
for _ in $(seq 30); do shoot before.png; cmp -s before.png first.png && break; sleep 0.3; done
cmp -s before.png first.png || failed "a light that has turned once around gives other bytes"
pass

# A window of a pixel, and back.
xdotool windowsize $id 1 1 sleep 0.5
alive "one pixel"
xdotool windowsize $id $((width + panel)) $height sleep 0.5
for _ in $(seq 30); do shoot before.png; cmp -s before.png first.png && break; sleep 0.3; done
cmp -s before.png first.png || failed "a window that was a pixel large shows something else"
pass

# Drops: an environment, what is none, another bake.
if cc -O1 -o drop "$here/drop.c" -lX11 2>cc.log; then
  drop() { ./drop $id "$@" || failed "the window takes no drop of $*"; }
  "$tool" render "$golden/blocks.glb" --env $sky --camera $camera --spp 1 --size 64x32 -o other.exr >log.env 2>&1 ||
    failed "$(cat log.env)"
  drop "$PWD/other.exr"
  becomes "an environment that is dropped" "$file" --env other.exr "${plain[@]}"
  for _ in $(seq 30); do  # like that, and then at rest
    cp before.png rested.png && sleep 0.3 && shoot before.png
    cmp -s before.png rested.png && break
  done
  echo "no picture" >wrong.hdr
  drop "$PWD/wrong.hdr"
  drop "$PWD/log.env"
  drop "$here/lost_context.c"
  sleep 0.5
  for _ in $(seq 30); do shoot after.png; cmp -s after.png before.png && break; sleep 0.3; done
  cmp -s after.png before.png || failed "what cannot be dropped has changed the picture"
  pass
  drop "$golden/matrix_phong.glb"
  becomes "a bake that is dropped" "$golden/matrix_phong.glb" --env other.exr "${plain[@]}"
else
  echo "window: drops are left out: $(tail -1 cc.log)"
fi
close
pass

# Keys of the window itself. Without the panel the picture is as wide as the window.
open "$file" --env $sky
for _ in $(seq 30); do shoot before.png; cmp -s before.png first.png && break; sleep 0.3; done
cmp -s before.png first.png || failed "the window opens with something else"
xdotool mousemove --window $id 20 20 key Tab
width=$((width + panel))
becomes "Tab: no panel" "$file" --env $sky "${plain[@]}"
width=$((width - panel))
xdotool key Tab
for _ in $(seq 30); do shoot before.png; cmp -s before.png first.png && break; sleep 0.3; done
cmp -s before.png first.png || failed "Tab: the panel does not come back"
pass
if cc -O1 -o grab "$here/grab.c" -lX11 2>cc.log; then
  # What it shows left and right of the wipe's line, in numbers.
  left() { ./grab $id 0 0 $((width / 2 - 8)) $height || failed "the window's picture cannot be read"; }
  right() { ./grab $id $((width / 2 + 8)) 0 $((width / 2 - 8)) $height || failed "its picture cannot be read"; }
  # A key, after which left and right are (=) or are not (!) as they were at first. A window that draws a frame a second
  # may not take one: it is typed again where nothing has come of it.
  sides() {
    local key=$1 what=$2 wanted=$3 l r
    for _ in 1 2 3 4; do
      xdotool mousemove --window $id 20 20 key $key
      for _ in $(seq 50); do
        alive "$what"
        l=! r=!
        [ "$(left)" != "$was_left" ] || l==
        [ "$(right)" != "$was_right" ] || r==
        [ "$l$r" != "$wanted" ] || { pass && return; }
        sleep 0.2
      done
    done
    failed "$what: left and right of the wipe are $l$r as before, not $wanted"
  }
  sleep 0.5
  was_left=$(left) was_right=$(right)
  sides r "R: the path tracer at the right" "=!"
  sides d "D: the difference in place of the wipe" "!!"
  sides d "D again" "=!"
  sides r "R again" "=="
  sides F1 "F1: keys" "!!"
  sides Escape "Escape: none" "=="
else
  echo "window: keys that draw beside the picture are left out: $(tail -1 cc.log)"
fi
close
pass

# F5 after the file was replaced.
cp "$golden/diffuse.glb" shown.glb
open shown.glb --env $sky
shoot before.png
cp "$golden/matrix_phong.glb" shown.glb
xdotool mousemove --window $id 100 100 key F5
becomes "a file that was replaced, by F5" "$golden/matrix_phong.glb" --env $sky "${plain[@]}"
: >shown.glb
xdotool key F5 sleep 0.5
shoot after.png
cmp -s after.png before.png || failed "a file of no bytes has changed the picture"
close
pass

# Space: what moves goes on, and stops.
echo '{"times": [0, 4], "places": [[0, 0.8, 0], [1, 0.8, 0.5, 0, 0, 90]]}' >path.json
open "$golden/diffuse_lattice.glb" --place "a=$golden/diffuse_field.glb@0,0.8,0,0,0,0,0.5" --move a=path.json --env $sky
for _ in $(seq 20); do shoot before.png; sleep 0.3; shoot after.png; cmp -s before.png after.png && break; done
cmp -s before.png after.png || failed "what stands moves"
xdotool key space
moved=0
for _ in $(seq 20); do
  shoot now.png
  cmp -s now.png before.png || { moved=1; break; }
done
[ $moved = 1 ] || failed "Space: nothing moves"
xdotool key space
for _ in $(seq 30); do shoot before.png; sleep 0.5; shoot after.png; cmp -s before.png after.png && break; done
cmp -s before.png after.png || failed "Space: it does not stop"
close
pass

# A double click takes hold of the material that is there: its number in the panel is then that one's. The wall is red.
models=(--material red=phong:exponent=20,diffuse=0.3,specular=0.6
  --material grey=phong:exponent=300,diffuse=0.5,specular=0.2)
open "$golden/blocks.glb" --env $sky "${models[@]}"
shoot before.png
for _ in 1 2 3; do  # on a machine that is busy a click may come too late for a double one
  xdotool mousemove --window $id 120 200 sleep 0.3 click 1 sleep 0.1 click 1 sleep 0.5
done
shoot before.png
type_into 443 4
becomes "a material that was double clicked" "$golden/blocks.glb" --env $sky "${plain[@]}" \
  --material red=phong:exponent=4,diffuse=0.3,specular=0.6 --material "${models[3]}"
close
pass

# A context that is lost: the driver says so, and another window takes the place of the one.
if cc -shared -fPIC -O1 -o lost.so "$here/lost_context.c" -ldl 2>cc.log; then
  LD_PRELOAD=$PWD/lost.so LOST_WHEN=$PWD/lost open "$file" --env $sky
  for _ in $(seq 30); do shoot before.png; cmp -s before.png first.png && break; sleep 0.3; done
  old=$id
  : >lost
  for _ in $(seq 300); do
    id=$(xdotool search --onlyvisible --all --pid $window --name '^lambent: ' 2>/dev/null | grep -vx "$old" |
      head -1) || id=""
    [ -z "$id" ] || break
    alive "a lost context"
    sleep 0.2
  done
  [ -n "$id" ] || failed "a lost context: there is no other window"
  for _ in $(seq 30); do shoot after.png; cmp -s after.png first.png && break; sleep 0.3; done
  cmp -s after.png first.png || failed "after a lost context something else is shown"
  close
  pass
else
  echo "window: a lost context is left out: $(tail -1 cc.log)"
fi
echo "window hands: $passed passed"
