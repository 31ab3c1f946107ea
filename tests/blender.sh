#!/usr/bin/env bash
# The Blender add-on, headless, against Cycles' own bake: tests/blender.sh LAMBENT [FOLDER]. Pictures stay in FOLDER,
# where one is given. Minutes; left out where Blender (Debian's `blender`) is missing.
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)
LAMBENT=$(realpath "${1:-$here/build/release/bin/lambent}")
export LAMBENT
if ! command -v blender >/dev/null; then
  echo "skipped: the Blender add-on, since blender is not installed"
  exit 0
fi
folder=${2:-$(mktemp -d)}
[ -n "${2:-}" ] || trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder"
for test in "$here"/tests/blender/test_*.py; do
  name=$(basename "$test" .py)
  if ! PYTHONDONTWRITEBYTECODE=1 blender -b --factory-startup --python-exit-code 1 -P "$test" -- \
    "$here/integrations/blender" "$folder" >"$folder/$name.log" 2>&1; then
    tail -n 30 "$folder/$name.log" >&2
    echo "$name failed" >&2
    exit 1
  fi
  grep -E '^(ok|measured): ' "$folder/$name.log"
done
