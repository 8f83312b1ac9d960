// SPDX-License-Identifier: Apache-2.0
#include "crate_values.h"

#include <algorithm>
#include <array>

namespace diorama::usd {
namespace {

constexpr std::uint64_t kArrayBit = std::uint64_t{1} << 63;
constexpr std::uint64_t kInlinedBit = std::uint64_t{1} << 62;
constexpr std::uint64_t kCompressedBit = std::uint64_t{1} << 61;
constexpr std::uint64_t kArrayEditBit = std::uint64_t{1} << 60;
constexpr std::uint64_t kPayloadMask = (std::uint64_t{1} << 48) - 1;
// Arrays shorter than this are stored as they are although marked as compressed.
constexpr std::uint64_t kMinCompressedArray = 16;
constexpr int kMaxValueNesting = 64;

struct Representation {
  std::uint64_t bits;
  Type type() const { return static_cast<Type>((bits >> 48) & 0xFF); }
  bool is_array() const { return bits & kArrayBit; }
  bool is_inlined() const { return bits & kInlinedBit; }
  bool is_compressed() const { return bits & kCompressedBit; }
  std::uint64_t payload() const { return bits & kPayloadMask; }
  std::uint32_t inlined() const { return static_cast<std::uint32_t>(bits); }
};

template <class T>
Buffer own(std::vector<T> items) {
  auto owner = std::make_shared<const std::vector<T>>(std::move(items));
  const auto* data = reinterpret_cast<const std::byte*>(owner->data());
  const std::size_t size = owner->size() * sizeof(T);
  return {std::move(owner), data, size};
}

void store_component(Type component, double value, std::byte* at) {
  switch (component) {
    case Type::Half: {
      const std::uint16_t half = float_to_half(static_cast<float>(value));
      std::memcpy(at, &half, 2);
      return;
    }
    case Type::Float: {
      const auto number = static_cast<float>(value);
      std::memcpy(at, &number, 4);
      return;
    }
    case Type::Double:
      std::memcpy(at, &value, 8);
      return;
    default: {
      const auto number = static_cast<std::int32_t>(value);
      std::memcpy(at, &number, 4);
      return;
    }
  }
}

}  // namespace

// Decodes one value with everything below it. The budget bounds the work that nested values of a
// malicious file can cause by pointing at each other.
class CrateValues::Decoder {
 public:
  explicit Decoder(const CrateValues& crate)
      : crate_(crate), budget_(crate.view_.bytes.size() + 1024) {}

  Value decode(Representation rep);

 private:
  Value decode_inlined(Representation rep) const;
  Value decode_array(Representation rep);
  Value decode_compressed_array(Type type, std::uint64_t count, CrateCursor cursor) const;
  template <class T>
  Value decode_compressed_floats(Type type, std::uint64_t count, CrateCursor cursor) const;
  Value decode_at(Type type, CrateCursor cursor);
  Value read_time_samples(CrateCursor cursor);
  std::shared_ptr<const Dictionary> read_dictionary(CrateCursor& cursor);
  Value read_nested(CrateCursor& cursor);
  Reference read_reference(CrateCursor& cursor, bool is_payload);
  StringPairs read_string_pairs(CrateCursor& cursor, bool are_paths);
  template <class Item, class Read>
  std::vector<Item> read_items(CrateCursor& cursor, std::uint64_t item_size, Read read);
  template <class Item, class Read>
  Value read_list_op(Type type, CrateCursor& cursor, std::uint64_t item_size, Read read);

  std::string read_token(CrateCursor& cursor) const {
    const std::uint64_t at = cursor.position();
    return std::string(crate_.token(cursor.read<std::uint32_t>("a token index"), at));
  }
  std::string read_string(CrateCursor& cursor) const {
    const std::uint64_t at = cursor.position();
    return std::string(crate_.string(cursor.read<std::uint32_t>("a string index"), at));
  }
  std::string read_path(CrateCursor& cursor) const {
    const std::uint64_t at = cursor.position();
    return crate_.path(cursor.read<std::uint32_t>("a path index"), at);
  }

