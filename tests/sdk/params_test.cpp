// SPDX-License-Identifier: Apache-2.0
#include "diorama/params.h"

#include "support/catch.h"

using namespace diorama;

namespace {

constexpr const char* kShapes[] = {"sphere", "cube", "cone"};

struct Inner {
  double width_m = 2.0;
  int count = 3;
  void visit(ParamVisitor& v) {
    v.param("width_m", width_m, {"Width.", "m", 0.0});
    v.param("count", count, {"How many."});
  }
};

struct Everything {
  bool on = false;
  int samples = 16;
  std::uint64_t seed = 5;
  double angle_deg = 30.0;
  std::string name = "default";
  Range height_m{1.0, 1.5};
  Vec3 offset{1, 2, 3};
  std::vector<std::string> words{"a"};
  std::vector<double> weights{0.5};
  std::optional<double> limit;
  std::optional<std::string> label = "x";
  Value extra;
  std::string shape = "cube";
  Inner inner;
  std::vector<Inner> items{Inner{9.0, 9}};

  void visit(ParamVisitor& v) {
    v.param("on", on, {"Switch."});
    v.param("samples", samples, {"Rays per pixel.", "", 1, 65536});
    v.param("seed", seed, {"Seed."});
    v.param("angle_deg", angle_deg, {"Angle.", "deg", 0.0, 75.0});
    v.param("name", name, {"Name."});
    v.param("height_m", height_m, {"Height.", "m", 0.0});
    v.param("offset", offset, {"Offset.", "m"});
    v.param("words", words, {"Words."});
    v.param("weights", weights, {"Weights.", "", 0.0, 1.0});
    v.param("limit", limit, {"Limit.", "m", 0.0});
    v.param("label", label, {"Label."});
    v.param("extra", extra, {"Free."});
    v.choice("shape", shape, kShapes, {"Shape."});
    v.group("inner", inner, {"Inner."});
    v.list("items", items, {"Items."});
  }
};

/// A scalar as a file would hold it, unquoted.
Value plain(const std::string& text) {
  Value value = Value::text(text);
  value.is_quoted = false;
  return value;
}

Value list(std::initializer_list<Value> values) {
  Value value = Value::make_list();
  value.list = values;
  return value;
}

Value entry(const char* key, Value value) {
  value.place = {"job.yaml", 31, 12};
  value.key_place = {"job.yaml", 31, 3};
  for (std::size_t i = 0; i < value.list.size(); ++i) {
    value.list[i].place = {"job.yaml", 32 + int(i), 5};
  }
  Value map = Value::make_map();
  map.set(key, std::move(value));
  return map;
}

struct Outcome {
  Everything params;
  std::vector<std::string> diagnostics;
};

Outcome read(const Value& map, std::span<const std::string_view> also_known = {}) {
  Outcome outcome;
  Diagnostics diagnostics;
  ParamReader reader(map, "renderer", diagnostics);
  outcome.params.visit(reader);
  reader.finish(also_known);
  outcome.diagnostics = diagnostics.messages();
  return outcome;
}

Everything good(const char* key, Value value) {
  const Outcome outcome = read(entry(key, std::move(value)));
  CHECK(outcome.diagnostics == std::vector<std::string>{});
  return outcome.params;
}

std::string bad(const char* key, Value value) {
  const Outcome outcome = read(entry(key, std::move(value)));
  if (outcome.diagnostics.size() != 1) return std::to_string(outcome.diagnostics.size());
  return outcome.diagnostics[0];
}

}  // namespace

TEST_CASE("Absent keys keep their defaults", "[params]") {
  for (const Value& map : {Value(), Value::make_map()}) {
    const Outcome outcome = read(map);
    CHECK(outcome.diagnostics.empty());
    CHECK(outcome.params.samples == 16);
    CHECK(outcome.params.items.size() == 1);
    CHECK(outcome.params.items[0].count == 9);
    CHECK(*outcome.params.label == "x");
  }
}

TEST_CASE("Integers are whole decimal numbers in their range", "[params]") {
  CHECK(good("samples", plain("65536")).samples == 65536);
  CHECK(good("samples", plain("+7")).samples == 7);
  CHECK(good("samples", plain("012")).samples == 12);
  const std::string expected =
      "job.yaml:31:12: renderer.samples: expected an integer in [1, 65536]";
  for (const char* text : {"lots", "3.0", "1e3", "0", "65537", "99999999999999999999", "0x10", "",
                           "-", "+-3", "1_000", "true", " 3"}) {
    CHECK(bad("samples", plain(text)) == expected + ", found '" + text + "'");
  }
  CHECK(bad("samples", Value::text("12")) == expected + ", found the text '12'");
  CHECK(bad("samples", Value()) == expected + ", found nothing");
  CHECK(bad("samples", list({plain("1")})) == expected + ", found a list");
}

TEST_CASE("A number too large for its type is told the type's limits", "[params]") {
  CHECK(bad("inner", entry("count", plain("-3000000000"))) ==
        "job.yaml:31:12: renderer.inner.count: expected an integer in [-2147483648, 2147483647], "
        "found '-3000000000'");
}

