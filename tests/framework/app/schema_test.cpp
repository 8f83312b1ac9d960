// SPDX-License-Identifier: Apache-2.0
#include "framework/app/job_schema.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/distribution.h"
#include "framework/app/cli.h"
#include "framework/app/reference_pages.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/job_sections.h"
#include "framework/replicator/dialect.h"
#include "program_run.h"
#include "support/catch.h"

using namespace diorama;

namespace {

bool has_validator() {
  if (std::system("/usr/bin/python3 -c 'import jsonschema' 2>/dev/null") == 0) return true;
  WARN("/usr/bin/python3 with jsonschema is not there; check skipped");
  return false;
}

ParamSpec parameter(const char* key, ParamType type, Value default_value) {
  ParamSpec spec;
  spec.key = key;
  spec.type = type;
  spec.default_value = std::move(default_value);
  spec.help = "Help.";
  return spec;
}

/// A few components that are always there.
std::vector<DescribedComponent> components() {
  ParamSpec samples = parameter("samples", ParamType::Int, Value::integer(8));
  samples.min = 1;
  samples.max = 64;
  ParamSpec nested = parameter("noise", ParamType::Group, Value::make_map());
  nested.children = {parameter("on", ParamType::Bool, Value::boolean(true))};
  return {{ComponentKind::Loader,
           "shapes",
           "Shapes.",
           {parameter("shapes", ParamType::TextList, Value::make_list())}},
          {ComponentKind::Renderer, "embree", "Light.", {samples, nested}},
          {ComponentKind::Renderer, "null", "No light.", {}},
          {ComponentKind::Writer,
           "boxes",
           "Boxes.",
           {parameter("height", ParamType::Interval, Value::number(1))}}};
}

std::string verdict(const std::string& job) {
  const test::WorkFolder folder;
  const auto schema =
      folder.write("schema.json", to_json(job_schema(job_specs(), components()), 1));
  const auto file = folder.write("job.json", to_json(parse_yaml(job, "job"), 1));
  const auto run = test::run_shell("/usr/bin/python3 " DIORAMA_SOURCE_DIR
                                   "/tests/framework/app/check_schema.py " +
                                   schema.string() + " " + file.string());
  CHECK(run.err.empty());
  return run.out;
}

}  // namespace

TEST_CASE("the schema accepts what the reader accepts", "[schema]") {
  if (!has_validator()) return;
  for (
      const char* job :
      {"environments: [{type: shapes}]",
       "environments: [{type: shapes, name: 7, shapes: [cube]}]\nrenderer: {samples: 3}\nlights:\n",
       "environments: [{type: shapes}]\nrenderer: {type: null}\nphysics: {type: none}",
       "environments: [{type: shapes}]\nwriters: [{type: boxes, height: [1, 2], output_dir: null}]",
       "environments: [{type: shapes}]\nobjects: [{type: shapes, count: 3, label: x}]\n"
       "timeline: [{simulate: 4}, {capture: floating, count: 2}]\n"
       "cameras: [{type: pinhole, width: 64, position: [1, 2, 3]}]\nassets_root: null"}) {
    INFO(job);
    CHECK(verdict(job) == "ok\n");
  }
}

TEST_CASE("the schema refuses what the reader refuses, at the same place", "[schema]") {
  if (!has_validator()) return;
  const std::string room = "environments: [{type: shapes}]\n";
  const std::vector<std::pair<std::string, std::string>> broken{
      {"seed: 3", ""},
      {"environments: []", "environments"},
      {"environments: [{shapes: [cube]}]", "environments/0"},
      {"environments: [{type: shape}]", "environments/0/type"},
      {room + "sead: 3", ""},
      {room + "seed: lots", "seed"},
      {room + "total_captures: -1", "total_captures"},
      {room + "debug: 1", "debug"},
      {room + "renderer: {samples: 65}", "renderer/samples"},
      {room + "renderer: {type: embree, noise: {on: 3}}", "renderer/noise/on"},
      {room + "renderer: {type: 'null', samples: 3}", "renderer"},
      {room + "physics: {type: magic}", "physics/type"},
      {room + "writers: [{type: boxes, height: [1, 2, 3]}]", "writers/0/height"},
      {room + "writers: [{type: boxes, hight: 1}]", "writers/0"},
      {room + "cameras: {type: pinhole}", "cameras"},
      {room + "cameras: [{type: pinhole, position: [1, 2]}]", "cameras/0/position"},
      {room + "lights: [{type: candle}]", "lights/0/type"}};
  for (const auto& [job, place] : broken) {
    INFO(job);
    CHECK(verdict(job) == "refused: " + place + "\n");
  }
}

