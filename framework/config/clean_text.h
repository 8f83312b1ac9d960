// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

/// Text from files of others, made fit for datasets, terminals and logs.
namespace diorama {

/// Length of the UTF-8 sequence at the front of a text, or 0 when there is none: overlong forms,
/// surrogates and what lies beyond U+10FFFF are no UTF-8.
std::size_t utf8_length(std::string_view text);

/// True for UTF-8 without control characters: what names and labels in datasets are.
bool is_clean_name(std::string_view text);

/// Every byte that is_clean_name() does not allow becomes "\xE9": names that differ go on to
/// differ, which they would not with one replacement for all bytes.
std::string clean_name(std::string_view text);

/// For people: also spells out what turns the direction of writing, and leaves line breaks and
/// tabs.
std::string printable(std::string_view text);

}  // namespace diorama
