#!/usr/bin/env bash
# Zonal lobes on the command line, textures of them, grooves, membranes and media.
set -uo pipefail
source "$(dirname "$0")/expect.sh"
expect 0 'receivers' bake corner.obj --max-edge 0.2 --samples 256 -o corner.glb
expect 0 'relit' render corner.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 256 -o a.exr \
  --background none
expect 0 'relit' render corner.glb --env sky:elevation=40 --size 40x40 -o sky.png

# Zonal lobes: closer with more of them, turning with what moves; a texture of them; a membrane.
expect 0 '"rms"' compress corner.glb --zonal 4 -o lobes.glb --view-error error.png --size 40x40 --json
expect 0 'zonal lobes' inspect lobes.glb
expect 0 'relit' render lobes.glb --env uniform:1,0.5,0.25 --camera 3,2,4,1,0.5,1,40 --size 48x32 --spp 64 \
  -o lobes.exr --background none
alike 40 "lobes and harmonics" lobes.exr a.exr
expect 0 'relit' render lobes.glb --env sky:elevation=40 --deform twist:50,y --size 40x40 -o twisted.png
expect 0 'cannot turn' render corner.glb --env sky:elevation=40 --deform bend:50,x,y --size 40x40 -o bent.png
expect 0 'lobes' bake corner.obj --max-edge 0.5 --samples 64 --transfer zonal --lobes 2 -o direct.glb
expect 0 'rows' bake corner.obj --max-edge 0.5 --samples 64 --order 5 --bounces 1 \
  --brdf cook-torrance:roughness=0.3 --transfer matrix --outgoing svd:3 --view-map 32 -o rows.glb
expect 0 '"rows": 3' compress rows.glb --zonal 3 -o glossy.glb --json
expect 0 'each of 3 rows' inspect glossy.glb
expect 0 'relit' render rows.glb --env sky:elevation=40 --camera 3,0.8,4,1,0.4,0.7,40 --size 48x32 -o rows.exr \
  --background none
expect 0 'relit' render glossy.glb --env sky:elevation=40 --camera 3,0.8,4,1,0.4,0.7,40 --size 48x32 -o glossy.exr \
  --background none
alike 35 "glossy lobes and the matrix that they stand for" glossy.exr rows.exr
expect 0 'relit' render glossy.glb --env sky:elevation=40 --deform twist:50,y --size 24x24 -o glossy.png
expect 0 'lobes' bake corner.obj --max-edge 0.5 --samples 64 --order 4 --bounces 0 --transfer zonal --lobes 2 \
  --outgoing svd:2 -o direct_glossy.glb
expect 2 'view-map: does not go with zonal transfer' bake corner.obj --transfer zonal --view-map 32 -o x.glb
expect 0 'paths' reference corner.obj --env uniform:1 --deform twist:50 --size 16x16 --spp 1 -o twisted.exr
expect 0 'membrane' bake corner.obj --membrane 0.4 -o membrane.glb
expect 0 'RMS' patch sky.png --size 8 --samples 64 --lobes 3 -o relief.lpt
expect 0 'texels' render corner.obj --transfer-texture relief.lpt --tile 2,2 --env sky:elevation=40 --size 24x24 \
  -o relief.png
expect 0 'events' bake corner.obj --subsurface marble:2 --samples 16 -o through.glb
expect 0 'lost' bake corner.obj --subsurface sigma_s=0,sigma_a=0 --samples 16 -o through.glb
expect 0 'lobes' bake corner.obj --subsurface sigma_s=3,2,1,sigma_a=0.1,g=0.5,eta=1.3 --transfer zonal --lobes 3 \
  --samples 16 -o through.glb
