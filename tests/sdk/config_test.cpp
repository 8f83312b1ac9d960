// SPDX-License-Identifier: Apache-2.0
#include "diorama/config.h"

#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

TEST_CASE("A place reads as file, line and column", "[config]") {
  CHECK(SourceLocation{"a.yaml", 31, 7}.text() == "a.yaml:31:7");
  CHECK(SourceLocation{"--set", 0, 0}.text() == "--set");
  CHECK(SourceLocation{}.text().empty());
}

TEST_CASE("A map keeps its order and replaces in place", "[config]") {
  Value map;
  map.set("b", Value::integer(1));
  map.set("a", Value::text("x"));
  map.set("b", Value::boolean(true));
  REQUIRE(map.map.size() == 2);
  CHECK(map.map[0].first == "b");
  CHECK(map.find("b")->scalar == "true");
  CHECK(map.find("c") == nullptr);
  map.erase("b");
  CHECK(map.find("b") == nullptr);
  Value number = Value::number(1);
  CHECK(test::error_text([&] { number.set("k", {}); }) ==
        "Value::set('k'): expected a mapping, found '1'");
}

TEST_CASE("Numbers are written so that they read back the same", "[config]") {
  CHECK(Value::number(0.1).scalar == "0.1");
  CHECK(Value::number(24).scalar == "24");
  CHECK(Value::number(-1.0 / 0.0).scalar == "-.inf");
  CHECK(std::stod(Value::number(1.0 / 3.0).scalar) == 1.0 / 3.0);
}

TEST_CASE("Values describe themselves for messages", "[config]") {
  Value unquoted = Value::text("lots");
  unquoted.is_quoted = false;
  CHECK(unquoted.describe() == "'lots'");
  CHECK(Value::text("12").describe() == "the text '12'");
  CHECK(Value().describe() == "nothing");
  CHECK(Value::make_map().describe() == "a mapping");
  CHECK(Value::make_list().describe() == "an empty list");
  CHECK(Value::text(std::string(100, 'x')).describe().size() < 80);
}

TEST_CASE("The nearest name is the one that was meant, or none", "[config]") {
  const std::vector<std::string> names = {"half_width_m", "height_m", "samples", "on"};
  CHECK(nearest_name("half_widht_m", names) == "half_width_m");
  CHECK(nearest_name("Samples", names) == "samples");
  CHECK(nearest_name("sample", names) == "samples");
  CHECK(nearest_name("hieght_m", names) == "height_m");
  CHECK(nearest_name("no", names) == "on");
  CHECK(nearest_name("x", names).empty());
  CHECK(nearest_name("", names).empty());
  CHECK(nearest_name("colour_of_the_sky", names).empty());
  CHECK(nearest_name("a", {}).empty());
}

TEST_CASE("Diagnostics are reported together", "[config]") {
  Diagnostics diagnostics;
  diagnostics.raise();
  diagnostics.add({"a.yaml", 3, 1}, "one");
  diagnostics.add({}, "two");
  CHECK(test::error_text([&] { diagnostics.raise(); }) == "a.yaml:3:1: one\ntwo");
}
