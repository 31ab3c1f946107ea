#!/usr/bin/env python3
"""Prints SOURCE;GROUP;... of sources to compile together, up to BYTES of them: the longest first, each where most is.
No two of a group give the same name to a helper of their own (in namespace {}), an alias or a macro, nor one to such a
helper and another, in a header that it includes, to what it declares. Sources of Highway, which includes them once a
target, are left out, and stay on their own. Usage: groups.py FILE..."""
import functools
import pathlib
import re
import sys

BYTES = 250_000  # beyond, headers are a small part of what is compiled, and the last groups wait for one core
NOT_DECLARED = (" ", "TEST", "using", "namespace", "static_assert")  # aliases are looked at by what they stand for
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
            if depth == 1 and not line.startswith(NOT_DECLARED) and (found := DECLARED.match(line)):
                yield found[1] or found[2], source
                if line.startswith(("const", "static")):  # the others of one declaration
                    yield from ((name, source) for name in re.findall(r", (\w+)(?= =|;|,)", line))
            depth += line.count("{") - line.count("}")
            if depth < 1:
                break


@functools.cache
def includes(file):
    """Headers of the project that a file includes, and what those include."""
    named = re.findall(r'^#include [<"]([^>"]+)[>"]', file.read_text(errors="surrogateescape"), re.M)
    found = [path for name in named for folder in (file.parent, pathlib.Path("src"), pathlib.Path("tests"))
             if (path := folder / name).exists()]
    return set(found).union(*map(includes, found))


@functools.cache
def declared(header):
    """What a header declares in namespaces: names at the beginning of a line."""
    lines = header.read_text(errors="surrogateescape").split("\n")
    return {found[1] or found[2] for line in lines if line[:1] > " " and (found := DECLARED.match(line))}


texts = {source: text for source in sys.argv[1:]
         if "#include <hwy/" not in (text := pathlib.Path(source).read_text(errors="surrogateescape"))}
groups = []  # [sources, their helpers, their bytes]
for source, text in sorted(texts.items(), key=lambda item: (-len(item[1]), item[0])):
    names = {name: "" for header in includes(pathlib.Path(source)) for name in declared(header)}
    names.update(helpers(source, text))
    fits = [group for group in groups if group[2] + len(text) <= BYTES
            and all(group[1].get(name, meaning) == meaning for name, meaning in names.items())]
    if not fits:
        groups.append([[], {}, 0])
    group = max(fits, key=lambda group: group[2], default=groups[-1])
    group[0].append(source)
    group[1].update(names)
    group[2] += len(text)
print(end=";".join(f"{source};{number}" for number, (sources, _, _) in enumerate(groups) for source in sorted(sources)))
