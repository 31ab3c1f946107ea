#!/usr/bin/env python3
"""Draws `scripts/bench indirect-convergence`, the error against surfels and the residual against bounces, as SVG.
    scripts/bench indirect-convergence >c.jsonl && bench/plot_convergence.py c.jsonl docs/images/convergence.svg"""
import json
import math
import sys

if len(sys.argv) != 3:
    sys.exit(__doc__)
lines = [json.loads(line) for line in open(sys.argv[1])]
errors = [line for line in lines if line["name"] == "indirect error"]
steps = [line for line in lines if line["name"] == "indirect residual"]
if not errors or not steps:
    sys.exit(f"{sys.argv[1]}: no lines of errors, or of residuals")
colors = dict(zip(dict.fromkeys(line["scene"] for line in errors), ("#1f618d", "#c0392b", "#1e8449")))
wide, high, left, top, gap = 330, 260, 60, 20, 80
out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * (wide + gap) + 10} {high + 110}" '
       'font-family="sans-serif" font-size="12">', '<rect width="100%" height="100%" fill="white"/>']


def text(x, y, words, anchor="middle"):
    out.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{words}</text>')


def panel(x0, y_range, y_ticks, label, x_of, x_ticks):
    y_of = lambda v: top + high * math.log(y_range[1] / max(v, y_range[0])) / math.log(y_range[1] / y_range[0])
    for value, words in y_ticks:
        if y_range[0] <= value <= y_range[1]:
            y = y_of(value)
            out.append(f'<line x1="{x0}" y1="{y:.1f}" x2="{x0 + wide}" y2="{y:.1f}" stroke="#ddd"/>')
            text(x0 - 6, y + 4, words, "end")
    for value, words in x_ticks:
        out.append(f'<line x1="{x_of(value):.1f}" y1="{top}" x2="{x_of(value):.1f}" y2="{top + high}" stroke="#eee"/>')
        text(x_of(value), top + high + 16, words)
    out.append(f'<rect x="{x0}" y="{top}" width="{wide}" height="{high}" fill="none" stroke="#888"/>')
    text(x0 + wide / 2, top + high + 34, label)
    return y_of


def draw(points, color, dashed):
    dash = ' stroke-dasharray="5 4"' if dashed else ""
    where = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    out.append(f'<polyline points="{where}" fill="none" stroke="{color}" stroke-width="2"{dash}/>')
    out.extend(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{color}"/>' for x, y in points)


counts = [line["surfels"] for line in errors]
low, high_count = min(counts) / 1.2, max(counts) * 1.2
x_of = lambda n: left + wide * math.log(n / low) / math.log(high_count / low)
found = [line["error"] for line in errors]
y_of = panel(left, (min(found) / 1.2, max(found) * 1.2), [(v / 100, f"{v:g} %") for v in (0.5, 1, 2, 5, 10, 20)],
             "surfels", x_of, [(1000 * 4**k, f"{4**k} k") for k in range(4) if low < 1000 * 4**k < high_count])
for scene, color in colors.items():
    for gatherers in ("quarter", "all"):
        draw([(x_of(line["surfels"]), y_of(line["error"])) for line in errors
              if (line["scene"], line["gatherers"]) == (scene, gatherers)], color, gatherers == "quarter")
start = left + wide + gap
most = max(line["bounces"] for line in steps)
x_of = lambda n: start + wide * n / most
y_of = panel(start, (1e-5, 1), [(10.0**-k, f"1e-{k}" if k else "1") for k in range(6)], "bounces", x_of,
             [(n, f"{n}") for n in range(0, most + 1, 4)])
for scene, color in colors.items():
    own = [line for line in steps if line["scene"] == scene]
    draw([(x_of(line["bounces"]), y_of(line["residual"])) for line in own if line["summed"]], color, False)
    for line in own:
        if not line["summed"]:
            x, y = x_of(line["bounces"]), y_of(line["residual"])
            out.append(f'<rect x="{x - 5:.1f}" y="{y - 5:.1f}" width="10" height="10" fill="none" stroke="{color}" '
                       'stroke-width="2"/>')
for i, (scene, color) in enumerate(colors.items()):
    text(left + 90 * i + 14, top + high + 62, scene, "start")
    out.append(f'<circle cx="{left + 90 * i + 4}" cy="{top + high + 58}" r="4" fill="{color}"/>')
text(left, top + high + 82, "error of a picture; all surfels gather, dashed: a quarter", "start")
text(start, top + high + 62, "what the equation does not hold by, bounces summed;", "start")
text(start, top + high + 82, "squares: the iteration that is used, where it ends", "start")
out.append("</svg>")
open(sys.argv[2], "w").write("\n".join(out) + "\n")
