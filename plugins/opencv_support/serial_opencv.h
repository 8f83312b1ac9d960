// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// Whatever calls OpenCV calls this before. OpenCV then works in the calling thread alone, as the
/// host shares out threads itself and results are the same for any number of them, and prints
/// nothing. Several threads may call it.
void use_serial_opencv();

}  // namespace diorama
