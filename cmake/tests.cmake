# Under the sanitizers the library is what is checked: tests that another build has compiled may be linked to it, whose
# list of objects LAMBENT_TEST_OBJECTS names. Of functions that both have, in headers, the linker takes the first: the
# library's, whole.
set(LAMBENT_TEST_OBJECTS "" CACHE FILEPATH "Link the objects that this file lists, and compile no tests")
set(lambent_golden ${CMAKE_CURRENT_SOURCE_DIR}/tests/golden)
set(test_libraries lambent GTest::gtest nlohmann_json::nlohmann_json fmt::fmt OpenEXR::OpenEXR TBB::tbb CLI11::CLI11
  PkgConfig::webp draco::draco)
if(LAMBENT_TEST_OBJECTS)
  file(STRINGS ${LAMBENT_TEST_OBJECTS} test_objects)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${LAMBENT_TEST_OBJECTS})
else()
  add_library(lambent-test-objects OBJECT ${lambent_tests} ${tool_tests})
  target_link_libraries(lambent-test-objects PRIVATE ${test_libraries})
  # Not of every test: a path on the command line is one that the compiler's cache cannot share with other checkouts,
  # as it cannot where sources are compiled together, which are named by whole paths.
  if(LAMBENT_TOGETHER)
    target_compile_definitions(lambent-test-objects PRIVATE LAMBENT_GOLDEN="${lambent_golden}")
  else()
    set_property(SOURCE src/lambent/c/lambent_test.cpp src/lambent/pipeline/draw_test.cpp
      src/lambent/pipeline/golden_test.cpp src/lambent/pipeline/golden_indirect_test.cpp
      src/lambent/pipeline/live_test.cpp src/lambent/pipeline/draw_indirect_test.cpp
      src/lambent/pipeline/live_kinds_test.cpp src/lambent/pipeline/live_look_test.cpp
      src/lambent/baked/packed_test.cpp
      APPEND PROPERTY COMPILE_DEFINITIONS LAMBENT_GOLDEN="${lambent_golden}")
  endif()
  target_include_directories(lambent-test-objects PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/tests)
  target_compile_options(lambent-test-objects PRIVATE -Wall -Wextra -Wno-missing-field-initializers)
  # Most of what a test compiles are these headers.
  target_precompile_headers(lambent-test-objects PRIVATE <gtest/gtest.h> <algorithm> <cmath> <filesystem> <functional>
    <map> <string> <variant> <vector>)
  lambent_compile_together(lambent-test-objects ${lambent_tests} ${tool_tests})
  # What is hot in tests is the library: less optimised they build in two thirds of the time, and under the sanitizers
  # those of the readers in a third.
  target_compile_options(lambent-test-objects PRIVATE
    $<IF:$<BOOL:${LAMBENT_SANITIZE}>,-O0,$<$<CONFIG:Release>:-O1>>)
  set(test_objects $<FILTER:$<TARGET_OBJECTS:lambent-test-objects>,EXCLUDE,[.]gch$>)
  file(GENERATE OUTPUT test_objects.txt CONTENT "$<JOIN:${test_objects},\n>\n")
endif()
add_executable(lambent-tests ${test_objects} apps/lambent/serve.cpp)
target_link_libraries(lambent-tests PRIVATE ${test_libraries} GTest::gtest_main
  $<LINK_ONLY:meshoptimizer::meshoptimizer>)
if(LAMBENT_TEST_OBJECTS)
  target_link_options(lambent-tests BEFORE PRIVATE LINKER:--whole-archive $<TARGET_FILE:lambent>
    $<TARGET_FILE:lambent_relight> LINKER:--no-whole-archive)
endif()

# A few processes of many tests and not one a test, which under the sanitizers would take longer to start than to run.
# One test is `lambent-tests --gtest_filter=NAME`.
set(lambent_shards 16)
set(filter "*")
if(LAMBENT_SANITIZE)  # less those whose code others pass too (tests/reached.py)
  set(list ${CMAKE_CURRENT_SOURCE_DIR}/tests/reached_by_others.txt)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${list})
  file(STRINGS ${list} left_out)
  list(JOIN left_out ":" filter)
  string(PREPEND filter "-")
endif()
math(EXPR last "${lambent_shards} - 1")
foreach(shard RANGE ${last})
  add_test(NAME unit_${shard} COMMAND lambent-tests --gtest_brief=1)
  set_tests_properties(unit_${shard} PROPERTIES
    ENVIRONMENT "GTEST_FILTER=${filter};GTEST_TOTAL_SHARDS=${lambent_shards};GTEST_SHARD_INDEX=${shard}")
endforeach()
# Of the library that engines embed, without the other.
add_executable(c_api tests/c_api.c)
target_compile_options(c_api PRIVATE -Wall -Wextra -pedantic)
add_executable(relight_memory tests/relight_memory.cpp)
foreach(name c_api relight_memory)
  target_link_libraries(${name} PRIVATE lambent_relight)
endforeach()
add_executable(own_threads tests/own_threads.cpp src/lambent/core/parallel.cpp)
target_compile_definitions(own_threads PRIVATE LAMBENT_TBB=0)
target_include_directories(own_threads PRIVATE src)
target_link_libraries(own_threads PRIVATE Threads::Threads)
add_test(NAME own_threads COMMAND own_threads)
add_test(NAME c_api COMMAND c_api ${lambent_golden})
if(NOT LAMBENT_SANITIZE)  # which has an allocator of its own
  add_test(NAME relight_memory COMMAND relight_memory ${lambent_golden})
  add_test(NAME wasm COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/wasm --if-there)
  set_tests_properties(wasm PROPERTIES ENVIRONMENT LAMBENT_RELIGHT=$<TARGET_FILE:relight> COST 500)
endif()

add_test(NAME include_arrows COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/include_arrows.sh ${CMAKE_CURRENT_SOURCE_DIR})
set(command_tests command_line command_line_stores command_line_lightmaps command_line_lobes command_line_indirect
  large)
if(NOT LAMBENT_SANITIZE)  # full disks, limits and torn files are core/checkpoint_test.cpp's, too
  list(APPEND command_tests durable)
endif()
foreach(name ${command_tests})
  add_test(NAME ${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/${name}.sh $<TARGET_FILE:lambent-tool>)
  set_tests_properties(${name} PROPERTIES COST 1000)  # the longest: first, beside the others
endforeach()
if(LAMBENT_SANITIZE)
  list(FILTER command_tests INCLUDE REGEX command_line)
  set_tests_properties(${command_tests} PROPERTIES ENVIRONMENT LAMBENT_COARSE=1)
endif()
set(kill_and_resume 2)  # moments of each kind; more of them: scripts/bench kills
if(LAMBENT_SANITIZE)  # where a bake takes seconds
  set(kill_and_resume 1 direct zonal)
endif()
add_test(NAME kill_and_resume COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/kill_and_resume.sh
  $<TARGET_FILE:lambent-tool> ${kill_and_resume})
if(NOT LAMBENT_SANITIZE)
  add_test(NAME ranks COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/ranks.sh $<TARGET_FILE:lambent-tool>)
  set_tests_properties(ranks PROPERTIES SKIP_RETURN_CODE 77 COST 900)
endif()
if(window_libraries)
  foreach(name window window_hands)
    add_test(NAME ${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/${name}.sh $<TARGET_FILE:lambent-tool>)
  endforeach()
endif()
