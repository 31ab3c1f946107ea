#!/usr/bin/env bash
# Installs the build into a temporary prefix and builds a program against the package: what a user of the library does.
set -euo pipefail
build=$1
source_dir=$(cd "$(dirname "$0")/.." && pwd)
prefix=$(mktemp -d)
trap 'rm -rf "$prefix"' EXIT
cmake --install "$build" --prefix "$prefix/installed" >"$prefix/log" 2>&1 || { cat "$prefix/log"; exit 1; }
mkdir "$prefix/user"
cp "$source_dir/examples/bake_and_relight.cpp" "$prefix/user/"
cat >"$prefix/user/CMakeLists.txt" <<'C'
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES CXX)
find_package(lambent 0.1 REQUIRED)
add_executable(user bake_and_relight.cpp)
target_link_libraries(user PRIVATE lambent::lambent)
C
{ cmake -S "$prefix/user" -B "$prefix/user/build" -G Ninja -DCMAKE_PREFIX_PATH="$prefix/installed" && cmake \
  --build "$prefix/user/build"; } \
  >"$prefix/log" 2>&1 || { cat "$prefix/log"; exit 1; }
printf 'v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n' >"$prefix/a.obj"
"$prefix/user/build/user" "$prefix/a.obj" uniform:1 "$prefix/a.png"
[ -s "$prefix/a.png" ] || { echo "the installed library wrote no picture"; exit 1; }
[ "$(wc -l <"$source_dir/examples/bake_and_relight.cpp")" -lt 60 ] ||
  { echo "the example is longer than 60 lines"; exit 1; }
echo "package test passed"
