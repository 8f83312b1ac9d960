# The public headers and a plugin compile without a warning: with any compiler that an author, an
# author's editor or clang-tidy may use. All in one go, as each costs what Eigen costs.
#   cmake -DCXX=clang++ -DINCLUDE_DIRS=dir:dir -DEIGEN=dir -DPLUGIN=file.cpp -P headers_compile.cmake
cmake_minimum_required(VERSION 3.25)
string(REPLACE ":" ";" folders "${INCLUDE_DIRS}")
set(command ${CXX} -std=c++20 -fsyntax-only -fPIC -DEIGEN_MAX_ALIGN_BYTES=16 -Wall -Wextra -Wpedantic
            -Wshadow -Werror -isystem ${EIGEN})
set(headers "")
foreach(folder IN LISTS folders)
  list(APPEND command -I${folder})
  file(GLOB found RELATIVE ${folder} ${folder}/diorama/*.h)
  list(APPEND headers ${found})
endforeach()
list(LENGTH headers count)
if(count LESS 20)
  message(FATAL_ERROR "expected the headers below ${INCLUDE_DIRS}, found ${count}")
endif()
list(TRANSFORM headers PREPEND "-include;")
execute_process(COMMAND ${command} ${headers} ${PLUGIN} RESULT_VARIABLE code ERROR_VARIABLE errors)
if(NOT code EQUAL 0)
  message(FATAL_ERROR "${CXX}\n${errors}")
endif()
