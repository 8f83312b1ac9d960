// SPDX-License-Identifier: Apache-2.0
#include "text_values.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

namespace diorama::usd {
namespace {

constexpr int kMaxTextNesting = 64;

bool is_quaternion(Type type) {
  return type == Type::Quatd || type == Type::Quatf || type == Type::Quath;
}

// Reads one value: numbers go to `bytes_`, texts to `texts_`; anything is skipped for an unknown
// type.
class ValueReader {
 public:
  ValueReader(TextScanner& scanner, const ValueTypeName& type)
      : scanner_(scanner), type_(type), layout_(numeric_layout(type.type)) {}

  Value read();

 private:
  void read_list(int nesting);
  bool next_item(char closing);
  void read_element();
  void read_tuple(int nesting);
  void read_atom();
  template <class Number>
  void append(Number number);
  template <class Integer>
  void append_integer(std::string_view digits);
  void append_number(std::string_view digits);
  void append_word(std::string_view word);
  Value finish();

  TextScanner& scanner_;
  const ValueTypeName& type_;
  NumericLayout layout_;
  std::vector<std::byte> bytes_;
  Strings texts_;
  std::size_t elements_ = 0;
};

Value ValueReader::read() {
  if (type_.type == Type::Invalid) {
    skip_text_value(scanner_);
    return Value(Type::UnregisteredValue, {});
  }
  if (type_.is_array) {
    if (scanner_.peek() != '[') scanner_.fail("expected a list in [ ] for " + type_.canonical);
    read_list(0);
  } else {
    if (scanner_.peek() == '[')
      scanner_.fail("found a list where " + type_.canonical + " is one value");
    read_element();
  }
  return finish();
}

void ValueReader::read_list(int nesting) {
  if (nesting > kMaxTextNesting) scanner_.fail("lists are nested too deeply");
  scanner_.expect('[', "before a list");
  const std::size_t start = scanner_.position();
  scanner_.skip_inline();
  if (scanner_.accept(']')) {
    if (nesting > 0) scanner_.fail("a list within a list is empty");
    return;
  }
  scanner_.rewind(start);
  scanner_.skip_lines();
  do {
    if (scanner_.peek() == '[') {
      read_list(nesting + 1);
    } else {
      read_element();
    }
  } while (next_item(']'));
  scanner_.skip_lines();
  scanner_.expect(']', "after a list");
}

// Steps over the comma to the next item, if there is one before `closing`.
bool ValueReader::next_item(char closing) {
  const std::size_t after = scanner_.position();
  scanner_.skip_inline();
  if (!scanner_.accept(',')) {
    scanner_.rewind(after);
    return false;
  }
  scanner_.skip_lines();
  return scanner_.peek() != closing;
}

void ValueReader::read_element() {
  ++elements_;
  if (scanner_.peek() == '(') {
    read_tuple(0);
  } else {
    read_atom();
  }
}

void ValueReader::read_tuple(int nesting) {
  if (nesting > kMaxTextNesting) scanner_.fail("tuples are nested too deeply");
  scanner_.expect('(', "before a tuple");
  scanner_.skip_lines();
  do {
    if (scanner_.peek() == '(') {
      read_tuple(nesting + 1);
    } else {
      read_atom();
    }
  } while (next_item(')'));
  scanner_.skip_lines();
  scanner_.expect(')', "after a tuple");
}

void ValueReader::read_atom() {
  if (type_.type == Type::AssetPath) {
    if (scanner_.peek() != '@' && !scanner_.at_string()) {
      scanner_.fail("expected an asset between @ signs");
    }
    texts_.push_back(scanner_.at_string() ? scanner_.read_string() : scanner_.read_asset());
    return;
  }
  if (is_text(type_.type)) {
    if (scanner_.at_string()) {
      texts_.push_back(scanner_.read_string());
      return;
    }
    const std::string_view word = scanner_.peek_word();
    if (type_.type != Type::Token || word.empty() || is_keyword(word)) {
      scanner_.fail("expected a quoted text for " + type_.canonical);
    }
    scanner_.advance(word.size());
    texts_.emplace_back(word);
    return;
  }
  const std::string_view digits = scanner_.read_number();
  if (!digits.empty()) return append_number(digits);
  const std::string_view word = scanner_.peek_word();
  append_word(word);
  scanner_.advance(word.size());
}

template <class Number>
void ValueReader::append(Number number) {
  const auto* raw = reinterpret_cast<const std::byte*>(&number);
  bytes_.insert(bytes_.end(), raw, raw + sizeof(Number));
}

template <class Integer>
void ValueReader::append_integer(std::string_view digits) {
  Integer value{};
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc{} && end == digits.data() + digits.size()) return append(value);
  // A number with a fraction is cut off; one outside of the range is an error.
  const double number = std::trunc(parse_number(digits));
  const int value_bits = std::numeric_limits<Integer>::digits;
  const double lowest = std::is_signed_v<Integer> ? -std::ldexp(1.0, value_bits) : 0.0;
  if (!(number >= lowest && number < std::ldexp(1.0, value_bits))) {
    scanner_.fail(std::string(digits) + " is not in the range of " + type_.canonical);
  }
  append(static_cast<Integer>(number));
}

void ValueReader::append_number(std::string_view digits) {
  switch (layout_.component) {
    case Type::Bool:
      return append<std::uint8_t>(parse_number(digits) != 0.0 ? 1 : 0);
    case Type::UChar:
      return append_integer<std::uint8_t>(digits);
    case Type::Int:
      return append_integer<std::int32_t>(digits);
    case Type::UInt:
      return append_integer<std::uint32_t>(digits);
    case Type::Int64:
      return append_integer<std::int64_t>(digits);
    case Type::UInt64:
      return append_integer<std::uint64_t>(digits);
    case Type::Half:
      return append(float_to_half(static_cast<float>(parse_number(digits))));
    case Type::Float:
      return append(static_cast<float>(parse_number(digits)));
    default:
      return append(parse_number(digits));
  }
}

void ValueReader::append_word(std::string_view word) {
  const auto is_any = [&](std::initializer_list<std::string_view> words) {
    for (const std::string_view candidate : words) {
      if (word.size() == candidate.size() &&
          std::equal(word.begin(), word.end(), candidate.begin(),
                     [](char a, char b) { return (a | 0x20) == b; })) {
        return true;
      }
    }
    return false;
  };
  if (layout_.component == Type::Bool && is_any({"true", "yes", "on"})) {
    return append<std::uint8_t>(1);
  }
  if (layout_.component == Type::Bool && is_any({"false", "no", "off"})) {
    return append<std::uint8_t>(0);
  }
  scanner_.fail("expected a number for " + type_.canonical);
}

Value ValueReader::finish() {
  if (is_text(type_.type)) {
    if (type_.is_array) return Value::text_array(type_.type, std::move(texts_));
    return Value::text(type_.type, std::move(texts_.front()));
  }
  const std::size_t needed = elements_ * layout_.size();
  if (bytes_.size() < needed) {
    scanner_.fail("too few numbers for " + type_.canonical);
  }
  bytes_.resize(needed);
  if (is_quaternion(type_.type)) {
    // Text puts the real part first, memory puts it last.
    for (std::size_t i = 0; i < needed; i += layout_.size()) {
      std::rotate(bytes_.begin() + i, bytes_.begin() + i + layout_.component_size,
                  bytes_.begin() + i + layout_.size());
    }
  }
  if (!type_.is_array) return Value::scalar(type_.type, bytes_.data());
  bytes_.shrink_to_fit();
  auto owner = std::make_shared<const std::vector<std::byte>>(std::move(bytes_));
  const std::byte* data = owner->data();
  return Value::array(type_.type, Buffer{std::move(owner), data, needed});
}

void skip_any(TextScanner& scanner, int nesting) {
  if (nesting > kMaxTextNesting) scanner.fail("values are nested too deeply");
  const char c = scanner.peek();
  if (c == '"' || c == '\'') {
    scanner.read_string();
    return;
  }
  if (c == '@') {
    scanner.read_asset();
    return;
  }
  if (c == '<') {
    scanner.read_path();
    return;
  }
  if (c == '[' || c == '(') {
    scanner.advance(1);
    const char close = c == '[' ? ']' : ')';
    scanner.skip_lines();
    if (nesting > 0 && c == '[' && scanner.peek() == ']') {
      scanner.fail("a list within a list is empty");
    }
    while (!scanner.accept(close)) {
      skip_any(scanner, nesting + 1);
      scanner.skip_inline();
      const bool has_more = scanner.accept(',');
      scanner.skip_lines();
      if (!has_more && scanner.peek() != close) scanner.expect(close, "after a list");
    }
    return;
  }
  if (!scanner.read_number().empty()) return;
  for (;;) {
    const std::string_view word = scanner.peek_word();
    if (word.empty() || is_keyword(word)) scanner.fail("expected a value");
    scanner.advance(word.size());
    if (!scanner.rest().starts_with("::")) return;
    scanner.advance(2);
  }
}

std::string read_dictionary_key(TextScanner& scanner) {
  if (scanner.at_string()) return scanner.read_string();
  const std::string_view word = scanner.peek_word();
  if (word.empty()) scanner.fail("expected the name of a dictionary entry");
  scanner.advance(word.size());
  return std::string(word);
}

std::shared_ptr<const Dictionary> read_dictionary(TextScanner& scanner, int nesting);

void read_dictionary_item(TextScanner& scanner, Dictionary& dictionary, int nesting) {
  if (scanner.accept_word("dictionary")) {
    scanner.require_space("dictionary");
    std::string key = read_dictionary_key(scanner);
    scanner.expect_assignment();
    dictionary.insert_or_assign(std::move(key),
                                Value(Type::Dictionary, read_dictionary(scanner, nesting + 1)));
    return;
  }
  std::string type_name(scanner.peek_word());
  if (type_name.empty() || is_keyword(type_name)) scanner.fail("expected a type or '}'");
  scanner.advance(type_name.size());
  const std::size_t after = scanner.position();
  scanner.skip_inline();
  if (scanner.accept('[')) {
    scanner.skip_inline();
    scanner.expect(']', "after [");
    type_name += "[]";
  } else {
    scanner.rewind(after);
  }
  const ValueTypeName type = parse_value_type(type_name);
  if (type.type == Type::Invalid) scanner.fail(type_name + " is not a type");
  scanner.require_space("a type");
  std::string key = read_dictionary_key(scanner);
  scanner.expect_assignment();
  dictionary.insert_or_assign(std::move(key), read_text_value(scanner, type));
}

std::shared_ptr<const Dictionary> read_dictionary(TextScanner& scanner, int nesting) {
  if (nesting > kMaxTextNesting) scanner.fail("dictionaries are nested too deeply");
  auto dictionary = std::make_shared<Dictionary>();
  scanner.expect('{', "before a dictionary");
  scanner.skip_lines();
  while (!scanner.accept('}')) {
    read_dictionary_item(scanner, *dictionary, nesting);
    const std::size_t after = scanner.position();
    scanner.skip_to_line_end();
    const bool is_separated = scanner.accept(';') || scanner.accept('\n') || scanner.accept('\r');
    if (!is_separated) scanner.rewind(after);
    scanner.skip_lines();
    if (!is_separated && scanner.peek() != '}') {
      scanner.fail("expected a new line or ';' between dictionary entries");
    }
  }
  return dictionary;
}

}  // namespace

Value read_text_value(TextScanner& scanner, const ValueTypeName& type) {
  return ValueReader(scanner, type).read();
}

std::shared_ptr<const Dictionary> read_text_dictionary(TextScanner& scanner) {
  return read_dictionary(scanner, 0);
}

void skip_text_value(TextScanner& scanner) { skip_any(scanner, 0); }

double parse_number(std::string_view digits) {
  if (digits == "inf") return std::numeric_limits<double>::infinity();
  if (digits == "-inf") return -std::numeric_limits<double>::infinity();
  if (digits == "nan") return std::numeric_limits<double>::quiet_NaN();
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::result_out_of_range) {
    // Too big becomes infinite, too small becomes zero.
    const bool is_small =
        digits.find("e-") != std::string_view::npos || digits.find("E-") != std::string_view::npos;
    const double size = is_small ? 0.0 : std::numeric_limits<double>::infinity();
    return digits.starts_with('-') ? -size : size;
  }
  return value;
}

}  // namespace diorama::usd
