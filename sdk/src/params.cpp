// SPDX-License-Identifier: Apache-2.0
#include "diorama/params.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>
#include <utility>

#include "diorama/distribution.h"

namespace diorama {

ParamVisitor::~ParamVisitor() = default;

namespace {

std::string shown(double number) { return Value::number(number).scalar; }

/// "an integer in [1, 65536]", "a number of at least 0".
std::string expected_number(std::string_view what, double min, double max) {
  const std::string name(what);
  if (std::isfinite(min) && std::isfinite(max)) {
    return name + " in [" + shown(min) + ", " + shown(max) + "]";
  }
  if (std::isfinite(min)) return name + " of at least " + shown(min);
  if (std::isfinite(max)) return name + " of at most " + shown(max);
  return name;
}

bool is_in_range(double number, const ParamDoc& doc) {
  return number >= doc.min && number <= doc.max;
}

template <class Integer>
std::optional<Integer> read_integer(const Value& value) {
  if (value.kind != Value::Kind::Scalar || value.is_quoted) return std::nullopt;
  std::string_view digits = value.scalar;
  if (digits.starts_with('+') && digits.size() > 1 && digits[1] != '-') digits.remove_prefix(1);
  Integer number{};
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return number;
}

/// A whole number, perhaps too large for any type.
bool is_digits(const Value& value) {
  if (value.kind != Value::Kind::Scalar || value.is_quoted || value.scalar.empty()) return false;
  const std::size_t first = value.scalar.find_first_of("+-") == 0 ? 1 : 0;
  return value.scalar.size() > first &&
         value.scalar.find_first_not_of("0123456789", first) == std::string::npos;
}

/// YAML's numbers without its hexadecimal and octal ones; not-a-number is none.
std::optional<double> read_number(const Value& value) {
  if (value.kind != Value::Kind::Scalar || value.is_quoted) return std::nullopt;
  std::string_view text = value.scalar;
  const bool is_negative = text.starts_with('-');
  if (is_negative || text.starts_with('+')) text.remove_prefix(1);
  if (text == ".inf" || text == ".Inf" || text == ".INF" || text == "inf") {
    return is_negative ? -kInfinity : kInfinity;
  }
  if (text.empty() || text.find_first_not_of("0123456789.eE+-") != text.npos) return std::nullopt;
  if (text.front() == '+' || text.front() == '-') return std::nullopt;
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return is_negative ? -number : number;
}

std::optional<std::string> read_text(const Value& value) {
  if (value.kind != Value::Kind::Scalar) return std::nullopt;
  return value.scalar;
}

}  // namespace

struct ParamReader::State {
  /// A mapping being read; null when the group or item is absent, so that defaults stay.
  struct Scope {
    const Value* map;
    std::string path;
    std::vector<std::string> known;
  };
  /// A list being read; null when absent.
  struct List {
    const Value* list;
    std::string path;
  };

  Diagnostics& diagnostics;
  std::vector<Scope> scopes;
  std::vector<List> lists;

  std::string full_name(std::string_view key) const {
    const std::string& path = scopes.back().path;
    return path.empty() ? std::string(key) : path + "." + std::string(key);
  }

  const Value* take(const char* key) {
    Scope& scope = scopes.back();
    scope.known.push_back(key);
    return scope.map ? scope.map->find(key) : nullptr;
  }

  void complain(const Value& found, const std::string& name, const std::string& expected,
                const std::string& hint = "") {
    diagnostics.add(found.place, (name.empty() ? "" : name + ": ") + "expected " + expected +
                                     ", found " + found.describe() + hint);
  }

  /// The value as a mapping to read from; null after a complaint.
  const Value* as_map(const Value* value, const std::string& name) {
    if (!value || value->kind == Value::Kind::Map) return value;
    complain(*value, name, "a mapping");
    return nullptr;
  }

  void finish_scope(std::span<const std::string_view> also_known) {
    Scope& scope = scopes.back();
    if (!scope.map) return;
    scope.known.insert(scope.known.end(), also_known.begin(), also_known.end());
    for (const auto& [key, value] : scope.map->map) {
      if (std::find(scope.known.begin(), scope.known.end(), key) != scope.known.end()) continue;
      std::string message = scope.path.empty() ? "" : scope.path + ": ";
      message += "unknown key '" + key + "'";
      const std::string meant = nearest_name(key, scope.known);
      if (!meant.empty()) message += ", did you mean '" + meant + "'?";
      diagnostics.add(value.key_place, message);
    }
  }

