// SPDX-License-Identifier: Apache-2.0
#include "framework/config/yaml_config.h"

#include <filesystem>
#include <fstream>

#include "framework/config/value_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::string error_of(std::string_view text) {
  try {
    parse_yaml(text, "job.yaml");
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Config);
    return error.what();
  }
  return "no error";
}

std::string file_error(const std::filesystem::path& file) {
  try {
    read_job_file(file);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Config);
    return error.what();
  }
  return "no error";
}

std::filesystem::path temporary_file(const std::string& name, const std::string& text) {
  const auto folder = std::filesystem::temp_directory_path() / "diorama_config_test";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / name, std::ios::binary) << text;
  return folder / name;
}

}  // namespace

TEST_CASE("every value knows where it stands", "[config]") {
  const Value job =
      parse_yaml("seed: 12\nrenderer:\n  type: embree\n  size: [640, 48]\n", "a.yaml");
  REQUIRE(job.kind == Value::Kind::Map);
  CHECK(job.find("seed")->scalar == "12");
  CHECK(job.find("seed")->place.text() == "a.yaml:1:7");
  const Value* renderer = job.find("renderer");
  REQUIRE(renderer);
  CHECK(renderer->key_place.text() == "a.yaml:2:1");
  CHECK(renderer->find("size")->key_place.text() == "a.yaml:4:3");
  CHECK(renderer->find("size")->list.at(1).place.text() == "a.yaml:4:15");
  CHECK(renderer->find("size")->list.at(1).scalar == "48");
  CHECK_FALSE(job.find("nothing"));
}

TEST_CASE("scalars keep their text and quotes make text", "[config]") {
  const Value job =
      parse_yaml("{a: 012, b: '012', c: 1e3, d: \"null\", e: null, f: ~, g: , h: ''}", "j");
  CHECK(job.find("a")->scalar == "012");
  CHECK_FALSE(job.find("a")->is_quoted);
  CHECK(job.find("b")->is_quoted);
  CHECK(job.find("c")->scalar == "1e3");
  CHECK(job.find("d")->kind == Value::Kind::Scalar);
  for (const char* key : {"e", "f", "g"}) CHECK(job.find(key)->kind == Value::Kind::Null);
  CHECK(job.find("h")->kind == Value::Kind::Scalar);
  CHECK(parse_yaml("a: !!str 12", "j").find("a")->is_quoted);
  CHECK(parse_yaml("a: |\n  two\n  lines\n", "j").find("a")->scalar == "two\nlines\n");
}

TEST_CASE("an empty document is a null value", "[config]") {
  CHECK(parse_yaml("", "j").kind == Value::Kind::Null);
  CHECK(parse_yaml("# only a comment\n", "j").kind == Value::Kind::Null);
}

TEST_CASE("JSON is read by the same parser", "[config]") {
  const Value job = parse_yaml(
      "{\n\t\"seed\": 7,\n\t\"writers\": [{\"type\":\"BasicWriter\",\"rgb\":true}],\n"
      "\t\"text\": \"a\\\"b\\u00e4\\/\\n\", \"none\": null}\n",
      "job.json");
  CHECK(job.find("seed")->scalar == "7");
  CHECK(job.find("writers")->list.at(0).find("rgb")->scalar == "true");
  CHECK(job.find("text")->scalar == "a\"b\xC3\xA4/\n");
  CHECK(job.find("text")->is_quoted);
  CHECK(job.find("none")->kind == Value::Kind::Null);
}

TEST_CASE("anchors, aliases and merge keys are resolved", "[config]") {
  const Value job = parse_yaml(
      "base: &base {type: sphere, radius: 1}\n"
      "more: &more {radius: 2, name: x}\n"
      "lamp:\n  <<: [*base, *more]\n  type: disk\n"
      "copy: *base\n",
      "j.yaml");
  const Value* lamp = job.find("lamp");
  CHECK(lamp->find("type")->scalar == "disk");
  CHECK(lamp->find("radius")->scalar == "1");
  CHECK(lamp->find("name")->scalar == "x");
  CHECK_FALSE(lamp->find("<<"));
  CHECK(job.find("copy")->find("type")->scalar == "sphere");
  CHECK(job.find("copy")->place.text() == "j.yaml:6:7");
  CHECK(error_of("a: &x 1\nb: {<<: *x}\n") == "job.yaml:2:9: '<<' merges mappings, found '1'");
}

