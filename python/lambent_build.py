"""What `pip install .` asks (PEP 517): CMake builds the extension, this puts a wheel together. It needs nothing that
pip would have to fetch; the C++ libraries are the system's (scripts/common.sh names Debian's). $LAMBENT_BUILD names a
build folder to use, as it is configured (with -DLAMBENT_PYTHON=ON) or new; without, build/wheel."""
import base64
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def project():
    """[project] of pyproject.toml, which Python 3.11 reads by itself and 3.9 and 3.10 by a line each."""
    text = open(os.path.join(root, "pyproject.toml"), "rb").read()
    try:
        import tomllib
        return tomllib.loads(text.decode())["project"]
    except ImportError:
        import ast
        import re
        out = {}
        for key, value in re.findall(r'^([a-z-]+) = (".*"|\[.*\])$', text.decode().split("[project]")[1], re.M):
            out.setdefault(key, ast.literal_eval(value))
        return out


def metadata():
    p = project()
    lines = ["Metadata-Version: 2.1", f"Name: {p['name']}", f"Version: {p['version']}", f"Summary: {p['description']}",
             "License: MIT", f"Requires-Python: {p['requires-python']}"]
    lines += [f"Requires-Dist: {d}" for d in p.get("dependencies", [])]
    for extra, wanted in p.get("optional-dependencies", {}).items():
        lines += [f"Provides-Extra: {extra}"] + [f'Requires-Dist: {d}; extra == "{extra}"' for d in wanted]
    lines += ["Description-Content-Type: text/markdown", ""]
    return "\n".join(lines) + "\n" + open(os.path.join(root, "README.md"), encoding="utf-8").read()


def get_requires_for_build_wheel(config_settings=None):
    return []


get_requires_for_build_sdist = get_requires_for_build_wheel


def build_extension(into):
    build = os.environ.get("LAMBENT_BUILD") or os.path.join(root, "build", "wheel")
    if not os.path.exists(os.path.join(build, "CMakeCache.txt")):
        subprocess.run(["cmake", "-S", root, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DLAMBENT_PYTHON=ON",
                        f"-DPython_EXECUTABLE={sys.executable}", "-DLAMBENT_TESTS=OFF", "-DLAMBENT_BENCH=OFF",
                        "-DLAMBENT_TOGETHER=ON",
                        *(["-G", "Ninja"] if shutil.which("ninja") else [])], check=True)
    subprocess.run(["cmake", "--build", build, "--target", "lambent_python", "--parallel"], check=True)
    subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", into, "--strip"], check=True)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    p = project()
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    name, info = f"{p['name']}-{p['version']}-{tag}-{tag}-{platform}.whl", f"{p['name']}-{p['version']}.dist-info"
    with tempfile.TemporaryDirectory() as stage:
        build_extension(stage)
        files = {}
        for folder, _, found in os.walk(stage):
            for f in found if os.path.basename(folder) == "lambent" else []:
                with open(os.path.join(folder, f), "rb") as content:
                    files[f"lambent/{f}"] = content.read()
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    if f"lambent/_lambent{suffix}" not in files:
        raise RuntimeError(f"the build folder's Python is another one: no _lambent{suffix} came of it")
    files[f"{info}/METADATA"] = metadata().encode()
    files[f"{info}/WHEEL"] = (f"Wheel-Version: 1.0\nGenerator: lambent\nRoot-Is-Purelib: false\n"
                              f"Tag: {tag}-{tag}-{platform}\n").encode()
    with open(os.path.join(root, "LICENSE"), "rb") as content:
        files[f"{info}/LICENSE"] = content.read()
    record = ""
    for path, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(content)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    with zipfile.ZipFile(os.path.join(wheel_directory, name), "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            wheel.writestr(path, content)
    return name


def build_sdist(sdist_directory, config_settings=None):
    """What git has."""
    p = project()
    stem = f"{p['name']}-{p['version']}"
    files = subprocess.run(["git", "-C", root, "ls-files", "-z"], check=True, capture_output=True).stdout
    with tarfile.open(os.path.join(sdist_directory, stem + ".tar.gz"), "w:gz", format=tarfile.PAX_FORMAT) as out:
        for path in files.decode().split("\0")[:-1]:
            out.add(os.path.join(root, path), f"{stem}/{path}", recursive=False)
        with tempfile.NamedTemporaryFile("w", encoding="utf-8") as info:
            info.write(metadata())
            info.flush()
            out.add(info.name, f"{stem}/PKG-INFO")
    return stem + ".tar.gz"
