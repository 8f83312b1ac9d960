// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace diorama::usd {

/// Walks over the text of a usda layer: padding, words, strings, asset references. Failures throw
/// FormatError with `file:line:column`.
class TextScanner {
 public:
  TextScanner(const std::string& file, std::string_view text) : file_(&file), text_(text) {}

  bool at_end() const { return at_ >= text_.size(); }
  char peek() const { return at_end() ? '\0' : text_[at_]; }
  std::string_view rest() const { return text_.substr(at_); }
  std::size_t position() const { return at_; }
  void rewind(std::size_t position) { at_ = position; }
  void advance(std::size_t count) { at_ += count; }

  /// Spaces, tabs and `/* */`.
  void skip_inline();
  /// Also comments that end with the line.
  void skip_to_line_end();
  /// Also line ends.
  void skip_lines();
  /// `skip_inline` that must meet a space.
  void require_space(const char* after);

  bool accept(char c);
  void expect(char c, const char* what);
  /// `=` with inline padding around it.
  void expect_assignment();
  /// Consumes `word` if the next identifier is just that.
  bool accept_word(std::string_view word);
  /// The next identifier without consuming it; empty when there is none.
  std::string_view peek_word() const;

  bool at_string() const { return peek() == '"' || peek() == '\''; }
  /// A quoted string with its escapes resolved.
  std::string read_string();
  /// `@asset@` or `@@@asset@@@`.
  std::string read_asset();
  /// The text between `<` and `>`.
  std::string read_path();
  /// The characters of a number; empty when there is none.
  std::string_view read_number();

  [[noreturn]] void fail(const std::string& what) const;

 private:
  bool skip_block_comment();
  bool skip_line_comment();

  const std::string* file_;
  std::string_view text_;
  std::size_t at_ = 0;
};

/// Words that cannot name a type or a metadata field.
bool is_keyword(std::string_view word);

}  // namespace diorama::usd
