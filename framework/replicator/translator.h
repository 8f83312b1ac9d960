// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/config.h"
#include "diorama/params.h"
#include "framework/replicator/dialect.h"

/// What the translations of the dialects share. For framework/replicator only.
namespace diorama::replicator {

/// A constant piece of the native job.
Value native(std::string_view yaml);
Value texts(const std::vector<std::string>& words);
Value numbers(const std::vector<double>& list);
/// "", "_2", "_3" ... for 0, 1, 2 ...
std::string numbered(int number);

class Translator {
 protected:
  Translator(const Value& job, std::string_view builtin_job, const char* builtin_name,
             Diagnostics& diagnostics);

  void set(std::string_view key, Value value) { result_.job.set(key, std::move(value)); }
  /// The file's, else the built-in one as a whole.
  const Value& section(std::string_view key) const;
  void complain_about_unknown(const Value& map, const std::string& path,
                              const std::vector<std::string>& known);
  /// The mapping's keys, read into a struct that holds the reference's fallbacks.
  template <class Block>
  Block block(const Value& map, const std::string& path) {
    Block result;
    if (map.kind == Value::Kind::Null) return result;
    if (map.kind != Value::Kind::Map) {
      diagnostics_.add(map.place, path + ": expected a mapping, found " + map.describe());
      return result;
    }
    ParamReader reader(map, path, diagnostics_);
    result.visit(reader);
    reader.finish();
    return result;
  }
  void check_resolution(const std::vector<double>& resolution, const SourceLocation& place,
                        const std::string& path);
  Value object_entry(const Value& source, const char* type, const std::string& name,
                     const std::string& under, int count, double gravity_disabled_chance);
  /// An entry of `writers`; the kwargs become its own keys.
  Value writer_entry(const Value& type, const Value* kwargs, const SourceLocation& place,
                     const std::string& kwargs_path);
  /// Sets `writers` and `output`: all folders are relative to the current one.
  void set_writers(Value list);

  Diagnostics& diagnostics_;
  const Value* given_ = nullptr;
  ReplicatorTranslation result_;

 private:
  Value defaults_;
  Value nothing_;
  std::map<std::string, int> writer_uses_;
};

}  // namespace diorama::replicator
