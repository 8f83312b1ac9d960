# What compiled plugins depend on in the public headers: their text without comments and spaces.
cmake_minimum_required(VERSION 3.25)

# diorama_headers_digest(VARIABLE FOLDER): one digest of all headers of the folder, 16 hexadecimal
# digits, and in VARIABLE_LINES "name digest" of each, a line per header.
function(diorama_headers_digest variable folder)
  file(GLOB headers RELATIVE ${folder} ${folder}/*.h)
  list(REMOVE_ITEM headers headers_digest.h) # which holds the result
  list(SORT headers)
  set(lines "")
  foreach(header IN LISTS headers)
    file(READ ${folder}/${header} text)
    string(REGEX REPLACE "//[^\n]*" "" text "${text}")
    string(REGEX REPLACE "/[*]([^*]|[*]+[^*/])*[*]+/" "" text "${text}")
    string(REGEX REPLACE "[ \t\r\n]+" "" text "${text}")
    string(SHA256 hash "${text}")
    string(SUBSTRING ${hash} 0 16 hash)
    string(APPEND lines "${header} ${hash}\n")
  endforeach()
  string(SHA256 digest "${lines}")
  string(SUBSTRING ${digest} 0 16 digest)
  set(${variable} ${digest} PARENT_SCOPE)
  set(${variable}_LINES "${lines}" PARENT_SCOPE)
endfunction()

# As a script, writes the header that carries the digest; its date stays when nothing changed.
#   cmake -DFOLDER=sdk/include/diorama -DOUT=build/.../headers_digest.h -P HeadersDigest.cmake
if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  diorama_headers_digest(digest ${FOLDER})
  file(
    CONFIGURE
    OUTPUT ${OUT}
    CONTENT
      "// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Digest of the public headers without comments and spaces: plugin and program must have the same
/// (abi_policy.md). Written by the build.
#define DIORAMA_HEADERS_DIGEST 0x${digest}ull
")
endif()
