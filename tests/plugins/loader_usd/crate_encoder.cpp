// SPDX-License-Identifier: Apache-2.0
#include "plugins/loader_usd/crate_encoder.h"

#include <lz4.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "loader_usd/usd/path.h"

namespace diorama::usd::test {
namespace {

constexpr std::uint64_t kArray = std::uint64_t{1} << 63;
constexpr std::uint64_t kInlined = std::uint64_t{1} << 62;
constexpr std::uint64_t kCompressed = std::uint64_t{1} << 61;
constexpr std::size_t kLeastCompressed = 16;
constexpr std::size_t kHeader = 88;

template <class T>
void add(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string fast_compress(const std::string& raw) {
  std::string block(1 + static_cast<std::size_t>(LZ4_compressBound(static_cast<int>(raw.size()))),
                    '\0');
  const int size = LZ4_compress_default(raw.data(), block.data() + 1, static_cast<int>(raw.size()),
                                        static_cast<int>(block.size()) - 1);
  block.resize(1 + static_cast<std::size_t>(size));
  return block;
}

template <class Small, class Wide>
bool fits(Wide value) {
  return value >= std::numeric_limits<Small>::min() && value <= std::numeric_limits<Small>::max();
}

// Differences to the one before in four sizes; the most frequent one takes no bytes at all.
template <class Integer>
std::string code_integers(std::span<const Integer> values) {
  using Unsigned = std::make_unsigned_t<Integer>;
  using Small = std::conditional_t<sizeof(Integer) == 4, std::int8_t, std::int16_t>;
  using Medium = std::conditional_t<sizeof(Integer) == 4, std::int16_t, std::int32_t>;
  if (values.empty()) return {};
  std::vector<Integer> steps;
  std::map<Integer, std::size_t> counts;
  Unsigned before = 0;
  for (const Integer value : values) {
    steps.push_back(static_cast<Integer>(static_cast<Unsigned>(value) - before));
    before = static_cast<Unsigned>(value);
    ++counts[steps.back()];
  }
  const auto common =
      std::max_element(counts.begin(), counts.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      })->first;
  std::string codes((2 * steps.size() + 7) / 8, '\0');
  std::string rest;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    int code = 3;
    if (steps[i] == common) {
      code = 0;
    } else if (fits<Small>(steps[i])) {
      code = 1;
      add(rest, static_cast<Small>(steps[i]));
    } else if (fits<Medium>(steps[i])) {
      code = 2;
      add(rest, static_cast<Medium>(steps[i]));
    } else {
      add(rest, steps[i]);
    }
    codes[i / 4] = static_cast<char>(codes[i / 4] | (code << (2 * (i % 4))));
  }
  std::string raw;
  add(raw, common);
  return fast_compress(raw + codes + rest);
}

template <class T>
std::vector<T> items_of(const Value& value) {
  std::vector<T> items(value.bytes().size() / sizeof(T));
  if (!items.empty()) std::memcpy(items.data(), value.bytes().data(), items.size() * sizeof(T));
  return items;
}

bool is_kept(const Value& value) {
  switch (value.type()) {
    case Type::Invalid:
    case Type::Spline:
    case Type::Value:
    case Type::UnregisteredValue:
    case Type::UnregisteredValueListOp:
      return false;
    default:
      return true;
  }
}

template <class Item>
bool has_new_edits(const ListOp<Item>* op) {
  return op && (!op->prepended.empty() || !op->appended.empty());
}

// A payload of the time before there were lists of them.
bool is_single(const ListOp<Reference>& op) {
  return op.is_explicit && op.explicit_items.size() == 1 &&
         op.explicit_items.front().offset == LayerOffset{};
}

int needed_minor(const Value& value) {
  int needed = 0;
  const auto need = [&](int minor) { needed = std::max(needed, minor); };
  if (value.type() == Type::TimeCode) need(9);
  if (value.type() == Type::PathExpression) need(10);
  if (value.type() == Type::Relocates) need(11);
  if (value.type() == Type::PayloadListOp && !is_single(*value.as_reference_list_op())) need(8);
  if (value.as_reference() && !(value.as_reference()->offset == LayerOffset{})) need(8);
  if (has_new_edits(value.as_string_list_op()) || has_new_edits(value.as_integer_list_op()) ||
      has_new_edits(value.as_reference_list_op())) {
    need(2);
  }
  if (const Dictionary* dictionary = value.as_dictionary()) {
    for (const auto& [key, item] : *dictionary) need(needed_minor(item));
  }
  if (const TimeSamples* samples = value.as_time_samples()) {
    for (std::size_t i = 0; i < samples->times.size(); ++i) need(needed_minor(samples->value(i)));
  }
  return needed;
}

class Encoder {
 public:
  Encoder(const Layer& layer, CrateVersion version) : layer_(layer), version_(version) {
    int needed = 0;
    for (const auto& [path, spec] : layer.prims()) {
      for (const auto& [name, value] : layer.fields(spec.fields)) {
        needed = std::max(needed, needed_minor(value));
      }
      for (const PropertySpec& property : spec.properties) {
        for (const auto& [name, value] : layer.fields(property.fields)) {
          needed = std::max(needed, needed_minor(value));
        }
      }
    }
    if (needed > version.minor) version_ = {needed, 0};
    // A property's token is stored negated, so that none may have the number 0.
    if (at_least(4)) token(";-)");
  }