expect 0 'RMS' patch sky.png --size 8 --samples 64 --lobes 3 --subsurface skin:5 -o skin.lpt
expect 0 'texels' render corner.obj --transfer-texture skin.lpt --env sky:elevation=40 --size 24x24 -o skin.png
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0.3\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n' >pyramid.obj
expect 0 'RMS' patch pyramid.obj --size 8 --samples 64 --lobes 3 -o pyramid.lpt
expect 0 'RMS' patch pyramid.obj --size 8 --samples 16 --subsurface sigma_s=9,8,7,sigma_a=1 -o wax.lpt
printf 'v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n' >oblong.obj
expect 0 'RMS' patch sky.png --size 6 --order 2 --samples 16 --lobes 1 --views 2x2 -o views.lpt
expect 0 'RMS' patch pyramid.obj --size 6 --order 2 --samples 16 --lobes 1 --views 2x2 -o views_mesh.lpt
expect 0 'RMS' patch sky.png --size 6 --order 2 --samples 16 --lobes 1 --views 2x2 --brdf ggx:roughness=0.7 -o wet.lpt
expect 0 'RMS' patch sky.png --size 6 --order 2 --samples 16 --lobes 1 --floor marble:20 -o floor.lpt
expect 2 'views' patch sky.png --views 3x4 -o x.lpt
expect 2 'views' patch sky.png --views 99x99 -o x.lpt
expect 2 'brdf' patch pyramid.obj --brdf phong:exponent=5 -o x.lpt
expect 2 'brdf' patch sky.png --brdf phong:exponent=5 --floor marble -o x.lpt
expect 2 'bottom' patch sky.png --subsurface marble --floor marble -o x.lpt
expect 2 'views' patch --groove 1 --views 4x4 -o x.lpt
expect 1 'as wide as' patch oblong.obj -o x.lpt
expect 2 'depth' patch pyramid.obj --depth 0.2 -o x.lpt
expect 2 'subsurface' bake corner.obj --subsurface jelly -o x.glb
expect 2 'sigma_a' bake corner.obj --subsurface sigma_s=1 -o x.glb
expect 2 'subsurface' bake corner.obj --subsurface marble --transfer matrix -o x.glb
expect 2 'subsurface' bake corner.obj --subsurface marble --shadows off -o x.glb
expect 2 'subsurface' patch sky.png --subsurface marble --albedo 0.2 -o x.lpt
expect 2 'subsurface' patch sky.png --subsurface sigma_s=nan,sigma_a=1 -o x.lpt
absent x.lpt
expect 1 'corner.glb: has no animations' render corner.glb --env uniform:1 --animation walk -o x.png
expect 1 'corner.obj: has no animations' reference corner.obj --env uniform:1 --animation 0 -o x.png
expect 1 'harmonics at vertices' compress lobes.glb --zonal 2 -o x.glb
expect 1 'corner.obj' render corner.obj --transfer-texture corner.obj --env uniform:1 -o x.png
head -c 200 relief.lpt >cut.lpt
expect 1 'cut.lpt' render corner.obj --transfer-texture cut.lpt --env uniform:1 -o x.png
expect 1 'missing.png: no such file' bake corner.obj --membrane missing.png -o x.glb
expect 2 '\-\-zonal: ' compress corner.glb --zonal 0 -o x.glb
expect 2 '\-\-zonal: ' compress corner.glb --zonal 100 -o x.glb
expect 2 'lobes' bake corner.obj --lobes 4 -o x.glb
expect 2 'deform' render corner.glb --env uniform:1 --deform melt:3 -o x.png
expect 2 'animation' render corner.glb --env uniform:1 --time 1 -o x.png
expect 2 'frames' render corner.glb --env uniform:1 --animation 0 --frames 3:1 -o x.png
expect 2 'membrane' bake corner.obj --membrane 1.5 -o x.glb
expect 2 'tile' render corner.obj --transfer-texture relief.lpt --tile 1 --env uniform:1 -o x.png
# Heights of 16 bits, all within four steps of 8 bits, and the same as floats; then with one that is not a number.
base64 -d <<'B' >heights.png
iVBORw0KGgoAAAANSUhEUgAAAAQAAAAEEAAAAADcCh3hAAAALUlEQVR42mMoUy7vK48t3cpQtqriZvmsclGG8g3lTaXF5XMYSm0rLlV0lgsAABW2D0qypi
RMAAAAAElFTkSuQmCC
B
base64 -d <<'B' | gzip -d >heights.exr
H4sIAAAAAAACA4VNMU4DMRBcX1JQotQU1DRAhESqRYAEJVKEFNFhzo5iZOzT2QqBii/wB15AyQ/4CMVdctblBTgXSzlI4ZVWO7M7Mzs9PCYJAKQTqhSXxg
MpjIVTv7uA1WVVJPT11ma4tYFUP2U5N0Zo9Qc3R0YtHQnF9DM86FlfwC5sqhOaCZNJ+hLVSaH4Tc543kLNl0zMuDw3GU/tkFqhYSw1tdBt3G9nJs05V+v4
S66st037Y9hpvWhLRoLZyb8IuCNr4XuY32GSZBNy5Ht+NUe359B9VVg+lhjjJPgWtwtcftboThxWBxXGeBJ87t5ndR2WPwW6gccR3gm+4rXA5UeNda/Gar
/CGP8FtnHOPTkCAAA=
B
base64 -d <<'B' | gzip -d >nan.exr
H4sIAAAAAAACA4VNMU4DMRBcX1JQImoKahogDVSLAAlKpAgposO5cxQjY5/OVgg08AX+wAsoqWj5CMVdYuvyApyLpRyk8EqrndmdmZ0cHJEEANIxlZIJ7Y
Hg2sCx353D8rIsEvpqY9Pf2ECqHvKCac2V/IObY0YNHXCZqUcYqmmPwzasqxM64zoX9CmqE1yy6yJjRQs1X3I+ZeJM5yw1fWq4gpFQ1EC3cb+e6rRgTK7i
L5g03jbpjWCr9aItGfDMjP9FwC1ZCd/C/A6TJOuQQ9+zyxm6XYfu02J1X2GMk+Cb38xx8VEjwNeL3bcY40nwuTuf1XVY/ZToTjyO8E7wlc8lLt5rrHdqtH
sWY/wXCih0PjkCAAA=
B
for heights in png exr; do
  expect 0 'RMS' patch heights.$heights --depth 5 --size 8 --samples 256 --lobes 3 -o heights_$heights.lpt
  expect 0 'texels' render corner.obj --transfer-texture heights_$heights.lpt --env sky:elevation=40 --size 24x24 \
    -o heights_$heights.exr
