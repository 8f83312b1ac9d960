// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/abi.h"
#include "diorama/error.h"

namespace diorama {

/// Where a value stands. `line` and `column` count from 1; 0 means "not in a file".
struct SourceLocation {
  std::string file;
  int line = 0;
  int column = 0;

  DIORAMA_SDK_API std::string text() const;  ///< "configs/dining.yaml:31:7", or the file alone.
};

/// One value of a job file with its place: null, a scalar, a list or a map. Scalars keep their
/// text; the reader decides what it may be, so `012` or `1e3` are never mangled on the way.
struct DIORAMA_SDK_API Value {
  enum class Kind : std::uint8_t { Null, Scalar, List, Map };

  Kind kind = Kind::Null;
  std::string scalar;       ///< Kind::Scalar.
  bool is_quoted = false;   ///< A quoted scalar is text whatever it looks like.
  std::vector<Value> list;  ///< Kind::List.
  std::vector<std::pair<std::string, Value>> map;  ///< Kind::Map, in file order, keys unique.
  SourceLocation place;
  SourceLocation key_place;  ///< Of the key, when the value stands in a map.

  // Out of line, where the list and the map of values are complete types.
  Value();
  ~Value();
  Value(const Value&);
  Value(Value&&) noexcept;
  Value& operator=(const Value&);
  Value& operator=(Value&&) noexcept;

  const Value* find(std::string_view key) const;  ///< Null when absent or when this is no map.
  Value* find(std::string_view key);
  /// Sets or replaces an entry of a map (a null value becomes a map first).
  Value& set(std::string_view key, Value value);
  void erase(std::string_view key);

  static Value text(std::string_view text);  ///< A quoted scalar.
  static Value number(double value);
  static Value integer(std::int64_t value);
  static Value boolean(bool value);
  static Value make_map();
  static Value make_list();

  /// What was found, for messages: `"lots"`, `a list`, `nothing`.
  std::string describe() const;
};

/// Collects the diagnostics of one document, so that all of them are reported in one go.
class DIORAMA_SDK_API Diagnostics {
 public:
  void add(const SourceLocation& place, std::string_view message);
  bool is_empty() const { return messages_.empty(); }
  const std::vector<std::string>& messages() const { return messages_; }
  /// Throws Error(Config) with one complaint per line unless there are none.
  void raise() const;

 private:
  std::vector<std::string> messages_;
};

/// The name of `names` nearest to `name` by edit distance, or empty when none is near enough to be
/// meant.
DIORAMA_SDK_API std::string nearest_name(std::string_view name,
                                         const std::vector<std::string>& names);

/// Interval for parameters; read from `[lo, hi]` or a single number. lo <= hi is checked.
struct Range {
  double lo = 0.0;
  double hi = 0.0;
  friend bool operator==(const Range&, const Range&) = default;
};

}  // namespace diorama
