// SPDX-License-Identifier: Apache-2.0
#include "value.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace diorama::usd {
namespace {

template <class T>
T load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

double component_at(Type component, const std::byte* at) {
  switch (component) {
    case Type::Bool:
      return load<std::uint8_t>(at) != 0 ? 1.0 : 0.0;
    case Type::UChar:
      return load<std::uint8_t>(at);
    case Type::Int:
      return load<std::int32_t>(at);
    case Type::UInt:
      return load<std::uint32_t>(at);
    case Type::Int64:
      return static_cast<double>(load<std::int64_t>(at));
    case Type::UInt64:
      return static_cast<double>(load<std::uint64_t>(at));
    case Type::Half:
      return half_to_float(load<std::uint16_t>(at));
    case Type::Float:
      return load<float>(at);
    case Type::Double:
      return load<double>(at);
    default:
      return 0.0;
  }
}

template <class T>
T convert(double value) {
  if constexpr (std::is_integral_v<T>) {
    if (!(value >= std::numeric_limits<T>::min())) return std::numeric_limits<T>::min();
    if (value >= std::numeric_limits<T>::max()) return std::numeric_limits<T>::max();
  }
  return static_cast<T>(value);
}

template <class T>
constexpr Type component_type() {
  if constexpr (std::is_same_v<T, float>) return Type::Float;
  if constexpr (std::is_same_v<T, double>) return Type::Double;
  return Type::Int;
}

template <class Item>
void erase_item(std::vector<Item>& list, const Item& item) {
  list.erase(std::remove(list.begin(), list.end(), item), list.end());
}

}  // namespace

template <class Item>
void reorder(std::vector<Item>& list, const std::vector<Item>& order) {
  std::vector<Item> wanted;
  for (const Item& item : order) {
    if (std::find(wanted.begin(), wanted.end(), item) == wanted.end() &&
        std::find(list.begin(), list.end(), item) != list.end()) {
      wanted.push_back(item);
    }
  }
  const auto is_wanted = [&](const Item& item) {
    return std::find(wanted.begin(), wanted.end(), item) != wanted.end();
  };
  const auto first = std::find_if(list.begin(), list.end(), is_wanted);
  std::vector<Item> result(list.begin(), first);
  for (const Item& item : wanted) {
    auto at = std::find(list.begin(), list.end(), item);
    do {
      result.push_back(*at++);
    } while (at != list.end() && !is_wanted(*at));
  }
  list = std::move(result);
}

template <class Item>
void ListOp<Item>::apply(std::vector<Item>& list) const {
  const auto contains = [&](const Item& item) {
    return std::find(list.begin(), list.end(), item) != list.end();
  };
  if (is_explicit) {
    list.clear();
    for (const Item& item : explicit_items) {
      if (!contains(item)) list.push_back(item);
    }
    return;
  }
  for (const Item& item : deleted) erase_item(list, item);
  for (const Item& item : added) {
    if (!contains(item)) list.push_back(item);
  }
  for (auto item = prepended.rbegin(); item != prepended.rend(); ++item) {
    erase_item(list, *item);
    list.insert(list.begin(), *item);
  }
  for (const Item& item : appended) {
    erase_item(list, item);
    list.push_back(item);
  }
  if (!ordered.empty()) reorder(list, ordered);
}

template struct ListOp<std::string>;
template struct ListOp<std::int64_t>;
template struct ListOp<Reference>;
template void reorder(std::vector<std::string>&, const std::vector<std::string>&);

ValueSource::~ValueSource() = default;

Value TimeSamples::value(std::size_t index) const {
  return source ? source->decode(representations.at(index)) : values.at(index);
}

Value Value::scalar(Type type, const void* bytes) {
  const std::size_t size = numeric_layout(type).size();
  if (size > 32) {
    auto copy = std::make_shared<std::vector<std::byte>>(size);
    std::memcpy(copy->data(), bytes, size);
    const std::byte* data = copy->data();
    return Value(type, Buffer{std::move(copy), data, size});
  }
  std::array<std::byte, 32> storage{};
  std::memcpy(storage.data(), bytes, size);
  return Value(type, storage);
}

