// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace diorama {

/// A regular expression of a job that turns file names into labels. Searching takes time in
/// proportion to the text, whatever the expression, so a job of somebody else cannot hang here; the
/// price is that back references and looking around are not understood. Else the syntax is Perl's.
class LabelPattern {
 public:
  /// Throws Error(Config) that says what is wrong, without a place.
  explicit LabelPattern(const std::string& pattern);
  ~LabelPattern();
  LabelPattern(LabelPattern&&) noexcept;
  LabelPattern& operator=(LabelPattern&&) noexcept;

  /// `text` (UTF-8) with every match replaced. In `replacement`, `$1` is a group, `${1}` too,
  /// `${name}` a named one, `$&` the match and `$$` a dollar sign.
  std::string replaced(std::string_view text, std::string_view replacement) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
