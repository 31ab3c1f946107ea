if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "LAMBENT_FUZZ needs clang: apt-get install clang libclang-rt-14-dev")
endif()
file(GLOB fuzz_sources CONFIGURE_DEPENDS fuzz/fuzz_*.cpp)
# Edges are flags and not counters, which threads would write all the time, each in the way of the others: on two cores
# that took three to six times as long as on one.
set(edges -fsanitize-coverage=inline-bool-flag,pc-table)
foreach(library lambent_relight lambent)
  target_compile_options(${library} PRIVATE ${edges},indirect-calls,trace-cmp)
endforeach()
target_compile_options(lambent_orders PRIVATE ${edges})  # for tests/reached.cpp alone: no fuzz target reads with them
target_sources(lambent-tests PRIVATE tests/reached.cpp)
foreach(source ${fuzz_sources})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source} fuzz/edges.cpp)
  target_link_libraries(${name} PRIVATE lambent)
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
endforeach()
