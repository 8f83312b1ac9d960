// SPDX-License-Identifier: Apache-2.0
#include "framework/config/yaml_config.h"

#include <yaml-cpp/depthguard.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

#include "framework/config/clean_text.h"
#include "framework/config/yaml_faults.h"

namespace diorama {
namespace {

constexpr std::size_t kMaxDepth = 100;
constexpr std::size_t kMaxValues = 500'000;
constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t(64) << 20;
constexpr std::string_view kCoreTag = "tag:yaml.org,2002:";

[[noreturn]] void refuse(const SourceLocation& place, const std::string& message) {
  throw Error(ErrorKind::Config, place.text() + ": " + message);
}

std::size_t count_values(const Value& value) {
  std::size_t count = 1;
  for (const Value& item : value.list) count += count_values(item);
  for (const auto& [key, item] : value.map) count += count_values(item);
  return count;
}

/// Levels of nesting; a scalar has none.
std::size_t depth_of(const Value& value) {
  std::size_t depth = 0;
  for (const Value& item : value.list) depth = std::max(depth, 1 + depth_of(item));
  for (const auto& [key, item] : value.map) depth = std::max(depth, 1 + depth_of(item));
  return depth;
}

/// Builds a Value tree from the parser's events. Recursion lives in explicit stacks, so that
/// the depth of a document cannot exhaust ours.
class TreeBuilder final : public YAML::EventHandler {
 public:
  TreeBuilder(std::string_view text, std::string file) : text_(text), file_(std::move(file)) {
    line_starts_.push_back(0);
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '\n') line_starts_.push_back(i + 1);
    }
  }
  Value take() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Value value;
    value.place = place(mark);
    finish(std::move(value), anchor);
  }

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end()) {
      refuse(place(mark), "this alias stands inside of the value that it refers to");
    }
    count(count_values(found->second), place(mark));
    check_depth(levels_.size() + depth_of(found->second), place(mark));
    Value copy = found->second;
    copy.place = place(mark);
    finish(std::move(copy), YAML::NullAnchor);
  }

  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& text) override {
    check_tag(tag, place(mark), {"str", "int", "float", "bool", "null"});
    check_quotes(mark);
    if (text.find('\0') != std::string::npos) {
      refuse(place(mark), "this text holds the character NUL, which no name and no path may");
    }
    Value value;
    value.kind = Value::Kind::Scalar;
    value.place = place(mark);
    value.scalar = text;
    value.is_quoted = tag == "!" || tag == std::string(kCoreTag) + "str";
    const bool is_null =
        text.empty() || text == "~" || text == "null" || text == "Null" || text == "NULL";
    if (is_null && !value.is_quoted) {
      value.kind = Value::Kind::Null;
      value.scalar.clear();
    }
    finish(std::move(value), anchor);
  }

  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    check_tag(tag, place(mark), {"seq"});
    open(Value::Kind::List, mark, anchor);
  }
  void OnSequenceEnd() override { close(); }

  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    check_tag(tag, place(mark), {"map"});
    open(Value::Kind::Map, mark, anchor);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Level {
    Value value;
    YAML::anchor_t anchor = YAML::NullAnchor;
    bool has_key = false;
    std::string key;
    SourceLocation key_place;
    std::set<std::string, std::less<>> keys;
    std::vector<Value> merged;  // values of "<<"
  };

  SourceLocation place(const YAML::Mark& mark) const {
    return {file_, mark.line + 1, mark.column + 1};
  }

  void check_tag(const std::string& tag, const SourceLocation& where,
                 std::initializer_list<const char*> known) const {
    if (tag.empty() || tag == "?" || tag == "!") return;
    for (const char* name : known) {
      if (tag == std::string(kCoreTag) + name) return;
    }
    refuse(where, "tag '" + tag + "' is not known here; only YAML's own (!!str, !!int ...) are");
  }

  /// yaml-cpp takes the end of the file for the end of a quoted text.
  void check_quotes(const YAML::Mark& mark) const {
    if (std::size_t(mark.line) >= line_starts_.size()) return;
    std::size_t at = line_starts_[std::size_t(mark.line)] + std::size_t(mark.column);
    if (at >= text_.size() || (text_[at] != '"' && text_[at] != '\'')) return;
    const char quote = text_[at];
    while (++at < text_.size()) {
      if (quote == '"' && text_[at] == '\\') {
        ++at;
      } else if (text_[at] == quote) {
        if (quote == '"' || at + 1 >= text_.size() || text_[at + 1] != '\'') return;
        ++at;
      }
    }
    refuse(place(mark), "YAML syntax error: the quotes that open here are never closed");
  }

  void count(std::size_t values, const SourceLocation& where) {
    count_ += values;
    if (count_ > kMaxValues) {
      refuse(where, "the document expands to more than " + std::to_string(kMaxValues) +
                        " values; use fewer aliases");
    }
  }

  static void check_depth(std::size_t depth, const SourceLocation& where) {
    if (depth <= kMaxDepth) return;
    refuse(where, "nested deeper than " + std::to_string(kMaxDepth) + " levels");
  }

  void open(Value::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor) {
    check_depth(levels_.size() + 1, place(mark));
    if (!levels_.empty() && levels_.back().value.kind == Value::Kind::Map &&
        !levels_.back().has_key) {
      if (const auto fault = unclosed_bracket(text_)) {
        refuse({file_, fault->line, fault->column}, "YAML syntax error: " + fault->message);
      }
      refuse(place(mark), "a key must be a text, found " +
                              std::string(kind == Value::Kind::Map ? "a mapping" : "a list"));
    }
    Level level;
    level.value.kind = kind;
    level.value.place = place(mark);
    level.anchor = anchor;
    levels_.push_back(std::move(level));
  }

  void close() {
    Level level = std::move(levels_.back());
    levels_.pop_back();
    for (const Value& source : level.merged) merge_into(level, source);
    finish(std::move(level.value), level.anchor);
  }

  /// Keys written in the map itself win over merged ones, earlier merged ones over later.
  void merge_into(Level& level, const Value& source) {
    if (source.kind == Value::Kind::List) {
      for (const Value& item : source.list) merge_into(level, item);
      return;
    }
    if (source.kind != Value::Kind::Map) {
      refuse(source.place, "'<<' merges mappings, found " + source.describe());
    }
    for (const auto& [key, value] : source.map) {
      if (level.keys.insert(key).second) level.value.map.emplace_back(key, value);
    }
  }

  void finish(Value value, YAML::anchor_t anchor) {
    if (anchor != YAML::NullAnchor) anchors_[anchor] = value;
    count(1, value.place);
    if (levels_.empty()) {
      root_ = std::move(value);
      return;
    }
    Level& level = levels_.back();
    if (level.value.kind == Value::Kind::List) {
      level.value.list.push_back(std::move(value));
    } else if (!level.has_key) {
      take_key(level, std::move(value));
    } else {
      take_entry(level, std::move(value));
    }
  }

  void take_key(Level& level, Value key) {
    if (key.kind != Value::Kind::Scalar) {
      refuse(key.place, "a key must be a text, found " + key.describe());
    }
    level.has_key = true;
    level.key = std::move(key.scalar);
    level.key_place = key.place;
    if (level.key == "<<" && !key.is_quoted) return;
    if (!level.keys.insert(level.key).second) {
      const Value* first = level.value.find(level.key);
      refuse(level.key_place, "key '" + level.key + "' comes twice, first in line " +
                                  std::to_string(first ? first->key_place.line : 0));
    }
  }

  void take_entry(Level& level, Value value) {
    level.has_key = false;
    if (!level.keys.contains(level.key)) {
      level.merged.push_back(std::move(value));
      return;
    }
    value.key_place = level.key_place;
    level.value.map.emplace_back(level.key, std::move(value));
  }

  std::string_view text_;
  std::string file_;
  std::vector<std::size_t> line_starts_;
  Value root_;
  std::vector<Level> levels_;
  std::map<YAML::anchor_t, Value> anchors_;
  std::size_t count_ = 0;
};

