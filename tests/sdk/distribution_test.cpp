// SPDX-License-Identifier: Apache-2.0
#include "diorama/distribution.h"

#include <cmath>
#include <map>

#include "error_text.h"
#include "framework/config/yaml_config.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

constexpr int kDraws = 500;

Distribution from_yaml(const std::string& yaml, int width = 1, ParamDoc doc = {"A quantity."}) {
  const Value job = parse_yaml("scale: " + yaml, "job.yaml");
  return Distribution::parse(*job.find("scale"), "scale", doc, width);
}

std::vector<double> draws(const Distribution& distribution) {
  std::vector<double> numbers;
  Rng rng(7);
  for (int i = 0; i < kDraws; ++i) numbers.push_back(distribution.draw(rng, std::uint64_t(i)));
  return numbers;
}

std::vector<double> draws(const std::string& yaml) { return draws(from_yaml(yaml)); }

std::string complaint(const std::string& yaml, int width = 1, ParamDoc doc = {"A quantity."}) {
  return error_text([&] { from_yaml(yaml, width, doc); });
}

}  // namespace

TEST_CASE("Numbers and pairs are constants and intervals", "[distribution]") {
  CHECK(draws("1.5") == std::vector<double>(kDraws, 1.5));
  CHECK(fills(draws("[0.9, 1.1]"), 0.9, 1.1));
  CHECK(draws("[0.9, 1.1]") == draws("{uniform: {lower: 0.9, upper: 1.1}}"));
  CHECK(draws("[0.9, 1.1]") == draws("{distribution.uniform: {lower: 0.9, upper: 1.1}}"));
  CHECK(draws("[0.9, 1.1]") == draws(Distribution(Range{0.9, 1.1})));
}

TEST_CASE("Normal numbers have their mean and deviation and stay in the parameter's range",
          "[distribution]") {
  const std::vector<double> numbers = draws("{normal: {mean: 3, std: 0.5}}");
  double sum = 0.0;
  double squares = 0.0;
  for (const double number : numbers) {
    sum += number;
    squares += (number - 3.0) * (number - 3.0);
  }
  // Four standard errors.
  CHECK(std::abs(sum / kDraws - 3.0) < 4.0 * 0.5 / std::sqrt(kDraws));
  CHECK(std::abs(squares / kDraws - 0.25) < 4.0 * 0.25 * std::sqrt(2.0 / kDraws));
  const ParamDoc bounded{"A quantity.", "", 2.8, 3.1};
  const Extent extent = extent_of(draws(from_yaml("{normal: {mean: 3, std: 0.5}}", 1, bounded)));
  CHECK(extent.lo == 2.8);
  CHECK(extent.hi == 3.1);
}

TEST_CASE("Logarithmic numbers are uniform in their logarithm", "[distribution]") {
  std::vector<double> logarithms;
  for (const double number : draws("{log_uniform: {lower: 0.01, upper: 100}}")) {
    logarithms.push_back(std::log10(number));
  }
  CHECK(fills(logarithms, -2.0, 2.0));
}

TEST_CASE("Choices follow their weights", "[distribution]") {
  std::map<double, int> count;
  for (const double number : draws("{choice: {choices: [1, 2, 4, 8], weights: [3, 1, 0, 1]}}")) {
    ++count[number];
  }
  // Binomial, four standard deviations.
  CHECK(std::abs(count[1.0] - 300) < 44);
  CHECK(std::abs(count[2.0] - 100) < 36);
  CHECK(count[4.0] == 0);
  CHECK(count.size() == 4);
  CHECK(fills(draws("{choice: {choices: [[0, 1], [1, 2]]}}"), 0.0, 2.0));
}

TEST_CASE("Sequences go from item to item, and inner ones a step per round", "[distribution]") {
  const std::vector<double> plain = draws("{sequence: {items: [5, 7, 6]}}");
  CHECK(std::vector<double>(plain.begin(), plain.begin() + 5) ==
        std::vector<double>{5, 7, 6, 5, 7});
  const auto nested = draws("{sequence: {items: [0, {sequence: {items: [1, 2]}}]}}");
  CHECK(std::vector<double>(nested.begin(), nested.begin() + 6) ==
        std::vector<double>{0, 1, 0, 2, 0, 1});
}