  std::string encode() {
    body_.assign(kHeader, '\0');
    for (const auto& [path, spec] : layer_.prims()) sorted_.emplace(path, &spec);
    for (const auto& [path, spec] : sorted_) {
      add_spec(path, spec->type, spec->fields);
      for (const PropertySpec& property : spec->properties) {
        add_spec(path::append_property(path, property.name), property.type, property.fields);
      }
    }
    link_paths();
    std::string contents;
    const std::pair<const char*, std::function<void()>> sections[] = {
        {"TOKENS", [&] { write_tokens(); }}, {"STRINGS", [&] { write_strings(); }},
        {"FIELDS", [&] { write_fields(); }}, {"FIELDSETS", [&] { write_field_sets(); }},
        {"PATHS", [&] { write_paths(); }},   {"SPECS", [&] { write_specs(); }}};
    // The elements of paths and the names of fields are tokens, so these come first.
    for (const auto& [path, node] : nodes_) token(node.element);
    add(contents, std::uint64_t{6});
    for (const auto& [name, write] : sections) {
      const std::size_t start = body_.size();
      write();
      std::string label(name);
      label.resize(16);
      contents += label;
      add(contents, static_cast<std::uint64_t>(start));
      add(contents, static_cast<std::uint64_t>(body_.size() - start));
    }
    std::string header = "PXR-USDC";
    for (const int number : {0, version_.minor, version_.patch, 0, 0, 0, 0, 0}) {
      header += static_cast<char>(number);
    }
    add(header, static_cast<std::int64_t>(body_.size()));
    std::memcpy(body_.data(), header.data(), header.size());
    return body_ + contents;
  }

 private:
  struct Node {
    std::uint32_t index = 0;
    std::string element;
    bool is_property = false;
    std::vector<std::string> children;
  };
  struct Spec {
    std::uint32_t path;
    std::uint32_t field_set;
    std::uint32_t type;
  };

  bool at_least(int minor) const { return version_.minor >= minor; }

