#!/usr/bin/env python3
"""Whether each C++ source includes what it uses, itself or by what it includes: names of std that have a header of
their own, and types and free functions of lambent's headers. Sources that are compiled several at a time
(LAMBENT_TOGETHER), behind a precompiled header, would not show it.
    tests/includes.py FILE...            from the repository's root"""
import functools
import pathlib
import re
import sys

# By name, the headers that bring it.
STD = {}
for headers, names in {
    "vector": "vector",
    "string": "string to_string stoi stof stod getline",
    "map": "map multimap",
    "set": "set multiset",
    "unordered_map": "unordered_map",
    "unordered_set": "unordered_set",
    "deque": "deque",
    "array": "array",
    "span": "span",
    "optional": "optional nullopt",
    "variant": "variant visit get_if holds_alternative monostate",
    "memory": "unique_ptr shared_ptr make_unique make_shared weak_ptr",
    "functional": "function",
    "atomic": "atomic",
    "mutex": "mutex lock_guard unique_lock call_once once_flag scoped_lock",
    "thread": "thread",
    "condition_variable": "condition_variable",
    "chrono": "chrono",
    "filesystem": "filesystem",
    "fstream": "ifstream ofstream fstream",
    "sstream": "ostringstream istringstream stringstream",
    "algorithm": "sort stable_sort all_of any_of none_of find_if upper_bound lower_bound max_element min_element "
                 "unique nth_element partial_sort count_if clamp",
    "numeric": "iota accumulate",
    "numbers": "numbers",
    "complex": "complex",
    "bit": "bit_cast has_single_bit countr_zero popcount",
    "charconv": "from_chars to_chars",
    "regex": "regex",
    "queue": "queue priority_queue",
    "tuple": "tuple",
    "limits": "numeric_limits",
}.items():
    STD.update({name: headers for name in names.split()})
STRINGS, COMMENTS = re.compile(r'"(?:\\.|[^"\\\n])*"'), re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
INCLUDE = re.compile(r"^#include [<\"]([^>\"]+)[>\"]", re.M)
# At the left margin: namespaces are not indented, members are.
TYPE = re.compile(r"^(?:struct|class|enum class|enum|using) (\w+)(?=[ ;{:]|$)", re.M)
FUNCTION = re.compile(r"^(?:inline |constexpr |template <[^\n]*>\n)*[\w:<>,&* ]+?[ &*](\w+)\([^\n]*", re.M)
ROOTS = ["src", "tests", "."]


@functools.cache
def read(path):
    return pathlib.Path(path).read_text(encoding="utf-8")


@functools.cache
def code(path):
    return COMMENTS.sub("", STRINGS.sub('""', read(path)))


@functools.cache
def found(name, folder):
    for root in [folder, *ROOTS]:
        path = pathlib.Path(root) / name
        if path.is_file():
            return str(path.resolve())
    return None


@functools.cache
def closure(path):
    """All headers that come with a file: paths of ours, names of others'."""
    ours, others, left = {path}, set(), [path]
    while left:
        at = left.pop()
        for name in INCLUDE.findall(read(at)):
            header = found(name, str(pathlib.Path(at).parent))
            if header is None:
                others.add(name)
            elif header not in ours:
                ours.add(header), left.append(header)
    return ours, others


declared = {}  # name -> headers at whose left margin it is declared
for header in pathlib.Path("src").rglob("*.h"):
    text = code(str(header.resolve()))
    for name in {*TYPE.findall(text), *FUNCTION.findall(text)}:
        declared.setdefault(name, set()).add(str(header.resolve()))
failed = 0
for source in sys.argv[1:]:
    path = str(pathlib.Path(source).resolve())
    text, (ours, others) = re.sub(r"^TEST\w*\(.*", "", code(path), flags=re.M), closure(path)
    missing = {f"<{STD[name]}> for std::{name}" for name in re.findall(r"\bstd::(\w+)", text)
               if name in STD and STD[name] not in others}
    own = {*TYPE.findall(text), *FUNCTION.findall(text), *re.findall(r"(?:\busing|::) ?(\w+)(?= =|[,;])", text)}
    # Types, and functions of two words or more that are called as no member: shorter names are variables', too.
    used = set(re.findall(r"(?<![\w.>:])([A-Z]\w+)\b(?!::\w+\()", text))
    used |= set(re.findall(r"(?<![\w.>:])(\w+_\w+)\(", text))
    used -= {name for name in used if name.endswith("_t") or name.isupper() or name == "static_assert"}
    for name in sorted(used & declared.keys() - own):
        if not declared[name] & ours and not re.search(rf"[\w>&*] {name}\(|\b{name} = \[", text):
            missing.add(f"a header of lambent for {name}: " +
                        ", ".join(sorted(str(pathlib.Path(h).relative_to(pathlib.Path.cwd())) for h in declared[name])))
    for what in sorted(missing):
        print(f"{source}: includes not {what}")
        failed = 1
sys.exit(failed)
