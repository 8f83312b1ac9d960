// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <streambuf>

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

}  // namespace diorama
