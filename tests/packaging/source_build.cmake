# From a build that is not installed, with its programs on the PATH, `diorama new-plugin` leads to a plugin
# that the program lists.
#   cmake -DBUILD=... -DWORK=... -DGENERATOR=... -DCXX=... -P source_build.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
function(run)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env PATH=${BUILD}/bin:$ENV{PATH} ${ARGV}
                  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE out
                  ERROR_VARIABLE err)
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "${command}\nended with ${result}\n${out}${err}")
  endif()
  set(OUT "${out}" PARENT_SCOPE)
endfunction()
run(diorama new-plugin writer my_boxes)
run(${CMAKE_COMMAND} -S my_boxes -B my_boxes/build -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX}
    -DCMAKE_BUILD_TYPE=Debug)
run(${CMAKE_COMMAND} --build my_boxes/build)
run(ctest --test-dir my_boxes/build --output-on-failure)
run(diorama --plugin-dir my_boxes/build/plugins plugins describe my_boxes)
if(NOT OUT MATCHES "writer my_boxes")
  message(FATAL_ERROR "the plugin is not listed:\n${OUT}")
endif()
