#!/usr/bin/env bash
# Nothing is lost, as a user meets it: checkpoints, batches, sets of files, and limits that end in one line.
set -uo pipefail
source "$(dirname "$0")/expect.sh"

# Results that cannot be printed are a failure.
for said in "inspect corner.obj" "inspect corner.obj --json" options --help --version; do
  # shellcheck disable=SC2086
  "$tool" $said >/dev/full 2>stderr
  [ $? -eq 1 ] && [ "$(grep -c 'No space left on device' stderr)" -eq 1 ] && [ "$(wc -l <stderr)" -eq 1 ] && ok ||
    bad "lambent $said into a full device: $(cat stderr)"
done
"$tool" inspect corner.obj >&- 2>stderr
[ $? -eq 1 ] && ok || bad "results to a stream that is closed are no failure"
# A file that is opened does not get the number of a stream that was closed.
"$tool" bake corner.obj --samples 16 -o closed.glb >&- 2>&-
"$tool" inspect closed.glb >/dev/null 2>stderr && ok || bad "written into with its streams closed: $(cat stderr)"
(
  ulimit -f 8
  expect 1 'cannot be written: File too large' bake corner.obj --max-edge 0.05 --samples 16 -o limited.glb
  [ $failures -eq 0 ]
) && ok || bad "a limit on files does not end in one line"
absent limited.glb
expect 2 'memory: must not be below 0' bake corner.obj --memory -1 -o x.glb
expect 2 'memory' bake corner.obj --memory=-1GB -o x.glb
expect 0 'receivers' bake corner.obj --samples 16 --memory 1GB -o x.glb
if [ "$(id -u)" -eq 0 ] && command -v python3 >/dev/null; then
  chmod 755 .
  python3 - "$tool" 2>stderr <<'P'
import os, resource, sys
os.setgid(65534)
os.setuid(65534)
resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
os.execv(sys.argv[1], [sys.argv[1], "bake", "corner.obj", "--max-edge", "0.05", "--threads", "8", "-o", "/tmp/x.glb"])
P
  got=$?
  # Where the machine has one core no thread is needed.
  [ $got -eq 0 ] || { [ $got -eq 1 ] && [ "$(wc -l <stderr)" -eq 1 ]; } && ok ||
    bad "threads that cannot be made: exit $got: $(cat stderr)"
fi
# Names that are no UTF-8, wherever one is told or kept.
odd=$'na\xffme'
cp corner.obj "$odd.obj"
for kind in "--samples 16" "--membrane 0.5" "--samples 16 --transfer lightmap --atlas 16x16 --sky uniform:1" \
  "--samples 16 --dry-run" "--samples 16 --fix-light uniform:1"; do
  # shellcheck disable=SC2086
  expect 0 'receivers' bake "$odd.obj" $kind -o "$odd.glb"
done
expect 0 'receivers' bake "$odd.obj" --samples 16 -o "$odd.glb" --json
expect 0 'receivers' bake --again "$odd.glb" "$odd.obj" -o again.glb
cmp -s "$odd.glb" again.glb && ok || bad "a scene whose name is no UTF-8 is not baked again alike"
# More than a file can hold is known before the first ray.
cat >coloured.obj <<'O'
mtllib coloured.mtl
usemtl red
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
f 4 3 2 1
O
printf 'newmtl red\nKd 0.8 0.1 0.1\n' >coloured.mtl
expect 2 'at least .* for .* receivers, and a .glb holds 4 GiB' bake coloured.obj --max-edge 0.004 --order 16 \
  --terms --precision single --memory 100GB -o x4.glb
absent x4.glb

# An output takes the place of no input, whatever its ending; modes and links stay.
light=(--transfer lightmap --atlas 32x16 --samples 16)  # pictures that can be skies
printf 'newmtl red\nKd 0.8 0.1 0.1\nKe 1 1 1\n' >coloured.mtl
expect 0 'lamps' bake coloured.obj "${light[@]}" -o lmo.glb
cp lmo.exr environment.exr
for sky in lmo.exr ./lmo.exr "$PWD/lmo.exr"; do
  expect 1 'lmo.exr: cannot be written: this command reads it' bake coloured.obj "${light[@]}" --sky $sky -o lmo.glb