TEST_CASE("Vectors are drawn per axis", "[distribution]") {
  const auto axes = [](const std::string& yaml) {
    const Distribution distribution = from_yaml(yaml, 3);
    std::array<std::vector<double>, 3> numbers;
    Rng rng(3);
    for (int i = 0; i < kDraws; ++i) {
      const Vec3 vector = distribution.draw_vector(rng, std::uint64_t(i));
      for (int axis = 0; axis < 3; ++axis) numbers[std::size_t(axis)].push_back(vector[axis]);
    }
    return numbers;
  };
  const auto mixed = axes("[[0, 1], 2, {sequence: {items: [3, 4]}}]");
  CHECK(fills(mixed[0], 0.0, 1.0));
  CHECK(mixed[1] == std::vector<double>(kDraws, 2.0));
  CHECK(mixed[2][0] == 3.0);
  CHECK(mixed[2][1] == 4.0);
  CHECK(mixed == axes("{combine: {distributions: [[0, 1], 2, {sequence: {items: [3, 4]}}]}}"));
  const auto box = axes("{uniform: {lower: [0, 5, -1], upper: [1, 6, -1]}}");
  CHECK(fills(box[0], 0.0, 1.0));
  CHECK(fills(box[1], 5.0, 6.0));
  CHECK(box[2] == std::vector<double>(kDraws, -1.0));
  const auto shared = axes("[0, 1]");
  CHECK(fills(shared[2], 0.0, 1.0));
  CHECK(shared[0] != shared[1]);
  CHECK(axes("{choice: {choices: [[1, 2, 3], [4, 5, 6]]}}")[1].size() == kDraws);
}

TEST_CASE("What a job says of a distribution comes back as its source", "[distribution]") {
  const std::string yaml = "{choice: {choices: [[0, 1], 3], weights: [2, 1]}}";
  const Distribution first = from_yaml(yaml);
  CHECK(draws(Distribution::parse(first.source(), "again", {"A quantity."}, 1)) == draws(first));
  const Distribution box = Distribution::between({0, 1, 2}, {3, 4, 5});
  const Distribution again = Distribution::parse(box.source(), "box", {"A quantity."}, 3);
  Rng one(5), two(5);
  CHECK(box.draw_vector(one) == again.draw_vector(two));
}

TEST_CASE("Mistakes in distributions are told with place, finding and what would be right",
          "[distribution]") {
  CHECK_THAT(complaint("lots"), ContainsSubstring("job.yaml:1:8: scale: expected a number"));
  CHECK_THAT(complaint("[2, 1]"), ContainsSubstring("lo <= hi"));
  CHECK_THAT(complaint("[1, 2, 3]"),
             ContainsSubstring("expected a number, [lo, hi], or one of uniform"));
  CHECK_THAT(complaint("{unifrom: {lower: 1, upper: 2}}"),
             ContainsSubstring("unknown distribution 'unifrom', did you mean 'uniform'?"));
  CHECK_THAT(complaint("{uniform: {lower: 2, upper: 1}}"),
             ContainsSubstring("scale.uniform: lower must not exceed upper"));
  CHECK_THAT(complaint("{uniform: {lower: 2}}"), ContainsSubstring("'upper' is missing"));
  CHECK_THAT(complaint("{uniform: {lower: 1, uper: 2}}"),
             ContainsSubstring("did you mean 'upper'?"));
  CHECK_THAT(complaint("{log_uniform: {lower: 0, upper: 1}}"), ContainsSubstring("above 0"));
  CHECK_THAT(complaint("{normal: {mean: 0, std: -1}}"), ContainsSubstring("scale.normal.std"));
  CHECK_THAT(complaint("{choice: {choices: []}}"), ContainsSubstring("at least one entry"));
  CHECK_THAT(complaint("{choice: {choices: [1, 2], weights: [1]}}"),
             ContainsSubstring("expected one per choice (2), found 1"));
  CHECK_THAT(complaint("{choice: {choices: [1], weights: [0]}}"),
             ContainsSubstring("at least one must be"));
  CHECK_THAT(complaint("{combine: {distributions: [1, 2, 3]}}"),
             ContainsSubstring("only a vector"));
  CHECK_THAT(complaint("{combine: {distributions: [1, 2]}}", 3),
             ContainsSubstring("a list of three"));
  CHECK_THAT(complaint("[0.5, 7]", 1, {"A quantity.", "m", 0.0, 5.0}),
             ContainsSubstring("expected a number in [0, 5], found '7'"));
  CHECK_THAT(complaint("{choice: {choices: [1, 9]}}", 1, {"A quantity.", "m", 0.0, 5.0}),
             ContainsSubstring("scale.choice.choices[1]"));
  for (const char* endless : {".inf", "[0, .inf]", "{normal: {mean: 0, std: .inf}}",
                              "{log_uniform: {lower: 1, upper: .inf}}"}) {
    CHECK_THAT(complaint(endless), ContainsSubstring("expected finite numbers"));
  }
}