  const CrateValues& crate_;
  std::uint64_t budget_;
  int nesting_ = 0;
};

std::string_view CrateValues::token(std::uint64_t index, std::uint64_t offset) const {
  if (index >= tokens_.size()) {
    throw format_error_at(
        file_,
        "token index " + std::to_string(index) + " is not below " + std::to_string(tokens_.size()),
        offset);
  }
  return tokens_[index];
}

std::string_view CrateValues::string(std::uint64_t index, std::uint64_t offset) const {
  if (index >= strings_.size()) {
    throw format_error_at(file_,
                          "string index " + std::to_string(index) + " is not below " +
                              std::to_string(strings_.size()),
                          offset);
  }
  return token(strings_[index], offset);
}

std::string CrateValues::path(std::uint64_t index, std::uint64_t offset) const {
  if (index >= paths_.size()) {
    throw format_error_at(
        file_,
        "path index " + std::to_string(index) + " is not below " + std::to_string(paths_.size()),
        offset);
  }
  std::vector<const PathEntry*> chain;
  const PathEntry* entry = &paths_[index];
  for (; entry->parent != PathEntry::kRoot; entry = &paths_[entry->parent]) {
    if (entry->parent == PathEntry::kUnset) return {};
    chain.push_back(entry);
  }
  if (chain.empty()) return "/";
  std::string text;
  for (auto it = chain.rbegin(); it != chain.rend(); ++it) {
    const std::string_view element = tokens_[(*it)->token];
    const bool is_bare =
        element.starts_with('{') || element.starts_with('[') || element.starts_with('.');
    if ((*it)->is_property) {
      text += '.';
    } else if (!is_bare && !text.ends_with('}')) {
      text += '/';
    }
    text += element;
  }
  return text;
}

Value CrateValues::decode(std::uint64_t representation) const {
  return Decoder(*this).decode(Representation{representation});
}

bool CrateValues::may_hold_array(std::uint64_t representation) const {
  const Representation rep{representation};
  return rep.is_array() || rep.type() == Type::TimeSamples;
}

Value CrateValues::Decoder::decode(Representation rep) {
  if (budget_ == 0 || nesting_ >= kMaxValueNesting) {
    crate_.cursor(0).fail_at("values are nested without end", rep.payload());
  }
  --budget_;
  // Edits of arrays came after the versions that this reader accepts.
  if (rep.bits & kArrayEditBit) {
    crate_.cursor(0).fail_at("an array edit, which needs crate version 0.14", rep.payload());
  }
  if (rep.is_array()) return decode_array(rep);
  if (rep.is_inlined()) return decode_inlined(rep);
  ++nesting_;
  Value value = decode_at(rep.type(), crate_.cursor(rep.payload()));
  --nesting_;
  return value;
}

Value CrateValues::Decoder::decode_inlined(Representation rep) const {
  const Type type = rep.type();
  const std::uint32_t bits = rep.inlined();
  switch (type) {
    case Type::String:
    case Type::PathExpression:
      return Value::text(type, std::string(crate_.string(bits, rep.payload())));
    case Type::Token:
    case Type::AssetPath:
      return Value::text(type, std::string(crate_.token(bits, rep.payload())));
    case Type::Specifier:
    case Type::Permission:
    case Type::Variability:
      return Value::enumerator(type, static_cast<int>(bits & 0xFF));
    case Type::ValueBlock:
    case Type::AnimationBlock:
      return Value(type, {});
    case Type::Dictionary:
      return Value(type, std::make_shared<const Dictionary>());
    default:
      break;
  }
  const NumericLayout layout = numeric_layout(type);
  if (layout.count == 0) {
    crate_.cursor(0).fail_at("a value of type " + std::to_string(static_cast<int>(type)) +
                                 " cannot be stored in its own representation",
                             rep.payload());
  }
  std::array<std::byte, 128> bytes{};
  if (layout.size() <= 4) {
    std::memcpy(bytes.data(), &bits, layout.size());
    return Value::scalar(type, bytes.data());
  }
  if (layout.count == 1) {
    if (layout.component == Type::Double) {
      float number;
      std::memcpy(&number, &bits, 4);
      const double exact = number;
      std::memcpy(bytes.data(), &exact, 8);
    } else {
      const std::int64_t number =
          type == Type::Int64 ? std::int64_t{static_cast<std::int32_t>(bits)} : std::int64_t{bits};
      std::memcpy(bytes.data(), &number, 8);
    }
    return Value::scalar(type, bytes.data());
  }
  const bool is_matrix = type == Type::Matrix2d || type == Type::Matrix3d || type == Type::Matrix4d;
  const int rows = type == Type::Matrix2d ? 2 : type == Type::Matrix3d ? 3 : 4;
  const int stored = is_matrix ? rows : layout.count;
  for (int i = 0; i < stored; ++i) {
    const auto number = static_cast<std::int8_t>(bits >> (8 * i));
    const int slot = is_matrix ? i * (rows + 1) : i;
    store_component(layout.component, number, bytes.data() + slot * layout.component_size);
  }
  return Value::scalar(type, bytes.data());
}

Value CrateValues::Decoder::decode_array(Representation rep) {
  const Type type = rep.type();
  const NumericLayout layout = numeric_layout(type);
  const bool holds_text = is_text(type);
  if (layout.count == 0 && !holds_text) {
    crate_.cursor(0).fail_at("an array of type " + std::to_string(static_cast<int>(type)),
                             rep.payload());
  }
  if (rep.payload() == 0) {
    return holds_text ? Value::text_array(type, {}) : Value::array(type, {});
  }
  CrateCursor cursor = crate_.cursor(rep.payload());
  if (!crate_.at_least(5)) cursor.read<std::uint32_t>("the rank of an array");
  const std::uint64_t count = crate_.at_least(7)
                                  ? cursor.read<std::uint64_t>("the length of an array")
                                  : cursor.read<std::uint32_t>("the length of an array");
  if (holds_text) {
    if (count > cursor.remaining() / 4) cursor.fail("an array is longer than the file");
    Strings items;
    items.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      items.push_back(type == Type::Token ? read_token(cursor) : read_string(cursor));
    }
    return Value::text_array(type, std::move(items));
  }
  if (rep.is_compressed() && count >= kMinCompressedArray) {
    return decode_compressed_array(type, count, cursor);
  }
  if (count > cursor.remaining() / layout.size()) {
    cursor.fail("an array of " + std::to_string(count) + " elements is longer than the file");
  }
  const auto bytes = cursor.take(count * layout.size(), "an array");
  return Value::array(type, Buffer{crate_.view_.owner, bytes.data(), bytes.size()});
}

