# The Python package (docs/python.md), in build/.../python as it is installed: `import lambent` with PYTHONPATH there.
# Debian's python3-dev, python3-numpy and pybind11-dev; another Python by -DPython_EXECUTABLE.
if(NOT DEFINED Python_EXECUTABLE AND EXISTS /usr/bin/python3)
  set(Python_EXECUTABLE /usr/bin/python3)
endif()
find_package(Python 3.9 REQUIRED COMPONENTS Interpreter Development.Module)
set(PYBIND11_FINDPYTHON ON)
find_package(pybind11 2.10 REQUIRED CONFIG)

set(lambent_python_folder ${CMAKE_CURRENT_BINARY_DIR}/python/lambent)
set(lambent_python_module python/baked.cpp python/image.cpp python/light.cpp python/module.cpp python/scene.cpp)
pybind11_add_module(lambent_python MODULE NO_EXTRAS ${lambent_python_module})
set_target_properties(lambent_python PROPERTIES OUTPUT_NAME _lambent CXX_VISIBILITY_PRESET hidden
  LIBRARY_OUTPUT_DIRECTORY ${lambent_python_folder})
target_compile_options(lambent_python PRIVATE ${lambent_warnings} $<$<CONFIG:Release>:-O1>)
lambent_compile_together(lambent_python ${lambent_python_module})
target_link_libraries(lambent_python PRIVATE lambent nlohmann_json::nlohmann_json fmt::fmt)
set(lambent_python_files __init__.py __init__.pyi _progress.py py.typed)
foreach(file ${lambent_python_files})
  configure_file(python/lambent/${file} ${lambent_python_folder}/${file} COPYONLY)
endforeach()

set(LAMBENT_PYTHON_DIR lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/dist-packages CACHE STRING
  "Where Python finds packages, below the prefix")
set(lambent_python_destination ${LAMBENT_PYTHON_DIR}/lambent)
list(TRANSFORM lambent_python_files PREPEND python/lambent/ OUTPUT_VARIABLE lambent_python_sources)
install(TARGETS lambent_python LIBRARY DESTINATION ${lambent_python_destination} COMPONENT python)
install(FILES ${lambent_python_sources} DESTINATION ${lambent_python_destination} COMPONENT python)

if(LAMBENT_TESTS)
  file(GLOB python_tests CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/python/tests python/tests/test_*.py)
  foreach(file ${python_tests})
    string(REGEX REPLACE "\\.py$" "" name ${file})
    add_test(NAME python_${name} COMMAND ${Python_EXECUTABLE} -m unittest -q ${name}
      WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/python/tests)
    set_tests_properties(python_${name} PROPERTIES ENVIRONMENT
      "PYTHONPATH=${CMAKE_CURRENT_BINARY_DIR}/python;PYTHONDONTWRITEBYTECODE=1;LAMBENT=$<TARGET_FILE:lambent-tool>")
  endforeach()
endif()
