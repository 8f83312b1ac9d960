include(${CMAKE_CURRENT_LIST_DIR}/steps.cmake)
set(build ${WORK}/find_package)
file(REMOVE_RECURSE ${build})
configure_command(configure ${SOURCE}/find_package ${build} -DCMAKE_BUILD_TYPE=
                  -DCMAKE_EXPORT_COMPILE_COMMANDS=ON)
run(${configure})
run(${CMAKE_COMMAND} --build ${build})
run(${build}/stranger)
expect_text("/cup is 0.20 m high")

# A hidden helper must stay hidden, or two plugins could meet in one process.
run(nm -D --defined-only ${build}/plugins/stranger_plugin.so)
expect_text("diorama_plugin")
string(FIND "${OUT}" "helper_of_the_stranger" at)
if(NOT at EQUAL -1)
  message(FATAL_ERROR "the plugin exports what it did not ask to export:\n${OUT}")
endif()
run(readelf -SW ${build}/plugins/stranger_plugin.so)
expect_text(".diorama_plugin")
run(${DIORAMA} --plugin-dir ${build}/plugins plugins)
expect_text("stranger")

# Without a build type plugins are optimised all the same; numbers agree between machines.
file(READ ${build}/compile_commands.json commands)
foreach(flag IN ITEMS "-ffp-contract=off" "-O2")
  if(NOT commands MATCHES "${flag}[^\n]*plugin[.]cpp")
    message(FATAL_ERROR "a plugin is built without ${flag}:\n${commands}")
  endif()
endforeach()

# Mistakes are told when configuring or linking.
file(REMOVE_RECURSE ${build}_wrong)
configure_command(configure ${SOURCE}/find_package ${build}_wrong)
run_refused("compatible with requested version \"9.0\"" ${configure} -DWANTED_VERSION=9.0)
run_refused("diorama_sdk has no component 'nonsense'; there are: library, plugin" ${configure}
            -DWANTED_VERSION=0.1 -DWANTED_COMPONENTS=nonsense)
run(${configure} -DWANTED_VERSION=0.1 -DWANTED_COMPONENTS=plugin)
run_refused("nothing_defines_this" ${CMAKE_COMMAND} --build ${build}_wrong --target undefined_plugin)
run_refused("diorama_plugin" ${CMAKE_COMMAND} --build ${build}_wrong --target empty_plugin)