Value CrateValues::Decoder::decode_compressed_array(Type type, std::uint64_t count,
                                                    CrateCursor cursor) const {
  switch (type) {
    case Type::Int:
      return Value::array(type, own(cursor.read_integers<std::int32_t>(count, "integers")));
    case Type::UInt:
      return Value::array(type, own(cursor.read_integers<std::uint32_t>(count, "integers")));
    case Type::Int64:
      return Value::array(type, own(cursor.read_integers<std::int64_t>(count, "integers")));
    case Type::UInt64:
      return Value::array(type, own(cursor.read_integers<std::uint64_t>(count, "integers")));
    case Type::Half:
      return decode_compressed_floats<std::uint16_t>(type, count, cursor);
    case Type::Float:
      return decode_compressed_floats<float>(type, count, cursor);
    case Type::Double:
      return decode_compressed_floats<double>(type, count, cursor);
    default:
      cursor.fail("arrays of this type are never compressed");
  }
}

template <class T>
Value CrateValues::Decoder::decode_compressed_floats(Type type, std::uint64_t count,
                                                     CrateCursor cursor) const {
  const char code = cursor.read<char>("the coding of an array");
  std::vector<T> result;
  if (code == 'i') {
    const auto integers = cursor.read_integers<std::int32_t>(count, "whole numbers");
    result.resize(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      if constexpr (std::is_same_v<T, std::uint16_t>) {
        result[i] = float_to_half(static_cast<float>(integers[i]));
      } else {
        result[i] = static_cast<T>(integers[i]);
      }
    }
  } else if (code == 't') {
    const auto table_size = cursor.read<std::uint32_t>("the size of a table of numbers");
    if (table_size > cursor.remaining() / sizeof(T)) cursor.fail("a table is longer than the file");
    const auto table = cursor.take(table_size * sizeof(T), "a table of numbers");
    const auto indices = cursor.read_integers<std::uint32_t>(count, "table indices");
    result.resize(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (indices[i] >= table_size) cursor.fail("an index into a table of numbers is too big");
      std::memcpy(&result[i], table.data() + indices[i] * sizeof(T), sizeof(T));
    }
  } else {
    cursor.fail("an array has an unknown coding");
  }
  return Value::array(type, own(std::move(result)));
}

