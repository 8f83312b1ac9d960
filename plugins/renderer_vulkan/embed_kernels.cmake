# cmake -D OUTPUT=kernels.h -D "KERNELS=a.spv|b.spv" -P embed_kernels.cmake
# Writes compiled kernels as arrays of words, named after their files: kAB for a_b.spv.
string(REPLACE "|" ";" files "${KERNELS}")
set(text "// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace diorama::kernels {
")
foreach(file IN LISTS files)
  get_filename_component(name ${file} NAME_WE)
  string(REPLACE "_" ";" parts "${name}")
  set(name)
  foreach(part IN LISTS parts)
    string(SUBSTRING ${part} 0 1 first)
    string(SUBSTRING ${part} 1 -1 rest)
    string(TOUPPER ${first} first)
    string(APPEND name ${first}${rest})
  endforeach()
  file(READ ${file} hex HEX)
  string(REGEX REPLACE "(..)(..)(..)(..)" "0x\\4\\3\\2\\1," words "${hex}")
  string(APPEND text "inline constexpr std::uint32_t k${name}[] = {${words}};\n")
endforeach()
string(APPEND text "}  // namespace diorama::kernels\n")
file(WRITE ${OUTPUT} "${text}")
