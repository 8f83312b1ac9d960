# Compares two builds of the SDK's library with libabigail. What plugins could notice is an error as
# long as both have the same soname, that is, the same ABI number. Types are compared where both have
# debug information, exported functions always.
#   cmake -DABIDIFF=abidiff -DOLD=libdiorama_sdk.so.1 -DNEW=libdiorama_sdk.so -P abi_diff.cmake
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND ${ABIDIFF} ${OLD} ${NEW} RESULT_VARIABLE code OUTPUT_VARIABLE out
                ERROR_VARIABLE err)
# Bits of the exit code: 1 and 2 usage and other errors, 4 any change, 8 an incompatible one.
if(NOT code MATCHES "^[0-9]+$")
  message(FATAL_ERROR "${ABIDIFF} could not be run: ${code}")
endif()
math(EXPR errors "${code} & 3")
if(NOT errors EQUAL 0)
  message(FATAL_ERROR "${ABIDIFF} ended with ${code}\n${out}${err}")
endif()
math(EXPR incompatible "${code} & 8")
if(incompatible EQUAL 0)
  return()
endif()
# A new soname is an incompatible change in itself, and the one that is meant to be.
if(out MATCHES "SONAME changed from '([^']*)' to '([^']*)'" AND NOT CMAKE_MATCH_1 STREQUAL CMAKE_MATCH_2)
  message("another ABI number: ${CMAKE_MATCH_1} and ${CMAKE_MATCH_2} are not for the same plugins")
  return()
endif()
message(FATAL_ERROR "${out}\nRaise DIORAMA_SDK_ABI (sdk/docs/abi_policy.md).")
