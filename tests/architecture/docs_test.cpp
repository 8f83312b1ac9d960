// SPDX-License-Identifier: Apache-2.0
// The pages for plugin authors quote what is compiled and speak of what is in the headers.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/catch.h"

namespace fs = std::filesystem;

namespace {

const fs::path kRoot = DIORAMA_SOURCE_DIR;

std::string read_text(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// The lines between the two "//! [mark]" of a file, or all without a mark; moved to the left edge.
std::vector<std::string> quotable(const fs::path& file, const std::string& mark) {
  std::vector<std::string> lines = lines_of(read_text(file));
  if (!mark.empty()) {
    const auto is_mark = [&](const std::string& line) {
      return line.find("//! [" + mark + "]") != std::string::npos;
    };
    const auto first = std::find_if(lines.begin(), lines.end(), is_mark);
    if (first == lines.end()) return {"no such mark"};
    lines = std::vector<std::string>(first + 1, std::find_if(first + 1, lines.end(), is_mark));
  }
  std::size_t indent = 100;
  for (const std::string& line : lines) {
    if (!line.empty()) indent = std::min(indent, line.find_first_not_of(' '));
  }
  for (std::string& line : lines) line.erase(0, line.empty() ? 0 : indent);
  return lines;
}

std::string all_headers() {
  std::string text;
  for (const auto& entry : fs::directory_iterator(kRoot / "sdk/include/diorama")) {
    text += read_text(entry.path());
  }
  return text;
}

/// The cells of the Markdown table rows of a page, head and ruler left out.
std::vector<std::vector<std::string>> table_rows(const std::string& page, const std::string& head) {
  std::vector<std::vector<std::string>> rows;
  bool is_inside = false;
  for (const std::string& line : lines_of(page)) {
    if (!line.starts_with("|")) is_inside = false;
    if (is_inside && !line.starts_with("|---")) {
      std::vector<std::string> cells;
      std::istringstream stream(line.substr(1));
      for (std::string cell; std::getline(stream, cell, '|');) cells.push_back(cell);
      rows.push_back(cells);
    }
    if (line.starts_with(head)) is_inside = true;
  }
  return rows;
}

std::vector<std::string> code_words(const std::string& text) {
  static const std::regex kCode("`([^`]+)`");
  std::vector<std::string> words;
  for (std::sregex_iterator it(text.begin(), text.end(), kCode), end; it != end; ++it) {
    words.push_back((*it)[1]);
  }
  return words;
}

}  // namespace

TEST_CASE("Quoted code is the code that is compiled", "[docs]") {
  static const std::regex kQuote(R"(^<!-- (\S+)(?: \[(\w+)\])? -->$)");
  int quotes = 0;
  for (const auto& entry : fs::directory_iterator(kRoot / "sdk/docs")) {
    const std::vector<std::string> lines = lines_of(read_text(entry.path()));
    for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
      std::smatch found;
      if (!std::regex_match(lines[i], found, kQuote)) continue;
      INFO(entry.path().filename().string() << ": " << lines[i]);
      REQUIRE(lines[i + 1].starts_with("```"));
      const auto begin = lines.begin() + std::ptrdiff_t(i) + 2;
      const std::vector<std::string> quoted(begin, std::find(begin, lines.end(), "```"));
      CHECK(quoted == quotable(kRoot / found[1].str(), found[2]));
      ++quotes;
    }
  }
  CHECK(quotes >= 6);
}

TEST_CASE("The glossary names what the headers have", "[docs]") {
  const std::string headers = all_headers();
  const auto rows = table_rows(read_text(kRoot / "sdk/docs/glossary.md"), "| word |");
  CHECK(rows.size() > 30);
  for (const std::vector<std::string>& row : rows) {
    REQUIRE(row.size() == 4);
    for (std::string name : code_words(row[2])) {
      INFO(row[0] << " names " << name);
      // Of Class::member both must be there.
      for (std::size_t at = name.find("::"); at != name.npos; at = name.find("::")) {
        CHECK(headers.find(name.substr(0, at)) != headers.npos);
        name.erase(0, at + 2);
      }
      CHECK(std::regex_search(headers, std::regex("\\b" + name + "\\b")));
    }
  }
}

TEST_CASE("The page of conventions has every channel", "[docs]") {
  std::set<std::string> declared, written;
  const std::string header = read_text(kRoot / "sdk/include/diorama/frame.h");
  static const std::regex kChannel(R"re(inline constexpr Channel<[^>]+> \w+\{"(\w+)"\})re");
  for (std::sregex_iterator it(header.begin(), header.end(), kChannel), end; it != end; ++it) {
    declared.insert((*it)[1]);
  }
  for (const auto& row : table_rows(read_text(kRoot / "sdk/docs/conventions.md"), "| channel |")) {
    for (const std::string& name : code_words(row[0])) written.insert(name);
  }
  CHECK(declared.size() >= 12);
  CHECK(declared == written);
}
