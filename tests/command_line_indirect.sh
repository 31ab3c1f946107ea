#!/usr/bin/env bash
# Lamps that move on the command line.
set -uo pipefail
source "$(dirname "$0")/expect.sh"
expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 64 -o corner.glb

# Lamps that move, over direct-to-indirect transport.
seen="--camera 3,2,4,1,0.5,1,40 --size 24x18 --spp 2"
expect 0 'surfels' bake corner.obj --transfer indirect --surfels 512 --samples 64 -o indirect.glb
expect 0 '"kind": "indirect"' inspect indirect.glb --json
expect 0 'direct to indirect light' inspect indirect.glb
expect 0 'shadow rays' render indirect.glb $seen --lamp point@0.4,0.6,0.5=3 --lamp sun@20,50=1,0.9,0.7 \
  --lamp sphere@0.7,0.5,0.6,0.05=9 --lamp spot@0.5,0.9,0.5,0.5,0,0.5,40=2 -o indirect.png
expect 0 '"frames": 3' render indirect.glb $seen --lamp point@0.4,0.6,0.5=3 \
  --move '1@0:0.2,0.5,0.5;1:0.8,0.5,0.5' --frames 0:1:0.5 --json -o moved.png
expect 0 'lights no surface' render indirect.glb $seen --lamp point@0.4,0.6,0.5=0 -o dark.png
expect 2 'lamp: or --env is needed' render indirect.glb $seen -o x.png
expect 0 'shadow rays' render indirect.glb $seen --env uniform:1 --env-rotate 20,0,0 -o sky.png
expect 2 'has no lamp "lamp"; it has none; or it is sphere@' render indirect.glb $seen --lamp lamp=1 -o x.png
expect 2 "radius must be above 0" render indirect.glb $seen --lamp sphere@0,1,0,0=1 -o x.png
expect 2 'within 1e9' render indirect.glb $seen --lamp point@nan,0,0=1 -o x.png
expect 0 'shadow rays' render indirect.glb $seen --lamp point@0.4,0.6,0.5=3 --move '1@0:0.2,0.5,0.5;1:0.8,0.5,0.5' \
  --time 1 -o there.exr
expect 0 'shadow rays' render indirect.glb $seen --lamp point@0.8,0.5,0.5=3 -o same.exr
alike 100 "a lamp that has moved there, and one that stands there" there.exr same.exr
expect 2 'time: needs --animation, --move or --pose' render indirect.glb $seen --lamp point@0,1,0=1 --time 1 -o x.png
expect 2 'frames: needs --move' render indirect.glb $seen --lamp point@0,1,0=1 --frames 0:1 -o x.png
expect 2 'albedo: the file has no material' render indirect.glb $seen --lamp point@0,1,0=1 --albedo none=1 \
  -o x.png
expect 2 'show: direct and indirect are of' render corner.glb --env uniform:1 --show indirect -o x.png
# Texels with directions and light in free space, by the same surfels.
expect 0 '8 points, order 3' bake corner.obj --transfer indirect --surfels 256 --samples 32 --receivers texels \
  --atlas 32x32 --directional sh:3 --lattice 2,2,2 --lattice-order 3 -o texels.glb
expect 0 '"directional": "sh:3"' inspect texels.glb --json
expect 0 'shadow rays' render texels.glb $seen --lamp point@0.4,0.6,0.5=3 --at receivers --show indirect -o texels.exr
expect 0 'shadow rays' render texels.glb $seen --lamp point@0.4,0.6,0.5=3 --show indirect -o pixels.exr
alike 30 "light that texels have, and that pixels read" texels.exr pixels.exr
expect 0 'shadow rays' render texels.glb $seen --lamp point@0.4,0.6,0.5=3 --insert corner.obj@0.5,0.1,0.5,0.2 \
  -o object.png
expect 0 '"lamps_evaluated": 1' render texels.glb $seen --lamp point@0.4,0.6,0.5=3 --lamp point@0.6,0.6,0.5=2 \
  --move '2@0:0.6,0.6,0.5;1:0.7,0.6,0.5' --frames 0:1 --frame-bounces 1 --json -o one_moved.png
expect 1 'has no light in free space' render indirect.glb $seen --lamp point@0.4,0.6,0.5=3 \
  --insert corner.obj@0.5,0.1,0.5,0.2 -o x.png
expect 2 'directional: of direct to indirect light is sh:2' bake corner.obj --transfer indirect --directional hl2 \
  -o x.glb
expect 2 'frame-bounces: needs --frames' render indirect.glb $seen --lamp point@0,1,0=1 --frame-bounces 1 -o x.png
expect 0 '"leaves_lit": 20' render texels.glb $seen --lamp point@0.4,0.6,0.5=3 --move '1@0:0.4,0.6,0.5;1:0.6,0.6,0.5' \
  --frames 0:1 --frame-leaves 20 --json -o few_leaves.png
expect 2 'frame-leaves: needs --frames' render indirect.glb $seen --lamp point@0,1,0=1 --frame-leaves 9 -o x.png
expect 1 'directional, at texels, which the web page does not draw' export texels.glb --web site_indirect
expect 2 'surfels: needs --receivers meshless' bake corner.obj --surfels 512 -o x.glb
expect 0 'receivers' bake corner.obj --max-edge 0.2 --receivers meshless --surfels 256 --samples 64 -o meshless.glb
expect 2 'receivers: direct to indirect light is over surfels' bake corner.obj --transfer indirect \
  --receivers meshless -o x.glb
expect 0 'receivers' bake corner.obj --receivers patches --projection least-squares --samples 64 -o least.glb
expect 2 'denoise: takes receivers for points' bake corner.obj --projection least-squares --denoise on -o x.glb
expect 2 'projection: does not go with direct to indirect light' bake corner.obj --transfer indirect \
  --projection least-squares -o x.glb
expect 0 '"bytes"' bake corner.obj --transfer indirect --surfels 256 --samples 64 --dry-run --json
expect 2 'order: does not go with direct to indirect light' bake corner.obj --transfer indirect --order 3 -o x.glb
expect 0 'paths a pixel' reference corner.obj --lamp point@0.4,0.6,0.5=3 --no-direct --spp 4 --size 16x16 \
  -o moved_truth.exr
expect 2 'lamp: expects 3 numbers' reference corner.obj --lamp point@0.4,0.6=3 --spp 4 --size 16x16 -o x.exr
absent x.glb
absent x.png
finish
