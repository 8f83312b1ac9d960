# What abi_diff.cmake makes of the answers of abidiff, which a script gives here.
#   cmake -DSCRIPT=abi_diff.cmake -DWORK=folder -P abi_diff_test.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK})

function(expect verdict code text)
  file(WRITE ${WORK}/abidiff "#!/bin/sh\ncat <<'end'\n${text}\nend\nexit ${code}\n")
  file(CHMOD ${WORK}/abidiff PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  execute_process(COMMAND ${CMAKE_COMMAND} -DABIDIFF=${WORK}/abidiff -DOLD=a -DNEW=b -P ${SCRIPT}
                  RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE out)
  set(found refuses)
  if(result EQUAL 0)
    set(found accepts)
  endif()
  if(NOT found STREQUAL verdict)
    message(FATAL_ERROR "exit code ${code}: ${found}, expected: ${verdict}\n${text}\n${out}")
  endif()
endfunction()

set(counts "Functions changes summary: 1 Removed, 0 Changed, 0 Added function")
set(raised "SONAME changed from 'libdiorama_sdk.so.1' to 'libdiorama_sdk.so.2'")
expect(accepts 0 "")
expect(accepts 4 "Functions changes summary: 0 Removed, 0 Changed, 1 Added function")
expect(refuses 12 "${counts}")
expect(refuses 8 "${counts}")
expect(accepts 12 "${raised}\n${counts}")
expect(refuses 12 "SONAME changed from 'libdiorama_sdk.so.1' to 'libdiorama_sdk.so.1'\n${counts}")
# A text that a symbol may have, and nothing about the library's name.
expect(refuses 12 "${counts}\n1 Removed function: 'note(\"SONAME changed from\")'")
expect(refuses 1 "abidiff: a is not an ELF file")
expect(refuses 3 "${raised}")