template <class Item, class Read>
std::vector<Item> CrateValues::Decoder::read_items(CrateCursor& cursor, std::uint64_t item_size,
                                                   Read read) {
  const std::uint64_t count = cursor.read_count(item_size, "items");
  std::vector<Item> items;
  items.reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) items.push_back(read());
  return items;
}

template <class Item, class Read>
Value CrateValues::Decoder::read_list_op(Type type, CrateCursor& cursor, std::uint64_t item_size,
                                         Read read) {
  const auto header = cursor.read<std::uint8_t>("the header of a list edit");
  auto op = std::make_shared<ListOp<Item>>();
  op->is_explicit = header & 0x01;
  const auto part = [&](int bit, std::vector<Item>& items) {
    if (header & bit) items = read_items<Item>(cursor, item_size, read);
  };
  part(0x02, op->explicit_items);
  part(0x04, op->added);
  part(0x20, op->prepended);
  part(0x40, op->appended);
  part(0x08, op->deleted);
  part(0x10, op->ordered);
  return Value(type, std::shared_ptr<const ListOp<Item>>(std::move(op)));
}

Value CrateValues::Decoder::read_nested(CrateCursor& cursor) {
  const auto offset = cursor.read<std::int64_t>("an offset");
  // Relative to where the offset itself stands.
  CrateCursor target = cursor.relative(offset - 8);
  const Representation rep{target.read<std::uint64_t>("a value")};
  cursor = target;
  ++nesting_;
  Value value = decode(rep);
  --nesting_;
  return value;
}

std::shared_ptr<const Dictionary> CrateValues::Decoder::read_dictionary(CrateCursor& cursor) {
  const std::uint64_t count = cursor.read_count(12, "dictionary entries");
  auto dictionary = std::make_shared<Dictionary>();
  for (std::uint64_t i = 0; i < count; ++i) {
    std::string key = read_string(cursor);
    dictionary->insert_or_assign(std::move(key), read_nested(cursor));
  }
  return dictionary;
}

Reference CrateValues::Decoder::read_reference(CrateCursor& cursor, bool is_payload) {
  Reference reference;
  reference.asset = read_string(cursor);
  reference.path = read_path(cursor);
  if (!is_payload || crate_.at_least(8)) {
    reference.offset.offset = cursor.read<double>("a layer offset");
    reference.offset.scale = cursor.read<double>("a layer scale");
  }
  if (!is_payload) read_dictionary(cursor);
  return reference;
}

StringPairs CrateValues::Decoder::read_string_pairs(CrateCursor& cursor, bool are_paths) {
  return read_items<StringPairs::value_type>(cursor, 8, [&] {
    std::string first = are_paths ? read_path(cursor) : read_string(cursor);
    return std::pair(std::move(first), are_paths ? read_path(cursor) : read_string(cursor));
  });
}

