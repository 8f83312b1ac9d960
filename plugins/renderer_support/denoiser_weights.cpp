// SPDX-License-Identifier: Apache-2.0
#include "denoiser_weights.h"

#include <cstddef>
#include <span>

// The file lies in the library as it is: parsed as a list of numbers it would take the compiler
// minutes.
asm(R"(.section .rodata
.balign 16
.global diorama_denoiser_weights
.hidden diorama_denoiser_weights
.type diorama_denoiser_weights, @object
diorama_denoiser_weights:
.incbin ")" DIORAMA_DENOISER_WEIGHTS R"("
.size diorama_denoiser_weights, . - diorama_denoiser_weights
.global diorama_denoiser_weights_end
.hidden diorama_denoiser_weights_end
diorama_denoiser_weights_end:
.byte 0
.previous
)");

extern "C" {
extern const std::byte diorama_denoiser_weights[];
extern const std::byte diorama_denoiser_weights_end[];
}

namespace diorama {

const DenoiserNetwork& denoiser_network() {
  static const DenoiserNetwork network(
      std::span(diorama_denoiser_weights, diorama_denoiser_weights_end));
  return network;
}

}  // namespace diorama
