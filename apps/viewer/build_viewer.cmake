# cmake -DNPM=… -DSOURCE=DIR -DBINARY=DIR -DFOR_TESTS=ON|OFF -P build_viewer.cmake
# Writes BINARY/viewer.js, the bundle, and BINARY/viewer_script.cpp, which holds it. If that fails, a line says why, the
# bundle is absent, the C++ file holds nothing, and the build goes on.

# Ends without a viewer.
macro(give_up why)
  message(NOTICE "No 3D view in dofusion-place's reports: ${why}")
  file(REMOVE ${BINARY}/viewer.js)
  set(SCRIPT "")
  configure_file(${SOURCE}/viewer_script.cpp.in ${BINARY}/viewer_script.cpp @ONLY)
  return()
endmacro()

if(NOT NPM)
  give_up("npm was not found (Debian: apt-get install npm)")
endif()

# npm ci deletes what is installed, so it runs only if the lock has changed.
file(SHA256 ${SOURCE}/package-lock.json lock)
set(wanted "${lock} ${FOR_TESTS}")
set(installed "")
if(EXISTS ${BINARY}/node_modules/.wanted)
  file(READ ${BINARY}/node_modules/.wanted installed)
endif()
if(NOT installed STREQUAL wanted)
  file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json DESTINATION ${BINARY})
  set(without --omit=dev)
  if(FOR_TESTS)
    set(without)
  endif()
  execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --fetch-retries=1
                          --fetch-retry-mintimeout=1000 ${without}
                  WORKING_DIRECTORY ${BINARY} TIMEOUT 300
                  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    give_up("npm ci failed (${status}); is there a network?\n${output}")
  endif()
  file(WRITE ${BINARY}/node_modules/.wanted "${wanted}")
endif()

execute_process(COMMAND ${CMAKE_COMMAND} -E env NODE_PATH=${BINARY}/node_modules
                        ${BINARY}/node_modules/.bin/esbuild ${SOURCE}/viewer.js --bundle --minify --format=iife
                        --target=es2020 --charset=utf8 --loader:.css=text --loader:.html=text --log-level=warning
                        --outfile=${BINARY}/viewer.js
                RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT status EQUAL 0)
  give_up("esbuild failed (${status})\n${output}")
endif()
file(READ ${BINARY}/viewer.js SCRIPT)
configure_file(${SOURCE}/viewer_script.cpp.in ${BINARY}/viewer_script.cpp @ONLY)
