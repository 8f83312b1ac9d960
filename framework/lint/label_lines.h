// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "framework/lint/dataset_files.h"

/// What the formats with one small label file per picture have in common.
namespace diorama::lint {

inline constexpr const char* kMissing = "nothing is missing";
inline constexpr const char* kRange = "labels lie in the image";
inline constexpr const char* kFields = "every file can be read";

std::vector<std::string> lines_of(const std::string& text);

/// Of a file whose every line ends; throws when the last one does not.
std::vector<std::string> whole_lines_of(const std::string& text);

std::vector<std::string> words_of(const std::string& line);

/// Those from `first` on; throws when a word is no number.
std::vector<double> numbers_of(const std::vector<std::string>& words, std::size_t first);

/// The file with one of the picture endings; empty when there is none.
std::string picture_file(const Dataset& dataset, const std::string& stem);

}  // namespace diorama::lint