  std::uint32_t token(std::string_view text) {
    const auto [entry, is_new] =
        token_of_.try_emplace(std::string(text), static_cast<std::uint32_t>(tokens_.size()));
    if (is_new) tokens_.emplace_back(text);
    return entry->second;
  }
  std::uint32_t string(const std::string& text) {
    const std::uint32_t index = token(text);
    const auto [entry, is_new] =
        string_of_.try_emplace(index, static_cast<std::uint32_t>(strings_.size()));
    if (is_new) strings_.push_back(index);
    return entry->second;
  }
  // The empty path has a number like any other, but no place in the tree.
  std::uint32_t path(const std::string& text) {
    const auto [entry, is_new] = path_of_.try_emplace(text, path_count_);
    if (!is_new) return entry->second;
    ++path_count_;
    if (text.empty()) return entry->second;
    Node& node = nodes_[text];
    node.index = entry->second;
    node.is_property = !path::property_part(text).empty();
    if (text == "/") return node.index;
    node.element = path::name(text);
    path(std::string(path::parent(text)));
    return nodes_.at(text).index;
  }
  void link_paths() {
    path("/");
    for (const auto& [text, node] : nodes_) {
      if (text != "/") nodes_.at(std::string(path::parent(text))).children.push_back(text);
    }
  }

  std::uint64_t rep(Type type, std::uint64_t payload) const {
    return static_cast<std::uint64_t>(type) << 48 | payload;
  }
  std::uint64_t inlined(Type type, std::uint32_t bits) const { return rep(type, bits) | kInlined; }
  std::uint64_t placed(Type type, const std::string& bytes) {
    body_.resize((body_.size() + 7) / 8 * 8);
    const std::uint64_t at = body_.size();
    body_ += bytes;
    return rep(type, at);
  }

  std::uint64_t encode(const Value& value) {
    const Type type = value.type();
    if (value.is_block()) return inlined(type, 0);
    if (const auto number = value.as_enumerator()) {
      return inlined(type, static_cast<std::uint32_t>(*number));
    }
    if (value.is_array()) return encode_array(value);
    if (numeric_layout(type).count > 0) return encode_number(value);
    if (const std::string* text = value.as_text()) return encode_text(type, *text);
    if (const Dictionary* dictionary = value.as_dictionary()) return encode_dictionary(*dictionary);
    if (const TimeSamples* samples = value.as_time_samples()) return encode_samples(*samples);
    if (const auto* op = value.as_string_list_op()) {
      return encode_list_op<std::string>(type, *op, [&](std::string& bytes, const std::string& s) {
        add(bytes, number_of(type, s));
      });
    }
    if (const auto* op = value.as_integer_list_op()) {
      const bool is_wide = type == Type::Int64ListOp || type == Type::UInt64ListOp;
      return encode_list_op<std::int64_t>(type, *op, [&](std::string& bytes, std::int64_t item) {
        is_wide ? add(bytes, item) : add(bytes, static_cast<std::int32_t>(item));
      });
    }
    if (const auto* op = value.as_reference_list_op()) return encode_references(type, *op);
    if (const Reference* reference = value.as_reference()) {
      std::string bytes;
      add_reference(bytes, *reference, true);
      return placed(type, bytes);
    }
    std::string bytes;
    if (const StringPairs* pairs = value.as_string_pairs()) {
      add(bytes, static_cast<std::uint64_t>(pairs->size()));
      for (const auto& [first, second] : *pairs) {
        add(bytes, type == Type::Relocates ? path(first) : string(first));
        add(bytes, type == Type::Relocates ? path(second) : string(second));
      }
    } else if (const auto* offsets = value.as_layer_offsets()) {
      add(bytes, static_cast<std::uint64_t>(offsets->size()));
      for (const LayerOffset& offset : *offsets) {
        add(bytes, offset.offset);
        add(bytes, offset.scale);
      }
    } else if (const Strings* items = value.as_strings()) {
      add(bytes, static_cast<std::uint64_t>(items->size()));
      for (const std::string& item : *items) add(bytes, number_of(type, item));
    }
    return placed(type, bytes);
  }

  std::uint32_t number_of(Type type, const std::string& text) {
    if (type == Type::PathListOp || type == Type::PathVector) return path(text);
    if (type == Type::StringListOp || type == Type::StringVector) return string(text);
    return token(text);
  }

