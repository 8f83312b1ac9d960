include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
find_program(PKG_CONFIG pkg-config)
if(NOT PKG_CONFIG)
  message("pkg-config is not installed, nothing was tested")
  return()
endif()
set(ENV{PKG_CONFIG_PATH} ${PREFIX}/${LIBDIR}/pkgconfig)

# value(variable argument...): what pkg-config says.
function(value variable)
  run(${PKG_CONFIG} ${ARGN} diorama_sdk)
  string(STRIP "${OUT}" out)
  set(${variable} ${out} PARENT_SCOPE)
endfunction()
value(version --modversion)
value(abi --variable=abi)
value(pluginsdir --variable=pluginsdir)
value(flags --cflags --libs)
cmake_path(NORMAL_PATH pluginsdir)
if(NOT version STREQUAL VERSION OR NOT abi STREQUAL ABI
   OR NOT pluginsdir STREQUAL "${PREFIX}/${LIBDIR}/diorama/plugins-${ABI}")
  message(FATAL_ERROR "pkg-config: version ${version}, abi ${abi}, pluginsdir ${pluginsdir}")
endif()

# One line each, as a makefile would have it.
set(build ${WORK}/pkg_config)
file(REMOVE_RECURSE ${build})
file(MAKE_DIRECTORY ${build}/plugins)
separate_arguments(flags UNIX_COMMAND "${flags}")
set(sources ${SOURCE}/find_package)
run(${CXX} -std=c++20 ${sources}/main.cpp -o ${build}/stranger ${flags}
    -Wl,-rpath,${PREFIX}/${LIBDIR})
run(${build}/stranger)
expect_text("/cup is 0.20 m high")
run(${CXX} -std=c++20 -fPIC -shared -fvisibility=hidden ${sources}/plugin.cpp
    -o ${build}/plugins/stranger_plugin.so ${flags})
run(${DIORAMA} --plugin-dir ${build}/plugins plugins)
expect_text("stranger")
