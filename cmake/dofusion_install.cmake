# find_package(dofusion COMPONENTS scene dataset stability perception diffusion diffusion_torch pipeline placement ranking
# assets) from an installed tree.
include(CMakePackageConfigHelpers)
install(EXPORT dofusion-targets NAMESPACE dofusion:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/dofusion)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/dofusionConfig.cmake.in
                              ${CMAKE_BINARY_DIR}/dofusionConfig.cmake
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/dofusion)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/dofusionConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/dofusionConfig.cmake ${CMAKE_BINARY_DIR}/dofusionConfigVersion.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/dofusion)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/assets/ DESTINATION ${CMAKE_INSTALL_DATADIR}/dofusion/assets)
