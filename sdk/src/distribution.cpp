// SPDX-License-Identifier: Apache-2.0
#include "diorama/distribution.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace diorama {
namespace {

constexpr const char* kForms =
    "a number, [lo, hi], or one of uniform, normal, log_uniform, choice, sequence, combine";

Value list_of(std::initializer_list<double> numbers) {
  Value list = Value::make_list();
  for (const double number : numbers) list.list.push_back(Value::number(number));
  return list;
}

Value list_of(const Vec3& vector) { return list_of({vector.x(), vector.y(), vector.z()}); }

Value mapping(const char* key, Value value) {
  Value map = Value::make_map();
  map.set(key, std::move(value));
  return map;
}

/// The one entry of {uniform: ...} or {distribution.uniform: ...}; null for anything else.
const std::pair<std::string, Value>* only_entry(const Value& value) {
  return value.kind == Value::Kind::Map && value.map.size() == 1 ? &value.map.front() : nullptr;
}

std::string_view word_of(std::string_view key) {
  constexpr std::string_view kPrefix = "distribution.";
  return key.starts_with(kPrefix) ? key.substr(kPrefix.size()) : key;
}

/// Position of `share` (in [0, 1)) among the weights.
std::size_t pick(const std::vector<double>& weights, double share) {
  double rest = share * std::accumulate(weights.begin(), weights.end(), 0.0);
  std::size_t last_possible = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] <= 0.0) continue;
    last_possible = i;
    rest -= weights[i];
    if (rest < 0.0) break;
  }
  return last_possible;
}

void check_weights(std::vector<double>& weights, std::size_t count, const Value& body,
                   const std::string& name, Diagnostics& diagnostics) {
  const Value* given = body.find("weights");
  if (!given || given->kind == Value::Kind::Null) {
    weights.assign(count, 1.0);
  } else if (weights.size() != count) {
    diagnostics.add(given->place, name + ".weights: expected one per choice (" +
                                      std::to_string(count) + "), found " +
                                      std::to_string(weights.size()));
  } else if (std::accumulate(weights.begin(), weights.end(), 0.0) <= 0.0) {
    diagnostics.add(given->place, name + ".weights: at least one must be above 0");
  }
}

/// Keys of `choice` and `sequence`, before their items are read.
struct ItemKeys {
  const char* list_key;
  Value items = Value::make_list();
  std::vector<double> weights;

  ItemKeys(const Value& body, bool is_sequence, const std::string& name, Diagnostics& diagnostics)
      : list_key(is_sequence ? "items" : "choices") {
    ParamReader reader(body, name, diagnostics);
    reader.param(list_key, items, {"What is chosen from."});
    if (!is_sequence) reader.param("weights", weights, {"One per choice.", "", 0.0});
    reader.finish();
    if (items.kind != Value::Kind::List || items.list.empty()) {
      diagnostics.add(items.place.line > 0 ? items.place : body.place,
                      name + "." + list_key + ": expected a list with at least one entry");
    }
  }
};

}  // namespace

/// Reads one distribution; diagnostics are collected.
struct Distribution::Reader {
  const ParamDoc& doc;
  int width;
  Diagnostics& diagnostics;

  Distribution read(const Value& value, const std::string& name) {
    Distribution made;
    made.limits_ = {doc.min, doc.max};
    if (value.kind == Value::Kind::Scalar) {
      made.first_ = made.second_ = point(mapping("", value), "", name, made.width_);
    } else if (value.kind == Value::Kind::List && value.list.size() == 2) {
      Range range;
      ParamReader(mapping(name.c_str(), value), "", diagnostics).param(name.c_str(), range, doc);
      made.first_ = Vec3::Constant(range.lo);
      made.second_ = Vec3::Constant(range.hi);
    } else if (value.kind == Value::Kind::List && value.list.size() == 3 && width == 3) {
      made.kind_ = Kind::Combine;
      add_axes(value, name, made);
    } else if (const auto* entry = only_entry(value)) {
      read_form(word_of(entry->first), entry->second, name, made);
    } else {
      complain(value, name);
    }
    if (!made.first_.allFinite() || !made.second_.allFinite()) {
      diagnostics.add(value.place, name + ": expected finite numbers, found " + value.describe());
    }
    made.source_ = value;
    return made;
  }

 private:
  void complain(const Value& value, const std::string& name) {
    const std::string vector = width == 3 ? "[x, y, z] with one of these per axis, " : "";
    diagnostics.add(value.place,
                    name + ": expected " + vector + kForms + ", found " + value.describe());
  }

