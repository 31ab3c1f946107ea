#!/usr/bin/env bash
# Installs a package into a bare Debian 12 and uses what it brings: tests/deb.sh DEB [ROOT]. Needs root and debootstrap;
# ROOT, where it is given, is kept, and used again if it is there. Left out with a line where those are missing.
set -euo pipefail
deb=$(realpath "$1")
here=$(cd "$(dirname "$0")/.." && pwd)
if [ "$(id -u)" -ne 0 ] || ! command -v debootstrap >/dev/null; then
  echo "skipped: a bare root for $(basename "$deb") needs root and debootstrap"
  exit 0
fi
root=${2:-$(mktemp -d)/root}
quietly() { "$@" >"$root.log" 2>&1 || { tail -n 30 "$root.log" >&2; exit 1; }; }
[ -x "$root/bin/sh" ] || quietly debootstrap --variant=minbase bookworm "$root"
[ -n "${2:-}" ] || trap 'umount "$root/proc" 2>/dev/null; rm -rf "$(dirname "$root")"' EXIT
cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/" 2>/dev/null || true
cp /etc/resolv.conf "$root/etc/resolv.conf"
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
inside() {
  chroot "$root" env -i PATH=/usr/bin:/bin:/usr/sbin:/sbin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}
cp "$deb" "$root/tmp/lambent.deb"
quietly inside apt-get update
quietly inside apt-get install -y --no-install-recommends /tmp/lambent.deb
echo "installed: $(inside dpkg-query -W -f '${Package} ${Version}' lambent)," \
  "$(inside dpkg-query -f '.\n' -W | wc -l) packages in all"
rm -rf "$root/tmp/use"
mkdir -p "$root/tmp/use"
cp "$here/examples/relight.c" "$here/examples/bake_and_relight.cpp" "$root/tmp/use/"
cat >"$root/tmp/use/use.sh" <<'S'
set -euo pipefail
cd /tmp/use
printf 'v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nv 0 2 0\nv 2 2 0\nf 4 3 2 1\nf 1 2 6 5\n' >corner.obj
lambent --version
lambent bake corner.obj --order 3 --samples 64 -o corner.glb >/dev/null 2>&1
lambent render corner.glb --env sky:elevation=30 --size 64x64 -o corner.png >/dev/null 2>&1
[ -s corner.png ]
echo "bake and render: ok"
lambent bake corner.obj --transfer lightmap --sky uniform:1 --atlas 32x32 --samples 64 -o map.glb >/dev/null 2>&1
mkdir light
lambent export map.glb --godot light/room >/dev/null
[ -s light/lambent_lightmap.gd ]
echo "export: ok"
lambent export corner.glb --web site >/dev/null
[ -s site/index.html ]
echo "page: ok"
python3 - <<'P'
import lambent, numpy
baked = lambent.bake(lambent.load("corner.obj"), order=3, samples=64)
light = baked.relight("uniform:1")
assert light.shape == (baked.receivers, 3) and numpy.isfinite(light).all()
print("python: ok,", baked.receivers, "receivers")
P
[ -s /usr/share/lambent/blender/lambent_bake/__init__.py ]
echo "add-on: there"
if ldd /usr/bin/lambent /usr/lib/python3/dist-packages/lambent/*.so | grep 'not found'; then exit 1; fi
echo "libraries: all found"
S
inside bash /tmp/use/use.sh
# The library: what Suggests names, a C and a C++ program.
if [ "${LAMBENT_DEB_LIBRARY:-yes}" = yes ]; then
  suggested=$(inside dpkg-query -W -f '${Suggests}' lambent | tr ',' '\n' | sed 's/ //g' | grep -v blender)
  quietly inside apt-get install -y --no-install-recommends $suggested
  cat >"$root/tmp/use/CMakeLists.txt" <<'C'
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES C CXX)
find_package(lambent REQUIRED)
add_executable(user bake_and_relight.cpp)
target_link_libraries(user PRIVATE lambent::lambent)
add_executable(relight relight.c)
target_link_libraries(relight PRIVATE lambent::relight)
C
  quietly inside sh -c 'cd /tmp/use && cmake -S . -B build && cmake --build build'
  echo "library: a C and a C++ program are built with find_package(lambent)"
fi
umount "$root/proc"
