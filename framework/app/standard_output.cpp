// SPDX-License-Identifier: Apache-2.0
#include "framework/app/standard_output.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <iostream>
#include <string>
#include <system_error>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "framework/host/terminal.h"

namespace diorama {

StandardOutput::StandardOutput() : former_(std::cout.rdbuf(this)) {}

StandardOutput::~StandardOutput() { std::cout.rdbuf(former_); }

void StandardOutput::finish() {
  sync();
  if (failure_ == 0 && std::ferror(stdout) == 0) return;
  throw Error(ErrorKind::Output,
              "cannot write to standard output" +
                  (failure_ != 0 ? ": " + std::system_category().message(failure_) : ""));
}

StandardOutput::int_type StandardOutput::overflow(int_type character) {
  if (traits_type::eq_int_type(character, traits_type::eof())) return 0;
  const char text = traits_type::to_char_type(character);
  return xsputn(&text, 1) == 1 ? character : traits_type::eof();
}

std::streamsize StandardOutput::xsputn(const char* text, std::streamsize size) {
  const std::size_t written = std::fwrite(text, 1, std::size_t(size), stdout);
  if (std::streamsize(written) != size) note_failure();
  return std::streamsize(written);
}

int StandardOutput::sync() {
  if (std::fflush(stdout) == 0) return 0;
  note_failure();
  return -1;
}

void StandardOutput::note_failure() {
  int none = 0;
  failure_.compare_exchange_strong(none, errno);
}

void print_text(std::string_view text) {
  const std::string clean = printable(text);
  const bool is_terminal = isatty(STDOUT_FILENO) == 1;
  std::cout << (is_terminal ? wrapped(clean, terminal_columns(STDOUT_FILENO)) : clean);
}

}  // namespace diorama