Value Value::array(Type type, Buffer buffer) {
  Value value(type, std::move(buffer));
  value.is_array_ = true;
  return value;
}

Value Value::text_array(Type type, Strings items) {
  Value value(type, std::make_shared<const Strings>(std::move(items)));
  value.is_array_ = true;
  return value;
}

Value Value::boolean(bool value) {
  const std::uint8_t byte = value ? 1 : 0;
  return scalar(Type::Bool, &byte);
}

Value Value::number(double value) { return scalar(Type::Double, &value); }

Value Value::integer(int value) {
  const std::int32_t number = value;
  return scalar(Type::Int, &number);
}

Value Value::text(Type type, std::string text) { return Value(type, std::move(text)); }

Value Value::enumerator(Type type, int number) {
  std::array<std::byte, 32> storage{};
  storage[0] = static_cast<std::byte>(number);
  return Value(type, storage);
}

std::optional<int> Value::as_enumerator() const {
  const bool is_enumerator =
      type_ == Type::Specifier || type_ == Type::Permission || type_ == Type::Variability;
  const auto* storage = std::get_if<std::array<std::byte, 32>>(&payload_);
  if (!is_enumerator || !storage) return std::nullopt;
  return std::to_integer<int>((*storage)[0]);
}

std::size_t Value::size() const {
  if (is_empty()) return 0;
  if (!is_array_) return 1;
  if (const auto* items = as_strings()) return items->size();
  const std::size_t element = numeric_layout(type_).size();
  return element == 0 ? 0 : bytes().size() / element;
}

std::span<const std::byte> Value::bytes() const {
  if (const auto* buffer = std::get_if<Buffer>(&payload_)) return {buffer->data, buffer->size};
  if (const auto* storage = std::get_if<std::array<std::byte, 32>>(&payload_)) {
    return {storage->data(), numeric_layout(type_).size()};
  }
  return {};
}

const void* Value::storage_key() const {
  if (const auto* buffer = std::get_if<Buffer>(&payload_)) return buffer->data;
  return as_strings();
}

std::optional<bool> Value::as_bool() const {
  const auto value = as_number();
  if (!value) return std::nullopt;
  return *value != 0.0;
}

std::optional<double> Value::as_number() const {
  const NumericLayout layout = numeric_layout(type_);
  if (layout.count == 0 || bytes().size() < layout.component_size) return std::nullopt;
  return component_at(layout.component, bytes().data());
}

bool Value::read(std::span<double> components) const {
  const NumericLayout layout = numeric_layout(type_);
  if (is_array_ || layout.count != components.size() || bytes().size() < layout.size()) {
    return false;
  }
  for (std::size_t i = 0; i < components.size(); ++i) components[i] = component(i);
  return true;
}

double Value::component(std::size_t index) const {
  const NumericLayout layout = numeric_layout(type_);
  const std::size_t offset = index * layout.component_size;
  if (layout.count == 0 || offset + layout.component_size > bytes().size()) return 0.0;
  return component_at(layout.component, bytes().data() + offset);
}

