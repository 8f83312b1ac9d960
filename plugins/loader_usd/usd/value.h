// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "types.h"

namespace diorama::usd {

class Value;

using Strings = std::vector<std::string>;
/// Keys in order of their bytes, as the format compares dictionaries.
using Dictionary = std::map<std::string, Value, std::less<>>;
using StringPairs = std::vector<std::pair<std::string, std::string>>;

/// Maps a layer's time to the time of who refers to it: time * scale + offset.
struct LayerOffset {
  double offset = 0.0;
  double scale = 1.0;
  bool is_identity() const { return offset == 0.0 && scale == 1.0; }
  double apply(double time) const { return time * scale + offset; }
  /// First `inner`, then this.
  LayerOffset compose(const LayerOffset& inner) const {
    return {offset + scale * inner.offset, scale * inner.scale};
  }
  friend bool operator==(const LayerOffset&, const LayerOffset&) = default;
};

/// A reference or a payload. An empty asset names the layer stack itself, an empty path the
/// default prim.
struct Reference {
  std::string asset;
  std::string path;
  LayerOffset offset;
  friend bool operator==(const Reference&, const Reference&) = default;
};

/// An edit of a list. Apply from the weakest opinion to the strongest.
template <class Item>
struct ListOp {
  bool is_explicit = false;
  std::vector<Item> explicit_items;
  std::vector<Item> added;
  std::vector<Item> prepended;
  std::vector<Item> appended;
  std::vector<Item> deleted;
  std::vector<Item> ordered;

  void apply(std::vector<Item>& list) const;
  friend bool operator==(const ListOp&, const ListOp&) = default;
};

/// Moves the items that `order` names into that order; every other item stays behind the item it
/// followed.
template <class Item>
void reorder(std::vector<Item>& list, const std::vector<Item>& order);

/// Where lazy values come from.
class ValueSource {
 public:
  virtual ~ValueSource();
  /// Reads what a value representation stands for. Throws FormatError.
  virtual Value decode(std::uint64_t representation) const = 0;
  /// Whether it stands for an array, or for time samples, which may be arrays.
  virtual bool may_hold_array(std::uint64_t representation) const = 0;
};

/// Times in ascending order and the value of each, read when asked for.
struct TimeSamples {
  std::vector<double> times;
  std::vector<Value> values;                   ///< Text layers.
  std::vector<std::uint64_t> representations;  ///< Crate layers.
  std::shared_ptr<const ValueSource> source;

  Value value(std::size_t index) const;
};

/// The value at a time: between two samples numbers and quaternions are blended as OpenUSD does it,
/// where both are of one kind and size; else the earlier one holds. Before the first and after the
/// last sample these hold.
Value value_at(const TimeSamples& samples, double time);
/// On the way between two values, as between two samples; the first one where there is no way.
Value blended(const Value& a, const Value& b, double share);

/// A run of numbers in memory that the value keeps alive: a part of the mapped file where that is
/// possible, a buffer otherwise.
struct Buffer {
  std::shared_ptr<const void> owner;
  const std::byte* data = nullptr;
  std::size_t size = 0;  ///< In bytes.
};

/// What a field of a layer holds. Cheap to copy: big values are shared and immutable.
class Value {
 public:
  using Payload = std::variant<
      std::monostate, std::array<std::byte, 32>, Buffer, std::string,
      std::shared_ptr<const Strings>, std::shared_ptr<const Dictionary>,
      std::shared_ptr<const ListOp<std::string>>, std::shared_ptr<const ListOp<std::int64_t>>,
      std::shared_ptr<const ListOp<Reference>>, std::shared_ptr<const StringPairs>,
      std::shared_ptr<const TimeSamples>, std::shared_ptr<const Reference>,
      std::shared_ptr<const std::vector<double>>, std::shared_ptr<const std::vector<LayerOffset>>>;

  Value() = default;
  Value(Type type, Payload payload) : type_(type), payload_(std::move(payload)) {}

  /// A number, a tuple, a matrix or a quaternion (i, j, k, real) from its raw bytes.
  static Value scalar(Type type, const void* bytes);
  /// An array of such; `buffer` holds a whole number of elements.
  static Value array(Type type, Buffer buffer);
  static Value text_array(Type type, Strings items);
  static Value boolean(bool value);
  static Value number(double value);
  static Value integer(int value);
  static Value text(Type type, std::string text);
  /// A specifier, permission or variability by its number.
  static Value enumerator(Type type, int number);
  static Value block() { return Value(Type::ValueBlock, {}); }

  Type type() const { return type_; }
  bool is_array() const { return is_array_; }
  bool is_empty() const { return type_ == Type::Invalid; }
  bool is_block() const { return type_ == Type::ValueBlock || type_ == Type::AnimationBlock; }

  /// Elements of an array, 1 for anything else that is not empty.
  std::size_t size() const;
  /// The numbers of a numeric value, element after element; empty for other types.
  std::span<const std::byte> bytes() const;
  /// Names the memory of an array: equal keys mean equal contents. Null for other values.
  const void* storage_key() const;

  const std::string* as_text() const { return std::get_if<std::string>(&payload_); }
  const Strings* as_strings() const { return shared<Strings>(); }
  const Dictionary* as_dictionary() const { return shared<Dictionary>(); }
  const ListOp<std::string>* as_string_list_op() const { return shared<ListOp<std::string>>(); }
  const ListOp<std::int64_t>* as_integer_list_op() const { return shared<ListOp<std::int64_t>>(); }
  const ListOp<Reference>* as_reference_list_op() const { return shared<ListOp<Reference>>(); }
  const Reference* as_reference() const { return shared<Reference>(); }
  const StringPairs* as_string_pairs() const { return shared<StringPairs>(); }
  const TimeSamples* as_time_samples() const { return shared<TimeSamples>(); }
  const std::vector<LayerOffset>* as_layer_offsets() const {
    return shared<std::vector<LayerOffset>>();
  }

  /// The number of an enumerator.
  std::optional<int> as_enumerator() const;
  std::optional<bool> as_bool() const;
  /// The first component of a numeric value.
  std::optional<double> as_number() const;
  /// Exactly `count` components of a scalar numeric value; false if it has another shape.
  bool read(std::span<double> components) const;
  /// Component `index` of a numeric value, counted over all elements.
  double component(std::size_t index) const;

 private:
  template <class T>
  const T* shared() const {
    const auto* pointer = std::get_if<std::shared_ptr<const T>>(&payload_);
    return pointer ? pointer->get() : nullptr;
  }

  Type type_ = Type::Invalid;
  bool is_array_ = false;
  Payload payload_;
};

/// The numbers of a numeric array as `T`, without a copy where the layer already stores that type.
/// Keeps the memory alive.
template <class T>
struct Numbers {
  std::span<const T> span;
  Value source;
  std::vector<T> converted;

  Numbers() = default;
  Numbers(Numbers&&) noexcept = default;
  Numbers& operator=(Numbers&&) noexcept = default;
  Numbers(const Numbers&) = delete;
  Numbers& operator=(const Numbers&) = delete;
};

/// Nothing when `value` is not numeric or has another number of components per element. `T` is
/// float, double or std::int32_t.
template <class T>
std::optional<Numbers<T>> numbers(const Value& value, std::size_t components_per_element);

}  // namespace diorama::usd
