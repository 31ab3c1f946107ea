include(CMakePackageConfigHelpers)
install(TARGETS lambent EXPORT lambentTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS lambent-tool RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
# The page, where scripts/web has built it.
install(DIRECTORY build/web/ DESTINATION ${CMAKE_INSTALL_DATADIR}/lambent/web OPTIONAL)
install(DIRECTORY src/lambent DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h" PATTERN "*-inl.h" EXCLUDE)
install(EXPORT lambentTargets NAMESPACE lambent:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/lambent)
configure_package_config_file(cmake/lambentConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/lambentConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/lambent)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/lambentConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/lambentConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/lambentConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/lambent)