namespace {

/// What read_job() says of a job with one room and this.
std::vector<std::string> complaints_of(const std::string& key, Value value) {
  Value job = parse_yaml("environments: [{type: shapes}]\ncameras: [{type: pinhole}]", "job");
  job.set(key, std::move(value));
  Diagnostics diagnostics;
  read_job(job, diagnostics);
  return diagnostics.messages();
}

bool says(const std::vector<std::string>& messages, const std::string& text) {
  return std::ranges::any_of(messages, [&](const std::string& message) {
    return message.find(text) != std::string::npos;
  });
}

}  // namespace

namespace {

/// Parameters that are drawn at random, some of them bounded.
struct Drawn {
  Distribution size = 1.5;
  Distribution angle = Range{-90.0, 90.0};
  Distribution color = Vec3(0.5, 0.5, 0.5);
  Distribution place = Vec3(0, 1, 2);
  std::optional<Distribution> length;
  std::optional<Distribution> speed;
  TextDistribution sky;

  void visit(ParamVisitor& v) {
    v.param("size", size, {"Size.", "m", 0.5, 4.0});
    v.param("angle", angle, {"Angle.", "deg"});
    v.param("color", color, {"Color.", "", 0.0, 1.0}, 3);
    v.param("place", place, {"Place.", "m"}, 3);
    v.param("length", length, {"Length; null keeps it.", "mm", 1.0});
    v.param("speed", speed, {"Speed; null keeps it.", "m/s", -2.0, 2.0}, 3);
    v.param("sky", sky, {"Pictures."});
  }
};

bool is_accepted(const std::string& yaml) {
  const Value job = parse_yaml(yaml, "job.yaml");
  Diagnostics diagnostics;
  Drawn drawn;
  ParamReader reader(job, "", diagnostics);
  drawn.visit(reader);
  reader.finish();
  return diagnostics.messages().empty();
}

}  // namespace