  std::uint64_t encode_text(Type type, const std::string& text) {
    if (type == Type::String) return inlined(type, string(text));
    if (type == Type::Token || type == Type::AssetPath) return inlined(type, token(text));
    std::string bytes;
    add(bytes, string(text));
    return placed(type, bytes);
  }

  // In 32 bits where nothing of the value is lost, else beside.
  std::uint64_t encode_number(const Value& value) {
    const Type type = value.type();
    const NumericLayout layout = numeric_layout(type);
    const auto raw = value.bytes();
    std::uint32_t bits = 0;
    if (raw.size() <= 4) {
      std::memcpy(&bits, raw.data(), raw.size());
      return inlined(type, bits);
    }
    if (type == Type::Double) {
      double number;
      std::memcpy(&number, raw.data(), 8);
      const auto single = static_cast<float>(number);
      const double back = single;
      if (std::memcmp(&back, &number, 8) == 0) {
        std::memcpy(&bits, &single, 4);
        return inlined(type, bits);
      }
    }
    if (type == Type::Int64 || type == Type::UInt64) {
      std::int64_t number;
      std::memcpy(&number, raw.data(), 8);
      const bool is_small =
          type == Type::Int64 ? fits<std::int32_t>(number) : number >= 0 && number <= 0xFFFFFFFFll;
      if (is_small) return inlined(type, static_cast<std::uint32_t>(number));
    }
    if (const auto small = small_components(value, layout)) return inlined(type, *small);
    return placed(type, std::string(reinterpret_cast<const char*>(raw.data()), raw.size()));
  }

  // Vectors of small whole numbers and matrices with nothing but such a diagonal.
  static std::optional<std::uint32_t> small_components(const Value& value,
                                                       const NumericLayout& layout) {
    const Type type = value.type();
    if (type == Type::Quatd || type == Type::Quatf || type == Type::Quath || layout.count == 1) {
      return std::nullopt;
    }
    const int rows = type == Type::Matrix2d   ? 2
                     : type == Type::Matrix3d ? 3
                     : type == Type::Matrix4d ? 4
                                              : 0;
    std::uint32_t bits = 0;
    int stored = 0;
    for (int i = 0; i < layout.count; ++i) {
      const double number = value.component(static_cast<std::size_t>(i));
      const bool is_plain = number == static_cast<std::int8_t>(std::clamp(number, -128.0, 127.0)) &&
                            !(number == 0.0 && std::signbit(number));
      if (!is_plain) return std::nullopt;
      const bool is_diagonal = rows == 0 || i % (rows + 1) == 0;
      if (!is_diagonal && number != 0.0) return std::nullopt;
      if (is_diagonal) {
        bits |=
            static_cast<std::uint32_t>(static_cast<std::uint8_t>(static_cast<std::int8_t>(number)))
            << (8 * stored++);
      }
    }
    return bits;
  }

  std::uint64_t encode_array(const Value& value) {
    const Type type = value.type();
    if (value.size() == 0) return rep(type, 0) | kArray;
    std::string bytes;
    if (!at_least(5)) add(bytes, std::uint32_t{1});  // the rank
    if (at_least(7)) {
      add(bytes, static_cast<std::uint64_t>(value.size()));
    } else {
      add(bytes, static_cast<std::uint32_t>(value.size()));
    }
    if (const Strings* items = value.as_strings()) {
      for (const std::string& item : *items) {
        add(bytes, type == Type::Token ? token(item) : string(item));
      }
      return placed(type, bytes) | kArray;
    }
    const auto coded = value.size() < kLeastCompressed ? std::nullopt : compressed(value);
    if (coded) return placed(type, bytes + *coded) | kArray | kCompressed;
    const auto raw = value.bytes();
    bytes.append(reinterpret_cast<const char*>(raw.data()), raw.size());
    // Short arrays of these types are marked, too.
    const bool is_marked = value.size() < kLeastCompressed && compressed(value);
    return placed(type, bytes) | kArray | (is_marked ? kCompressed : 0);
  }

