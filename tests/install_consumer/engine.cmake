# A program of somebody else on the installed libdiorama, by CMake and by pkg-config.
include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
set(build ${WORK}/engine)
file(REMOVE_RECURSE ${build})
configure_command(configure ${SOURCE}/engine ${build})
run(${configure})
run(${CMAKE_COMMAND} --build ${build})
# Nothing of the environment: plugins are found beside the library.
set(alone ${CMAKE_COMMAND} -E env --unset=DIORAMA_PLUGIN_PATH HOME=${build} --unset=XDG_DATA_HOME)
run(${alone} ${build}/embedder ${build})
expect_text("captures, the last 32 x 24")
expect_text("engine ${VERSION}: 3 captures handed on")
# It is the dataset that the program makes and reads.
run(${DIORAMA} lint ${build}/dataset)

# Compiled with other headers, it is told so before anything happens.
file(COPY ${PREFIX}/include DESTINATION ${build})
file(WRITE ${build}/include/diorama/engine_digest.h "#define DIORAMA_ENGINE_DIGEST 1ull\n")
find_program(PKG_CONFIG pkg-config)
if(PKG_CONFIG)
  set(ENV{PKG_CONFIG_PATH} ${PREFIX}/${LIBDIR}/pkgconfig)
  run(${PKG_CONFIG} --cflags --libs diorama)
  string(STRIP "${OUT}" flags)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  run(${LAUNCHER} ${CXX} -std=c++20 ${SOURCE}/engine/main.cpp -o ${build}/other -I${build}/include
      ${flags} -Wl,-rpath,${PREFIX}/${LIBDIR})
  run_refused("headers of another version" ${alone} ${build}/other ${build})
endif()

# One class is all that the library shows, beside what the standard library's templates leave.
run(nm -DC --defined-only ${PREFIX}/${LIBDIR}/libdiorama.so)
string(REGEX MATCHALL "[TBD] [^\n]*" shown "${OUT}")
list(FILTER shown EXCLUDE REGEX "^[TBD] diorama::Engine::")
if(shown)
  message(FATAL_ERROR "libdiorama shows more than its header:\n${shown}")
endif()
