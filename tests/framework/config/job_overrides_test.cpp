// SPDX-License-Identifier: Apache-2.0
#include "framework/config/job_overrides.h"

#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Value job() {
  return parse_yaml(
      "seed: 1\nrenderer: {type: embree, samples: 8}\n"
      "writers:\n  - {type: BasicWriter, name: basic, rgb: true}\n  - {type: PoseWriter}\n"
      "twins: [{name: x}, {name: x}]\n",
      "job.yaml");
}

std::string set_error(std::string_view assignment) {
  Value value = job();
  try {
    apply_set(value, assignment);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Usage);
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("merging goes into mappings and replaces everything else", "[config]") {
  Value base = parse_yaml("{a: {b: 1, c: {d: 2, e: 3}}, list: [1, 2, 3], keep: x, gone: 5}", "b");
  merge(base, parse_yaml("{a: {c: {e: 4, f: 5}}, list: [9], new: {n: 1}, gone: null}", "o"));
  CHECK(
      to_json(base, 0) ==
      "{\"a\": {\"b\": 1, \"c\": {\"d\": 2, \"e\": 4, \"f\": 5}}, \"list\": [9], \"keep\": \"x\", "
      "\"gone\": null, \"new\": {\"n\": 1}}");
}

TEST_CASE("--set reaches keys, indices and named entries", "[config]") {
  Value value = job();
  apply_set(value, "seed=42");
  apply_set(value, "renderer.samples=64");
  apply_set(value, "renderer.nested.key=[a, {b: 1}]");
  apply_set(value, "writers.0.rgb=false");
  apply_set(value, "writers.PoseWriter.debug='yes'");
  apply_set(value, "writers[1].level=3");
  apply_set(value, "writers[basic].rgb=");
  CHECK(value.find("seed")->scalar == "42");
  CHECK(value.find("renderer")->find("samples")->scalar == "64");
  CHECK(value.find("renderer")->find("nested")->find("key")->list.at(1).find("b")->scalar == "1");
  CHECK(value.find("writers")->list[0].find("rgb")->kind == Value::Kind::Null);
  CHECK(value.find("writers")->list[1].find("debug")->is_quoted);
  CHECK(value.find("writers")->list[1].find("level")->scalar == "3");
  CHECK(value.find("renderer")->find("samples")->place.file == "--set renderer.samples=64");
  CHECK(value.find("renderer")->find("nested")->key_place.file ==
        "--set renderer.nested.key=[a, {b: 1}]");
}

TEST_CASE("--set says which part does not fit", "[config]") {
  CHECK(set_error("seed") == "--set seed: expected key=value, for instance renderer.samples=64");
  CHECK(set_error("=3") == "--set =3: expected key=value, for instance renderer.samples=64");
  CHECK(set_error("a..b=3") == "--set a..b=3: the key has an empty part");
  CHECK(set_error("writers.2.rgb=1") ==
        "--set writers.2.rgb=1: writers has 2 entries, counted from 0; there is no entry 2");
  CHECK(set_error("writers.coco.rgb=1") ==
        "--set writers.coco.rgb=1: writers has no entry called 'coco'; it has: basic, PoseWriter");
  CHECK(set_error("writers[2].rgb=1") ==
        "--set writers[2].rgb=1: writers has 2 entries, counted from 0; there is no entry 2");
  CHECK(set_error("writers[0].rgb.x=1") ==
        "--set writers[0].rgb.x=1: writers[0].rgb is 'true', it has no key 'x'");
  for (const char* key : {"writers[0=1", "writers[0]rgb=1", "writers]0[=1"}) {
    CHECK(set_error(key) != "no error");
  }
  CHECK(set_error("writers[0]rgb=1") ==
        "--set writers[0]rgb=1: expected entries of lists as in cameras[0].width");
  CHECK(set_error("twins.x.a=1") ==
        "--set twins.x.a=1: twins has several entries called 'x'; use an index from 0");
  CHECK(set_error("seed.deep=1") == "--set seed.deep=1: seed is '1', it has no key 'deep'");
  CHECK(set_error("seed=[1").starts_with("--set seed=[1:1:"));
}