  template <class Integer>
  static std::string sized(const std::vector<Integer>& items) {
    const std::string coded = code_integers<Integer>(items);
    std::string bytes;
    add(bytes, static_cast<std::uint64_t>(coded.size()));
    return bytes + coded;
  }

  std::optional<std::string> compressed(const Value& value) const {
    switch (value.type()) {
      case Type::Int:
      case Type::UInt:
        if (!at_least(5)) return std::nullopt;
        return sized(items_of<std::int32_t>(value));
      case Type::Int64:
      case Type::UInt64:
        if (!at_least(5)) return std::nullopt;
        return sized(items_of<std::int64_t>(value));
      case Type::Half:
        return compressed_floats<std::uint16_t>(value);
      case Type::Float:
        return compressed_floats<std::uint32_t>(value);
      case Type::Double:
        return compressed_floats<std::uint64_t>(value);
      default:
        return std::nullopt;
    }
  }

  // As whole numbers if all are, by a table if there are few different ones.
  template <class Bits>
  std::optional<std::string> compressed_floats(const Value& value) const {
    if (!at_least(6)) return std::nullopt;
    const auto items = items_of<Bits>(value);
    std::vector<std::int32_t> whole;
    for (std::size_t i = 0; i < items.size(); ++i) {
      const double number = value.component(i);
      const bool is_whole = number >= -2147483648.0 && number <= 2147483647.0 &&
                            number == static_cast<std::int32_t>(number) &&
                            !(number == 0.0 && std::signbit(number));
      if (!is_whole) break;
      whole.push_back(static_cast<std::int32_t>(number));
    }
    if (whole.size() == items.size()) return 'i' + sized(whole);
    std::map<Bits, std::uint32_t> table;
    std::vector<Bits> entries;
    std::vector<std::int32_t> indices;
    for (const Bits item : items) {
      const auto [entry, is_new] =
          table.try_emplace(item, static_cast<std::uint32_t>(entries.size()));
      if (is_new) entries.push_back(item);
      if (entries.size() > 1024) return std::nullopt;
      indices.push_back(static_cast<std::int32_t>(entry->second));
    }
    std::string bytes = "t";
    add(bytes, static_cast<std::uint32_t>(entries.size()));
    for (const Bits entry : entries) add(bytes, entry);
    return bytes + sized(indices);
  }

  std::uint64_t encode_dictionary(const Dictionary& dictionary) {
    std::string bytes;
    std::uint64_t count = 0;
    for (const auto& [key, value] : dictionary) {
      if (!is_kept(value)) continue;
      ++count;
      add(bytes, string(key));
      add(bytes, std::int64_t{8});  // The value's representation follows.
      add(bytes, encode(value));
    }
    if (count == 0) return inlined(Type::Dictionary, 0);
    std::string head;
    add(head, count);
    return placed(Type::Dictionary, head + bytes);
  }

  std::uint64_t encode_samples(const TimeSamples& samples) {
    std::string times;
    add(times, static_cast<std::uint64_t>(samples.times.size()));
    for (const double time : samples.times) add(times, time);
    const std::uint64_t times_rep = placed(Type::DoubleVector, times);
    std::string values;
    for (std::size_t i = 0; i < samples.times.size(); ++i) add(values, encode(samples.value(i)));
    std::string bytes;
    add(bytes, std::int64_t{8});
    add(bytes, times_rep);
    add(bytes, std::int64_t{8});
    add(bytes, static_cast<std::uint64_t>(samples.times.size()));
    return placed(Type::TimeSamples, bytes + values);
  }

