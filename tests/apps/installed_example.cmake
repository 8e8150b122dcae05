# Installs the build to a temporary folder, builds the example against it and runs it on the shipped scan.
#
#   cmake -DBUILD=… -DSOURCE=… -DGENERATOR=… -DCXX=… -DBUILD_TYPE=… -P installed_example.cmake
execute_process(COMMAND mktemp -d OUTPUT_VARIABLE folder OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  set(output "${output}" PARENT_SCOPE)
  if(NOT status EQUAL 0)
    file(REMOVE_RECURSE ${folder})
    message(FATAL_ERROR "${ARGN}\nended with ${status}:\n${output}")
  endif()
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${folder}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE}/apps/examples -B ${folder}/build -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${folder}/prefix
    -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_BUILD_TYPE=${BUILD_TYPE})
run(${CMAKE_COMMAND} --build ${folder}/build)
# What was installed must do without the source tree.
set(ENV{DOFUSION_ASSETS} ${folder}/prefix/share/dofusion/assets)
set(scan ${folder}/prefix/share/dofusion/assets/scans/two_blocks)
run(${folder}/build/place_example ${scan}/depth.png ${scan}/camera.json)
file(REMOVE_RECURSE ${folder})
if(NOT output MATCHES "2 objects; put the hat at .* probability of 0\\.[5-9]")
  message(FATAL_ERROR "the example said: ${output}")
endif()
message(STATUS "${output}")
