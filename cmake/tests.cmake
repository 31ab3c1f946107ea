add_executable(lambent-tests ${lambent_tests})
target_link_libraries(lambent-tests PRIVATE lambent GTest::gtest GTest::gtest_main nlohmann_json::nlohmann_json
  fmt::fmt OpenEXR::OpenEXR TBB::tbb)
target_include_directories(lambent-tests PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/tests)
target_compile_options(lambent-tests PRIVATE -Wall -Wextra -Wno-missing-field-initializers)
include(GoogleTest)
gtest_discover_tests(lambent-tests DISCOVERY_TIMEOUT 60)

add_test(NAME include_arrows COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/include_arrows.sh ${CMAKE_CURRENT_SOURCE_DIR})
add_test(NAME command_line COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/tests/command_line.sh $<TARGET_FILE:lambent-tool>)
