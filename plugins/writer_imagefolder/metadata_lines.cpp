// SPDX-License-Identifier: Apache-2.0
#include "writer_imagefolder/metadata_lines.h"

#include <fstream>
#include <stdexcept>

#include "reader_support/stored_files.h"

namespace diorama {
namespace {

constexpr std::size_t kMostBytes = std::size_t(64) << 20;

/// A field as what it looks like.
Json value_of(const std::string& field) {
  if (field.starts_with('[') || field.starts_with('{')) {
    try {
      return parse_stored_json(field);
    } catch (const std::exception&) {
      return field;
    }
  }
  return field;
}

}  // namespace

void visit_rows(const std::filesystem::path& file, bool is_csv, const RowVisitor& visit) {
  std::ifstream in = open_stored(file);
  if (!in) throw std::runtime_error("cannot be read");
  std::vector<char> block(std::size_t(1) << 20);
  std::string row;
  std::uint64_t begin = 0;
  std::uint64_t at = 0;
  bool is_quoted = false;
  const auto end_row = [&] {
    const RowSpan span{begin, std::uint32_t(row.size())};
    if (row.ends_with('\r')) row.pop_back();
    if (row.find_first_not_of(" \t") != std::string::npos) visit(span, row);
    row.clear();
  };
  while (in) {
    in.read(block.data(), std::streamsize(block.size()));
    for (std::streamsize i = 0; i < in.gcount(); ++i, ++at) {
      const char c = block[std::size_t(i)];
      if (c == '\n' && !is_quoted) {
        end_row();
        begin = at + 1;
        continue;
      }
      if (is_csv && c == '"') is_quoted = !is_quoted;
      if (row.size() >= kMostBytes) throw std::runtime_error("has a row above 64 MiB");
      row.push_back(c);
    }
  }
  end_row();
}

std::string read_row(const std::filesystem::path& file, RowSpan span) {
  std::ifstream in = open_stored(file);
  in.seekg(std::streamoff(span.offset));
  std::string row(span.length, '\0');
  in.read(row.data(), std::streamsize(row.size()));
  if (!in) throw std::runtime_error("has become shorter");
  if (row.ends_with('\r')) row.pop_back();
  return row;
}

std::vector<std::string> csv_fields(std::string_view row) {
  std::vector<std::string> fields(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    const char c = row[i];
    if (c == '"') {
      if (is_quoted && i + 1 < row.size() && row[i + 1] == '"') {
        fields.back().push_back(c);
        ++i;
      } else {
        is_quoted = !is_quoted;
      }
    } else if (c == ',' && !is_quoted) {
      fields.emplace_back();
    } else {
      fields.back().push_back(c);
    }
  }
  if (is_quoted) throw std::runtime_error("a quote does not end");
  return fields;
}

Json json_of_csv(const std::vector<std::string>& columns, std::string_view row) {
  const std::vector<std::string> fields = csv_fields(row);
  if (fields.size() != columns.size()) {
    throw std::runtime_error("a row has " + std::to_string(fields.size()) + " fields, the first " +
                             std::to_string(columns.size()));
  }
  Json json = Json::object();
  for (std::size_t i = 0; i < fields.size(); ++i) json[columns[i]] = value_of(fields[i]);
  return json;
}

}  // namespace diorama