TEST_CASE("Seeds take all 64 bits and no sign", "[params]") {
  CHECK(good("seed", plain("18446744073709551615")).seed == 18446744073709551615ull);
  CHECK(bad("seed", plain("-1")) ==
        "job.yaml:31:12: renderer.seed: expected an integer in [0, 18446744073709551615], found "
        "'-1'");
  CHECK(bad("seed", plain("x")) ==
        "job.yaml:31:12: renderer.seed: expected an integer of at least 0, found 'x'");
}

TEST_CASE("Numbers may be written in every usual way but not be nan", "[params]") {
  CHECK(good("angle_deg", plain("7")).angle_deg == 7.0);
  CHECK(good("angle_deg", plain(".5")).angle_deg == 0.5);
  CHECK(good("angle_deg", plain("+2.5e1")).angle_deg == 25.0);
  CHECK(good("limit", plain(".inf")).limit == kInfinity);
  CHECK(good("limit", plain("inf")).limit == kInfinity);
  CHECK(good("offset", list({plain("-.inf"), plain("-1"), plain("2.")})).offset ==
        Vec3(-kInfinity, -1, 2));
  const std::string expected = "job.yaml:31:12: renderer.angle_deg: expected a number in [0, 75]";
  for (const char* text :
       {"-1", "75.001", ".nan", "nan", ".inf", "1,5", "0x1p3", "1e999", "e", "."}) {
    CHECK(bad("angle_deg", plain(text)) == expected + ", found '" + text + "'");
  }
}

TEST_CASE("Truth values are true and false only", "[params]") {
  CHECK(good("on", plain("true")).on);
  CHECK_FALSE(good("on", plain("false")).on);
  for (const char* text : {"yes", "True", "1", "on", ""}) {
    CHECK(bad("on", plain(text)) ==
          std::string("job.yaml:31:12: renderer.on: expected true or false, found '") + text + "'");
  }
  CHECK(bad("on", Value::text("true")) ==
        "job.yaml:31:12: renderer.on: expected true or false, found the text 'true'");
}

TEST_CASE("Texts keep the characters of the file", "[params]") {
  CHECK(good("name", plain("012")).name == "012");
  CHECK(good("name", Value::text("")).name.empty());
  CHECK(bad("name", Value()) == "job.yaml:31:12: renderer.name: expected a text, found nothing");
  CHECK(bad("name", Value::make_map()) ==
        "job.yaml:31:12: renderer.name: expected a text, found a mapping");
}

TEST_CASE("Ranges are a number or two in order", "[params]") {
  CHECK(good("height_m", plain("2")).height_m == Range{2, 2});
  CHECK(good("height_m", list({plain("0"), plain("2.5")})).height_m == Range{0, 2.5});
  const std::string name = "renderer.height_m: ";
  CHECK(bad("height_m", list({plain("3"), plain("1")})) ==
        "job.yaml:31:12: " + name + "expected [lo, hi] with lo <= hi, found [3, 1]");
  CHECK(bad("height_m", list({plain("-1"), plain("1")})) ==
        "job.yaml:32:5: renderer.height_m[0]: expected a number of at least 0, found '-1'");
  CHECK(bad("height_m", list({plain("1")})) ==
        "job.yaml:31:12: " + name +
            "expected a number of at least 0 or a list [lo, hi] of two, found a list");
}

TEST_CASE("Vectors and lists are checked item by item", "[params]") {
  CHECK(good("words", list({plain("a"), plain("1")})).words == std::vector<std::string>{"a", "1"});
  CHECK(good("words", list({})).words.empty());
  CHECK(good("weights", list({plain("0"), plain("1")})).weights == std::vector<double>{0, 1});
  CHECK(bad("offset", list({plain("1"), plain("2")})) ==
        "job.yaml:31:12: renderer.offset: expected a list of three numbers, found a list of 2");
  CHECK(bad("offset", plain("1")) ==
        "job.yaml:31:12: renderer.offset: expected a list of three numbers, found '1'");
  CHECK(bad("words", plain("a")) ==
        "job.yaml:31:12: renderer.words: expected a list of texts, found 'a'");
  CHECK(bad("words", list({plain("a"), Value()})) ==
        "job.yaml:33:5: renderer.words[1]: expected a text, found nothing");
  CHECK(bad("weights", list({plain("0.5"), plain("7")})) ==
        "job.yaml:33:5: renderer.weights[1]: expected a number in [0, 1], found '7'");
}

TEST_CASE("Optional values may be null", "[params]") {
  CHECK_FALSE(good("label", Value()).label);
  CHECK_FALSE(good("limit", Value()).limit);
  CHECK(good("label", plain("cup")).label == "cup");
  CHECK(bad("limit", plain("far")) ==
        "job.yaml:31:12: renderer.limit: expected a number of at least 0 or null, found 'far'");
  CHECK(bad("label", list({})) ==
        "job.yaml:31:12: renderer.label: expected a text or null, found an empty list");
}