  template <class Item>
  std::uint64_t encode_list_op(Type type, const ListOp<Item>& op,
                               const std::function<void(std::string&, const Item&)>& add_item) {
    int header = op.is_explicit ? 1 : 0;
    std::string bytes;
    const auto part = [&](int bit, const std::vector<Item>& items) {
      if (items.empty()) return;
      header |= bit;
      add(bytes, static_cast<std::uint64_t>(items.size()));
      for (const Item& item : items) add_item(bytes, item);
    };
    part(0x02, op.explicit_items);
    part(0x04, op.added);
    part(0x20, op.prepended);
    part(0x40, op.appended);
    part(0x08, op.deleted);
    part(0x10, op.ordered);
    return placed(type, static_cast<char>(header) + bytes);
  }

  std::uint64_t encode_references(Type type, const ListOp<Reference>& op) {
    const bool is_payload = type == Type::PayloadListOp;
    if (is_payload && !at_least(8)) {
      std::string bytes;
      add_reference(bytes, op.explicit_items.front(), true);
      return placed(Type::Payload, bytes);
    }
    return encode_list_op<Reference>(type, op, [&](std::string& bytes, const Reference& item) {
      add_reference(bytes, item, is_payload);
    });
  }

  void add_reference(std::string& bytes, const Reference& reference, bool is_payload) {
    add(bytes, string(reference.asset));
    add(bytes, path(reference.path));
    if (!is_payload || at_least(8)) {
      add(bytes, reference.offset.offset);
      add(bytes, reference.offset.scale);
    }
    if (!is_payload) add(bytes, std::uint64_t{0});  // an empty dictionary
  }

  void add_spec(const std::string& spec_path, SpecType type, const FieldSet& set) {
    std::vector<std::uint32_t> fields;
    for (const auto& [name, value] : layer_.fields(set)) {
      if (!is_kept(value)) continue;
      fields.push_back(static_cast<std::uint32_t>(fields_.size()));
      const std::uint32_t name_token = token(name);
      fields_.emplace_back(name_token, encode(value));
    }
    specs_.push_back({path(spec_path), static_cast<std::uint32_t>(field_sets_.size()),
                      static_cast<std::uint32_t>(type)});
    field_sets_.insert(field_sets_.end(), fields.begin(), fields.end());
    field_sets_.push_back(0xFFFFFFFF);
  }

  template <class Integer>
  void add_coded(const std::vector<Integer>& items) {
    std::vector<std::int32_t> list(items.begin(), items.end());
    body_ += sized(list);
  }
  void add_compressed(const std::string& raw) {
    const std::string block = fast_compress(raw);
    add(body_, static_cast<std::uint64_t>(block.size()));
    body_ += block;
  }

