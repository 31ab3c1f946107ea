#!/usr/bin/env python3
"""Tables in markdown of what `scripts/bench products` printed: bench/products_tables.py FILE, or standard input."""
import json
import sys

rows, lights = {}, []
for line in open(sys.argv[1]) if len(sys.argv) > 1 else sys.stdin:
    try:
        j = json.loads(line)
    except ValueError:
        continue
    if not isinstance(j, dict) or not str(j.get("name", "")).startswith("products_"):
        continue
    if j["name"] == "products_light":
        lights.append(j)
    else:
        rows.setdefault(j["scene"], {})[j["name"][9:], j.get("material")] = j


def table(title, heads, lines):
    print(f"\n{title}\n\n| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for cells in lines:
        shown = (c if isinstance(c, str) else f"{c:,.3g}" if abs(c) < 1000 else f"{c:,.0f}" for c in cells)
        print("| " + " | ".join(shown) + " |")


def of(name):
    """All lines of one name, with their scene and material."""
    return [(scene, material, j) for scene, found in rows.items() for (n, material), j in found.items() if n == name]


def peer(scene, name, material):
    """What a line is compared with, over nanoseconds by blocks; a line that a cut run lacks leaves a dash."""
    j = rows[scene].get((name, material))
    return j["limit"] / j["ours"] if j else "-"


table("New environment", ["cube", "light", "project, ms", "three forms, ms", "aim, ms"],
      [(str(j["cube"]), j["light"], j["project_ms"], j["forms_ms"], j["limit"]) for j in lights])
for title, sampling in (("bounded", "bounded"), ("appendix A", "appendix_a")):
    table(f"Tables 1 and 2, {title}: % of blocks that are not blocked, by line of Algorithm 1 and by samples",
          ["scene", "material", "line 6", "line 9", "line 11", "1", "4", "16", "64", "256"],
          [(s, m, j[sampling]["line_6"], j[sampling]["line_9"], j[sampling]["line_11"],
            *j[sampling]["samples_1_4_16_64_256"])
           for s, m, j in of("table_1_2")])
bakes = {s: j for s, _, j in of("bake")}
table("Table 3: database and bake", ["scene", "vertices", "MB", "bytes a vertex", "changes a mixed block", "bake, s",
                                     "of raw Embree"],
      [(s, f"{j['receivers']:,}", j["MB"], j["ours"], j["changes_per_mixed_block"], bakes[s]["seconds"],
        bakes[s]["ratio"])
       for s, _, j in of("database") if s in bakes])
table("Speed: ns a shaded vertex and core", ["scene", "material", "blocks", "times SIMD", "times scalar", "appendix A"],
      [(s, m, j["ours"], peer(s, "blocks_vs_simd", m), peer(s, "blocks_vs_scalar", m), j["appendix_a_ns"])
       for s, m, j in of("blocks_vs_simd")])
table("Frames: all cores; ns a vertex from near and from afar tell whether time is linear in the vertices seen",
      ["scene", "material", "ms a frame", "ns near", "vertices near", "ns afar"],
      [(s, m, j["ours"], j["ns_a_vertex_near"], j["seen_near"], j["ns_a_vertex_all"]) for s, m, j in of("frame")])
table("Fig. 5: PSNR against the standard basis, dB (the paper: 45.67; its Haar at 1 %: 33.54)",
      ["scene", "material", "blocks", "appendix A", "Haar at 1 %"],
      [(s, m, j["ours"], j["appendix_a"], j["haar_1_percent"]) for s, m, j in of("accuracy")])