  /// A number or three of them; `used_width` grows to 3 for the latter.
  Vec3 point(const Value& map, const char* key, const std::string& name, int& used_width) {
    const Value* value = map.find(key);
    if (!value) {
      diagnostics.add(map.place, name + ": '" + key + "' is missing");
      return Vec3::Zero();
    }
    const std::string full = *key ? name + "." + key : name;
    const Value named = mapping(full.c_str(), *value);
    ParamReader reader(named, "", diagnostics);
    if (value->kind == Value::Kind::List && width == 3) {
      used_width = 3;
      Vec3 vector = Vec3::Zero();
      reader.param(full.c_str(), vector, doc);
      return vector;
    }
    double number = 0.0;
    reader.param(full.c_str(), number, doc);
    return Vec3::Constant(number);
  }

  void read_form(std::string_view word, const Value& body, const std::string& name,
                 Distribution& made) {
    const std::string full = name + "." + std::string(word);
    if (word == "uniform" || word == "log_uniform") {
      made.kind_ = word == "uniform" ? Kind::Uniform : Kind::LogUniform;
      read_pair(body, full, "lower", "upper", made);
    } else if (word == "normal") {
      made.kind_ = Kind::Normal;
      read_pair(body, full, "mean", "std", made);
    } else if (word == "choice" || word == "sequence") {
      made.kind_ = word == "choice" ? Kind::Choice : Kind::Sequence;
      read_items(body, full, made);
    } else if (word == "combine") {
      made.kind_ = Kind::Combine;
      read_axes(body, full, made);
    } else {
      const std::string near =
          nearest_name(word, {"uniform", "normal", "log_uniform", "choice", "sequence", "combine"});
      diagnostics.add(body.key_place, name + ": unknown distribution '" + std::string(word) + "'" +
                                          (near.empty() ? "" : ", did you mean '" + near + "'?"));
    }
  }

  void read_pair(const Value& body, const std::string& name, const char* first_key,
                 const char* second_key, Distribution& made) {
    Value first;
    Value second;
    const std::size_t before = diagnostics.messages().size();
    ParamReader reader(body, name, diagnostics);
    reader.param(first_key, first, {"The first."});
    reader.param(second_key, second, {"The second."});
    reader.finish();
    if (diagnostics.messages().size() != before) return;
    made.first_ = point(body, first_key, name, made.width_);
    if (made.kind_ == Kind::Normal) {
      const ParamDoc not_negative{"Standard deviation.", "", 0.0};
      made.second_ =
          Reader{not_negative, width, diagnostics}.point(body, second_key, name, made.width_);
      return;
    }
    made.second_ = point(body, second_key, name, made.width_);
    if (diagnostics.messages().size() != before) return;
    if ((made.first_.array() > made.second_.array()).any()) {
      diagnostics.add(body.place, name + ": lower must not exceed upper");
    }
    if (made.kind_ == Kind::LogUniform && (made.first_.array() <= 0.0).any()) {
      diagnostics.add(body.place, name + ": the bounds must be above 0");
    }
  }

  void read_items(const Value& body, const std::string& name, Distribution& made) {
    const std::size_t before = diagnostics.messages().size();
    ItemKeys keys(body, made.kind_ == Kind::Sequence, name, diagnostics);
    if (diagnostics.messages().size() != before) return;
    for (std::size_t i = 0; i < keys.items.list.size(); ++i) {
      made.parts_.push_back(
          read(keys.items.list[i], name + "." + keys.list_key + "[" + std::to_string(i) + "]"));
      made.width_ = std::max(made.width_, made.parts_.back().width_);
    }
    made.weights_ = std::move(keys.weights);
    if (made.kind_ == Kind::Choice) {
      check_weights(made.weights_, made.parts_.size(), body, name, diagnostics);
    }
  }

  void read_axes(const Value& body, const std::string& name, Distribution& made) {
    Value axes = Value::make_list();
    ParamReader reader(body, name, diagnostics);
    reader.param("distributions", axes, {"One per axis."});
    reader.finish();
    if (width != 3 || axes.kind != Value::Kind::List || axes.list.size() != 3) {
      diagnostics.add(body.place,
                      width == 3 ? name + ".distributions: expected a list of three, one per axis"
                                 : name + ": only a vector can be combined from several");
      return;
    }
    add_axes(axes, name + ".distributions", made);
  }

  void add_axes(const Value& axes, const std::string& name, Distribution& made) {
    made.width_ = 3;
    for (std::size_t i = 0; i < 3; ++i) {
      made.parts_.push_back(
          Reader{doc, 1, diagnostics}.read(axes.list[i], name + "[" + std::to_string(i) + "]"));
    }
  }
};

Distribution::Distribution(double always)
    : first_(Vec3::Constant(always)), second_(first_), source_(Value::number(always)) {}

Distribution::Distribution(const Range& uniform)
    : first_(Vec3::Constant(uniform.lo)),
      second_(Vec3::Constant(uniform.hi)),
      source_(list_of({uniform.lo, uniform.hi})) {}

Distribution::Distribution(const Vec3& always)
    : width_(3), first_(always), second_(always), source_(list_of(always)) {}

