// SPDX-License-Identifier: Apache-2.0
#include "writer_support/semantic_filter.h"

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Labels kept(std::string_view predicate, const Labels& labels) {
  return SemanticFilter::parse(predicate).apply(labels);
}

}  // namespace

TEST_CASE("only labels of the named types count", "[writers]") {
  const Labels labels{{"class", "car"}, {"shape", "box"}, {"colour", "red"}};
  CHECK(kept("class:*", labels) == Labels{{"class", "car"}});
  CHECK(kept("class:*; shape: box", labels) == Labels{{"class", "car"}, {"shape", "box"}});
  CHECK(kept("class: bus, shape: *", labels) == Labels{{"shape", "box"}});
  CHECK(kept("*: *", labels) == labels);
  CHECK(kept("*: red", labels) == Labels{{"colour", "red"}});
}

TEST_CASE("expressions combine or, and, not and groups", "[writers]") {
  const Labels labels{{"class", "car,broken"}};
  CHECK(kept("class: bus | car", labels) == labels);
  CHECK(kept("class: bus, car", labels) == labels);
  CHECK(kept("class: car & broken", labels) == labels);
  CHECK(kept("class: car & !broken", labels).empty());
  CHECK(kept("class: !(bus | tram) & car", labels) == labels);
  CHECK(kept("class: bus | car & !broken", labels).empty());
}

TEST_CASE("types and predicate exclude each other", "[writers]") {
  const std::vector<std::string> types{"class", "shape"};
  CHECK(SemanticFilter::from_params(types, {}).apply({{"shape", "a"}, {"x", "b"}}) ==
        Labels{{"shape", "a"}});
  CHECK(SemanticFilter::from_params({}, {}).apply({{"shape", "a"}, {"class", "b"}}) ==
        Labels{{"class", "b"}});
  CHECK_THROWS_WITH(SemanticFilter::from_params(types, "class:*"),
                    ContainsSubstring("exclude each other"));
}

TEST_CASE("a bad predicate is quoted with what was expected", "[writers]") {
  CHECK_THROWS_WITH(SemanticFilter::parse("class"),
                    ContainsSubstring("semantic filter 'class': expected ':', found the end"));
  CHECK_THROWS_WITH(SemanticFilter::parse("class: (car"), ContainsSubstring("expected ')'"));
  CHECK_THROWS_WITH(SemanticFilter::parse("class: car &"), ContainsSubstring("expected a label"));
  CHECK_THROWS_WITH(SemanticFilter::parse("  "), ContainsSubstring("'class: *'"));
}
