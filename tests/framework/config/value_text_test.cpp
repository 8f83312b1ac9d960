// SPDX-License-Identifier: Apache-2.0
#include "framework/config/value_text.h"

#include "framework/config/yaml_config.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// Equal as far as a reader of the values can tell: places aside, and a quoted word may lose quotes
/// that it does not need.
bool is_same(const Value& a, const Value& b) {
  if (a.kind != b.kind || a.scalar != b.scalar || a.list.size() != b.list.size() ||
      a.map.size() != b.map.size()) {
    return false;
  }
  for (std::size_t i = 0; i < a.list.size(); ++i) {
    if (!is_same(a.list[i], b.list[i])) return false;
  }
  for (std::size_t i = 0; i < a.map.size(); ++i) {
    if (a.map[i].first != b.map[i].first || !is_same(a.map[i].second, b.map[i].second)) {
      return false;
    }
  }
  return true;
}

Value nested() {
  return parse_yaml(
      "a: 1\n'on': yes\nempty: []\nnone: {}\n'null': \n"
      "list: [1, 'two', \"3\", null, [4, [5]], {k: {l: [m, {n: o}]}}]\n"
      "maps:\n  - {type: x, deep: [{p: q}, {r: 's: t'}]}\n  - - - x\n"
      "texts: ['', ' ', 'a: b', '#c', '- d', '%e', '@f', '`g', \"h\\ti\\x01\", 'true', '1e3', "
      "'~',\n"
      "  '*j', '&k', '!l', '|', '>', '?', 'm, n', '[', '<<', \"two\\nlines\", 'ümlaut', "
      "'\\\\d+_']\n"
      "'key with: colon': {'': x}\n",
      "j");
}

}  // namespace

TEST_CASE("YAML text reads back as the same values", "[config]") {
  const Value value = nested();
  const std::string text = to_yaml(value);
  INFO(text);
  const Value again = parse_yaml(text, "again");
  CHECK(is_same(value, again));
  CHECK(to_yaml(again) == text);
}

TEST_CASE("JSON text reads back as the same values", "[config]") {
  const Value value = nested();
  for (const int indent : {0, 2}) {
    const std::string text = to_json(value, indent);
    INFO(text);
    CHECK(is_same(value, parse_yaml(text, "again")));
    CHECK((text.find('\n') == std::string::npos) == (indent == 0));
  }
}

TEST_CASE("texts that look like other types are quoted", "[config]") {
  Value map = Value::make_map();
  for (const char* word : {"true", "12", "-1.5", ".5", "null", "~", "0x1F", "yes", ".inf"}) {
    map.set("k", Value::text(word));
    CHECK(to_yaml(map) == "k: \"" + std::string(word) + "\"\n");
    CHECK(to_json(map, 0) == "{\"k\": \"" + std::string(word) + "\"}");
  }
  map.set("k", Value::text("/Isaac/a_b.usd"));
  CHECK(to_yaml(map) == "k: /Isaac/a_b.usd\n");
}

TEST_CASE("JSON numbers are told from other plain scalars", "[config]") {
  for (const char* number : {"0", "-0", "12", "-1.50", "1e3", "2E-7", "0.25e+1"}) {
    CHECK(is_json_number(number));
  }
  for (const char* other : {"", "-", "+1", "012", ".5", "1.", "1e", "0x1F", "nan", "1 ", "1_000"}) {
    CHECK_FALSE(is_json_number(other));
  }
  const Value value = parse_yaml("[012, 1e3, nan, true, True]", "j");
  CHECK(to_json(value, 0) == "[\"012\", 1e3, \"nan\", true, \"True\"]");
}

TEST_CASE("JSON strings escape what they must and repair what is no UTF-8", "[config]") {
  CHECK(json_quoted("a\"b\\c\n\t\x01\x7F") == "\"a\\\"b\\\\c\\n\\t\\u0001\\u007f\"");
  CHECK(json_quoted("\xC3\xA4") == "\"\xC3\xA4\"");
  CHECK(json_quoted("\xC3(") == "\"\xEF\xBF\xBD(\"");
}

TEST_CASE("small lists stay on one line", "[config]") {
  CHECK(to_yaml(parse_yaml("size: [640, 480]\nmore:\n- a: [x]\n  b: 2\n- 3\n", "j")) ==
        "size: [640, 480]\nmore:\n  - a: [x]\n    b: 2\n  - 3\n");
}
