# Compares the public headers, comments and spaces aside, with the lock that belongs to the ABI number.
#   cmake -DINCLUDE_DIR=sdk/include/diorama -DLOCK=tests/sdk/abi_lock.txt [-DLAYOUT=program]
#         [-DACCEPT=ON] -P abi_guard.cmake
# Compiled plugins are only as good as these headers: see sdk/docs/abi_policy.md.
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/../../sdk/cmake/HeadersDigest.cmake)
diorama_headers_digest(digest ${INCLUDE_DIR})

file(STRINGS ${INCLUDE_DIR}/abi.h abi REGEX "^#define DIORAMA_SDK_ABI ")
string(REGEX REPLACE "[^0-9]" "" abi "${abi}")
execute_process(COMMAND ${LAYOUT} OUTPUT_VARIABLE layout COMMAND_ERROR_IS_FATAL ANY)
set(found "abi ${abi}\nlayout ${layout}headers ${digest}\n${digest_LINES}")

if(ACCEPT)
  file(WRITE ${LOCK} "${found}")
  message("wrote ${LOCK}")
  return()
endif()
file(READ ${LOCK} locked)
if(found STREQUAL locked)
  return()
endif()

string(REGEX MATCH "^abi ([0-9]+)" ignored "${locked}")
set(locked_abi ${CMAKE_MATCH_1})
set(changed "")
string(REPLACE "\n" ";" found_lines "${found}")
string(REPLACE "\n" ";" locked_lines "${locked}")
foreach(line IN LISTS found_lines)
  if(NOT line IN_LIST locked_lines)
    string(REGEX REPLACE " .*" "" name "${line}")
    string(APPEND changed " ${name}")
  endif()
endforeach()
foreach(line IN LISTS locked_lines)
  string(REGEX REPLACE " .*" "" name "${line}")
  if(NOT line STREQUAL "" AND NOT found MATCHES "(^|\n)${name} ")
    string(APPEND changed " ${name} (gone)")
  endif()
endforeach()

if(abi STREQUAL locked_abi)
  set(advice
      "The plugin interface changed, its number did not. If a compiled plugin could notice (a new or"
      "moved field, virtual function, enumerator, default or inline code), raise DIORAMA_SDK_ABI in"
      "sdk/include/diorama/abi.h. sdk/docs/abi_policy.md lists the changes that need no new number.")
else()
  set(advice "DIORAMA_SDK_ABI went from ${locked_abi} to ${abi}: lock the new interface.")
endif()
list(JOIN advice " " advice)
message(FATAL_ERROR "changed:${changed}\n${advice}\n"
                    "Then accept the new state: ninja accept_abi, and commit tests/sdk/abi_lock.txt.")