TEST_CASE("the schema says of distributions what the reader says, out of range and malformed",
          "[schema]") {
  if (!has_validator()) return;
  struct Given {
    const char* text;
    bool is_right;
  };
  const std::vector<Given> givens{
      {"size: 0.5", true},
      {"size: 4", true},
      {"size: 0.49", false},
      {"size: 4.01", false},
      {"size: [0.5, 4]", true},
      {"size: [0.4, 2]", false},
      {"size: [1, 5]", false},
      {"size: [1]", false},
      {"size: [1, 2, 3]", false},
      {"size: true", false},
      {"size: null", false},
      {"size: '1'", false},
      {"size: {uniform: {lower: 1, upper: 2}}", true},
      {"size: {distribution.uniform: {lower: 1, upper: 2}}", true},
      {"size: {distribution.uniform: {lower: 0, upper: 2}}", false},
      {"size: {uniform: {lower: 1, upper: 9}}", false},
      {"size: {uniform: {lower: 1}}", false},
      {"size: {uniform: {lower: 1, upper: 2, middle: 1}}", false},
      {"size: {uniform: [1, 2]}", false},
      {"size: {uniform: {lower: [1, 1, 1], upper: 2}}", false},
      {"size: {uniform: {lower: 1, upper: 2}, normal: {mean: 1, std: 1}}", false},
      {"size: {unifrom: {lower: 1, upper: 2}}", false},
      {"size: {normal: {mean: 4, std: 100}}", true},  // clamped
      {"size: {normal: {mean: 5, std: 1}}", false},
      {"size: {normal: {mean: 1, std: -1}}", false},
      {"size: {log_uniform: {lower: 0.5, upper: 4}}", true},
      {"size: {log_uniform: {lower: 0.5, upper: 5}}", false},
      {"size: {log_uniform: {lower: 0.1, upper: 4}}", false},
      {"size: {choice: {choices: [0.5, [1, 2], {uniform: {lower: 1, upper: 4}}]}}", true},
      {"size: {choice: {choices: [0.5, [1, 2], {uniform: {lower: 1, upper: 5}}]}}", false},
      {"size: {choice: {choices: [0.5, 5]}}", false},
      {"size: {choice: {choices: []}}", false},
      {"size: {choice: {choices: [1, 2], weights: [3, 0]}}", true},
      {"size: {choice: {choices: [1, 2], weights: [3, -1]}}", false},
      {"size: {choice: {choices: [1, 2], weights: null}}", false},
      {"size: {sequence: {items: [1, 4]}}", true},
      {"size: {sequence: {items: [1, 4.5]}}", false},
      {"size: {sequence: {items: [1], weights: [1]}}", false},
      {"size: {combine: {distributions: [1, 1, 1]}}", false},
      {"angle: -1e9", true},
      {"angle: {log_uniform: {lower: 0, upper: 1}}", false},
      {"angle: {log_uniform: {lower: 1, upper: -1}}", false},
      {"angle: {log_uniform: {lower: 1e-9, upper: 1}}", true},
      {"color: 0.5", true},
      {"color: 1.5", false},
      {"color: [0, 1]", true},
      {"color: [0, 2]", false},
      {"color: [0, 1, 1]", true},
      {"color: [0, 1, 1.5]", false},
      {"color: [[0, 1], 1, {normal: {mean: 1, std: 2}}]", true},
      {"color: [[0, 1.5], 1, {normal: {mean: 1, std: 2}}]", false},
      {"color: [[0, 1], 1, {normal: {mean: -1, std: 2}}]", false},
      {"color: [[0, 0, 0], [1, 1, 1]]", false},
      {"color: {uniform: {lower: [0, 0, 0], upper: 1}}", true},
      {"color: {uniform: {lower: [0, 0, -1], upper: 1}}", false},
      {"color: {uniform: {lower: [0, 0], upper: 1}}", false},
      {"color: {log_uniform: {lower: [0.1, 0.1, 0], upper: 1}}", false},
      {"color: {log_uniform: {lower: [0.1, 0.1, 0.1], upper: 1}}", true},
      {"color: {normal: {mean: [0, 1, 1], std: [0, 0, 3]}}", true},
      {"color: {normal: {mean: [0, 1, 1], std: [0, 0, -3]}}", false},
      {"color: {choice: {choices: [[0, 0, 0], [1, 1, 1], 0.5]}}", true},
      {"color: {choice: {choices: [[0, 0, 0], [1, 1, 2]]}}", false},
      {"color: {combine: {distributions: [0, [0, 1], 1]}}", true},
      {"color: {distribution.combine: {distributions: [0, [0, 1.1], 1]}}", false},
      {"color: {combine: {distributions: [0, 1]}}", false},
      {"place: [-1e6, 0, 1e6]", true},
      {"place: {combine: {distributions: [{sequence: {items: [1, -2]}}, 0, 0]}}", true},
      {"place: null", false},
      {"length: null", true},
      {"length: 1", true},
      {"length: 0.9", false},
      {"length: {log_uniform: {lower: 0.9, upper: 2}}", false},
      {"speed: null", true},
      {"speed: [2, -2, 0]", true},
      {"speed: [2, -2.5, 0]", false},
      {"speed: {choice: {choices: [{uniform: {lower: [-2, -2, -3], upper: 0}}]}}", false},
      {"sky: a.hdr", true},
      {"sky: []", true},
      {"sky: [a.hdr, b.hdr]", true},
      {"sky: [[a.hdr]]", false},
      {"sky: {choice: {choices: [a, b], weights: [1, 2]}}", true},
      {"sky: {choice: {choices: [a, b], weights: [1, -2]}}", false},
      {"sky: {sequence: {items: []}}", false},
      {"sky: {shuffle: {items: [a]}}", false}};

  ParamLister lister;
  Drawn().visit(lister);
  auto known = components();
  known.push_back({ComponentKind::Randomizer, "shake", "Shakes.", lister.take()});
  const test::WorkFolder folder;
  std::string files =
      folder.write("schema.json", to_json(job_schema(job_specs(), known), 1)).string();
  for (std::size_t i = 0; i < givens.size(); ++i) {
    const Value job = parse_yaml("environments: [{type: shapes}]\nrandomizers:\n- {type: shake, " +
                                     std::string(givens[i].text) + "}",
                                 "job");
    files += " " + folder.write(std::to_string(i) + ".json", to_json(job, 1)).string();
  }
  const auto run = test::run_shell(
      "/usr/bin/python3 " DIORAMA_SOURCE_DIR "/tests/framework/app/check_schema.py " + files);
  REQUIRE(run.err.empty());
  std::istringstream lines(run.out);
  for (const Given& given : givens) {
    INFO(given.text);
    CHECK(is_accepted(given.text) == given.is_right);
    const std::string key(given.text, std::string_view(given.text).find(':'));
    std::string line;
    REQUIRE(std::getline(lines, line));
    CHECK(line == (given.is_right ? "ok" : "refused: randomizers/0/" + key));
  }
}

