// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "diorama/error.h"
#include "framework/pipeline/fake_host.h"
#include "orbit_cameras.h"
#include "random_labels.h"
#include "scatter_poses.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

std::string text_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Config);
    return error.what();
  }
  return "";
}

/// What a job file that holds one scalar parameter would be told.
template <class Params>
std::string complaint_about(const std::string& key, Value value) {
  Value map = Value::make_map();
  map.set(key, std::move(value));
  Diagnostics diagnostics;
  ParamReader reader(map, "randomizers[0]", diagnostics);
  Params params;
  params.visit(reader);
  reader.finish();
  return diagnostics.is_empty() ? "" : diagnostics.messages().front();
}

Value scalar(const std::string& text) {
  Value value = Value::text(text);
  value.is_quoted = false;
  return value;
}

}  // namespace

TEST_CASE("labels to choose from must be there", "[randomizers]") {
  FakeHost host;
  RandomLabels::Params none;
  none.labels = {};
  CHECK(text_of([&] { RandomLabels(none, host); }) == "'labels': expected at least one");
}

TEST_CASE("parameters out of range or unknown are named", "[randomizers]") {
  CHECK(complaint_about<OrbitCameras::Params>("distanse", Value::number(1.0)).find("distance") !=
        std::string::npos);
  CHECK(complaint_about<OrbitCameras::Params>("roll", scalar("free")).find("level") !=
        std::string::npos);
  CHECK(complaint_about<OrbitCameras::Params>("max_tries", Value::integer(0)).find("max_tries") !=
        std::string::npos);
  CHECK(complaint_about<ScatterPoses::Params>("scale", Value::number(-1.0))
            .find("scale: expected a number in [1e-04, 10000], found") != std::string::npos);
  CHECK(complaint_about<ScatterPoses::Params>("scale", Value::number(0.5)).empty());
}