TEST_CASE("A choice lists its words and guesses the meant one", "[params]") {
  CHECK(good("shape", plain("cone")).shape == "cone");
  CHECK(bad("shape", plain("cuve")) ==
        "job.yaml:31:12: renderer.shape: expected one of 'sphere', 'cube', 'cone', found 'cuve', "
        "did you mean 'cube'?");
  CHECK(bad("shape", plain("torus")) ==
        "job.yaml:31:12: renderer.shape: expected one of 'sphere', 'cube', 'cone', found "
        "'torus'");
}

TEST_CASE("Free values pass unread", "[params]") {
  CHECK(good("extra", list({plain("1"), Value::make_map()})).extra.list.size() == 2);
}

TEST_CASE("Unknown keys are refused where they stand, with a guess", "[params]") {
  CHECK(bad("sampels", plain("1")) ==
        "job.yaml:31:3: renderer: unknown key 'sampels', did you mean 'samples'?");
  CHECK(bad("zzz", plain("1")) == "job.yaml:31:3: renderer: unknown key 'zzz'");
  const std::string_view also_known[] = {"type"};
  CHECK(read(entry("type", plain("embree")), also_known).diagnostics.empty());
}

TEST_CASE("Groups nest in names, unknown keys and types", "[params]") {
  Value group = entry("width_m", plain("4"));
  CHECK(good("inner", group).inner.width_m == 4.0);
  CHECK(good("inner", group).inner.count == 3);
  CHECK(bad("inner", entry("widht_m", plain("4"))) ==
        "job.yaml:31:3: renderer.inner: unknown key 'widht_m', did you mean 'width_m'?");
  CHECK(bad("inner", entry("width_m", plain("-4"))) ==
        "job.yaml:31:12: renderer.inner.width_m: expected a number of at least 0, found '-4'");
  CHECK(bad("inner", plain("4")) ==
        "job.yaml:31:12: renderer.inner: expected a mapping, found '4'");
}

TEST_CASE("Lists of mappings replace the default items", "[params]") {
  const Everything params = good("items", list({entry("count", plain("1")), Value::make_map()}));
  REQUIRE(params.items.size() == 2);
  CHECK(params.items[0].count == 1);
  CHECK(params.items[0].width_m == 2.0);  // of a fresh item, not of the default list
  CHECK(params.items[1].count == 3);
  CHECK(good("items", list({})).items.empty());
  CHECK(bad("items", list({Value::make_map(), entry("count", plain("x"))})) ==
        "job.yaml:31:12: renderer.items[1].count: expected an integer, found 'x'");
  CHECK(bad("items", list({plain("7")})) ==
        "job.yaml:32:5: renderer.items[0]: expected a mapping, found '7'");
  CHECK(bad("items", Value()) ==
        "job.yaml:31:12: renderer.items: expected a list of mappings, found nothing");
}

TEST_CASE("All diagnostics of a mapping are collected", "[params]") {
  Value map = Value::make_map();
  map.set("samples", plain("x"));
  map.set("on", plain("maybe"));
  map.set("nonsense", plain("1"));
  CHECK(read(map).diagnostics.size() == 3);
  CHECK(read(plain("7")).diagnostics ==
        std::vector<std::string>{"renderer: expected a mapping, found '7'"});
}

TEST_CASE("The lister shows what the reader reads", "[params]") {
  Everything params;
  ParamLister lister;
  params.visit(lister);
  const std::vector<ParamSpec> specs = lister.take();
  REQUIRE(specs.size() == 15);

  CHECK(specs[1].key == "samples");
  CHECK(specs[1].type == ParamType::Int);
  CHECK(specs[1].default_value.scalar == "16");
  CHECK(specs[1].help == "Rays per pixel.");
  CHECK(specs[1].max == 65536);
  CHECK(specs[2].min == 0.0);
  CHECK(specs[3].unit == "deg");
  CHECK(specs[5].default_value.list[1].scalar == "1.5");
  CHECK(specs[9].default_value.kind == Value::Kind::Null);
  CHECK(specs[12].choices == std::vector<std::string>{"sphere", "cube", "cone"});
  REQUIRE(specs[13].children.size() == 2);
  CHECK(specs[13].children[0].key == "width_m");
  CHECK(specs[13].default_value.find("count")->scalar == "3");
  // The default list has one item with 9; the description of an item shows a fresh one.
  CHECK(specs[14].type == ParamType::List);
  REQUIRE(specs[14].default_value.list.size() == 1);
  CHECK(specs[14].default_value.list[0].find("count")->scalar == "9");
  CHECK(specs[14].children[1].default_value.scalar == "3");
}

TEST_CASE("The listed defaults read back as the defaults", "[params]") {
  Everything params;
  ParamLister lister;
  params.visit(lister);
  Value map = Value::make_map();
  for (const ParamSpec& spec : lister.take()) map.set(spec.key, spec.default_value);
  const Outcome outcome = read(map);
  CHECK(outcome.diagnostics.empty());
  CHECK(outcome.params.height_m == params.height_m);
  CHECK(outcome.params.items.size() == 1);
  CHECK(outcome.params.items[0].width_m == 9.0);
  CHECK(outcome.params.label == params.label);
}
