// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace diorama {

/// Width of the terminal behind a descriptor; 80 where there is none, or it does not say.
int terminal_columns(int descriptor);

/// Breaks lines longer than `columns` at spaces. What goes on begins where the last column of the
/// line began (behind two or more spaces) that leaves half of the width.
std::string wrapped(std::string_view text, int columns);

}  // namespace diorama