Value CrateValues::Decoder::read_time_samples(CrateCursor cursor) {
  auto samples = std::make_shared<TimeSamples>();
  const Value times = read_nested(cursor);
  if (const auto list = numbers<double>(times, 1)) {
    samples->times.assign(list->span.begin(), list->span.end());
  } else {
    cursor.fail("the times of samples are not a list of numbers");
  }
  const auto offset = cursor.read<std::int64_t>("an offset");
  cursor = cursor.relative(offset - 8);
  const std::uint64_t count = cursor.read_count(8, "time samples");
  if (count != samples->times.size()) {
    cursor.fail(std::to_string(samples->times.size()) + " sample times but " +
                std::to_string(count) + " samples");
  }
  const auto bytes = cursor.take(count * 8, "time samples");
  samples->representations.resize(count);
  if (count > 0) std::memcpy(samples->representations.data(), bytes.data(), bytes.size());
  samples->source = crate_.shared_from_this();
  return Value(Type::TimeSamples, std::shared_ptr<const TimeSamples>(std::move(samples)));
}

Value CrateValues::Decoder::decode_at(Type type, CrateCursor cursor) {
  const NumericLayout layout = numeric_layout(type);
  if (layout.count > 0) {
    return Value::scalar(type, cursor.take(layout.size(), "a value").data());
  }
  const auto strings = [&](auto read) {
    return Value(type, std::make_shared<const Strings>(read_items<std::string>(cursor, 4, read)));
  };
  switch (type) {
    case Type::String:
    case Type::PathExpression:
      return Value::text(type, read_string(cursor));
    case Type::Token:
    case Type::AssetPath:
      return Value::text(type, read_token(cursor));
    case Type::Dictionary:
      return Value(type, read_dictionary(cursor));
    case Type::TokenListOp:
      return read_list_op<std::string>(type, cursor, 4, [&] { return read_token(cursor); });
    case Type::StringListOp:
      return read_list_op<std::string>(type, cursor, 4, [&] { return read_string(cursor); });
    case Type::PathListOp:
      return read_list_op<std::string>(type, cursor, 4, [&] { return read_path(cursor); });
    case Type::ReferenceListOp:
      return read_list_op<Reference>(type, cursor, 32,
                                     [&] { return read_reference(cursor, false); });
    case Type::PayloadListOp:
      return read_list_op<Reference>(type, cursor, 8, [&] { return read_reference(cursor, true); });
    case Type::IntListOp:
      return read_list_op<std::int64_t>(
          type, cursor, 4, [&] { return std::int64_t{cursor.read<std::int32_t>("an integer")}; });
    case Type::UIntListOp:
      return read_list_op<std::int64_t>(
          type, cursor, 4, [&] { return std::int64_t{cursor.read<std::uint32_t>("an integer")}; });
    case Type::Int64ListOp:
    case Type::UInt64ListOp:
      return read_list_op<std::int64_t>(type, cursor, 8,
                                        [&] { return cursor.read<std::int64_t>("an integer"); });
    case Type::TokenVector:
      return strings([&] { return read_token(cursor); });
    case Type::StringVector:
      return strings([&] { return read_string(cursor); });
    case Type::PathVector:
      return strings([&] { return read_path(cursor); });
    case Type::VariantSelectionMap:
    case Type::Relocates:
      return Value(type, std::make_shared<const StringPairs>(
                             read_string_pairs(cursor, type == Type::Relocates)));
    case Type::TimeSamples:
      return read_time_samples(cursor);
    case Type::Payload:
      return Value(type, std::make_shared<const Reference>(read_reference(cursor, true)));
    case Type::DoubleVector:
      return Value::array(
          Type::Double,
          own(read_items<double>(cursor, 8, [&] { return cursor.read<double>("a number"); })));
    case Type::LayerOffsetVector: {
      auto offsets = read_items<LayerOffset>(cursor, 16, [&] {
        LayerOffset offset;
        offset.offset = cursor.read<double>("a layer offset");
        offset.scale = cursor.read<double>("a layer scale");
        return offset;
      });
      return Value(type, std::make_shared<const std::vector<LayerOffset>>(std::move(offsets)));
    }
    case Type::Value:
    case Type::UnregisteredValue:
      return read_nested(cursor);
    // Nothing here asks for their contents, so they are known by their type only.
    case Type::Spline:
    case Type::UnregisteredValueListOp:
    case Type::ValueBlock:
    case Type::AnimationBlock:
      return Value(type, {});
    default:
      cursor.fail("a value of the unknown type " + std::to_string(static_cast<int>(type)));
  }
}

}  // namespace diorama::usd
