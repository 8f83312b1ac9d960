// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Small label files of lines, words and numbers. Line ends of any system; functions throw
/// std::runtime_error that says what is wrong.
namespace diorama {

/// Without line ends; a last line that does not end counts too.
std::vector<std::string> text_lines(std::string_view text);
/// Split at blanks.
std::vector<std::string> text_words(std::string_view line);
/// FNV-1a: names by the million are told apart by their digests.
std::uint64_t text_hash(std::string_view text);
/// The whole word, finite.
double number_of(std::string_view word);
int integer_of(std::string_view word);
/// Those from `first` on.
std::vector<double> numbers_from(const std::vector<std::string>& words, std::size_t first);

}  // namespace diorama