Distribution Distribution::between(const Vec3& lower, const Vec3& upper) {
  Distribution made(lower);
  made.second_ = upper;
  made.source_ = Value::make_list();
  for (int axis = 0; axis < 3; ++axis) {
    made.source_.list.push_back(list_of({lower[axis], upper[axis]}));
  }
  return made;
}

std::optional<Distribution> Distribution::read(const Value& value, const std::string& name,
                                               const ParamDoc& doc, int width,
                                               Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.messages().size();
  Distribution made = Reader{doc, width, diagnostics}.read(value, name);
  if (diagnostics.messages().size() != before) return std::nullopt;
  return made;
}

Distribution Distribution::parse(const Value& value, const std::string& name, const ParamDoc& doc,
                                 int width) {
  Diagnostics diagnostics;
  std::optional<Distribution> made = read(value, name, doc, width, diagnostics);
  diagnostics.raise();
  return *std::move(made);
}

double Distribution::draw_axis(int axis, Rng& rng) const {
  switch (kind_) {
    case Kind::LogUniform:
      return std::clamp(std::exp(rng.uniform(std::log(first_[axis]), std::log(second_[axis]))),
                        first_[axis], second_[axis]);
    case Kind::Normal:
      return std::clamp(first_[axis] + second_[axis] * rng.normal(), limits_.lo, limits_.hi);
    default:
      return rng.uniform(first_[axis], second_[axis]);
  }
}

double Distribution::draw(Rng& rng, std::uint64_t index) const {
  if (kind_ == Kind::Choice) return parts_[pick(weights_, rng.uniform())].draw(rng, index);
  if (kind_ == Kind::Sequence) {
    return parts_[index % parts_.size()].draw(rng, index / parts_.size());
  }
  return draw_axis(0, rng);
}

Vec3 Distribution::draw_vector(Rng& rng, std::uint64_t index) const {
  Vec3 vector;
  if (width_ == 1) {
    for (int axis = 0; axis < 3; ++axis) vector[axis] = draw(rng, index);
    return vector;
  }
  if (kind_ == Kind::Choice) return parts_[pick(weights_, rng.uniform())].draw_vector(rng, index);
  if (kind_ == Kind::Sequence) {
    return parts_[index % parts_.size()].draw_vector(rng, index / parts_.size());
  }
  for (int axis = 0; axis < 3; ++axis) {
    vector[axis] =
        kind_ == Kind::Combine ? parts_[std::size_t(axis)].draw(rng, index) : draw_axis(axis, rng);
  }
  return vector;
}

TextDistribution::TextDistribution(const std::vector<std::string>& choices)
    : texts_(choices), weights_(choices.size(), 1.0) {
  for (const std::string& text : choices) source_.list.push_back(Value::text(text));
}

std::optional<TextDistribution> TextDistribution::read(const Value& value, const std::string& name,
                                                       Diagnostics& diagnostics) {
  const std::size_t before = diagnostics.messages().size();
  const auto is_bad = [&] { return diagnostics.messages().size() != before; };
  TextDistribution made;
  Value items = value;
  const auto* entry = only_entry(value);
  const std::string_view word = entry ? word_of(entry->first) : std::string_view();
  if (value.kind == Value::Kind::Scalar) {
    items = Value::make_list();
    items.list.push_back(value);
  } else if (word == "choice" || word == "sequence") {
    made.is_sequence_ = word == "sequence";
    ItemKeys keys(entry->second, made.is_sequence_, name + "." + std::string(word), diagnostics);
    items = std::move(keys.items);
    made.weights_ = std::move(keys.weights);
    if (!made.is_sequence_ && !is_bad()) {
      check_weights(made.weights_, items.list.size(), entry->second, name + ".choice", diagnostics);
    }
  } else if (value.kind != Value::Kind::List && value.kind != Value::Kind::Null) {
    diagnostics.add(value.place, name +
                                     ": expected a text, a list of texts, 'choice' or "
                                     "'sequence', found " +
                                     value.describe());
  }
  if (is_bad()) return std::nullopt;
  if (items.kind == Value::Kind::List) {
    ParamReader(mapping(name.c_str(), items), "", diagnostics)
        .param(name.c_str(), made.texts_, {"Texts."});
  }
  if (is_bad()) return std::nullopt;
  if (!entry) made.weights_.assign(made.texts_.size(), 1.0);
  made.source_ = value;
  return made;
}

TextDistribution TextDistribution::parse(const Value& value, const std::string& name) {
  Diagnostics diagnostics;
  std::optional<TextDistribution> made = read(value, name, diagnostics);
  diagnostics.raise();
  return *std::move(made);
}

std::size_t TextDistribution::draw(Rng& rng, std::uint64_t index) const {
  if (is_sequence_) return std::size_t(index % texts_.size());
  return pick(weights_, rng.uniform());
}

}  // namespace diorama
