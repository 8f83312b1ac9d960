// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdlib.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace diorama::test {

/// For what is read by name: inputs are written to one file over and over.
class InputFile {
 public:
  /// `ending`: of the file's name, with its dot.
  explicit InputFile(const std::string& ending) : path_("/tmp/fuzzer_XXXXXX" + ending) {
    const int descriptor = ::mkstemps(path_.data(), int(ending.size()));
    if (descriptor < 0) std::abort();  // nothing would be tested
    ::close(descriptor);
  }
  ~InputFile() { ::unlink(path_.c_str()); }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& write(const std::uint8_t* data, std::size_t size) const {
    std::FILE* const file = std::fopen(path_.c_str(), "wb");
    if (!file) std::abort();
    std::fwrite(data, 1, size, file);
    std::fclose(file);
    return path_;
  }

 private:
  std::string path_;
};

}  // namespace diorama::test
