// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/frame.h"
#include "diorama/params.h"

namespace diorama {

/// The parameter of writers that write any channel, those of other plugins' annotators too.
struct ChannelList {
  std::vector<std::string> names;

  void visit(ParamVisitor& v);
  /// Throws Error(Config) for a name that no file can have, that comes twice, that stands for an
  /// annotation, or that is one of `taken`: names of what the writer makes in its own way.
  void check(std::span<const std::string_view> taken = {}) const;
  void add_to(NameSet& needs) const { needs.insert(names.begin(), names.end()); }
};

}  // namespace diorama
