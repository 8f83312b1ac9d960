// SPDX-License-Identifier: Apache-2.0
#include "isa.h"

#include <string>

#include "diorama/error.h"

namespace diorama {
namespace {

bool is_supported(Isa isa) {
  __builtin_cpu_init();
  switch (isa) {
    case Isa::Sse2:
      break;
    case Isa::Sse42:
      return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt");
    case Isa::Avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
             __builtin_cpu_supports("bmi2");
    case Isa::Avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  }
  return true;
}

}  // namespace

Isa isa_by_name(std::string_view name) {
  for (std::size_t i = 0; i < kIsaNames.size(); ++i) {
    if (name != kIsaNames[i]) continue;
    if (is_supported(Isa(i))) return Isa(i);
    throw Error(ErrorKind::Config, "isa: this processor does not have " + std::string(name));
  }
  throw Error(ErrorKind::Config, "isa: unknown instruction set " + std::string(name));
}

const char* best_isa_name() {
  for (const Isa isa : {Isa::Avx512, Isa::Avx2, Isa::Sse42}) {
    if (is_supported(isa)) return kIsaNames[std::size_t(isa)];
  }
  return kIsaNames[std::size_t(Isa::Sse2)];
}

}  // namespace diorama
