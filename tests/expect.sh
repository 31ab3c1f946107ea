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

# Where LAMBENT_COARSE says so, for tools that are slow, as under sanitizers, commands are what they are with fewer
# rays, smaller skies and coarser wavelets; how far pictures agree is for the tool that is quick.
coarse() {
  local previous="" word
  words=()
  for word in "$@"; do
    case $previous in
      --samples | --paths) [[ $word =~ ^[0-9]+$ ]] && [ "$word" -gt 64 ] && word=64 ;;
      --spp) [[ $word =~ ^[0-9]+$ ]] && [ "$word" -gt 8 ] && word=8 ;;
    esac
    case $word in
      haar:32*) word=haar:16${word#haar:32} ;;
      *width=* | sky) ;;
      sky:*) word+=,width=128 ;;
    esac
    words+=("$word")
    previous=$word
  done
}

# expect CODE PATTERN COMMAND...: exit code, and one line on stderr that matches.
expect() {
  local code=$1 pattern=$2 words
  shift 2
  words=("$@")
  [ -z "${LAMBENT_COARSE:-}" ] || coarse "$@"
  "$tool" "${words[@]}" >stdout 2>stderr
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

# alike DECIBELS WHAT COMPARED...: two pictures agree to that PSNR. That of identical ones is null, and their RMSE 0.
alike() {
  local least=$1 what=$2 psnr
  [ -z "${LAMBENT_COARSE:-}" ] || least=$((least / 2))
  shift 2
  expect 0 '"psnr"' compare "$@" --json
  psnr=$(sed -nE 's/.*"psnr": (null|-?[0-9]+)[.,].*/\1/p' stdout)
  if [ "$psnr" = null ]; then
    grep -qE '"rmse": 0\.0$' stdout && ok || bad "$what: no PSNR, though they differ"
  else
    [ -n "$psnr" ] && [ "$psnr" -ge "$least" ] && ok || bad "$what differ: PSNR ${psnr:-unreadable}, not $least"
  fi
}
smaller() {  # smaller NEW OLD
  [ "$(stat -c %s "$1")" -le "$(stat -c %s "$2")" ] && ok ||
    bad "$1 has $(stat -c %s "$1") bytes, $2 only $(stat -c %s "$2")"
}

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