TEST_CASE("a key of the job's table is known to reader, defaults, schema and reference",
          "[schema]") {
  const auto nothing = [](ComponentKind, std::string_view) {
    return std::optional<std::vector<ParamSpec>>();
  };
  const Value schema = job_schema(job_specs(), components());
  const Value resolved = resolved_job(
      parse_yaml("environments: [{type: shapes}]\nloaders: [{type: a}]\nannotators: [{type: b}]\n"
                 "views: [{}]\nobjects: [{type: c}]\nwriters: [{type: d}]\ncameras: [{}]\n"
                 "lights: [{}]\nrandomizers: [{type: e}]",
                 "job"),
      nothing);
  std::string page;
  for (const PageFile& file :
       reference_pages({{"diorama", "Fills rooms.", {}}}, job_specs(), components(), "1")) {
    page += file.text;
  }
  CHECK(job_specs().size() == plain_job_keys().size() + job_sections().size());
  for (const ParamSpec& spec : job_specs()) {
    INFO(spec.key);
    const auto right = complaints_of(spec.key, spec.default_value);
    CHECK_FALSE(says(right, "unknown key"));
    // Who reads it knows what it has to be.
    const bool is_text = spec.type == ParamType::OptionalText;
    CHECK(says(complaints_of(spec.key, is_text ? Value::make_map() : Value::text("x y")),
               spec.key + ": expected"));
    CHECK(says(complaints_of(spec.key.front() + spec.key, Value::text("x")),
               "did you mean '" + spec.key + "'?"));
    REQUIRE(resolved.find(spec.key));
    const Value* described = schema.find("properties")->find(spec.key);
    REQUIRE(described);
    CHECK(described->find("description")->scalar.starts_with(spec.help));
    CHECK(page.find(spec.key) != page.npos);
    for (const ParamSpec& child : spec.children) {
      INFO(child.key);
      CHECK(page.find(child.key) != page.npos);
      if (const JobSection* const section = job_section(spec.key);
          !section || section->when_absent) {
        continue;  // what is given stays as it is
      }
      const Value* const in = resolved.find(spec.key);
      const Value* const entry = in->kind == Value::Kind::List ? &in->list.at(0) : in;
      CHECK(entry->find(child.key));
    }
  }
  for (const JobSection& section : job_sections()) {
    INFO(section.key);
    const auto keys = host_keys(section.key);
    CHECK(keys.size() == section.keys().size());
    if (section.kind) CHECK(std::ranges::find(keys, "type") != keys.end());
  }
}

TEST_CASE("the schema of the program accepts all jobs of the project", "[schema]") {
  if (!has_validator()) return;
  const test::WorkFolder folder;
  const auto schema = test::run_program("--log-level error schema");
  REQUIRE(schema.code == 0);
  const std::string file = folder.write("schema.json", schema.out).string();
  const auto verdict_on = [&](const std::string& json) {
    const std::string job = folder.write("job.json", json).string();
    return test::run_shell("/usr/bin/python3 " DIORAMA_SOURCE_DIR
                           "/tests/framework/app/check_schema.py " +
                           file + " " + job)
        .out;
  };
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DIORAMA_SOURCE_DIR "/configs")) {
    if (entry.path().extension() != ".yaml") continue;
    INFO(entry.path().string());
    const auto resolved =
        test::run_program("--log-level error config --json " + entry.path().string());
    if (resolved.code == exit_code(ErrorKind::Plugin)) {
      WARN(entry.path().string() << ": some of its plugins are not built; skipped");
      continue;
    }
    REQUIRE(resolved.code == 0);
    CHECK(verdict_on(resolved.out) == "ok\n");
    // As an editor sees the file; the schema is that of native jobs.
    const Value written = parse_yaml(test::read_file(entry.path()), entry.path().string());
    if (!is_replicator_job(written)) CHECK(verdict_on(to_json(written, 1)) == "ok\n");
    ++count;
  }
  CHECK(count >= 1);
}
