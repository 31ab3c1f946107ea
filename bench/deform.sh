#!/usr/bin/env bash
# Truth for lobes that turn (local-deformable-prt, Fig. 6c-e): a bent and a twisted mesh, path-traced as deformed,
# against transfer that stayed as it was baked and against lobes. One JSON line a case, diffuse and glossy; pictures
# (undeformed transfer, lobes, truth) in build/deform.
source "$(dirname "$0")/common.sh"
[ -d "$data/meshes" ] || { echo "skipped: no $data/meshes" >&2; exit 0; }
out=build/deform
mkdir -p $out
light="--env sky:elevation=35,azimuth=60,turbidity=3"
# case NAME MESH DEFORM BANDS REFERENCE-OPTIONS...: of $out/NAME.glb and $out/NAME.lobes.glb.
case_of() {
  local case=$1 mesh=$2 deform=$3 bands=$4 name=$out/$1-${3%%:*} kind
  shift 4
  local view="--deform $deform $light --light-order $bands --size 320x320 --background none"
  $tool render $out/$case.glb $view -o $name-still.exr >&2
  $tool render $out/$case.lobes.glb $view -o $name-lobes.exr >&2
  $tool reference "$data/meshes/$mesh.obj" $view "$@" --spp ${SPP:-128} -o $name-truth.exr >&2
  for kind in still lobes; do $tool compare $name-$kind.exr $name-truth.exr --exposure -2 --json >$name-$kind.json; done
  $tool compare $name-lobes.exr $name-truth.exr --exposure -2 -o $name.png >&2
  echo "{\"name\": \"zonal_deform\", \"case\": \"$case\", \"deform\": \"$deform\"," \
    "\"ours\": $(number rmse $name-lobes.json), \"limit\": $(number rmse $name-still.json)," \
    "\"unit\": \"RMSE against the path-traced deformed mesh\", \"limit_is\": \"transfer as baked, not turned\"," \
    "\"psnr_lobes\": $(number psnr $name-lobes.json)," \
    "\"psnr_still\": $(number psnr $name-still.json), \"aim\": \"ratio well below 1\"}"
}
for mesh in armadillo scorpion; do
  [ -f $out/$mesh.glb ] || $tool bake "$data/meshes/$mesh.obj" --order 6 --samples 512 --bounces 2 -o $out/$mesh.glb >&2
  [ -f $out/$mesh.lobes.glb ] || $tool compress $out/$mesh.glb --zonal 4 -o $out/$mesh.lobes.glb >&2
  for deform in bend:90 twist:120; do case_of $mesh $mesh $deform 6 --bounces 2; done
done
# Glossy: six rows, three lobes each.
brdf=cook-torrance:roughness=0.3
[ -f $out/glossy.glb ] || $tool bake "$data/meshes/armadillo.obj" --transfer matrix --outgoing svd:6 --brdf $brdf \
  --order 4 --samples 512 --bounces 1 -o $out/glossy.glb >&2
[ -f $out/glossy.lobes.glb ] || $tool compress $out/glossy.glb --zonal 3 -o $out/glossy.lobes.glb >&2
for deform in bend:90 twist:120; do case_of glossy armadillo $deform 4 --bounces 1 --brdf $brdf; done