namespace {

void store(Type component, double value, std::byte* at) {
  if (component == Type::Double) {
    std::memcpy(at, &value, sizeof value);
  } else if (component == Type::Float) {
    const auto number = static_cast<float>(value);
    std::memcpy(at, &number, sizeof number);
  } else {
    const std::uint16_t half = float_to_half(static_cast<float>(value));
    std::memcpy(at, &half, sizeof half);
  }
}

// The shorter way between two rotations, of unit length where both are.
std::array<double, 4> blend_turns(const std::array<double, 4>& a, std::array<double, 4> b,
                                  double share) {
  double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  if (cosine < 0.0) {
    for (double& part : b) part = -part;
    cosine = -cosine;
  }
  double of_a = 1.0 - share;
  double of_b = share;
  if (cosine < 0.9995) {
    const double angle = std::acos(std::min(cosine, 1.0));
    of_a = std::sin((1.0 - share) * angle) / std::sin(angle);
    of_b = std::sin(share * angle) / std::sin(angle);
  }
  std::array<double, 4> result{};
  for (std::size_t i = 0; i < 4; ++i) result[i] = of_a * a[i] + of_b * b[i];
  return result;
}

bool is_blended(const Value& a, const Value& b) {
  const Type component = numeric_layout(a.type()).component;
  return a.type() == b.type() && a.is_array() == b.is_array() && !a.bytes().empty() &&
         a.bytes().size() == b.bytes().size() && numeric_layout(a.type()).count > 0 &&
         (component == Type::Half || component == Type::Float || component == Type::Double);
}

Value blend(const Value& a, const Value& b, double share) {
  const NumericLayout layout = numeric_layout(a.type());
  const bool are_turns =
      a.type() == Type::Quatd || a.type() == Type::Quatf || a.type() == Type::Quath;
  auto bytes = std::make_shared<std::vector<std::byte>>(a.bytes().size());
  const std::size_t count = bytes->size() / layout.component_size;
  const auto put = [&](std::size_t i, double value) {
    store(layout.component, value, bytes->data() + i * layout.component_size);
  };
  for (std::size_t i = 0; i + (are_turns ? 3 : 0) < count; i += are_turns ? 4 : 1) {
    if (!are_turns) {
      put(i, (1.0 - share) * a.component(i) + share * b.component(i));
      continue;
    }
    std::array<double, 4> turn_a{}, turn_b{};
    for (std::size_t k = 0; k < 4; ++k) {
      turn_a[k] = a.component(i + k);
      turn_b[k] = b.component(i + k);
    }
    const auto turn = blend_turns(turn_a, turn_b, share);
    for (std::size_t k = 0; k < 4; ++k) put(i + k, turn[k]);
  }
  if (!a.is_array()) return Value::scalar(a.type(), bytes->data());
  return Value::array(a.type(), Buffer{bytes, bytes->data(), bytes->size()});
}

}  // namespace

Value blended(const Value& a, const Value& b, double share) {
  return is_blended(a, b) ? blend(a, b, share) : a;
}

Value value_at(const TimeSamples& samples, double time) {
  const auto& times = samples.times;
  const auto later = std::upper_bound(times.begin(), times.end(), time);
  if (later == times.begin()) return samples.value(0);
  const auto before = static_cast<std::size_t>(later - times.begin()) - 1;
  const Value earlier = samples.value(before);
  if (later == times.end() || times[before] == time) return earlier;
  const Value next = samples.value(before + 1);
  const double length = times[before + 1] - times[before];
  if (!(length > 0.0)) return earlier;
  return blended(earlier, next, (time - times[before]) / length);
}

template <class T>
std::optional<Numbers<T>> numbers(const Value& value, std::size_t components_per_element) {
  const NumericLayout layout = numeric_layout(value.type());
  if (layout.count == 0 || layout.count != components_per_element) return std::nullopt;
  Numbers<T> result;
  result.source = value;
  // Of the copy: a small value lives inside the Value object itself.
  const auto bytes = result.source.bytes();
  const std::size_t count = bytes.size() / layout.component_size;
  const bool is_aligned = reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(T) == 0;
  if (layout.component == component_type<T>() && value.storage_key() && is_aligned) {
    result.span = {reinterpret_cast<const T*>(bytes.data()), count};
    return result;
  }
  result.converted.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    result.converted[i] =
        convert<T>(component_at(layout.component, bytes.data() + i * layout.component_size));
  }
  result.span = result.converted;
  return result;
}

template std::optional<Numbers<float>> numbers(const Value&, std::size_t);
template std::optional<Numbers<double>> numbers(const Value&, std::size_t);
template std::optional<Numbers<std::int32_t>> numbers(const Value&, std::size_t);

}  // namespace diorama::usd
