// SPDX-License-Identifier: Apache-2.0
#include "framework/app/param_text.h"

#include "support/catch.h"

using namespace diorama;

namespace {

struct Layer {
  std::string name = "top";
  void visit(ParamVisitor& v) { v.param("name", name, {"Of the layer."}); }
};

struct Noise {
  double sigma = 0.25;
  void visit(ParamVisitor& v) { v.param("sigma", sigma, {"Spread.", "m", 0.0}); }
};

struct Params {
  int count = 3;
  Range height{1, 2};
  Noise noise;
  std::vector<Layer> layers;
  std::string shape = "cube";
  void visit(ParamVisitor& v) {
    static constexpr const char* kWords[] = {"cube", "ball"};
    v.param("count", count, {"How many.", "", 1, 9});
    v.param("height", height, {"Between.", "m"});
    v.group("noise", noise, {"Noise."});
    v.list("layers", layers, {"Layers."});
    v.choice("shape", shape, kWords, {"Shape."});
  }
};

std::vector<ParamSpec> specs() {
  Params params;
  ParamLister lister;
  params.visit(lister);
  return lister.take();
}

}  // namespace

TEST_CASE("declared parameters become rows of words", "[params]") {
  const std::vector<ParamRow> rows = param_rows(specs());
  REQUIRE(rows.size() == 7);
  CHECK(rows[0].key == "count");
  CHECK(rows[0].type == "integer");
  CHECK(rows[0].default_value == "3");
  CHECK(rows[0].range == "1 to 9");
  CHECK(rows[1].type == "[lo, hi] or number");
  CHECK(rows[1].default_value == "[1, 2]");
  CHECK(rows[1].range.empty());
  CHECK(rows[2].key == "noise");
  CHECK(rows[2].default_value.empty());
  CHECK(rows[3].key == "noise.sigma");
  CHECK(rows[3].range == ">= 0");
  CHECK(rows[3].unit == "m");
  CHECK(rows[5].key == "layers[].name");
  CHECK(rows[6].type == "one of: cube, ball");
}

TEST_CASE("declared parameters become values for programs", "[params]") {
  const Value list = param_values(specs());
  CHECK(list.list.at(0).find("max")->scalar == "9");
  CHECK_FALSE(list.list.at(1).find("max"));
  CHECK(list.list.at(2).find("children")->list.at(0).find("key")->scalar == "sigma");
  CHECK(list.list.at(4).find("choices")->list.at(1).scalar == "ball");
}