  /// Numbers of a list, each checked; nothing after a complaint.
  std::optional<std::vector<double>> numbers(const Value& value, const std::string& name,
                                             const ParamDoc& doc) {
    std::vector<double> all;
    bool is_good = true;
    for (std::size_t i = 0; i < value.list.size(); ++i) {
      const std::optional<double> number = read_number(value.list[i]);
      if (number && is_in_range(*number, doc)) {
        all.push_back(*number);
        continue;
      }
      complain(value.list[i], name + "[" + std::to_string(i) + "]",
               expected_number("a number", doc.min, doc.max));
      is_good = false;
    }
    if (!is_good) return std::nullopt;
    return all;
  }

  template <class Integer>
  void integer(const char* key, Integer& field, const ParamDoc& doc) {
    const Value* value = take(key);
    if (!value) return;
    const std::optional<Integer> number = read_integer<Integer>(*value);
    if (number && is_in_range(double(*number), doc)) {
      field = *number;
      return;
    }
    using Limits = std::numeric_limits<Integer>;
    const double min = Limits::is_signed ? doc.min : std::max(doc.min, 0.0);
    std::string expected = expected_number("an integer", min, doc.max);
    if (!number && is_digits(*value) && !std::isfinite(doc.max)) {
      expected = "an integer in [" + shown(std::max(min, double(Limits::min()))) + ", " +
                 std::to_string(Limits::max()) + "]";
    }
    complain(*value, full_name(key), expected);
  }
};

ParamReader::ParamReader(const Value& map, std::string path, Diagnostics& diagnostics)
    : state_(new State{diagnostics, {}, {}}) {
  const Value* top = map.kind == Value::Kind::Null ? nullptr : state_->as_map(&map, path);
  state_->scopes.push_back({top, std::move(path), {}});
}
ParamReader::~ParamReader() = default;

void ParamReader::finish(std::span<const std::string_view> also_known) {
  state_->finish_scope(also_known);
}

void ParamReader::param(const char* key, bool& field, const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  const bool is_plain = value->kind == Value::Kind::Scalar && !value->is_quoted;
  if (is_plain && (value->scalar == "true" || value->scalar == "false")) {
    field = value->scalar == "true";
    return;
  }
  state_->complain(*value, state_->full_name(key), "true or false");
}

void ParamReader::param(const char* key, int& field, const ParamDoc& doc) {
  state_->integer(key, field, doc);
}

void ParamReader::param(const char* key, std::uint64_t& field, const ParamDoc& doc) {
  state_->integer(key, field, doc);
}

void ParamReader::param(const char* key, double& field, const ParamDoc& doc) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::optional<double> number = read_number(*value);
  if (number && is_in_range(*number, doc)) {
    field = *number;
    return;
  }
  state_->complain(*value, state_->full_name(key), expected_number("a number", doc.min, doc.max));
}

void ParamReader::param(const char* key, std::string& field, const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  if (const std::optional<std::string> text = read_text(*value)) {
    field = *text;
    return;
  }
  state_->complain(*value, state_->full_name(key), "a text");
}

void ParamReader::param(const char* key, Range& field, const ParamDoc& doc) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::string name = state_->full_name(key);
  if (value->kind == Value::Kind::List && value->list.size() == 2) {
    const auto ends = state_->numbers(*value, name, doc);
    if (!ends) return;
    if ((*ends)[0] <= (*ends)[1]) {
      field = {(*ends)[0], (*ends)[1]};
      return;
    }
    state_->diagnostics.add(value->place, name + ": expected [lo, hi] with lo <= hi, found [" +
                                              value->list[0].scalar + ", " + value->list[1].scalar +
                                              "]");
    return;
  }
  const std::optional<double> number = read_number(*value);
  if (number && is_in_range(*number, doc)) {
    field = {*number, *number};
    return;
  }
  state_->complain(*value, name,
                   expected_number("a number", doc.min, doc.max) + " or a list [lo, hi] of two");
}

void ParamReader::param(const char* key, Vec3& field, const ParamDoc& doc) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::string name = state_->full_name(key);
  if (value->kind != Value::Kind::List || value->list.size() != 3) {
    const bool is_list = value->kind == Value::Kind::List;
    state_->complain(*value, name, "a list of three numbers",
                     is_list ? " of " + std::to_string(value->list.size()) : "");
    return;
  }
  if (const auto all = state_->numbers(*value, name, doc)) {
    field = Vec3((*all)[0], (*all)[1], (*all)[2]);
  }
}

void ParamReader::param(const char* key, std::vector<std::string>& field, const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::string name = state_->full_name(key);
  if (value->kind != Value::Kind::List) {
    state_->complain(*value, name, "a list of texts");
    return;
  }
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < value->list.size(); ++i) {
    const std::optional<std::string> text = read_text(value->list[i]);
    if (text) {
      texts.push_back(*text);
    } else {
      state_->complain(value->list[i], name + "[" + std::to_string(i) + "]", "a text");
    }
  }
  if (texts.size() == value->list.size()) field = std::move(texts);
}

