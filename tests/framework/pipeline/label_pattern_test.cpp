// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/label_pattern.h"

#include "diorama/error.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

std::string replaced(const std::string& pattern, const std::string& text,
                     const std::string& replacement) {
  return LabelPattern(pattern).replaced(text, replacement);
}

std::string fault(const std::string& pattern) {
  try {
    const LabelPattern made(pattern);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Config);
    return error.what();
  }
  return "no fault";
}

}  // namespace

// Expected texts are what Python's re.sub() gives.
TEST_CASE("Labels are replaced as Python does it", "[label_pattern]") {
  CHECK(replaced("^\\d+_", "011_banana_12_", "") == "banana_12_");
  CHECK(replaced("^\\d+_", "banana", "x") == "banana");
  CHECK(replaced("^", "cube", "") == "cube");
  CHECK(replaced("^", "cube", "a_") == "a_cube");
  CHECK(replaced("$", "cube", "_a") == "cube_a");
  CHECK(replaced("", "ab", "-") == "-a-b-");
  CHECK(replaced("x*", "axb", "-") == "-a--b-");
  CHECK(replaced("_", "a_b_c", " ") == "a b c");
  CHECK(replaced("(\\w+?)_(\\w+)", "red_mug", "$2 of $1, $0, $9, $&") ==
        "mug of red, red_mug, , red_mug");
  CHECK(replaced("(a)(b)?", "ac", "[$1|$2]") == "[a|]c");
  CHECK(replaced("(?P<what>mug)", "red_mug", "${what}s, ${1}s") == "red_mugs, mugs");
  CHECK(replaced("mug", "mug", "$$1 $") == "$1 $");
  CHECK(replaced("\\bm", "mm m", "n") == "nm n");
  CHECK(replaced("[^a-z]", "b\u00FCro", "?") == "b?ro");
  CHECK(replaced("", "\u00FC", "-") == "-\u00FC-");
  CHECK(replaced("(?i)MUG", "a Mug", "cup") == "a cup");
}

TEST_CASE("A pattern that backtracks for ever elsewhere takes no time", "[label_pattern]") {
  const std::string name(60, 'a');
  CHECK(replaced("^(a+)+$", name + "!", "x") == name + "!");
  CHECK(replaced("^(a|a)*b", name, "x") == name);
  CHECK(replaced("(.*)(.*)(.*)(.*)(.*)(.*)(.*)(.*)(.*)x", std::string(100'000, 'a'), "") ==
        std::string(100'000, 'a'));
  // Neither does one that grows when it is spelt out.
  CHECK(fault("((a{100}){100}){100}").starts_with("not a regular expression: "));
}

TEST_CASE("What is wrong with a pattern is said in words", "[label_pattern]") {
  CHECK(fault("(") == "not a regular expression: a '(' is not closed, found '('");
  CHECK(fault("[a") == "not a regular expression: a '[' is not closed, found '[a'");
  CHECK(fault("a)") == "not a regular expression: a ')' closes nothing, found 'a)'");
  CHECK(fault("*a") ==
        "not a regular expression: '*', '+', '?' or '{}' repeats nothing, found '*'");
  CHECK(fault("a\\") == "not a regular expression: it ends with a backslash");
  CHECK(fault("(a)\\1") ==
        "not a regular expression: back references are not supported, found '\\1'; write the "
        "repeated part out");
  for (const char* pattern : {"a(?=b)", "a(?!b)", "(?<=a)b", "(?<!a)b"}) {
    CHECK_THAT(fault(pattern),
               ContainsSubstring("looking ahead and behind is not supported, found '(?"));
  }
  CHECK_THAT(complaints_about(with(good_job(), "\"^\\\\d+_\"", "\"a(?=b)\"")),
             ContainsSubstring("job.yaml:5:") &&
                 ContainsSubstring("objects[0].label_pattern: not a regular expression: looking"));
}
