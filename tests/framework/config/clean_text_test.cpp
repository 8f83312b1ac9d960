// SPDX-License-Identifier: Apache-2.0
#include "framework/config/clean_text.h"

#include "framework/config/json_text.h"
#include "support/catch.h"

using namespace diorama;

TEST_CASE("UTF-8 is what Unicode says it is", "[text]") {
  const struct {
    const char* text;
    std::size_t length;
  } kCases[] = {{"a", 1},
                {"\xC2\x80", 2},
                {"\xE2\x82\xAC", 3},
                {"\xF0\x9F\x8D\x8C", 4},
                {"\xF4\x8F\xBF\xBF", 4},
                {"\x80", 0},
                {"\xC1\x81", 0},              // 'A', spelt too long
                {"\xE0\x9F\xBF", 0},          // the same
                {"\xED\xA0\x80", 0},          // a surrogate
                {"\xF4\x90\x80\x80", 0},      // beyond U+10FFFF
                {"\xF0\x8F\xBF\xBF", 0},      // spelt too long
                {"\xF8\x88\x80\x80\x80", 0},  // five bytes
                {"\xE2\x82", 0},              // cut off
                {"", 0}};
  for (const auto& [text, length] : kCases) {
    CHECK(utf8_length(text) == length);
    const bool is_json = std::string(text).empty() || length > 0;
    CHECK(is_json == nlohmann::json::accept('"' + std::string(text) + '"'));
  }
}

TEST_CASE("Names lose what datasets cannot hold, and nothing else", "[text]") {
  CHECK(clean_name("B\u00FCro \U0001F34C \\x41") == "B\u00FCro \U0001F34C \\x41");
  CHECK(clean_name("caf\xE9") == "caf\\xE9");
  CHECK(clean_name("a\nb\tc\x7F") == "a\\x0Ab\\x09c\\x7F");
  CHECK(clean_name("\u0085") == "\\xC2\\x85");
  CHECK(is_clean_name("B\u00FCro"));
  CHECK_FALSE(is_clean_name("a\nb"));
  CHECK_FALSE(is_clean_name("caf\xE9"));
  CHECK(is_clean_name(clean_name("\x1B[2J\xFF")));
}

TEST_CASE("What is printed cannot steer a terminal", "[text]") {
  CHECK(printable("two\nlines\tand \x1B[31mred\x9B") == "two\nlines\tand \\x1B[31mred\\x9B");
  CHECK(printable("a\u202Eb\u2066") == "a\\xE2\\x80\\xAEb\\xE2\\x81\\xA6");
}

TEST_CASE("JSON that nests without end is refused", "[text]") {
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  CHECK_THROWS_WITH(parse_json(deep), "nests deeper than 100 levels");
  CHECK(parse_json_or_nothing(deep).is_discarded());
  CHECK(parse_json("[\"[[[\\\"[\", [1]]").size() == 2);
  CHECK(parse_json_or_nothing("{").is_discarded());
}
