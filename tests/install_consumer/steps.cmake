# What the scripts share. The installation that they use lies at ${PREFIX}.
cmake_minimum_required(VERSION 3.25)
set(PREFIX ${WORK}/moved)
# In a prefix that the dynamic linker does not know by itself.
set(DIORAMA ${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=${PREFIX}/${LIBDIR} ${PREFIX}/${BINDIR}/diorama)

# run(command...): fails with all output unless the command succeeds; output in OUT.
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "${command}\nended with ${result}\n${out}${err}")
  endif()
  set(OUT "${out}${err}" PARENT_SCOPE)
endfunction()

# run_refused(text command...): fails unless the command fails and says the text.
function(run_refused text)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE err)
  string(REGEX REPLACE "[ \n]+" " " said "${out}${err}")
  string(FIND "${said}" "${text}" at)
  if(result EQUAL 0 OR at EQUAL -1)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${result}; expected a failure that says\n${text}\n"
                        "found\n${out}${err}")
  endif()
endfunction()

function(expect_text text)
  string(FIND "${OUT}" "${text}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "expected the output to hold\n${text}\nfound\n${OUT}")
  endif()
endfunction()

# configure_command(variable source build option...): unoptimised, as only building is tested.
function(configure_command variable source build)
  set(${variable}
      ${CMAKE_COMMAND} -S ${source} -B ${build} -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX}
      -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -DCMAKE_BUILD_TYPE=Debug
      "-DCMAKE_CXX_FLAGS=-g0 -Wall -Wextra -Wpedantic -Werror" -DCMAKE_PREFIX_PATH=${PREFIX} ${ARGN}
      PARENT_SCOPE)
endfunction()

# Configures, builds, tests and installs a plugin project; its plugin must then be listed, without a word
# where it was installed beside the program or below ~/.local, as it is here.
function(build_and_list source build type)
  configure_command(configure ${source} ${build})
  run(${configure})
  run(${CMAKE_COMMAND} --build ${build})
  run(${CMAKE_CTEST_COMMAND} --test-dir ${build} --output-on-failure --no-tests=error)
  set(home ${CMAKE_COMMAND} -E env HOME=${build}/home --unset=XDG_DATA_HOME)
  run(${home} ${CMAKE_COMMAND} --install ${build} --prefix ${build}/home/.local)
  set(plugins ${build}/home/.local/${LIBDIR}/diorama/plugins-${ABI})
  run(${home} ${DIORAMA} plugins describe ${type})
  expect_text("${plugins}")
  run(${home} ${CMAKE_COMMAND} --install ${build} --prefix ${build}/elsewhere)
  expect_text("set DIORAMA_PLUGIN_PATH=${build}/elsewhere/${LIBDIR}/diorama/plugins-${ABI}")
endfunction()