  void write_tokens() {
    std::string raw;
    for (const std::string& text : tokens_) raw.append(text).push_back('\0');
    add(body_, static_cast<std::uint64_t>(tokens_.size()));
    add(body_, static_cast<std::uint64_t>(raw.size()));
    if (at_least(4)) {
      add_compressed(raw);
    } else {
      body_ += raw;
    }
  }
  void write_strings() {
    add(body_, static_cast<std::uint64_t>(strings_.size()));
    for (const std::uint32_t index : strings_) add(body_, index);
  }
  void write_fields() {
    add(body_, static_cast<std::uint64_t>(fields_.size()));
    if (!at_least(4)) {
      for (const auto& [name, value] : fields_) {
        add(body_, std::uint32_t{0});
        add(body_, name);
        add(body_, value);
      }
      return;
    }
    std::vector<std::uint32_t> names;
    std::string values;
    for (const auto& [name, value] : fields_) {
      names.push_back(name);
      add(values, value);
    }
    add_coded(names);
    add_compressed(values);
  }
  void write_field_sets() {
    add(body_, static_cast<std::uint64_t>(field_sets_.size()));
    if (at_least(4)) return add_coded(field_sets_);
    for (const std::uint32_t index : field_sets_) add(body_, index);
  }
  void write_paths() {
    add(body_, static_cast<std::uint64_t>(path_count_));
    if (!at_least(4)) return write_records("/", false);
    std::vector<std::uint32_t> indices;
    std::vector<std::int32_t> elements;
    std::vector<std::int32_t> jumps;
    const std::function<void(const std::string&, bool)> visit = [&](const std::string& text,
                                                                    bool has_sibling) {
      const Node& node = nodes_.at(text);
      const auto number = static_cast<std::int32_t>(token_of_.at(node.element));
      const std::size_t place = indices.size();
      indices.push_back(node.index);
      elements.push_back(node.is_property ? -number : number);
      jumps.push_back(0);
      for (std::size_t i = 0; i < node.children.size(); ++i) {
        visit(node.children[i], i + 1 < node.children.size());
      }
      const bool has_child = !node.children.empty();
      if (has_child && has_sibling) {
        jumps[place] = static_cast<std::int32_t>(indices.size() - place);
      } else {
        jumps[place] = has_child ? -1 : has_sibling ? 0 : -2;
      }
    };
    visit("/", false);
    add(body_, static_cast<std::uint64_t>(indices.size()));
    add_coded(indices);
    add_coded(elements);
    add_coded(jumps);
  }
  void write_records(const std::string& text, bool has_sibling) {
    const Node& node = nodes_.at(text);
    const bool has_child = !node.children.empty();
    if (!at_least(1)) add(body_, std::uint32_t{0});
    add(body_, node.index);
    add(body_, token_of_.at(node.element));
    add(body_, static_cast<std::uint32_t>((has_child ? 1 : 0) | (has_sibling ? 2 : 0) |
                                          (node.is_property ? 4 : 0)));
    const std::size_t sibling_at = body_.size();
    if (has_child && has_sibling) add(body_, std::int64_t{0});
    for (std::size_t i = 0; i < node.children.size(); ++i) {
      write_records(node.children[i], i + 1 < node.children.size());
    }
    if (!has_child || !has_sibling) return;
    const auto next = static_cast<std::int64_t>(body_.size());
    std::memcpy(body_.data() + sibling_at, &next, sizeof(next));
  }
  void write_specs() {
    add(body_, static_cast<std::uint64_t>(specs_.size()));
    std::vector<std::uint32_t> paths;
    std::vector<std::uint32_t> sets;
    std::vector<std::uint32_t> types;
    for (const Spec& spec : specs_) {
      paths.push_back(spec.path);
      sets.push_back(spec.field_set);
      types.push_back(spec.type);
      if (at_least(4)) continue;
      if (!at_least(1)) add(body_, std::uint32_t{0});
      for (const std::uint32_t number : {spec.path, spec.field_set, spec.type}) add(body_, number);
    }
    if (!at_least(4)) return;
    for (const auto* list : {&paths, &sets, &types}) add_coded(*list);
  }

