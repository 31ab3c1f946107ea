# Sourced by scripts that use the tool as a user does: bash THIS LAMBENT. A folder of their own, what is expected of a
# command, and a scene.
tool=$1
source_dir=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
failures=0
passed=0
ok() { passed=$((passed + 1)); }
bad() { echo "FAILED: $*"; failures=$((failures + 1)); }

# expect CODE PATTERN COMMAND...: exit code, and one line on stderr that matches.
expect() {
  local code=$1 pattern=$2
  shift 2
  "$tool" "$@" >stdout 2>stderr
  local got=$?
  sed -i -E '/^[a-z0-9 ]+  [0-9.]+%(, .* left)?$/d' stderr  # progress, told every few seconds: machines may be slow
  [ $got -eq "$code" ] || { bad "exit $got, not $code: lambent $*: $(head -c 300 stderr)"; return; }
  if [ "$code" -ne 0 ]; then
    [ "$(wc -l <stderr)" -eq 1 ] || { bad "not one line: lambent $*: $(cat stderr)"; return; }
    [ -s stdout ] && { bad "results on stdout despite failure: lambent $*"; return; }
  fi
  grep -qE "$pattern" stderr stdout || { bad "no \"$pattern\": lambent $*: $(cat stderr)"; return; }
  ok
}
absent() { [ -e "$1" ] && bad "$1 was left behind" || ok; }

finish() {
  echo "$passed passed, $failures failed"
  [ $failures -eq 0 ]
}

# A corner of two quads and a floor, as OBJ.
cat >corner.obj <<'O'
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
f 4 3 2 1
f 1 2 6 5
O
