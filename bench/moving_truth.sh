#!/usr/bin/env bash
# Objects over a yard and over one another, drawn from their fields and path-traced as one scene: two, five and ten in a
# ring, apart, touching one another and the floor, and within one another; direct light, and with one bounce; light of
# four bands. One JSON object each: dB of the displayed picture, beside those without the objects' fields and those of
# the yard alone against its own truth, and milliseconds a frame.
#   COUNTS="2 5 10" BOUNCES="0 1" SPP=256 SIZE=160x120 EDGE=0.1 scripts/bench moving-truth
# Pictures go to out/moving-truth/.
source "$(dirname "$0")/common.sh"
out=out/moving-truth spp=${SPP:-256} size=${SIZE:-160x120} edge=${EDGE:-0.1}
mkdir -p $out
# yard.obj, ball.obj and box.obj; of each ring the joint scene, and what --place says.
python3 - $out ${COUNTS:-2 5 10} <<'P'
import math, sys
out, counts = sys.argv[1], [int(n) for n in sys.argv[2:]]
def box(x0, y0, z0, x1, y1, z1):
    return [[(x0, y1, z0), (x0, y1, z1), (x1, y1, z1), (x1, y1, z0)],
            [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
            [(x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)],
            [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)],
            [(x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)],
            [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)]]
def ball(radius, rows=16, columns=32):
    def at(i, j):
        t, p = math.pi * i / rows, 2 * math.pi * (j % columns) / columns
        return tuple(radius * v for v in (math.sin(t) * math.cos(p), math.cos(t), -math.sin(t) * math.sin(p)))
    faces = []
    for i in range(rows):
        for j in range(columns):
            face = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
            faces.append(face[:3] if i == 0 else [face[0], face[1], face[3]] if i == rows - 1 else face)
    return faces
def moved(faces, place, yaw):
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    return [[(c * x + s * z + place[0], y + place[1], c * z - s * x + place[2]) for x, y, z in face] for face in faces]
def write(name, parts):
    with open(f"{out}/{name}.obj", "w") as f:
        f.write("mtllib all.mtl\n")
        for k, (material, faces) in enumerate(parts):
            f.write(f"o {material}{k}\nusemtl {material}\n")
            for face in faces:
                f.writelines("v %.7g %.7g %.7g\n" % p for p in face)
                f.write("f " + " ".join(str(i - len(face)) for i in range(len(face))) + "\n")
open(f"{out}/all.mtl", "w").write("newmtl yard\nKd 0.7 0.65 0.6\nnewmtl ball\nKd 0.6 0.3 0.2\n"
                                  "newmtl box\nKd 0.3 0.5 0.6\n")
yard = [[(-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3)], [(-3, 0, -3), (3, 0, -3), (3, 2, -3), (-3, 2, -3)]]
yard += box(-2.2, 0.001, -2.2, -1.8, 1.8, -1.8) + box(1.8, 0.001, -2.2, 2.2, 1.4, -1.8)
things = {"ball": ball(0.4), "box": box(-0.3, -0.3, -0.3, 0.3, 0.3, 0.3)}
write("yard", [("yard", yard)])
for name, faces in things.items(): write(name, [(name, faces)])
for n in counts:
    for how, distance, height in (("apart", 1.4, 0.6), ("touching", 0.8, 0.4), ("within", 0.5, 0.4)):
        ring, parts, places = distance / 2 / math.sin(math.pi / n), [("yard", yard)], []
        for i in range(n):
            name, angle = ("ball", "box")[i % 2], 2 * math.pi * i / n + 0.3
            yaw = 25 * i if name == "box" else 0
            y = height if name == "ball" or how == "apart" else 0.3
            place = (ring * math.cos(angle), y, ring * math.sin(angle))
            parts.append((name, moved(things[name], place, yaw)))
            places.append("--place o%d=%s/%s.field.glb@%.6g,%.6g,%.6g,%g,0,0" % ((i, out, name) + place + (yaw,)))
        write(f"{n}_{how}", parts)
        open(f"{out}/{n}_{how}.places", "w").write(" ".join(places))
P
light=(--env sky:elevation=30,azimuth=40 --light-order 4 --window none)
shot=(--camera 3.5,4,4.6,0,0.2,0,40 --size "$size" --background none)
for bounces in ${BOUNCES:-0 1}; do
  # Light in free space has met surfaces once more than they have met each other: direct light alone is that of a scene
  # that is all but black.
  [ "$bounces" = 0 ] && terms=() dark=(--max-albedo 0.02) || terms=(--terms) dark=()
  # Objects reflect where light bounces at all.
  [ "$bounces" = 0 ] && reflect=() || reflect=(${REFLECT---transfer})
  for name in ball box; do
    $tool bake $out/$name.obj --max-edge 0.1 --order 8 --samples 512 --bounces 0 "${dark[@]}" -o $out/$name.glb \
      >/dev/null
    $tool field $out/$name.glb --order 8 "${reflect[@]}" -o $out/$name.field.glb >/dev/null
  done
  yard=$out/yard_$bounces.glb
  $tool bake $out/yard.obj --max-edge "$edge" --order 8 --samples 1024 --bounces "$bounces" "${terms[@]}" "${dark[@]}" \
    --lattice 16,6,16 --lattice-box=-3,0.1,-3,3,2,3 -o "$yard" >/dev/null
  $tool render "$yard" "${light[@]}" "${shot[@]}" -o $out/alone.exr >/dev/null
  truth=("${light[@]}" "${dark[@]}" --bounces "$bounces" --spp "$spp" "${shot[@]}")
  $tool reference $out/yard.obj "${truth[@]}" -o $out/truth.exr >/dev/null
  $tool compare $out/alone.exr $out/truth.exr --json >$out/mean.json
  exposure=$(exposure_of $out/mean.json)
  $tool compare $out/alone.exr $out/truth.exr --exposure="$exposure" --json >$out/alone.json
  for n in ${COUNTS:-2 5 10}; do
    for how in apart touching within; do
      to=$out/${n}_${how}_$bounces
      # shellcheck disable=SC2046  # a list of options
      $tool render "$yard" "${light[@]}" "${shot[@]}" $(cat $out/"${n}"_$how.places) -o "$to.exr" --json >"$to.json"
      $tool reference $out/"${n}"_$how.obj "${truth[@]}" -o "${to}_truth.exr" >/dev/null
      $tool compare "$to.exr" "${to}_truth.exr" --exposure="$exposure" -o "${to}_error.png" --json >"${to}_error.json"
      $tool compare $out/alone.exr "${to}_truth.exr" --exposure="$exposure" --json >"${to}_without.json"
      python3 - "$n" $how "$bounces" $out/alone "$to" <<'P'
import json, sys
n, how, bounces, alone, to = sys.argv[1:6]
drawn, error, without = (json.load(open(to + end)) for end in (".json", "_error.json", "_without.json"))
alone = json.load(open(alone + ".json"))["psnr"]
aim = 35 if bounces == "0" else 33
print(json.dumps({"name": f"moving truth, {n} objects {how}, {bounces} bounces", "ours": error["psnr"], "limit": aim,
                  "ratio": error["psnr"] / aim, "unit": "dB", "limit_is": "the aim", "yard_alone": alone,
                  "without_objects": without["psnr"], "receivers": drawn["receivers"], "pairs": drawn["pairs"],
                  "frame_ms": 1e3 * drawn["relight_seconds"]}))
P
    done
  done
done