  const Layer& layer_;
  CrateVersion version_;
  std::string body_;
  std::map<std::string, const PrimSpec*> sorted_;
  std::vector<std::string> tokens_;
  std::map<std::string, std::uint32_t, std::less<>> token_of_;
  std::vector<std::uint32_t> strings_;
  std::map<std::uint32_t, std::uint32_t> string_of_;
  std::uint32_t path_count_ = 0;
  std::map<std::string, std::uint32_t> path_of_;
  std::map<std::string, Node> nodes_;
  std::vector<std::pair<std::uint32_t, std::uint64_t>> fields_;
  std::vector<std::uint32_t> field_sets_;
  std::vector<Spec> specs_;
};

bool equal(const Value& a, const Value& b);

template <class T>
bool equal_items(const T* a, const T* b) {
  return a && b && *a == *b;
}

bool equal(const Dictionary& a, const Dictionary& b) {
  // What the reader does not keep is in one of them only.
  for (const auto& [key, value] : a) {
    if (!is_kept(value)) continue;
    const auto other = b.find(key);
    if (other == b.end() || !equal(value, other->second)) return false;
  }
  return std::all_of(b.begin(), b.end(), [&](const auto& item) { return a.contains(item.first); });
}

bool equal(const TimeSamples& a, const TimeSamples& b) {
  if (a.times != b.times) return false;
  for (std::size_t i = 0; i < a.times.size(); ++i) {
    if (!equal(a.value(i), b.value(i))) return false;
  }
  return true;
}

bool equal(const Value& a, const Value& b) {
  // A list of payloads is one payload in old files.
  if (a.type() == Type::PayloadListOp && b.type() == Type::Payload) {
    return a.as_reference_list_op()->explicit_items == std::vector<Reference>{*b.as_reference()};
  }
  if (a.type() != b.type() || a.is_array() != b.is_array() || a.size() != b.size()) return false;
  if (a.is_block()) return true;
  if (a.as_enumerator()) return a.as_enumerator() == b.as_enumerator();
  if (a.as_text()) return equal_items(a.as_text(), b.as_text());
  if (a.as_strings()) return equal_items(a.as_strings(), b.as_strings());
  if (a.as_dictionary()) return b.as_dictionary() && equal(*a.as_dictionary(), *b.as_dictionary());
  if (a.as_time_samples()) {
    return b.as_time_samples() && equal(*a.as_time_samples(), *b.as_time_samples());
  }
  if (a.as_string_list_op()) return equal_items(a.as_string_list_op(), b.as_string_list_op());
  if (a.as_integer_list_op()) return equal_items(a.as_integer_list_op(), b.as_integer_list_op());
  if (a.as_reference_list_op()) {
    return equal_items(a.as_reference_list_op(), b.as_reference_list_op());
  }
  if (a.as_reference()) return equal_items(a.as_reference(), b.as_reference());
  if (a.as_string_pairs()) return equal_items(a.as_string_pairs(), b.as_string_pairs());
  if (a.as_layer_offsets()) return equal_items(a.as_layer_offsets(), b.as_layer_offsets());
  return std::ranges::equal(a.bytes(), b.bytes());
}

std::string difference(const std::string& where, const Layer& a, const FieldSet& a_set,
                       const Layer& b, const FieldSet& b_set) {
  // Of fields of the same name the first counts.
  std::map<std::string_view, Value> others;
  for (auto& [name, value] : b.fields(b_set)) others.emplace(name, value);
  std::set<std::string_view> names;
  for (const auto& [name, value] : a.fields(a_set)) {
    if (!is_kept(value) || !names.insert(name).second) continue;
    const auto other = others.find(name);
    if (other == others.end()) return where + " lacks " + std::string(name);
    if (!equal(value, other->second)) return where + " has another " + std::string(name);
  }
  if (names.size() != others.size()) return where + " has fields of its own";
  return {};
}

}  // namespace

std::string encode_crate(const Layer& layer, CrateVersion version) {
  return Encoder(layer, version).encode();
}

std::string first_difference(const Layer& a, const Layer& b) {
  if (a.prims().size() != b.prims().size()) return "another number of prims";
  for (const auto& [path, spec] : a.prims()) {
    const PrimSpec* other = b.prim(path);
    if (!other) return path + " is missing";
    if (other->type != spec.type) return path + " is of another kind";
    std::string found = difference(path, a, spec.fields, b, other->fields);
    if (!found.empty()) return found;
    if (spec.properties.size() != other->properties.size()) return path + " has other properties";
    for (const PropertySpec& property : spec.properties) {
      const PropertySpec* same = other->property(property.name);
      const std::string where = path + "." + std::string(property.name);
      if (!same) return where + " is missing";
      if (same->type != property.type) return where + " is of another kind";
      found = difference(where, a, property.fields, b, same->fields);
      if (!found.empty()) return found;
    }
  }
  return {};
}

}  // namespace diorama::usd::test