TEST_CASE("what is no job is refused with its place", "[config]") {
  CHECK(error_of("a: 1\nb: 2\na: 3\n") == "job.yaml:3:1: key 'a' comes twice, first in line 1");
  CHECK(error_of("[1, 2]: x") == "job.yaml:1:1: a key must be a text, found a list");
  CHECK(error_of("? {a: 1}\n: x\n") == "job.yaml:1:3: a key must be a text, found a mapping");
  CHECK(error_of("~: x") == "job.yaml:1:1: a key must be a text, found nothing");
  CHECK(error_of("a: 1\n---\nb: 2\n") ==
        "job.yaml:3:1: a second document begins here; a job is one document");
  CHECK(error_of("a: !!python/object x") ==
        "job.yaml:1:4: tag 'tag:yaml.org,2002:python/object' is not known here; only YAML's own "
        "(!!str, !!int ...) are");
  CHECK(error_of("a: !local [1]").find("tag '!local' is not known here") != std::string::npos);
  CHECK(error_of("a: &x [*x]") ==
        "job.yaml:1:8: this alias stands inside of the value that it refers to");
}

TEST_CASE("syntax errors name line and column", "[config]") {
  const auto fault_of = [](std::string_view text) {
    const std::string error = error_of(text);
    const std::string_view kind = ": YAML syntax error: ";
    const std::size_t at = error.find(kind);
    if (at == std::string::npos) return error;
    return error.substr(9, at - 9) + " " + error.substr(at + kind.size());
  };
  CHECK(fault_of("a: [1, 2\nb: 3\n") ==
        "1:4 the '[' that opens here is not closed, or a comma is missing, before 2:2");
  CHECK(fault_of("a: [[[\n") ==
        "1:6 the '[' that opens here is not closed, or a comma is missing, before 2:1");
  CHECK(fault_of("a: {b: \"]\", c: [\n  1, 2\n") ==
        "1:16 the '[' that opens here is not closed, or a comma is missing, before 3:1");
  CHECK(fault_of("a: {b: 1 c: 2}\n") ==
        "1:4 the '{' that opens here is not closed, or a comma is missing, before 1:11");
  CHECK(fault_of("a: [1]]\n") == "1:7 this bracket closes nothing that is open");
  CHECK(fault_of("a:\n\tb: 1\n") ==
        "2:1 a tab indents this line; YAML is indented by spaces alone");
  CHECK(fault_of("a:\n  b: 1\n\tc: 2\n") ==
        "3:1 a tab indents this line; YAML is indented by spaces alone");
  CHECK(fault_of("a:\n  b:\n    c: 1\n   d: 2\n") ==
        "4:4 this line is indented by 3 spaces, the lines that it could belong to by 0, 2 or 4; "
        "lines of one mapping or list begin in one column");
  CHECK(fault_of("a:\n  - x: 1\n   y: 2\n") ==
        "3:4 this line is indented by 3 spaces, the lines that it could belong to by 0 or 2; lines "
        "of one mapping or list begin in one column");
  CHECK(fault_of("a:\n  b: 1\n   c: 2\n") ==
        "3:4 this line is indented deeper than line 2, which has a value already");
  CHECK(fault_of("seed: 1\ncount 2\nb: 2\n") ==
        "2:1 this line is no 'key: value'; is the colon missing, or the space behind it?");
  CHECK(fault_of("seed:1\nb: 2\n") ==
        "1:1 this line is no 'key: value'; is the colon missing, or the space behind it?");
  CHECK(
      fault_of("a: b: c\n") ==
      "1:5 a second 'key: value' in one line; put the value in quotes if the colon belongs to it");
  CHECK(fault_of("a: 1\n- b\n") ==
        "2:1 a list entry stands where a 'key: value' of the mapping above belongs");
  CHECK(fault_of("a: 'it's'\n") ==
        "1:8 something follows a value that is at its end; put the whole in quotes");
  CHECK(fault_of("a: @x\n") == "1:4 no value begins with this character; put it in quotes");
  CHECK(fault_of("a: \"\\d+\"\n") ==
        "1:7 no such escape in double quotes; write '\\\\' for a backslash, or use single quotes");
  CHECK(fault_of("a: - b\n") ==
        "1:4 a list entry '- ' cannot begin here; it begins a line, or follows another '- '");
  CHECK(fault_of("a: *nobody\n") ==
        "1:4 no '&anchor' of this name stands before the alias; put text that begins with '*' in "
        "quotes");
  CHECK(error_of("a: \"x\\0y\"\n") ==
        "job.yaml:1:4: this text holds the character NUL, which no name and no path may");
  CHECK(error_of("a: \xED\xA0\x80\n").starts_with("job.yaml:1:4: this is no UTF-8 text"));
  CHECK(error_of("a: \"open\nb: 2\n") ==
        "job.yaml:1:4: YAML syntax error: the quotes that open here are never closed");
  CHECK(error_of("x: ä\na: 'it''s open\n") ==
        "job.yaml:2:4: YAML syntax error: the quotes that open here are never closed");
  CHECK(error_of("a: 'it''s'\nb: \"\\\"\"\n") == "no error");
  CHECK(error_of("a: \xff\xfe\n") ==
        "job.yaml:1:4: this is no UTF-8 text; save the file as UTF-8 (is it really a job file?)");
  CHECK(error_of(std::string("a: 1\nb\0: 2\n", 11)).starts_with("job.yaml:2:2: this is no UTF-8"));
}

