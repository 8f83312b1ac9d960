// SPDX-License-Identifier: Apache-2.0
#include "framework/host/terminal.h"

#include <sys/ioctl.h>

#include <algorithm>

namespace diorama {
namespace {

constexpr int kUsualColumns = 80;
constexpr int kLeastColumns = 20;

/// Where the last column of a line begins that begins in the first half of the width.
std::size_t column_start(std::string_view line, std::size_t columns) {
  const std::size_t gap = line.rfind("  ", columns / 2);
  const std::size_t start = gap == std::string_view::npos ? 0 : gap + 2;
  return std::min(line.find_first_not_of(' ', start), line.size());
}

void append_wrapped(std::string_view line, std::size_t columns, std::string& out) {
  const std::size_t start = column_start(line, columns);
  const std::size_t indent = start <= columns / 2 ? start : columns / 8;
  std::size_t margin = 0;
  while (margin + line.size() > columns) {
    const std::size_t room = columns - margin;
    // Not within what stands before the text.
    const std::size_t first = margin == 0 ? std::min(start, line.size()) : 0;
    std::size_t cut = line.rfind(' ', room);
    if (cut == std::string_view::npos || cut <= first) cut = line.find(' ', std::max(room, first));
    if (cut == std::string_view::npos) break;
    const std::size_t end = line.find_last_not_of(' ', cut);
    out += std::string(margin, ' ') + std::string(line.substr(0, end + 1)) + "\n";
    line.remove_prefix(std::min(line.find_first_not_of(' ', cut), line.size()));
    margin = indent;
  }
  out += std::string(line.empty() ? 0 : margin, ' ') + std::string(line);
}

}  // namespace

int terminal_columns(int descriptor) {
  winsize size{};
  if (ioctl(descriptor, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kUsualColumns;
  return std::max(int(size.ws_col), kLeastColumns);
}

std::string wrapped(std::string_view text, int columns) {
  std::string out;
  for (std::size_t start = 0; start < text.size();) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    append_wrapped(text.substr(start, end - start), std::size_t(std::max(columns, kLeastColumns)),
                   out);
    if (end < text.size()) out += '\n';
    start = end + 1;
  }
  return out;
}

}  // namespace diorama
