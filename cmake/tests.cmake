add_executable(lambent-tests ${lambent_tests} ${tool_tests} apps/lambent/serve.cpp)
target_link_libraries(lambent-tests PRIVATE lambent GTest::gtest GTest::gtest_main nlohmann_json::nlohmann_json
  fmt::fmt OpenEXR::OpenEXR TBB::tbb CLI11::CLI11 PkgConfig::httplib)
target_include_directories(lambent-tests PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/tests)
target_compile_options(lambent-tests PRIVATE -Wall -Wextra -Wno-missing-field-initializers)
# Tests are half of what is compiled, and what is hot in them is the library: less optimised they build in two thirds of the time. Under
# the sanitizers, where their own loops count too, only those of readers and writers.
if(LAMBENT_SANITIZE)
  file(GLOB plain_tests CONFIGURE_DEPENDS src/lambent/scene/*_test.cpp src/lambent/image/*_test.cpp src/lambent/baked/*_test.cpp src/lambent/core/*_test.cpp)
  set_source_files_properties(${plain_tests} PROPERTIES COMPILE_OPTIONS -O0)
else()
  target_compile_options(lambent-tests PRIVATE $<$<CONFIG:Release>:-O1>)
endif()
include(GoogleTest)
gtest_discover_tests(lambent-tests DISCOVERY_TIMEOUT 60)

add_test(NAME include_arrows COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/include_arrows.sh ${CMAKE_CURRENT_SOURCE_DIR})
add_test(NAME command_line COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/command_line.sh $<TARGET_FILE:lambent-tool>)
set_tests_properties(command_line PROPERTIES COST 1000)  # the longest: first, beside the others