TEST_CASE("nesting is bounded, through aliases too", "[config]") {
  const std::string deep = std::string(101, '[') + std::string(101, ']');
  CHECK(error_of(deep) == "job.yaml:1:101: nested deeper than 100 levels");
  const std::string fits = std::string(100, '[') + std::string(100, ']');
  CHECK(error_of(fits) == "no error");
  for (const char bracket : {'[', '{'}) {
    CHECK(error_of("a: " + std::string(100'000, bracket)) != "no error");
  }
  std::string rows;
  for (int i = 0; i < 150; ++i) rows += std::string(std::size_t(i), ' ') + "-\n";
  CHECK(error_of(rows) == "job.yaml:101:101: nested deeper than 100 levels");
  std::string chain = "a0: &a0 " + std::string(60, '[') + std::string(60, ']') + "\n";
  chain += "a1: " + std::string(60, '[') + "*a0" + std::string(60, ']') + "\n";
  CHECK(error_of(chain) == "job.yaml:2:65: nested deeper than 100 levels");
}

TEST_CASE("aliases cannot blow up memory", "[config]") {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) bomb += (k ? ", *a" : "*a") + std::to_string(i - 1);
    bomb += "]\n";
  }
  CHECK(error_of(bomb).find("expands to more than 500000 values; use fewer aliases") !=
        std::string::npos);
}

TEST_CASE("every prefix and every damaged byte of a job gives a value or one clear error",
          "[config]") {
  const std::string job =
      "seed: 12 # c\nlist: &l [a, 'b', \"c\\n\", {k: v}]\nmap: {<<: &m {x: 1}, y: *l}\n"
      "text: |\n  one\n  two\nfold: >-\n  three\n? key\n: - 1\n  - !!int 2\n";
  REQUIRE(error_of(job) == "no error");
  const auto try_it = [](const std::string& text) {
    try {
      parse_yaml(text, "job.yaml");
    } catch (const Error& error) {
      CHECK(std::string(error.what()).starts_with("job.yaml:"));
    }
  };
  for (std::size_t size = 0; size < job.size(); ++size) try_it(job.substr(0, size));
  for (std::size_t at = 0; at < job.size(); ++at) {
    for (const char damage : {'\0', '\t', '\n', '[', '}', ':', '&', '*', '%', '\xff', '"'}) {
      std::string text = job;
      text[at] = damage;
      try_it(text);
    }
  }
}

TEST_CASE("job files that cannot be used say why", "[config]") {
  CHECK(file_error("/nowhere/job.yaml") ==
        "/nowhere/job.yaml: no such file; a job is a YAML or JSON file");
  const auto folder = std::filesystem::temp_directory_path();
  CHECK(file_error(folder) == folder.string() + ": is a folder; name the job file that is in it");
  const auto empty = temporary_file("empty.yaml", "# nothing\n");
  CHECK(file_error(empty) == empty.string() + ": the file is empty; a job is a mapping");
  const auto list = temporary_file("list.yaml", "\n- a\n");
  CHECK(file_error(list) ==
        list.string() + ":2:1: a job is a mapping of keys to values, found a list");
  const auto good = temporary_file("good.yaml", "seed: 3\n");
  CHECK(read_job_file(good).find("seed")->place.text() == good.string() + ":1:7");
}