done
cmp -s lmo.exr environment.exr && ok || bad "a lightmap has taken the place of its sky"
expect 1 'lmo.glb: cannot be written: this command reads it' bake lmo.glb --samples 16 -o lmo.glb
expect 1 'lmo.glb: cannot be written: this command reads it' bake --again lmo.glb -o lmo.glb
expect 0 'receivers' bake corner.obj --samples 16 -o corner.glb
expect 1 'lmo.exr: cannot be written: this command reads it' render corner.glb --env lmo.exr --size 8x8 -o lmo.exr
expect 1 'environment.exr: cannot be written' compare environment.exr lmo.exr -o environment.exr
cmp -s lmo.exr environment.exr && ok || bad "a picture has taken the place of its environment"
ln -s /dev/null null.png
expect 1 'null.png: cannot be written: it is not a plain file' render lmo.glb --size 8x8 -o null.png
[ -c /dev/null ] && ok || bad "a picture has taken the place of /dev/null"

# Killed at any moment a lightmap's files are of one bake: here by two that take turns.
"$tool" bake coloured.obj "${light[@]}" --emit red=1,1,1 -o set.glb >/dev/null 2>&1
one=$(cat set.exr set.glb | sha256sum)
"$tool" bake coloured.obj "${light[@]}" --emit red=2,2,2 -o set.glb >/dev/null 2>&1
two=$(cat set.exr set.glb | sha256sum)
for i in $(seq 40); do
  "$tool" bake coloured.obj "${light[@]}" --emit red=$((i % 2 + 1)),$((i % 2 + 1)),$((i % 2 + 1)) -o set.glb \
    >/dev/null 2>&1 &
  sleep 0.0$((RANDOM % 60 + 10))
  kill -9 $! 2>/dev/null
  wait $! 2>/dev/null
  for wait in $(seq 100); do  # the one that renames may still be at it
    now=$(cat set.exr set.glb | sha256sum)
    [ "$now" = "$one" ] || [ "$now" = "$two" ] && break
    sleep 0.05
  done
  [ "$now" = "$one" ] || [ "$now" = "$two" ] || bad "after a kill set.exr and set.glb are not of one bake"
done
"$tool" bake coloured.obj "${light[@]}" -o set.glb >/dev/null 2>&1
[ -z "$(ls set.*.lambent-part* 2>/dev/null)" ] && ok || bad "temporaries of killed runs stay: $(ls set.*.lambent-part*)"

# Checkpoints: interrupted, gone on with; refused by name; listed and cleaned.
rays=1024
work=(bake corner.obj --max-edge 0.03 --samples "$rays")
"$tool" "${work[@]}" --checkpoint off -o whole.glb >/dev/null 2>stderr || bad "$(cat stderr)"
"$tool" "${work[@]}" --checkpoint kept -o part.glb >/dev/null 2>stderr &
for i in $(seq 600); do [ -s kept/tracing.pieces ] || sleep 0.05; done
kill -INT $!
wait $!
[ $? -eq 1 ] && tail -1 stderr | grep -qx 'lambent: cancelled; the same command goes on from kept' && ok ||
  bad "an interrupted bake: $(cat stderr)"
expect 0 'kept [0-9.]+ s ago' checkpoints
expect 0 'can go on' checkpoints
expect 0 'corner.obj' checkpoints kept --json
expect 1 "kept: is of another request: samples was $rays, and is 32" bake corner.obj --max-edge 0.03 --samples 32 \
  --checkpoint kept -o part.glb
