#!/usr/bin/env python3
"""Which unit tests the sanitizers leave to the release build: of those that take long there, the ones whose edges of
control flow in the libraries the others pass too. Tests of what reads files are kept, since there the data matters. Of
the rest it takes, by edges gained a second, tests until SHARE of all edges that any test passes is reached, and prints
the others, one a line: tests/reached_by_others.txt.

Usage: LAMBENT_REACHED=FILE build/sanitize/bin/lambent-tests --gtest_filter='*'; tests/reached.py FILE [SHARE=0.995]"""
import pathlib
import re
import sys

import numpy as np

LONG = 0.25  # seconds
READERS = "baked c core image scene".split()  # folders

names, seconds, ranges = [], [], []
for line in open(sys.argv[1]):
    name, microseconds, *edges = line.split()
    names.append(name)
    seconds.append(float(microseconds) / 1e6)
    ranges.append([(int(first), int(last or first)) for first, _, last in (edge.partition("-") for edge in edges)])
share = float(sys.argv[2]) if len(sys.argv) > 2 else 0.995
reached = np.zeros((len(names), 1 + max(last for test in ranges for _, last in test)), bool)
for row, test in zip(reached, ranges):
    for first, last in test:
        row[first : last + 1] = True

sources = [source for folder in READERS for source in pathlib.Path("src/lambent", folder).glob("*_test.cpp")]
readers = {suite for source in sources for suite in re.findall(r"^TEST(?:_[FP])?\((\w+),", source.read_text(), re.M)}
kept = {i for i, name in enumerate(names) if seconds[i] < LONG or name.split(".")[0].split("/")[-1] in readers}
every = reached.any(0)
missing = every & ~reached[sorted(kept)].any(0)
left = set(range(len(names))) - kept
while missing.sum() > (1 - share) * every.sum():
    best = max(left, key=lambda i: ((reached[i] & missing).sum() / seconds[i], names[i]))
    kept.add(best)
    left.remove(best)
    missing &= ~reached[best]
print(*sorted(names[i] for i in left), sep="\n")
print(f"{len(names)} tests pass {every.sum()} edges in {sum(seconds):.0f} s; {len(kept)} of them pass "
      f"{every.sum() - missing.sum()} in {sum(seconds[i] for i in kept):.0f} s", file=sys.stderr)