done
alike 50 "heights of 16 bits and floats" heights_png.exr heights_exr.exr
expect 1 'not a finite number' patch nan.exr -o x.lpt
head -c 60 heights.png >cut.png
expect 1 'cut.png' patch cut.png -o x.lpt
printf 'P6\n1 1\n255\nabc' >one.ppm
expect 1 'one.ppm' patch one.ppm -o x.lpt
# Grooves as a table, near lamps, relief as geometry.
expect 0 'grooves' patch --groove 1 --size 6 -o groove.lpt
printf 'v 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n' >card.obj
expect 0 'grooves up to' inspect groove.lpt
expect 0 'transfer texture' inspect relief.lpt --json
expect 1 'cut.lpt' inspect cut.lpt
expect 0 'grooves' render card.obj --transfer-texture groove.lpt --tile 5,0 --groove-depth 0.5 --groove-width 0.6 \
  --groove-map sky.png --env sky:elevation=40 --size 24x24 -o grooves.png
expect 0 'texels' render card.obj --transfer-texture relief.lpt --sphere-lamp 0.5,1,-0.5,0.2,5,4,3 --size 24x24 \
  -o near.png
expect 0 'relit' render lobes.glb --sphere-lamp 3,3,3,0.5,9,9,9 --env uniform:0.1 --size 24x24 -o near.png
expect 0 'paths' reference card.obj --displace sky.png --depth 0.2 --tile 2,2 --heights 16 --env uniform:1 \
  --size 16x16 --spp 1 -o displaced.exr
expect 1 'no texture coordinates' reference corner.obj --displace sky.png --env uniform:1 --size 16x16 -o x.exr
expect 1 'no grooves' render card.obj --transfer-texture relief.lpt --groove-depth 0.5 --env uniform:1 -o x.png
expect 2 'sphere-lamp: does not go with diffuse' render corner.glb --sphere-lamp 3,3,3,0.5,9,9,9 --env uniform:1 \
  -o x.png
expect 2 'radius' render lobes.glb --sphere-lamp 3,3,3,0,9,9,9 -o x.png
expect 2 'sphere-lamp' render lobes.glb --sphere-lamp 3,3,3,nan,9,9,9 -o x.png
expect 2 'not both' patch sky.png --groove 1 -o x.lpt
expect 2 'not both' patch -o x.lpt
expect 2 'grooves' patch --groove 1 --depth 0.1 -o x.lpt
expect 2 'lobes' patch --groove 1 --lobes 2 -o x.lpt
absent x.lpt
expect 2 'depth' patch --groove nan -o x.lpt
expect 2 'precision' patch --groove 1 --precision half -o x.lpt
expect 2 'below 1' patch --groove 1 --albedo 1 -o x.lpt
expect 2 'shadows' bake corner.obj --transfer zonal --outgoing svd:2 --shadows off -o x.glb
expect 0 'what was baked is left out' render corner.glb --transfer-texture relief.lpt --env uniform:1 --size 8x8 \
  -o card.png
# Over a bake that kept incident light, by what arrives.
expect 0 'rows' bake corner.obj --max-edge 0.5 --samples 64 --order 4 --incident-order 4 --bounces 1 --transfer matrix \
  -o arriving.glb
expect 0 '"arriving_order": 4' render arriving.glb --transfer-texture relief.lpt --env sky:elevation=40 --size 8x8 \
  -o card.png --json
expect 0 'since it is of the scene at rest' render arriving.glb --transfer-texture relief.lpt --env uniform:1 \
  --deform twist:20,y --size 8x8 -o card.png
expect 2 'lamp: does not go with transfer textures' render card.obj --transfer-texture relief.lpt --env uniform:1 \
  --lamp x=1,1,1 -o x.png
expect 0 'paths' reference card.obj --ground --displace sky.png --heights 8 --env uniform:1 --size 8x8 --spp 1 \
  -o displaced.exr
finish
