#!/usr/bin/env bash
# Fails if a folder of src/lambent includes one that the architecture does not let it (docs/architecture.md), or if a
# library is included outside the one place for it, or if lambent_relight reaches beyond what engines need.
set -euo pipefail
cd "$1/src/lambent"
declare -A allowed=(
  [core]="" [basis]="" [image]="" [brdf]="basis" [light]="basis image" [scene]="brdf light image" [receivers]="scene"
  [trace]="scene" [transfer]="basis" [baked]="transfer scene receivers basis"
  [bake]="trace receivers scene brdf light basis transfer" [compress]="transfer basis brdf"
  [relight]="transfer basis brdf light" [render]="relight transfer trace receivers scene light image"
  [reference]="scene brdf light image" [c]="baked transfer basis light relight"
  [pipeline]="basis image brdf light scene receivers trace transfer baked bake compress relight render reference"
)
bad=0
for folder in */; do
  folder=${folder%/}
  [ -n "${allowed[$folder]+x}" ] || { echo "folder $folder is not in the table of arrows"; bad=1; continue; }
  for file in "$folder"/*; do
    [[ $file == *_test.cpp || $file == *_test-inl.h ]] && continue  # tests may look further
    while read -r target; do
      [[ " core $folder ${allowed[$folder]} " == *" $target "* ]] || { echo "$file may not include $target/"; bad=1; }
    done < <(sed -n 's/^#include <lambent\/\([a-z]*\)\/.*/\1/p' "$file")
  done
done
# What lambent_relight is made of (cmake/relight.cmake), with every header that it includes on the way, lies in these
# folders, and includes no other library than these.
relight_folders=" baked basis brdf c core image light relight transfer "
relight_libraries="^(hwy|Eigen|nlohmann|tbb|fcntl.h|unistd.h|sys/)"
declare -A seen=()
mapfile -t todo < <(sed -n 's/^  src\/lambent\/\(.*\.cpp\)$/\1/p' ../../cmake/relight.cmake)
[ ${#todo[@]} -gt 0 ] || { echo "cmake/relight.cmake lists no sources"; bad=1; }
while [ ${#todo[@]} -gt 0 ]; do
  file=${todo[-1]}
  unset 'todo[-1]'
  [ -z "${seen[$file]+x}" ] || continue
  seen[$file]=1
  [[ $relight_folders == *" ${file%%/*} "* && $file != baked/baked_file.h && $file != baked/viewer_look.h ]] ||
    { echo "lambent_relight may not include $file"; bad=1; }
  while read -r target; do
    if [[ $target == lambent/* ]]; then todo+=("${target#lambent/}")
    elif [[ $target == */* || $target == *.h ]] && [[ $target != lambent.h && ! $target =~ $relight_libraries ]]; then
      echo "lambent_relight: $file may not include $target"
      bad=1
    fi
  done < <(sed -n 's/^#include [<"]\([^>"]*\)[>"].*/\1/p' "$file")
done

only() {  # only PATTERN PLACES...
  local pattern=$1
  shift
  while read -r file; do
    [[ " $* " == *" ${file%%/*} "* ]] || { echo "$file may not include $pattern"; bad=1; }
  done < <(grep -rlE "#include [<\"]$pattern" . --include='*.h' --include='*.cpp' | sed 's/^\.\///')
}
only embree core trace reference
only tbb/ core
only stb_image image scene
only OpenEXR image
only Imf image
only Eigen basis trace
only draco scene
only meshoptimizer scene
only webp scene
exit $bad
