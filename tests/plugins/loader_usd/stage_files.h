// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loader_usd/usd/stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::usd {

/// A stage made of a root layer, with other layers beside it.
class Files {
 public:
  void add(const std::string& name, const std::string& text) {
    folder_.write(name, "#usda 1.0\n" + text);
  }
  Stage open(const std::string& text) {
    return Stage(folder_.write("root.usda", "#usda 1.0\n" + text));
  }

 private:
  test::TemporaryFolder folder_;
};

inline double x_of(Stage& stage, const char* path, const char* attribute = "x") {
  const Prim* prim = stage.find(path);
  INFO(path);
  REQUIRE(prim);
  return stage.value(*prim, attribute).as_number().value_or(-1.0);
}

inline Strings children_of(Stage& stage, const char* path) {
  Strings names;
  for (const Prim* child : stage.visible_children(*stage.find(path))) {
    names.push_back(child->path.substr(child->path.rfind('/') + 1));
  }
  return names;
}

}  // namespace diorama::usd
