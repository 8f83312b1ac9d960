// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <streambuf>
#include <string_view>

namespace diorama {

/// std::cout for as long as this lives. It goes on to stdio, so that what else is printed keeps its
/// order, and what could not be written is not forgotten.
class StandardOutput final : private std::streambuf {
 public:
  StandardOutput();
  ~StandardOutput() override;
  StandardOutput(const StandardOutput&) = delete;
  StandardOutput& operator=(const StandardOutput&) = delete;

  /// Writes what still waits. Throws Error(Output) when that, or anything before, could not be
  /// written.
  void finish();

 private:
  int_type overflow(int_type character) override;
  std::streamsize xsputn(const char* text, std::streamsize size) override;
  int sync() override;
  void note_failure();

  std::streambuf* former_;
  std::atomic<int> failure_ = 0;  ///< errno of the first failure.
};

/// Text for people, to std::cout: nothing in it steers a terminal, and its lines fit the width of
/// the terminal where there is one. What programs read, and commands to copy, go to std::cout as
/// they are.
void print_text(std::string_view text);

}  // namespace diorama
