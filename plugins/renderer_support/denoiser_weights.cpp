// SPDX-License-Identifier: Apache-2.0
#include "denoiser_weights.h"

#include <cstddef>
#include <span>

// The file lies in the library as it is: parsed as a list of numbers it would take the compiler
// minutes.
asm(".section .rodata\n"
    ".balign 16\n"
    ".global diorama_denoiser_weights\n"
    ".hidden diorama_denoiser_weights\n"
    ".type diorama_denoiser_weights, @object\n"
    "diorama_denoiser_weights:\n"
    ".incbin \"" DIORAMA_DENOISER_WEIGHTS
    "\"\n"
    ".size diorama_denoiser_weights, . - diorama_denoiser_weights\n"
    ".global diorama_denoiser_weights_end\n"
    ".hidden diorama_denoiser_weights_end\n"
    "diorama_denoiser_weights_end:\n"
    ".byte 0\n"
    ".previous\n");

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
