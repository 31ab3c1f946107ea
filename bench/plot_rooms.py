#!/usr/bin/env python3
"""Draws how joined rooms come near the scene baked whole, from the JSON line of `scripts/bench rooms`, as SVG.
    scripts/bench rooms >rooms.jsonl && bench/plot_rooms.py rooms.jsonl docs/rooms.svg"""
import json
import math
import sys

if len(sys.argv) != 3:
    sys.exit(__doc__)
records = [r for r in map(json.loads, open(sys.argv[1])) if r["name"] == "rooms_joined"]
if not records:
    sys.exit(f"{sys.argv[1]}: no rooms_joined line")
record = records[-1]
width, height, left, right, top, bottom = 640, 360, 70, 20, 20, 50
sweeps = len(record["residuals"])
y_low = -4


def x(sweep):
    return left + (sweep - 1) / max(1, sweeps - 1) * (width - left - right)


def y(value):
    return top + max(0, min(1, math.log10(max(value, 1e-30)) / y_low)) * (height - top - bottom)


out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
       'font-family="sans-serif" font-size="13">',
       f'<rect width="{width}" height="{height}" fill="white"/>']
for decade in range(0, y_low - 1, -1):
    at = y(10.0 ** decade)
    out.append(f'<line x1="{left}" y1="{at:.1f}" x2="{width - right}" y2="{at:.1f}" stroke="#ddd"/>')
    out.append(f'<text x="{left - 8}" y="{at + 4:.1f}" text-anchor="end">1e{decade}</text>')
for sweep in range(1, sweeps + 1):
    out.append(f'<text x="{x(sweep):.1f}" y="{height - bottom + 18}" text-anchor="middle">{sweep}</text>')
out.append(f'<text x="{(left + width - right) / 2}" y="{height - 10}" text-anchor="middle">'
           'sweeps over all rooms</text>')
curves = [("residual over all rooms", "#1f618d", record["residuals"], ""),
          ("difference from the scene baked whole", "#c0392b", record["differences"], ""),
          ("two seeds of the whole", "#888", [record["limit"]] * sweeps, ' stroke-dasharray="5 4"')]
for i, (name, color, values, dash) in enumerate(curves):
    points = " ".join(f"{x(k + 1):.1f},{y(v):.1f}" for k, v in enumerate(values))
    out.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2"{dash}/>')
    out.append(f'<text x="{width - right - 265}" y="{top + 18 + 18 * i}" fill="{color}">{name}</text>')
out.append("</svg>")
open(sys.argv[2], "w").write("\n".join(out) + "\n")
