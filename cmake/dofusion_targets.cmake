# One way to declare a library, so that all of them carry the same warnings, include path and install rule.
#
#   dofusion_add_library(<name> SOURCES … [HEADERS …] [PUBLIC …] [PRIVATE …])
#
# makes dofusion_<name> with the alias dofusion::<name>. PUBLIC and PRIVATE list what it links.
function(dofusion_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  set(target dofusion_${name})
  add_library(${target} STATIC ${ARG_SOURCES} ${ARG_HEADERS})
  add_library(dofusion::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                              $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/dofusion>)
  target_compile_features(${target} PUBLIC cxx_std_17)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  dofusion_set_warnings(${target})
  install(TARGETS ${target} EXPORT dofusion-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  install(FILES ${ARG_HEADERS} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/dofusion/${folder})
endfunction()

function(dofusion_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-unknown-pragmas
                                           $<$<BOOL:${DOFUSION_WERROR}>:-Werror>)
endfunction()

# A program in build/<preset>/bin, installed to bin.
function(dofusion_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  dofusion_set_warnings(${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(FILES ${PROJECT_SOURCE_DIR}/apps/completion.bash RENAME ${name}
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
endfunction()

# A GoogleTest program; its tests are registered with CTest.
function(dofusion_add_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} GTest::gmock GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE DOFUSION_ASSETS_DIR="${PROJECT_SOURCE_DIR}/assets"
                                             DOFUSION_BIN_DIR="${CMAKE_BINARY_DIR}/bin"
                                             DOFUSION_REAL_DIR="${PROJECT_SOURCE_DIR}/../shared/real")
  dofusion_set_warnings(${name})
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 900)
endfunction()
