// SPDX-License-Identifier: Apache-2.0
#include "reader_support/npy_array.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <stdexcept>

namespace diorama {
namespace {

constexpr std::size_t kMostSize = std::numeric_limits<std::size_t>::max();

std::size_t product(std::size_t a, std::size_t b) {
  if (b != 0 && a > kMostSize / b) throw std::runtime_error("its header's size is beyond reason");
  return a * b;
}

/// The Python literals of an npy header: texts, numbers, tuples, lists.
class HeaderText {
 public:
  explicit HeaderText(std::string_view text) : text_(text) {}

  bool accept(char c) {
    skip();
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  void expect(char c) {
    if (!accept(c)) throw std::runtime_error(std::string("its header lacks a '") + c + "'");
  }
  bool starts_with(char c) {
    skip();
    return text_.starts_with(c);
  }
  std::string text() {
    skip();
    const char quote = text_.empty() ? '\0' : text_.front();
    if (quote != '\'' && quote != '"') throw std::runtime_error("its header lacks a text");
    const std::size_t end = text_.find(quote, 1);
    if (end == text_.npos) throw std::runtime_error("a text in its header does not end");
    std::string result(text_.substr(1, end - 1));
    text_.remove_prefix(end + 1);
    return result;
  }
  std::string word() {
    skip();
    std::size_t end = 0;
    while (end < text_.size() &&
           std::string_view(",})] ").find(text_[end]) == std::string_view::npos)
      ++end;
    std::string result(text_.substr(0, end));
    text_.remove_prefix(end);
    return result;
  }
  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> numbers;
    expect('(');
    while (!accept(')')) {
      const std::string digits = word();
      std::size_t value = 0;
      const char* end = digits.data() + digits.size();
      const auto parsed = std::from_chars(digits.data(), end, value);
      if (parsed.ec != std::errc() || parsed.ptr != end || numbers.size() > 8) {
        throw std::runtime_error("the shape in its header is none");
      }
      numbers.push_back(value);
      if (!starts_with(')')) expect(',');
    }
    return numbers;
  }

 private:
  void skip() {
    while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\n'))
      text_.remove_prefix(1);
  }
  std::string_view text_;
};

std::size_t number_size(const std::string& type) {
  std::size_t size = 0;
  const char* end = type.data() + type.size();
  const bool is_known = type.size() >= 3 && (type[0] == '<' || type[0] == '|') &&
                        std::string_view("fiub").find(type[1]) != std::string_view::npos;
  if (!is_known || std::from_chars(type.data() + 2, end, size).ptr != end || size == 0 ||
      size > 16) {
    throw std::runtime_error("numbers of the type '" + type + "' are not understood");
  }
  return size;
}

void read_types(HeaderText& header, StoredArray& array) {
  if (!header.accept('[')) {
    const std::string type = header.text();
    array.item_size = number_size(type);
    array.fields.push_back({"", type, 0, 1});
    return;
  }
  while (!header.accept(']')) {
    header.expect('(');
    StoredArray::Field field;
    field.name = header.text();
    header.expect(',');
    field.type = header.text();
    field.offset = array.item_size;
    if (header.accept(',') && header.starts_with('(')) {
      for (const std::size_t extent : header.tuple()) field.count = product(field.count, extent);
    }
    header.accept(',');
    header.expect(')');
    array.item_size += product(field.count, number_size(field.type));
    if (array.item_size > (std::size_t(1) << 24) || array.fields.size() > 256) {
      throw std::runtime_error("its header's size is beyond reason");
    }
    array.fields.push_back(std::move(field));
    header.accept(',');
  }
}

}  // namespace

std::size_t StoredArray::count() const {
  std::size_t count = 1;
  for (const std::size_t extent : shape) count = product(count, extent);
  return count;
}

const StoredArray::Field* StoredArray::field(std::string_view name) const {
  const auto found = std::ranges::find(fields, name, &Field::name);
  return found == fields.end() ? nullptr : &*found;
}

StoredArray parse_array(std::string bytes) {
  if (bytes.size() < 12 || !bytes.starts_with("\x93NUMPY") || bytes[6] < 1 || bytes[6] > 3) {
    throw std::runtime_error("not an npy file of the versions 1 to 3");
  }
  const auto byte = [&](std::size_t at) {
    return std::size_t(static_cast<unsigned char>(bytes[at]));
  };
  const std::size_t begin = bytes[6] == 1 ? 10 : 12;
  std::size_t length = byte(8) | byte(9) << 8;
  if (bytes[6] != 1) length |= byte(10) << 16 | byte(11) << 24;
  if (bytes.size() - begin < length) throw std::runtime_error("ends within its header");
  StoredArray array;
  HeaderText header(std::string_view(bytes).substr(begin, length));
  header.expect('{');
  while (!header.accept('}')) {
    const std::string key = header.text();
    header.expect(':');
    if (key == "descr") {
      read_types(header, array);
    } else if (key == "shape") {
      array.shape = header.tuple();
    } else if (header.word() != "False") {
      throw std::runtime_error("its numbers are in Fortran order, which is not understood");
    }
    header.accept(',');
  }
  if (array.fields.empty()) throw std::runtime_error("its header says no type");
  const std::size_t expected = product(array.count(), array.item_size);
  const std::size_t found = bytes.size() - begin - length;
  if (found != expected) {
    throw std::runtime_error("holds " + std::to_string(found) + " bytes of data, its header says " +
                             std::to_string(expected));
  }
  bytes.erase(0, begin + length);
  array.data = std::move(bytes);
  return array;
}

}  // namespace diorama