cp corner.obj was.obj
sed -i 's/v 2 2 0/v 2 2 0.5/' corner.obj
expect 1 'kept: is of another input: "corner.obj" has changed' "${work[@]}" --checkpoint kept -o part.glb
expect 0 'stale: .*corner.obj has changed' checkpoints
cp was.obj corner.obj
printf 'letter' >kept/letter.txt
expect 1 'kept: is no folder of a checkpoint: letter.txt is in it' "${work[@]}" --checkpoint kept -o part.glb
rm kept/letter.txt
for file in kept/*.pieces; do  # a bit in the middle of each
  middle=$(($(stat -c %s "$file") / 2))
  byte=$(od -An -tu1 -j$middle -N1 "$file" | tr -d ' ')
  printf "\\x$(printf %02x $((byte ^ 4)))" | dd of="$file" bs=1 seek=$middle conv=notrunc status=none
done
expect 0 'kept: tracing: 1 piece is damaged' "${work[@]}" --checkpoint kept -o part.glb
cmp -s whole.glb part.glb && ok || bad "what was gone on with has other bytes"
grep -q 'resumed' stdout && ok || bad "nothing was gone on with"
absent kept
# By itself, where it is long; and with nothing left where it is short.
"$tool" bake corner.obj --max-edge 0.01 --samples 16384 -o long.glb >/dev/null 2>stderr &
for i in $(seq 600); do [ -s long.glb.checkpoint/tracing.pieces ] || sleep 0.1; done
kill -INT $!
wait $!
grep -q 'goes on from long.glb.checkpoint$' stderr && [ -e long.glb.checkpoint/checkpoint.json ] && ok ||
  bad "long work is not kept by itself: $(tail -1 stderr)"
expect 0 'removed' checkpoints long.glb.checkpoint --clean
absent long.glb.checkpoint
expect 0 'receivers' bake corner.obj --samples 16 -o short.glb
absent short.glb.checkpoint
printf 'mine' >archive.glb.part1  # nobody else's is touched
printf 'half' >other.glb.lambent-part12345
expect 0 'left by a killed program' checkpoints
expect 0 'removed' checkpoints --clean
absent other.glb.lambent-part12345
[ -e archive.glb.part1 ] && ok || bad "a file of the user's was removed"
expect 1 'cannot be written' "${work[@]}" --checkpoint nowhere/kept -o part.glb
expect 2 'checkpoint: does not go with membranes' bake corner.obj --membrane 0.5 --checkpoint kept -o x.glb
mkdir small
if mount -t tmpfs -o size=400k tmpfs small 2>/dev/null; then
  expect 0 'small/kept: no more is kept: No space left on device' "${work[@]}" --checkpoint small/kept -o part.glb
  cmp -s whole.glb part.glb && ok || bad "a checkpoint on a full disk changes the result"
  mkdir -p small/kept
  mount -o remount,ro small
  expect 1 'small/.*cannot be written: Read-only file system' "${work[@]}" --checkpoint small/kept2 -o part.glb
  expect 1 'small/kept.*cannot be written: Read-only file system' "${work[@]}" --checkpoint small/kept -o part.glb
  umount small
fi

# Batches.
cat >manifest.jsonl <<'J'
{"scene": "corner.obj", "output": "job1.glb", "samples": 64}

{"scene": "corner.obj", "output": "job2.glb", "samples": 64, "max_edge": 0.5}
{"scene": "missing.obj", "output": "job3.glb"}
J
"$tool" batch manifest.jsonl --jobs 2 >stdout 2>stderr
[ $? -eq 1 ] && ok || bad "a batch whose job fails does not exit with 1"
[ "$(grep -cE '^\[[123]/3\] job[123].glb  ' stderr)" -eq 3 ] &&
  grep -q 'failed: missing.obj: no such file' stderr && ok ||
  bad "not one line a job: $(cat stderr)"
tail -1 stdout | grep -qx '2 baked, 1 failed' && ok || bad "no summary of a batch: $(cat stdout)"
grep -q 'corner.obj' job1.glb.d && ok || bad "no rule of make beside a job's output"
expect 0 'receivers' bake corner.obj --samples 64 -o alone.glb
cmp -s alone.glb job1.glb && ok || bad "a job bakes another file than bake"
sed -i '$d' manifest.jsonl
expect 0 '2 skipped' batch manifest.jsonl
sed -i 's/"samples": 64}/"samples": 65}/' manifest.jsonl
expect 0 '1 baked, 1 skipped' batch manifest.jsonl
echo '# another' >>corner.obj
expect 0 '2 baked' batch manifest.jsonl
expect 1 'again.jsonl:2: writes ./x.glb, as line 1 does' batch again.jsonl < <(
  printf '{"scene": "corner.obj", "output": "%s"}\n' x.glb ./x.glb >again.jsonl)
printf '{"sample": 3}\n' >wrong.jsonl
expect 1 'wrong.jsonl:1: sample: is no field' batch wrong.jsonl
# Killed, with what it had begun: the next goes on.
cat >long.jsonl <<J
{"scene": "corner.obj", "output": "long1.glb", "samples": $rays, "max_edge": 0.03}
{"scene": "corner.obj", "output": "long2.glb", "samples": 16}
J
"$tool" batch long.jsonl --resume >/dev/null 2>&1 &
sleep 0.7
kill -9 $!
wait $! 2>/dev/null
sleep 0.5
expect 0 '2 baked' batch long.jsonl --resume
"$tool" bake corner.obj --samples "$rays" --max-edge 0.03 -o alone.glb >/dev/null 2>&1
cmp -s alone.glb long1.glb && ok || bad "a job that was killed and gone on with has other bytes"
[ -z "$(ls -d ./*.checkpoint 2>/dev/null)" ] && ok || bad "a batch leaves checkpoints"

finish
