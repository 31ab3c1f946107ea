# Two components: relight (lambent::relight), and lambent (lambent::lambent), which needs it.
include(CMakePackageConfigHelpers)
include(cmake/headers.cmake)

function(lambent_install_headers component)
  foreach(header ${ARGN})
    get_filename_component(folder ${header} DIRECTORY)
    install(FILES src/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder} COMPONENT ${component})
  endforeach()
endfunction()

set(lambent_package ${CMAKE_INSTALL_LIBDIR}/cmake/lambent)
lambent_install_headers(relight ${lambent_relight_headers})
install(TARGETS lambent_relight EXPORT lambentRelightTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT relight)
install(EXPORT lambentRelightTargets NAMESPACE lambent:: DESTINATION ${lambent_package} COMPONENT relight)
configure_package_config_file(cmake/lambentConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/lambentConfig.cmake
  INSTALL_DESTINATION ${lambent_package})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/lambentConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/lambentConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/lambentConfigVersion.cmake
  DESTINATION ${lambent_package} COMPONENT relight)

if(NOT LAMBENT_RELIGHT_ONLY)
  lambent_install_headers(lambent ${lambent_headers})
  install(TARGETS lambent EXPORT lambentTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT lambent)
  install(TARGETS lambent-tool RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT lambent)
  install(EXPORT lambentTargets NAMESPACE lambent:: DESTINATION ${lambent_package} COMPONENT lambent)
  # The page, where scripts/web has built it.
  install(DIRECTORY build/web/ DESTINATION ${CMAKE_INSTALL_DATADIR}/lambent/web COMPONENT lambent OPTIONAL)
endif()
