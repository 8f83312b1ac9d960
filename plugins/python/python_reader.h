// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens the folders that a class derived from diorama.plugins.Reader knows, in any file of the
/// user's folders. Without such a file the interpreter is not started.
class PythonReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  PythonReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override { return {"*.*", "*/*"}; }
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  Host& host_;
};

}  // namespace diorama
