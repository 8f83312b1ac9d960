// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "diorama/abi.h"

namespace diorama {

/// What went wrong, as far as a caller can act on it. The program's exit code follows from it
/// (framework/docs/exit_codes.md).
enum class ErrorKind : std::uint8_t {
  Internal,  ///< A bug of ours or of a plugin.
  Usage,     ///< Command line.
  Config,    ///< A job file or a parameter.
  Plugin,    ///< A plugin is missing, refused or broken.
  Asset,     ///< An input file is missing or bad.
  Output,    ///< The dataset cannot be written.
};

/// The one exception type that crosses library borders. The text says where, what was found and
/// what would be right: `configs/a.yaml:31:12: renderer.samples: expected an integer in [1, 65536],
/// found "lots"`. Plugins may throw it from any call; the host puts the component's name in front.
class DIORAMA_SDK_API Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& text);
  ~Error() override;
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

}  // namespace diorama
