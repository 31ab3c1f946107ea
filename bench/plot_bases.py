#!/usr/bin/env python3
"""Draws the bases of `scripts/bench bases`, error against bytes and against seconds, a row a scene, as SVG.
    scripts/bench bases >bases.jsonl && bench/plot_bases.py bases.jsonl docs/images/bases.svg"""
import json
import math
import sys

if len(sys.argv) != 3:
    sys.exit(__doc__)
lines = [json.loads(line) for line in open(sys.argv[1])]
lines = [line for line in lines if line["name"] == "basis"]
if not lines:
    sys.exit(f"{sys.argv[1]}: no lines of bases")
scenes = list(dict.fromkeys(line["scene"] for line in lines))
colors = dict(vertices="#1f618d", texels="#1e8449", patches="#c0392b", meshless="#7d3c98")
names = dict(vertices="hats (vertices)", texels="tents (texels)", patches="boxes (patches)", meshless="meshless")
wide, high, left, top, gap = 330, 250, 60, 30, 75
width, height = 2 * (wide + gap) + 20, len(scenes) * (high + gap) + 70
out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
       'font-size="12">', f'<rect width="{width}" height="{height}" fill="white"/>']


def text(x, y, words, anchor="middle", more=""):
    out.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{words}</text>')


def ticks(low, high):
    """1, 2 and 5 of each decade."""
    found = [m * 10.0**d for d in range(-6, 12) for m in (1, 2, 5) if low <= m * 10.0**d <= high]
    return found if len(found) <= 7 else [t for t in found if f"{t:e}"[0] == "1"]


def short(value, unit):
    for size, mark in ((1e6, "M"), (1e3, "k")):
        if unit == "bytes" and value >= size:
            return f"{value / size:g} {mark}"
    return f"{100 * value:g} %" if unit == "error" else f"{value:g}"


for row, scene in enumerate(scenes):
    own = [line for line in lines if line["scene"] == scene]
    errors = [line["error"] for line in own]
    e0, e1 = min(errors) / 1.15, max(errors) * 1.15
    for column, unit in enumerate(("bytes", "seconds")):
        x0, y0 = left + column * (wide + gap), top + row * (high + gap)
        values = [line[unit] for line in own]
        v0, v1 = min(values) / 1.2, max(values) * 1.2
        at = lambda v, e: (x0 + wide * math.log(v / v0) / math.log(v1 / v0),
                           y0 + high * math.log(e1 / e) / math.log(e1 / e0))
        for t in ticks(e0, e1):
            y = at(v0, t)[1]
            out.append(f'<line x1="{x0}" y1="{y:.1f}" x2="{x0 + wide}" y2="{y:.1f}" stroke="#ddd"/>')
            text(x0 - 6, y + 4, short(t, "error"), "end")
        for t in ticks(v0, v1):
            x = at(t, e1)[0]
            out.append(f'<line x1="{x:.1f}" y1="{y0}" x2="{x:.1f}" y2="{y0 + high}" stroke="#eee"/>')
            text(x, y0 + high + 16, short(t, unit))
        out.append(f'<rect x="{x0}" y="{y0}" width="{wide}" height="{high}" fill="none" stroke="#888"/>')
        text(x0 + wide / 2, y0 + high + 34, "bytes of coefficients" if unit == "bytes" else "seconds")
        text(x0 + wide / 2, y0 - 8, scene, more='font-weight="bold"')
        for basis in colors:
            for projection in ("collocation", "least-squares"):
                points = [at(line[unit], line["error"]) for line in own
                          if (line["basis"], line["projection"]) == (basis, projection)]
                if not points:
                    continue
                dashed = ' stroke-dasharray="5 4"' if projection == "least-squares" else ""
                out.append(f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" fill="none" '
                           f'stroke="{colors[basis]}" stroke-width="2"{dashed}/>')
                out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colors[basis]}"/>' for x, y in points]
for i, basis in enumerate(colors):
    x = left + i * 150
    out.append(f'<line x1="{x}" y1="{height - 40}" x2="{x + 24}" y2="{height - 40}" stroke="{colors[basis]}" '
               'stroke-width="2"/>')
    text(x + 30, height - 36, names[basis], "start")
text(left, height - 14, "dashed: least squares; whole: light at points", "start")
out.append("</svg>")
open(sys.argv[2], "w").write("\n".join(out) + "\n")
