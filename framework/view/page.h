// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

/// The page of the browser as it was built from web/ (see web/README.md), part of the program.
namespace diorama {

std::string_view page_html();
std::string_view page_script();
std::string_view page_style();
std::string_view page_icon();

}  // namespace diorama
