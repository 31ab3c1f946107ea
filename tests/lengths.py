#!/usr/bin/env python3
"""Lines to 120 columns and sources to 500 of them; in C++, functions to 80 lines.
    tests/lengths.py EXCEPTIONS FILE...
A line of EXCEPTIONS is `function PATH NAME: REASON` or `source PATH: REASON`; one that is no longer needed fails too.
C++ is read as clang-format leaves it: what a line ends with `{` ends at the next `}` of the first line's indent."""
import re
import sys

columns, function_lines, source_lines = 120, 80, 500
control = re.compile(r"\s*(namespace|extern|(template.*)?(struct|class|enum|union))\b")


def functions(lines):
    """Name, first line (from 1) and length of each outermost function."""
    head, first, indent, inside = "", 0, "", ""
    for i, line in enumerate(lines):
        if inside:
            if line.startswith(indent + "}"):
                if inside == "function":
                    test = re.match(r"\s*TEST\w*\((\w+), (\w+)\)", head)
                    name = ".".join(test.groups()) if test else re.search(r"([\w:~]+|operator\S+)\s*\(", head)[1]
                    yield name, first + 1, i - first + 1
                head = inside = ""
            continue
        code = re.sub(r"\s*//.*", "", line)
        if not code.strip() or code.startswith("#"):
            head = ""
            continue
        if not head:
            first, indent = i, re.match(r"\s*", line)[0]
        head += code
        if code.endswith("{"):
            if control.match(head) and not re.search(r"\) (const )?\{$", head):
                head = ""
            else:
                inside = "function" if "(" in head and not re.search(r"= \{$", head) else "table"
        elif re.search(r"[;}:]$", code):
            head = ""
    if inside:
        yield "a function that does not end", first + 1, len(lines) - first


exceptions = {}
for number, line in enumerate(open(sys.argv[1]), 1):
    if line.strip() and not line.startswith("#"):
        what = re.match(r"((?:function \S+|source) \S+): \S", line)
        if not what:
            sys.exit(f"{sys.argv[1]}:{number}: not an exception with a reason")
        exceptions[what[1]] = number
failures, used = [], set()


def fail(key, text):
    used.add(key) if key in exceptions else failures.append(text)


for path in sys.argv[2:]:
    lines = open(path, encoding="utf-8").read().splitlines()
    for i, line in enumerate(lines, 1):
        if len(line) > columns:
            failures.append(f"{path}:{i}: {len(line)} columns, of {columns}")
    if len(lines) > source_lines:
        fail(f"source {path}", f"{path}: {len(lines)} lines, of {source_lines}")
    if path.endswith((".cpp", ".h")):
        for name, first, length in functions(lines):
            if length > function_lines:
                fail(f"function {path} {name}", f"{path}:{first}: {name} has {length} lines, of {function_lines}")
for key, number in exceptions.items():
    if key not in used:
        failures.append(f"{sys.argv[1]}:{number}: no exception any more: {key}")
print("\n".join(failures), end="\n" if failures else "")
sys.exit(1 if failures else 0)
