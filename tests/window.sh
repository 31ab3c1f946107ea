#!/usr/bin/env bash
# `lambent view --window` without a screen: Xvfb, OpenGL in software, hands by xdotool. What it shows, once it has
# settled, is the picture that `lambent render` writes, byte for byte, of every kind of file (tests/golden).
#   tests/window.sh LAMBENT
set -euo pipefail
source "$(dirname "$(readlink -f "$0")")/xvfb.sh"

# Without a display: one line.
env -u DISPLAY -u WAYLAND_DISPLAY "$tool" view --window "$golden/diffuse.glb" 2>error && failed "a window on no display"
grep -q "there is no display" error && [ "$(wc -l <error)" = 1 ] || failed "no display: $(cat error)"
pass

begin_screen

sky=sky:elevation=40,azimuth=20,turbidity=4 camera=3,2,4,1,0.5,1,40
for file in "$golden"/*.glb; do
  name=$(basename "$file" .glb)
  light=(--env $sky) view=(--camera $camera --spp 2) size=(--size 96x72)
  case $name in
    indirect) light=(--lamp sphere@1,1.2,1,0.1=30,20,10 --albedo red=0.2,0.3,0.8) ;;
    *_fixed_view) view=() size=() ;;
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

# Lamps of direct to indirect light: one at the middle of the picture is carried by a hand with Ctrl, put back by a
# script, joined by another and taken out.
printf '%s\n' 'panel off' 'size 320x240' 'settle' 'save before.exr' 'wait 6' 'settle' 'save after.exr' \
  'lamp 1 point@1,0.5,1=5' 'settle' 'save back.exr' 'lamp 2 sun@40,60=1' 'set albedo red=0.1,0.9,0.2' 'settle' \
  'save two.exr' 'lamp 2' 'set albedo red=' 'settle' 'save again.exr' >script
rm -f before.exr
show "$golden/indirect.glb" --lamp point@1,0.5,1=5 --camera $camera --spp 1 --script script 2>log &
window=$!
for _ in $(seq 200); do [ -s before.exr ] && break; sleep 0.1; done
id=$(xdotool search --sync --onlyvisible --name '^lambent: ' | head -1) || failed "no window was found"
xdotool mousemove --window $id 160 120 keydown ctrl mousedown 1 sleep 0.2 mousemove --window $id 130 120 sleep 0.3 \
  mouseup 1 keyup ctrl
wait $window || failed "lamps: $(cat log)"
"$tool" render "$golden/indirect.glb" --lamp point@1,0.5,1=5 --lamp sun@40,60=1 --albedo red=0.1,0.9,0.2 \
  --camera $camera --spp 1 --size 320x240 -o lamps.exr >log 2>&1 || failed "lamps: $(cat log)"
cmp -s before.exr after.exr && failed "a hand with Ctrl did not carry the lamp"
cmp -s before.exr back.exr || failed "a lamp that is put back is another"
cmp -s two.exr lamps.exr || failed "two lamps and paint: the window's picture is not render's"
cmp -s before.exr again.exr || failed "a lamp that was taken out is still there"
pass

# A transfer texture over a scene that no bake is of, and its grooves.
printf 'v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 4/1 3/2 2/3\nf 4/1 2/3 1/4\n' >card.obj
"$tool" env sky:width=16 --order 2 -o relief.png >log 2>&1 || failed "$(cat log)"
"$tool" patch relief.png --size 8 --samples 64 --lobes 3 -o relief.lpt >log 2>&1 || failed "$(cat log)"
texture=(--transfer-texture relief.lpt --tile 3,3 --env $sky --camera $camera --spp 2)
printf '%s\n' 'panel off' 'size 96x72' 'frames 2' 'settle' 'save texture.exr' 'set tile 2,1' 'settle' >script
show card.obj "${texture[@]}" --script script 2>log || failed "a transfer texture: $(cat log)"
"$tool" render card.obj "${texture[@]}" --size 96x72 -o render.exr >log 2>&1 || failed "$(cat log)"
cmp -s texture.exr render.exr || failed "a transfer texture: the window's picture is not render's"
pass

# A file that is cut short while it is shown; another window in the place of one; no OpenGL 3.3.
cp "$golden/diffuse.glb" shown.glb
printf '%s\n' 'panel off' 'size 96x72' 'settle' 'save before.exr' 'wait 3' 'turn-light 90' 'turn-light -90' 'reopen' \
  'settle' 'save after.exr' 'reload' >script
rm -f before.exr
show shown.glb --env $sky --camera $camera --spp 1 --script script 2>log &
window=$!
for _ in $(seq 200); do [ -s before.exr ] && break; sleep 0.1; done
: >shown.glb
wait $window && failed "a file of no bytes was read again"
[ -s after.exr ] || failed "a window whose file was cut short: $(cat log)"
cmp -s before.exr after.exr || failed "a window whose file was cut short shows something else"
grep -q "line 11" log && [ "$(wc -l <log)" = 1 ] || failed "a file of no bytes: $(cat log)"
pass
MESA_GL_VERSION_OVERRIDE=2.1 show "$golden/diffuse.glb" --env $sky --script script 2>log &&
  failed "OpenGL 2.1 went through"
grep -q "OpenGL 3.3 is not to be had" log && [ "$(wc -l <log)" = 1 ] || failed "no OpenGL 3.3: $(cat log)"
pass

# Looks of several kinds.
printf '%s\n' 'size 200x150' 'look lobes' 'settle' 'screenshot lobes.png' 'look balls' 'settle' 'screenshot balls.png' \
  'look hits' 'settle' 'look buried' 'settle' 'look rows' 'settle' 'look picture' 'settle' >script
show "$golden/zonal.glb" --env $sky --camera $camera --spp 1 --script script 2>log || failed "looks: $(cat log)"
for picture in lobes.png balls.png; do [ -s $picture ] || failed "$picture is missing"; done
printf '%s\n' 'set material red=ward:ax=0.1,ay=0.4' 'settle' 'set material grey=textured:phong:exponent=30' 'settle' \
  'set material red=' 'settle' 'compare reference' 'settle' 'wait 1' 'screenshot materials.png' >script
show "$golden/blocks.glb" --env $sky --camera $camera --spp 1 --script script 2>log || failed "materials: $(cat log)"
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
# Films through ffmpeg, where it is; without it a line.
if command -v ffmpeg >/dev/null && command -v ffprobe >/dev/null; then
  printf '%s\n' 'panel off' 'size 97x72' 'film light 12 out.mp4' 'film camera 5 out.webm' >script
  show "$golden/diffuse.glb" --env $sky --camera $camera --spp 1 --script script 2>log || failed "a film: $(cat log)"
  probed=$(ffprobe -v error -count_frames -select_streams v \
    -show_entries stream=codec_type,width,height,nb_read_frames -of csv=p=0 out.mp4)
  [ "$probed" = video,96,72,12 ] || failed "a film has \"$probed\""
  [ -s out.webm ] || failed "out.webm is missing"
  printf '%s\n' 'film light 3 no_folder/out.mp4' >script
  show "$golden/diffuse.glb" --env $sky --script script 2>log && failed "a film into no folder went through"
  grep -q "line 1.*ffmpeg" log || failed "a film into no folder: $(cat log)"
  pass
else
  echo "window: films are left out: ffmpeg is not installed"
fi
mkdir programs
for program in sh rm; do ln -s "$(command -v $program)" programs/; done
printf '%s\n' 'film light 3 out.avi' >script
PATH=$PWD/programs show "$golden/diffuse.glb" --env $sky --script script 2>log && failed "a film without ffmpeg"
grep -q "line 1.*ffmpeg, which is not installed" log && [ "$(wc -l <log)" = 1 ] || failed "no ffmpeg: $(cat log)"
[ ! -e out.avi ] || failed "a film without ffmpeg left a file"
pass

# Where buffers cannot be mapped for good the picture is copied, and the same.
printf '%s\n' 'panel off' 'size 200x150' 'frames 2' 'settle' 'screenshot SHOT' >script
for way in mapped copied; do
  sed "s/SHOT/$way.png/" script >script.$way
  extension=
  [ $way = mapped ] || extension=-GL_ARB_buffer_storage
  MESA_EXTENSION_OVERRIDE=$extension show "$golden/diffuse.glb" --env $sky --camera $camera --spp 1 \
    --script script.$way 2>log || failed "$way: $(cat log)"
done
for tone in none neutral agx; do  # what is on the screen is what is saved
  printf '%s\n' 'panel off' 'size 200x150' 'frames 2' 'settle' "screenshot screen.png" 'save saved.png' >script
  show "$golden/diffuse.glb" --env $sky --camera $camera --spp 4 --tone $tone --exposure 1 --script script 2>log ||
    failed "$tone: $(cat log)"
  cmp -s screen.png saved.png || failed "the screen shows other bytes than are saved, with --tone $tone"
done
cmp -s mapped.png copied.png || failed "a picture that is copied to the screen is another than one that is mapped"
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
look lobes|no zonal lobes
lamp 0 point@0,0,0=1|counts from 1
lamp 3 point@0,0,0=1|there are lamps 1 to 0
set material red=lambert|does not go with
ACTIONS
show "$golden/diffuse.glb" --port 80 2>error && failed "--port went through"
grep -q -e "--port" error || failed "$(cat error)"
"$tool" view "$golden/diffuse.glb" --script script 2>error && failed "--script without --window went through"
grep -q -e "--script" error || failed "$(cat error)"
pass
echo "window: $passed passed"
