// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"
#include "python/script.h"

namespace diorama {

/// Opens folders by the class that its parameters name; by themselves, those that a class derived
/// from diorama.plugins.Reader knows, in any file of the user's folders. Without such a file the
/// interpreter is not started.
class PythonReader final : public Reader {
 public:
  static constexpr const char* kScriptKind = "reader";
  using Params = ScriptParams;
  PythonReader(const Params& params, Host& host);

  std::vector<std::string> patterns() const override { return {"*.*", "*/*"}; }
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  Host& host_;
  std::optional<Script> script_;  ///< Of the class that was named.
};

}  // namespace diorama