void ParamReader::param(const char* key, std::vector<double>& field, const ParamDoc& doc) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::string name = state_->full_name(key);
  if (value->kind != Value::Kind::List) {
    state_->complain(*value, name, "a list of numbers");
    return;
  }
  if (auto all = state_->numbers(*value, name, doc)) field = std::move(*all);
}

void ParamReader::param(const char* key, std::optional<double>& field, const ParamDoc& doc) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::optional<double> number = read_number(*value);
  if (value->kind == Value::Kind::Null || (number && is_in_range(*number, doc))) {
    field = number;
    return;
  }
  state_->complain(*value, state_->full_name(key),
                   expected_number("a number", doc.min, doc.max) + " or null");
}

void ParamReader::param(const char* key, std::optional<std::string>& field, const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  if (value->kind == Value::Kind::Null || value->kind == Value::Kind::Scalar) {
    field = read_text(*value);
    return;
  }
  state_->complain(*value, state_->full_name(key), "a text or null");
}

void ParamReader::param(const char* key, Distribution& field, const ParamDoc& doc, int width) {
  const Value* value = state_->take(key);
  if (!value) return;
  auto read = Distribution::read(*value, state_->full_name(key), doc, width, state_->diagnostics);
  if (read) field = *std::move(read);
}

void ParamReader::param(const char* key, std::optional<Distribution>& field, const ParamDoc& doc,
                        int width) {
  const Value* value = state_->take(key);
  if (!value) return;
  field.reset();
  if (value->kind == Value::Kind::Null) return;
  field = Distribution::read(*value, state_->full_name(key), doc, width, state_->diagnostics);
}

void ParamReader::param(const char* key, TextDistribution& field, const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  auto read = TextDistribution::read(*value, state_->full_name(key), state_->diagnostics);
  if (read) field = *std::move(read);
}

void ParamReader::param(const char* key, Value& field, const ParamDoc&) {
  if (const Value* value = state_->take(key)) field = *value;
}

void ParamReader::choice(const char* key, std::string& field, std::span<const char* const> words,
                         const ParamDoc&) {
  const Value* value = state_->take(key);
  if (!value) return;
  const std::optional<std::string> text = read_text(*value);
  if (text && std::find(words.begin(), words.end(), *text) != words.end()) {
    field = *text;
    return;
  }
  std::string expected = "one of";
  for (const char* word : words)
    expected += std::string(word == words[0] ? " '" : ", '") + word + "'";
  const std::string meant =
      text ? nearest_name(*text, std::vector<std::string>(words.begin(), words.end())) : "";
  state_->complain(*value, state_->full_name(key), expected,
                   meant.empty() ? "" : ", did you mean '" + meant + "'?");
}

void ParamReader::begin_group(const char* key, const ParamDoc&) {
  const Value* value = state_->take(key);
  const std::string name = state_->full_name(key);
  state_->scopes.push_back({state_->as_map(value, name), name, {}});
}

void ParamReader::end_group() {
  state_->finish_scope({});
  state_->scopes.pop_back();
}

std::size_t ParamReader::begin_list(const char* key, std::size_t, const ParamDoc&) {
  const Value* value = state_->take(key);
  const std::string name = state_->full_name(key);
  if (value && value->kind != Value::Kind::List) {
    state_->complain(*value, name, "a list of mappings");
    value = nullptr;
  }
  state_->lists.push_back({value, name});
  return value ? value->list.size() : kKeepItems;
}

void ParamReader::begin_item(std::size_t index) {
  const State::List& list = state_->lists.back();
  const std::string name = list.path + "[" + std::to_string(index) + "]";
  const Value* item = list.list ? &list.list->list[index] : nullptr;
  state_->scopes.push_back({state_->as_map(item, name), name, {}});
}

void ParamReader::end_item() {
  state_->finish_scope({});
  state_->scopes.pop_back();
}

void ParamReader::end_list() { state_->lists.pop_back(); }

namespace {

Value list_of(const auto& items, const auto& as_value) {
  Value list = Value::make_list();
  for (const auto& item : items) list.list.push_back(as_value(item));
  return list;
}

Value defaults_of(const std::vector<ParamSpec>& specs) {
  Value map = Value::make_map();
  for (const ParamSpec& spec : specs) map.set(spec.key, spec.default_value);
  return map;
}

ParamSpec spec_of(const char* key, ParamType type, const ParamDoc& doc, Value default_value) {
  ParamSpec spec;
  spec.key = key;
  spec.type = type;
  spec.default_value = std::move(default_value);
  spec.help = doc.help;
  spec.unit = doc.unit;
  spec.min = doc.min;
  spec.max = doc.max;
  return spec;
}

}  // namespace

