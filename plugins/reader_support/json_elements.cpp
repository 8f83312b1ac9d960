// SPDX-License-Identifier: Apache-2.0
#include "reader_support/json_elements.h"

#include <fstream>
#include <memory>
#include <stdexcept>
#include <vector>

#include "reader_support/stored_files.h"

namespace diorama {
namespace {

constexpr std::size_t kBlock = std::size_t(1) << 20;
constexpr std::size_t kMostValueBytes = std::size_t(1) << 30;

/// The characters of a file, one after the other.
class Characters {
 public:
  explicit Characters(const std::filesystem::path& file) : in_(open_stored(file)), block_(kBlock) {
    if (!in_) throw std::runtime_error("the file cannot be opened");
    // Some editors put the mark of UTF-8 in front.
    fill();
    if (std::string_view(block_.data(), size_).starts_with("\xEF\xBB\xBF")) at_ = 3;
  }

  /// -1 at the end.
  int peek() {
    if (at_ == size_ && !fill()) return -1;
    return static_cast<unsigned char>(block_[at_]);
  }
  int take() {
    const int c = peek();
    if (c >= 0) ++at_;
    return c;
  }
  std::uint64_t offset() const { return before_ + at_; }

 private:
  bool fill() {
    before_ += size_;
    in_.read(block_.data(), std::streamsize(block_.size()));
    size_ = std::size_t(in_.gcount());
    at_ = 0;
    return size_ > 0;
  }
  std::ifstream in_;
  std::vector<char> block_;
  std::size_t at_ = 0;
  std::size_t size_ = 0;
  std::uint64_t before_ = 0;
};

class Walker {
 public:
  Walker(const std::filesystem::path& file, const JsonVisitor& visit)
      : characters_(file), visit_(visit) {}

  void walk() {
    if (next() != '{') throw std::runtime_error("does not hold a JSON object");
    characters_.take();
    if (next() == '}') return;
    while (true) {
      if (next() != '"') throw std::runtime_error("expected a key" + place());
      value();
      const std::string key = text_.substr(1, text_.size() - 2);
      expect(':');
      if (next() == '[') {
        list(key);
      } else {
        const JsonSpan span = value();
        visit_(key, false, span, text_);
      }
      if (next() == '}') break;
      expect(',');
    }
    characters_.take();
    if (next() >= 0) throw std::runtime_error("goes on behind its end" + place());
  }

 private:
  std::string place() const { return " at byte " + std::to_string(characters_.offset()); }

  /// The next character that is no blank; -1 at the end.
  int next() {
    int c = characters_.peek();
    while (c == ' ' || c == '\n' || c == '\r' || c == '\t') {
      characters_.take();
      c = characters_.peek();
    }
    return c;
  }
  void expect(char c) {
    if (next() != c) {
      throw std::runtime_error(std::string(next() < 0 ? "is cut short, expected '" : "expected '") +
                               c + "'" + place());
    }
    characters_.take();
  }

  void list(const std::string& key) {
    const JsonSpan begin{characters_.offset(), 2};
    characters_.take();
    if (next() == ']') {
      characters_.take();
      visit_(key, false, begin, "[]");
      return;
    }
    while (true) {
      const JsonSpan span = value();
      visit_(key, true, span, text_);
      if (next() == ']') break;
      expect(',');
    }
    characters_.take();
  }

  void keep(int c) {
    if (c < 0) throw std::runtime_error("is cut short" + place());
    if (text_.size() >= kMostValueBytes)
      throw std::runtime_error("holds a value above 1 GiB" + place());
    text_.push_back(char(c));
  }

  void quoted() {
    keep(characters_.take());
    while (true) {
      const int c = characters_.take();
      keep(c);
      if (c == '\\') {
        keep(characters_.take());
      } else if (c == '"') {
        return;
      }
    }
  }

  /// The text of the value that begins here goes to text_.
  JsonSpan value() {
    next();
    JsonSpan span{characters_.offset(), 0};
    text_.clear();
    std::size_t depth = 0;
    while (true) {
      const int c = characters_.peek();
      if (c == '"') {
        quoted();
        if (depth == 0) break;
        continue;
      }
      if (depth == 0 && (c == ',' || c == '}' || c == ']' || c == ':' || c < 0)) break;
      if (c == '{' || c == '[') ++depth;
      if (c == '}' || c == ']') --depth;
      keep(characters_.take());
      if (depth == 0 && (c == '}' || c == ']')) break;
    }
    if (text_.empty()) throw std::runtime_error("expected a value" + place());
    span.length = std::uint32_t(text_.size());
    return span;
  }

  Characters characters_;
  const JsonVisitor& visit_;
  std::string text_;
};

}  // namespace

void visit_json_file(const std::filesystem::path& file, const JsonVisitor& visit) {
  Walker(file, visit).walk();
}

std::string read_span(const std::filesystem::path& file, JsonSpan span) {
  std::ifstream in = open_stored(file);
  in.seekg(std::streamoff(span.offset));
  std::string text(span.length, '\0');
  in.read(text.data(), std::streamsize(text.size()));
  if (!in) throw std::runtime_error("has become shorter");
  return text;
}

}  // namespace diorama
