#!/usr/bin/env bash
# Installs the build into a temporary prefix and builds programs against the package, as users of the library do: C and
# C++, with the component `relight` alone and with everything.
set -euo pipefail
build=$1
source_dir=$(cd "$(dirname "$0")/.." && pwd)
prefix=$(mktemp -d)
trap 'rm -rf "$prefix"' EXIT
quietly() { "$@" >"$prefix/log" 2>&1 || { cat "$prefix/log"; exit 1; }; }
quietly cmake --install "$build" --prefix "$prefix/installed"
include=$prefix/installed/include

# Public headers alone, and they name no other library.
(cd "$include" && find . -name '*.h' | sed 's/^\.\///' | sort) >"$prefix/installed.txt"
sed -n 's/^  \(lambent[a-z_/]*\.h\)$/\1/p' "$source_dir/cmake/headers.cmake" | sort >"$prefix/public.txt"
diff "$prefix/public.txt" "$prefix/installed.txt" || { echo "installed headers are not the public ones"; exit 1; }
if grep -rnE '#include <[^>]*/' "$include" | grep -v '#include <lambent/'; then
  echo "public headers include other libraries"
  exit 1
fi

mkdir "$prefix/user"
cp "$source_dir/examples/bake_and_relight.cpp" "$source_dir/examples/relight.c" "$prefix/user/"
sed 's/.*/#include <&>/' "$prefix/public.txt" >"$prefix/user/every_header.cpp"
echo '#include <lambent.h>' >"$prefix/user/c_header.c"
cat >"$prefix/user/glm_user.cpp" <<'C'
// A program with GLM of its own, set up as it likes: public types are the same to both.
#include <glm/glm.hpp>
#include <lambent/lambent.h>
#include <cstdio>
int main() {
  const glm::vec3 sun = glm::normalize(glm::vec3(1, 2, 3));
  const lambent::Environment env = lambent::make_environment("", 64, 32, [&](lambent::Vec3 d) {
    return lambent::Vec3(1 + sun.x * d.x + sun.y * d.y + sun.z * d.z);
  });
  const std::vector<lambent::Vec3> light = lambent::project_environment(env, 2);
  const lambent::Vec3 zero;
  const glm::vec3 towards(-light[3].x, -light[1].x, light[2].x);
  std::printf("%.2f %.2f\n", glm::dot(glm::normalize(towards), sun), zero.x + zero.y + zero.z);
}
C
cat >"$prefix/user/CMakeLists.txt" <<'C'
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES C CXX)
find_package(lambent 0.1 REQUIRED COMPONENTS relight)
foreach(target lambent::lambent embree OpenEXR::OpenEXR PkgConfig::stb)
  if(TARGET ${target})
    message(FATAL_ERROR "the component relight looked for ${target}")
  endif()
endforeach()
add_executable(relight relight.c)
add_executable(user bake_and_relight.cpp)
add_library(every_header OBJECT every_header.cpp c_header.c)
target_link_libraries(relight PRIVATE lambent::relight)
find_package(lambent 0.1 REQUIRED)
target_link_libraries(user PRIVATE lambent::lambent)
target_link_libraries(every_header PRIVATE lambent::lambent)
set_target_properties(relight every_header PROPERTIES C_STANDARD 99 C_EXTENSIONS OFF)
find_path(GLM glm/glm.hpp)
if(GLM)
  add_executable(glm_user glm_user.cpp)
  add_executable(glm_user_ctor_init glm_user.cpp)
  target_compile_definitions(glm_user_ctor_init PRIVATE GLM_FORCE_CTOR_INIT)
  target_link_libraries(glm_user PRIVATE lambent::lambent)
  target_link_libraries(glm_user_ctor_init PRIVATE lambent::lambent)
endif()
C
quietly cmake -S "$prefix/user" -B "$prefix/user/build" -G Ninja -DCMAKE_PREFIX_PATH="$prefix/installed"
quietly cmake --build "$prefix/user/build"

printf 'v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n' >"$prefix/a.obj"
"$prefix/user/build/user" "$prefix/a.obj" uniform:1 "$prefix/a.png"
[ -s "$prefix/a.png" ] || { echo "the installed library wrote no picture"; exit 1; }
"$prefix/user/build/relight" "$source_dir/tests/golden/diffuse.glb" >"$prefix/relit.txt"
diff <("$build/bin/relight" "$source_dir/tests/golden/diffuse.glb") "$prefix/relit.txt" ||
  { echo "the installed library relights differently"; exit 1; }
if [ -x "$prefix/user/build/glm_user" ]; then
  for program in glm_user glm_user_ctor_init; do
    said=$("$prefix/user/build/$program")
    [ "$said" = "1.00 0.00" ] || { echo "$program: $said"; exit 1; }
  done
else
  echo "package: no GLM here (libglm-dev): its user was left out"
fi
for example in bake_and_relight.cpp relight.c; do
  [ "$(wc -l <"$source_dir/examples/$example")" -lt 60 ] || { echo "$example is longer than 60 lines"; exit 1; }
done
echo "package test passed"