TEST_CASE("Texts are chosen by weight or in turn", "[distribution]") {
  const auto text_from = [](const std::string& yaml) {
    const Value job = parse_yaml("sky: " + yaml, "job.yaml");
    return TextDistribution::parse(*job.find("sky"), "sky");
  };
  const auto counts = [](const TextDistribution& distribution) {
    std::map<std::string, int> count;
    Rng rng(2);
    for (int i = 0; i < kDraws; ++i) {
      ++count[distribution.texts()[distribution.draw(rng, std::uint64_t(i))]];
    }
    return count;
  };
  CHECK(counts(text_from("a.hdr"))["a.hdr"] == kDraws);
  CHECK(std::abs(counts(text_from("[a, b]"))["a"] - 250) < 45);
  CHECK(std::abs(counts(text_from("{choice: {choices: [a, b], weights: [1, 4]}}"))["a"] - 100) <
        36);
  CHECK(counts(text_from("{sequence: {items: [a, b]}}"))["a"] == 250);
  CHECK(text_from("[]").texts().empty());
  CHECK_THAT(error_text([&] { text_from("{shuffle: [a]}"); }), ContainsSubstring("'choice' or"));
  CHECK_THAT(error_text([&] { text_from("{choice: {choices: [a], weights: [-1]}}"); }),
             ContainsSubstring("sky.choice.weights[0]"));
}

namespace {

struct Drawn {
  Distribution size = 1.5;
  Distribution place = Vec3(0, 1, 2);
  std::optional<Distribution> length;
  std::optional<Distribution> speed = Distribution(Vec3(1, 0, 0));
  TextDistribution sky{{"a.hdr", "b.hdr"}};

  void visit(ParamVisitor& v) {
    v.param("size", size, {"Size.", "m", 0.5, 4.0});
    v.param("place", place, {"Place.", "m"}, 3);
    v.param("length", length, {"Length; null keeps it.", "mm", 1.0});
    v.param("speed", speed, {"Speed.", "m/s"}, 3);
    v.param("sky", sky, {"Pictures."});
  }
};

}  // namespace

TEST_CASE("Distributions are declared with type and range like other parameters",
          "[distribution]") {
  Drawn drawn;
  ParamLister lister;
  drawn.visit(lister);
  const std::vector<ParamSpec> specs = lister.take();
  REQUIRE(specs.size() == 5);
  CHECK(specs[0].type == ParamType::Distribution);
  CHECK(specs[0].min == 0.5);
  CHECK(specs[0].max == 4.0);
  CHECK(specs[0].unit == "m");
  CHECK(specs[0].default_value.scalar == "1.5");
  CHECK(specs[1].type == ParamType::VectorDistribution);
  CHECK(specs[1].default_value.list.size() == 3);
  CHECK(specs[2].type == ParamType::OptionalDistribution);
  CHECK(specs[2].default_value.kind == Value::Kind::Null);
  CHECK(specs[3].type == ParamType::OptionalVectorDistribution);
  CHECK(specs[4].type == ParamType::TextDistribution);
}

TEST_CASE("Mistakes in distributions are collected with the others, with their place",
          "[distribution]") {
  const Value job = parse_yaml(
      "size: {uniform: {lower: 1, upper: 9}}\nplace: [0, 1]\nlength: null\nspeed: null\n"
      "sky: {shuffle: [a]}\nsise: 1\n",
      "job.yaml");
  Diagnostics diagnostics;
  Drawn drawn;
  ParamReader reader(job, "randomizers[2]", diagnostics);
  drawn.visit(reader);
  reader.finish();
  CHECK(diagnostics.messages() ==
        std::vector<std::string>{
            "job.yaml:1:35: randomizers[2].size.uniform.upper: expected a number in [0.5, 4], "
            "found '9'",
            "job.yaml:5:6: randomizers[2].sky: expected a text, a list of texts, 'choice' or "
            "'sequence', found a mapping",
            "job.yaml:6:1: randomizers[2]: unknown key 'sise', did you mean 'size'?"});
  CHECK(drawn.place.width() == 1);
  CHECK_FALSE(drawn.length);
  CHECK_FALSE(drawn.speed);
  CHECK(drawn.sky.texts().size() == 2);
}
