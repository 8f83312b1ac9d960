// SPDX-License-Identifier: Apache-2.0
#include "writer_support/python_json.h"

#include <fstream>
#include <limits>
#include <sstream>

#include "diorama/error.h"
#include "support/catch.h"
#include "support/shared_data.h"

using namespace diorama;

TEST_CASE("floats print as Python prints them", "[writers]") {
  // Expected texts: repr() of CPython 3.11.
  CHECK(python_float(1.0) == "1.0");
  CHECK(python_float(-0.0) == "-0.0");
  CHECK(python_float(0.1) == "0.1");
  CHECK(python_float(double(20.955f)) == "20.954999923706055");
  CHECK(python_float(0.0001) == "0.0001");
  CHECK(python_float(0.00001) == "1e-05");
  CHECK(python_float(7.2e-16) == "7.2e-16");
  CHECK(python_float(9999999999999998.0) == "9999999999999998.0");
  CHECK(python_float(1e16) == "1e+16");
  CHECK(python_float(1.5e300) == "1.5e+300");
  CHECK(python_float(-1.3234889955336728e-22) == "-1.3234889955336728e-22");
  CHECK(python_float(std::numeric_limits<double>::infinity()) == "Infinity");
  CHECK(python_float(-std::numeric_limits<double>::infinity()) == "-Infinity");
  CHECK(python_float(std::numeric_limits<double>::quiet_NaN()) == "NaN");
}

TEST_CASE("rounding follows the exact value, not the printed one", "[writers]") {
  CHECK(python_round(2.675, 2) == 2.67);  // 2.675 is a little less
  CHECK(python_round(0.125, 2) == 0.12);  // a true tie goes to even
  CHECK(python_round(0.375, 2) == 0.38);
  CHECK(python_float(python_round(-0.000001, 5)) == "-0.0");
}

TEST_CASE("JSON text has Python's separators, escapes and indentation", "[writers]") {
  const Json value{{"b", {1, 2.0}}, {"a", Json::object()}, {"e", Json::array()}, {"t", true}};
  CHECK(python_json(value) == R"({"b": [1, 2.0], "a": {}, "e": [], "t": true})");
  CHECK(python_json(value, 2) ==
        "{\n  \"b\": [\n    1,\n    2.0\n  ],\n  \"a\": {},\n  \"e\": [],\n  \"t\": true\n}");
  CHECK(python_json(Json("Tür \"\\\n\x01\x7f \xF0\x9F\x8D\x8C")) ==
        R"("T\u00fcr \"\\\n\u0001\u007f \ud83c\udf4c")");
  CHECK_THROWS_AS(python_json(Json("\xFF")), Error);
  CHECK_THROWS_AS(python_json(Json("\xC0\x80")), Error);
  CHECK_THROWS_AS(python_json(Json("\xE2\x82")), Error);
}

TEST_CASE("a parsed golden file prints as the same bytes", "[writers][golden]") {
  const auto shared = test::shared_folder();
  if (!shared) {
    WARN("shared data is absent: golden files not compared");
    return;
  }
  for (const char* camera : {"rp1", "rp2"}) {
    for (const char* lens : {"pinhole", "fisheyePolynomial"}) {
      const auto file = *shared / "data/replicator_golden" / ("pose_writer_" + std::string(lens)) /
                        camera / "000000.json";
      std::ifstream in(file);
      REQUIRE(in);
      std::stringstream text;
      text << in.rdbuf();
      CHECK(python_json(Json::parse(text.str()), 2) == text.str());
    }
  }
}