std::string read_text(const std::filesystem::path& file) {
  std::error_code failed;
  const std::filesystem::file_status status = std::filesystem::status(file, failed);
  if (!std::filesystem::exists(status)) {
    throw Error(ErrorKind::Config, file.string() + ": no such file; a job is a YAML or JSON file");
  }
  if (std::filesystem::is_directory(status)) {
    throw Error(ErrorKind::Config,
                file.string() + ": is a folder; name the job file that is in it");
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(ErrorKind::Config, file.string() + ": cannot be read, check its rights");
  std::string text;
  std::vector<char> block(1 << 16);
  while (stream.read(block.data(), std::streamsize(block.size())) || stream.gcount() > 0) {
    text.append(block.data(), std::size_t(stream.gcount()));
    if (text.size() > kMaxFileBytes) {
      throw Error(ErrorKind::Config,
                  file.string() + ": is larger than 64 MiB; this is no job file");
    }
  }
  return text;
}

/// Line and column (in bytes) of the first byte that no UTF-8 text and no YAML holds, as a message.
void check_text(std::string_view text, const std::string& file) {
  int line = 1;
  std::size_t line_start = 0;
  for (std::size_t i = 0; i < text.size();) {
    const char byte = text[i];
    const std::size_t length = utf8_length(text.substr(i));
    const bool is_good = length > 0 && byte != '\0';
    if (!is_good) {
      refuse({file, line, int(i - line_start) + 1},
             "this is no UTF-8 text; save the file as UTF-8 (is it really a job file?)");
    }
    i += length;
    if (byte == '\n') {
      ++line;
      line_start = i;
    }
  }
}

}  // namespace

Value parse_yaml(std::string_view text, std::string file) {
  check_text(text, file);
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    TreeBuilder builder(text, file);
    if (!parser.HandleNextDocument(builder)) return {};
    TreeBuilder second(text, file);
    if (parser.HandleNextDocument(second)) {
      refuse(second.take().place, "a second document begins here; a job is one document");
    }
    return builder.take();
  } catch (const YAML::DeepRecursion& error) {
    refuse({file, error.mark.line + 1, error.mark.column + 1},
           "nested deeper than " + std::to_string(kMaxDepth) + " levels");
  } catch (const YAML::Exception& error) {
    const int line = error.mark.is_null() ? 1 : error.mark.line + 1;
    const int column = error.mark.is_null() ? 1 : error.mark.column + 1;
    const YamlFault fault = explain_yaml_fault(text, line, column, error.msg);
    refuse({file, fault.line, fault.column}, "YAML syntax error: " + fault.message);
  }
}

Value read_job_file(const std::filesystem::path& file) {
  Value job = parse_yaml(read_text(file), file.string());
  if (job.kind == Value::Kind::Null) {
    throw Error(ErrorKind::Config, file.string() + ": the file is empty; a job is a mapping");
  }
  if (job.kind != Value::Kind::Map) {
    refuse(job.place, "a job is a mapping of keys to values, found " + job.describe());
  }
  return job;
}

}  // namespace diorama
