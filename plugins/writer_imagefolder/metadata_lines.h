// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "reader_support/stored_files.h"

namespace diorama {

/// Where a row stands in metadata.jsonl or metadata.csv.
struct RowSpan {
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
};

/// Goes through a file row by row, one in memory at a time: lines, and in .csv what quotes hold
/// together. Empty lines are left out. Throws std::runtime_error: cannot be read, a row above 64
/// MiB.
using RowVisitor = std::function<void(RowSpan span, const std::string& row)>;
void visit_rows(const std::filesystem::path& file, bool is_csv, const RowVisitor& visit);

std::string read_row(const std::filesystem::path& file, RowSpan span);

/// Fields of a row of CSV, quotes taken off.
std::vector<std::string> csv_fields(std::string_view row);

/// A row as an object by the names of the columns; numbers and JSON lists become such.
Json json_of_csv(const std::vector<std::string>& columns, std::string_view row);

}  // namespace diorama
