#!/usr/bin/env bash
# Bases of diffuse transfer at equal bytes: boxes (patches), hats (vertices), tents (texels) and kernels about surfels
# (meshless), by light at points and by least squares. The error is the certificate's: of the field all over the
# surfaces, by rays and places of their own. Bytes are of the coefficients that are solved for; a meshless bake is read
# by a mesh of FINE edges, whose vertices the file has in its place. Neither is denoised. One JSON object a line;
# bench/plot_bases.py draws them.
#   SCENES="room cornell" SAMPLES=512 scripts/bench bases
source "$(dirname "$0")/common.sh"
out=out/bases
mkdir -p $out
meshes=$data/meshes
# of SCENE BASIS SIZE OPTIONS...: a line a projection.
of() {
  local scene=$1 file=$2 basis=$3
  shift 3
  for projection in collocation least-squares; do
    [ "$basis-$projection" = meshless-least-squares ] && continue
    local denoise=(--denoise off)
    [ $projection = collocation ] || denoise=()
    $tool --json bake "$file" --order 4 --bounces 2 --samples "${SAMPLES:-512}" --max-albedo 0.8 --receivers "$basis" \
      --projection $projection "${denoise[@]}" "$@" -o $out/baked.glb >$out/baked.json 2>$out/said.txt ||
      { cat $out/said.txt >&2; exit 1; }
    python3 - $out/baked.json "$scene" "$basis" $projection <<'P'
import json, sys
b = json.load(open(sys.argv[1]))
each = b["order"] ** 2 * b["channels"] * 2
print(json.dumps(dict(name="basis", scene=sys.argv[2], basis=sys.argv[3], projection=sys.argv[4],
                      receivers=b["traced"], bytes=b["traced"] * each, error=round(b["certificate"]["error"], 4),
                      seconds=round(sum(b["seconds"].values()) - b["seconds"].get("certify", 0), 2))), flush=True)
P
  done
}
for scene in ${SCENES:-room cornell}; do
  case $scene in
    room) file=$meshes/room.glb edges="1.6 0.8 0.4" patches="2.4 1.2 0.6" fine=0.2 texels="2 4 8" ;;
    cornell)
      file=$meshes/cornell_box.obj edges="200 100 50 25" patches="300 150 75 37" fine=14 texels="0.01 0.02 0.04 0.08"
      ;;
    level) file=$meshes/zdm2_level.glb edges="32 16" patches="48 24" fine=12 texels="0.05 0.1" ;;
    *) echo "bases: no scene $scene" >&2; exit 2 ;;
  esac
  for edge in $edges; do of $scene "$file" vertices --max-edge $edge; done
  for edge in $patches; do of $scene "$file" patches --max-edge $edge; done
  for density in $texels; do of $scene "$file" texels --texels-per-unit $density; done
  for surfels in ${SURFELS:-256 1024 4096 8192}; do of $scene "$file" meshless --surfels $surfels --max-edge $fine; done
done
