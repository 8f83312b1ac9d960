// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

/// Makes sure that descriptors 0 to 2 are taken: a file that is opened later could get the number
/// of one that was closed at start, and what is printed would land in it. Reading and printing
/// through a descriptor that was closed goes on to fail. Call before anything is opened; child
/// processes inherit the result.
void claim_standard_streams();

}  // namespace diorama
