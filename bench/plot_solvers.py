#!/usr/bin/env python3
"""Draws the convergence of the radiosity solvers, from the JSON lines of `scripts/bench solvers`, as SVG.
    scripts/bench solvers >solvers.jsonl && bench/plot_solvers.py solvers.jsonl docs/solvers.svg"""
import json
import math
import sys

if len(sys.argv) != 3:
    sys.exit(__doc__)
curves = {}
for line in open(sys.argv[1]):
    record = json.loads(line)
    if record["name"].startswith("radiosity_solver_"):
        curves[record["name"][len("radiosity_solver_"):]] = record["steps"]
if not curves:
    sys.exit(f"{sys.argv[1]}: no radiosity_solver_ lines")

width, height, left, right, top, bottom = 640, 400, 70, 20, 20, 50
x_end = max(s[0] for steps in curves.values() for s in steps)
y_low = -6
colors = dict(zip(curves, ["#c0392b", "#d68910", "#1e8449", "#1f618d"]))


def x(applications):
    return left + applications / x_end * (width - left - right)


def y(residual):
    return top + max(0, min(1, math.log10(max(residual, 1e-30)) / y_low)) * (height - top - bottom)


out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
       'font-family="sans-serif" font-size="13">',
       f'<rect width="{width}" height="{height}" fill="white"/>']
for decade in range(0, y_low - 1, -1):
    at = y(10.0 ** decade)
    out.append(f'<line x1="{left}" y1="{at:.1f}" x2="{width - right}" y2="{at:.1f}" stroke="#ddd"/>')
    out.append(f'<text x="{left - 8}" y="{at + 4:.1f}" text-anchor="end">1e{decade}</text>')
for tick in range(0, int(x_end) + 1, 5):
    out.append(f'<text x="{x(tick):.1f}" y="{height - bottom + 18}" text-anchor="middle">{tick}</text>')
out.append(f'<text x="{(left + width - right) / 2}" y="{height - 10}" text-anchor="middle">'
           'applications of the gather operator</text>')
middle = (top + height - bottom) / 2
out.append(f'<text x="16" y="{middle}" text-anchor="middle" transform="rotate(-90 16 {middle})">'
           'relative residual</text>')
for i, (name, steps) in enumerate(curves.items()):
    points = " ".join(f"{x(a):.1f},{y(r):.1f}" for a, r in steps)
    out.append(f'<polyline points="{points}" fill="none" stroke="{colors[name]}" stroke-width="2"/>')
    out.append(f'<text x="{width - right - 110}" y="{top + 18 + 18 * i}" fill="{colors[name]}">{name}</text>')
out.append("</svg>")
open(sys.argv[2], "w").write("\n".join(out) + "\n")