struct ParamLister::State {
  std::vector<std::vector<ParamSpec>> scopes{1};   // innermost last
  std::vector<std::size_t> default_items_to_come;  // of the lists being visited

  void add(ParamSpec spec) { scopes.back().push_back(std::move(spec)); }

  std::vector<ParamSpec> close_scope() {
    std::vector<ParamSpec> specs = std::move(scopes.back());
    scopes.pop_back();
    return specs;
  }
};

ParamLister::ParamLister() : state_(std::make_unique<State>()) {}
ParamLister::~ParamLister() = default;

std::vector<ParamSpec> ParamLister::take() {
  return std::exchange(state_->scopes.front(), std::vector<ParamSpec>());
}

void ParamLister::param(const char* key, bool& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Bool, doc, Value::boolean(field)));
}

void ParamLister::param(const char* key, int& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Int, doc, Value::integer(field)));
}

void ParamLister::param(const char* key, std::uint64_t& field, const ParamDoc& doc) {
  Value value = Value::integer(0);
  value.scalar = std::to_string(field);  // may exceed what integer() takes
  ParamSpec spec = spec_of(key, ParamType::Int, doc, std::move(value));
  spec.min = std::max(spec.min, 0.0);
  state_->add(std::move(spec));
}

void ParamLister::param(const char* key, double& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Number, doc, Value::number(field)));
}

void ParamLister::param(const char* key, std::string& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Text, doc, Value::text(field)));
}

void ParamLister::param(const char* key, Range& field, const ParamDoc& doc) {
  const double ends[] = {field.lo, field.hi};
  state_->add(spec_of(key, ParamType::Interval, doc, list_of(ends, Value::number)));
}

void ParamLister::param(const char* key, Vec3& field, const ParamDoc& doc) {
  const double numbers[] = {field.x(), field.y(), field.z()};
  state_->add(spec_of(key, ParamType::Vector, doc, list_of(numbers, Value::number)));
}

void ParamLister::param(const char* key, std::vector<std::string>& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::TextList, doc, list_of(field, Value::text)));
}

void ParamLister::param(const char* key, std::vector<double>& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::NumberList, doc, list_of(field, Value::number)));
}

void ParamLister::param(const char* key, std::optional<double>& field, const ParamDoc& doc) {
  state_->add(
      spec_of(key, ParamType::OptionalNumber, doc, field ? Value::number(*field) : Value()));
}

void ParamLister::param(const char* key, std::optional<std::string>& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::OptionalText, doc, field ? Value::text(*field) : Value()));
}

void ParamLister::param(const char* key, Distribution& field, const ParamDoc& doc, int width) {
  const ParamType type = width == 3 ? ParamType::VectorDistribution : ParamType::Distribution;
  state_->add(spec_of(key, type, doc, field.source()));
}

void ParamLister::param(const char* key, std::optional<Distribution>& field, const ParamDoc& doc,
                        int width) {
  const ParamType type =
      width == 3 ? ParamType::OptionalVectorDistribution : ParamType::OptionalDistribution;
  state_->add(spec_of(key, type, doc, field ? field->source() : Value()));
}

void ParamLister::param(const char* key, TextDistribution& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::TextDistribution, doc, field.source()));
}

void ParamLister::param(const char* key, Value& field, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Any, doc, field));
}

void ParamLister::choice(const char* key, std::string& field, std::span<const char* const> words,
                         const ParamDoc& doc) {
  ParamSpec spec = spec_of(key, ParamType::Choice, doc, Value::text(field));
  spec.choices.assign(words.begin(), words.end());
  state_->add(std::move(spec));
}

void ParamLister::begin_group(const char* key, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::Group, doc, {}));
  state_->scopes.emplace_back();
}

void ParamLister::end_group() {
  std::vector<ParamSpec> children = state_->close_scope();
  ParamSpec& group = state_->scopes.back().back();
  group.default_value = defaults_of(children);
  group.children = std::move(children);
}

std::size_t ParamLister::begin_list(const char* key, std::size_t count, const ParamDoc& doc) {
  state_->add(spec_of(key, ParamType::List, doc, Value::make_list()));
  state_->default_items_to_come.push_back(count);
  return kKeepItems;
}

void ParamLister::begin_item(std::size_t) { state_->scopes.emplace_back(); }

void ParamLister::end_item() {
  std::vector<ParamSpec> children = state_->close_scope();
  ParamSpec& list = state_->scopes.back().back();
  // The default items come first, then the prototype.
  std::size_t& to_come = state_->default_items_to_come.back();
  if (to_come == 0) {
    list.children = std::move(children);
    return;
  }
  --to_come;
  list.default_value.list.push_back(defaults_of(children));
}

void ParamLister::end_list() { state_->default_items_to_come.pop_back(); }

}  // namespace diorama
