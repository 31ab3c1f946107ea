#!/usr/bin/env python3
"""Prints SOURCE;GROUP;... of sources to compile together: up to eight of a folder, of which no two give the same name
to a helper of their own (in namespace {}), an alias or a macro. Those of Highway, which includes them once a target,
are left out, and stay on their own. Usage: groups.py FILE..."""
import collections
import pathlib
import re
import sys

DECLARED = re.compile(r"(?:struct|class|enum class|enum) (\w+)|(?:[\w:<>,&*\[\] ]+[ &*>])?(\w+)\s*(?:\(|=|\{|\[|;)")


def helpers(source, text):
    """Pairs of a name and what it stands for: the same alias twice is no clash."""
    text = re.sub(r"//[^\n]*", "", text)
    yield from re.findall(r"^(?:using|namespace) (\w+) = (.*);", text, re.M)
    yield from ((name, scope + name) for scope, name in re.findall(r"^using ([\w:]+::)(\w+);", text, re.M))
    yield from ((name, source) for name in re.findall(r"^#define (\w+)", text, re.M))
    for start in re.finditer(r"^namespace \{$", text, re.M):
        depth = 1
        for line in text[start.end() + 1 :].split("\n"):
            if depth == 1 and not line.startswith("TEST") and (found := DECLARED.match(line)):
                yield found[1] or found[2], source
                if line.startswith(("const", "static")):  # the others of one declaration
                    yield from ((name, source) for name in re.findall(r", (\w+)(?= =|;|,)", line))
            depth += line.count("{") - line.count("}")
            if depth < 1:
                break


groups = collections.defaultdict(list)  # folder -> [(sources, their helpers)]
for source in sys.argv[1:]:
    text = pathlib.Path(source).read_text()
    if "#include <hwy/" in text:
        continue
    folder, names = pathlib.Path(source).parent, dict(helpers(source, text))
    for sources, taken in groups[folder]:
        if len(sources) < 8 and all(taken.get(name, meaning) == meaning for name, meaning in names.items()):
            break
    else:
        groups[folder].append((sources := [], taken := {}))
    sources.append(source)
    taken.update(names)
print(end=";".join(f"{source};{'_'.join(folder.parts)}_{number}" for folder, of_folder in groups.items()
                   for number, (sources, _) in enumerate(of_folder) for source in sources))
