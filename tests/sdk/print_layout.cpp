// SPDX-License-Identifier: Apache-2.0
// Prints the digest of the sizes of all boundary types, for abi_guard.cmake.
#include <cstdio>

#include "diorama/abi_layout.h"

int main() { std::printf("%016llx\n", static_cast<unsigned long long>(diorama::abi::kLayout)); }
