# Compares two builds of the SDK's library with libabigail. What plugins could notice is an error as
# long as both have the same soname, that is, the same ABI number. Types are compared where both have
# debug information, exported functions always.
#   cmake -DABIDIFF=abidiff -DOLD=libdiorama_sdk.so.1 -DNEW=libdiorama_sdk.so -P abi_diff.cmake
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND ${ABIDIFF} ${OLD} ${NEW} RESULT_VARIABLE code OUTPUT_VARIABLE out
                ERROR_VARIABLE out)
if(out MATCHES "SONAME changed from")
  message("another ABI number: nothing to compare")
  return()
endif()
# Bits of the exit code: 1 and 2 usage and other errors, 4 any change, 8 an incompatible one.
math(EXPR fatal "${code} & 11")
if(NOT fatal EQUAL 0)
  message(FATAL_ERROR "${out}\nRaise DIORAMA_SDK_ABI (sdk/docs/abi_policy.md).")
endif()
