#!/usr/bin/env bash
# Fails if a folder of src/lambent includes one that the architecture does not let it (docs/architecture.md), or if a library is
# included outside the one place for it.
set -euo pipefail
cd "$1/src/lambent"
declare -A allowed=(
  [core]="" [basis]="" [image]="" [brdf]="basis" [light]="basis image" [scene]="brdf light image" [receivers]="scene"
  [trace]="scene" [transfer]="basis" [baked]="transfer scene receivers basis" [bake]="trace receivers scene brdf light basis transfer"
  [compress]="transfer basis brdf" [relight]="transfer basis brdf light" [render]="relight transfer trace receivers scene light image" [reference]="scene brdf light image"
  [pipeline]="basis image brdf light scene receivers trace transfer bake compress baked relight render reference"
)
bad=0
for folder in */; do
  folder=${folder%/}
  [ -n "${allowed[$folder]+x}" ] || { echo "folder $folder is not in the table of arrows"; bad=1; continue; }
  for file in "$folder"/*; do
    [[ $file == *_test.cpp ]] && continue
    while read -r target; do
      [[ " core $folder ${allowed[$folder]} " == *" $target "* ]] || { echo "$file may not include $target/"; bad=1; }
    done < <(sed -n 's/^#include <lambent\/\([a-z]*\)\/.*/\1/p' "$file")
  done
done
only() {  # only PATTERN PLACES...
  local pattern=$1
  shift
  while read -r file; do
    [[ " $* " == *" ${file%%/*} "* ]] || { echo "$file may not include $pattern"; bad=1; }
  done < <(grep -rlE "#include [<\"]$pattern" . --include='*.h' --include='*.cpp' | sed 's/^\.\///')
}
only embree trace reference
only tbb/ core
only stb_image image scene
only OpenEXR image
only Imf image
only Eigen basis
exit $bad
