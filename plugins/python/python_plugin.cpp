// SPDX-License-Identifier: Apache-2.0
// Randomizers and writers that are classes in Python files; framework/docs/python.md says how to
// write them. Their base classes stand in framework/python/diorama/plugins.py.
#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <string>
#include <vector>

#include "diorama/plugin.h"
#include "diorama/randomizer.h"
#include "diorama/writer.h"
#include "python/script.h"

namespace py = pybind11;

namespace diorama {
namespace {

template <class T>
py::capsule capsule_of(T& object, const char* name) {
  return py::capsule(static_cast<const void*>(&object), name);
}

class PythonRandomizer final : public Randomizer {
 public:
  using Params = ScriptParams;
  PythonRandomizer(const Params& params, Host& host)
      : script_(params, "randomizer", host), host_(host) {}

  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override {
    script_.call([&](const py::object& object) {
      plugins_module().attr("_randomize")(object, capsule_of(scene, "diorama::Scene"),
                                          capsule_of(host_, "diorama::Host"), context.moment,
                                          context.capture, context.working_area_world,
                                          context.occurrence, capsule_of(rng, "diorama::Rng"));
    });
  }

 private:
  Script script_;
  Host& host_;
};

class PythonWriter final : public Writer {
 public:
  using Params = ScriptParams;
  PythonWriter(const Params& params, Host& host) : script_(params, "writer", host) {
    script_.call([&](const py::object& object) {
      needs_ = object.attr("needs").cast<std::vector<std::string>>();
    });
  }

  NameSet needs() const override { return {needs_.begin(), needs_.end()}; }
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override {
    script_.call([&](const py::object& object) {
      plugins_module().attr("_begin")(object, capsule_of(dataset, "diorama::DatasetInfo"),
                                      capsule_of(files, "diorama::DatasetFiles"));
    });
  }
  void write(const Capture& capture, CaptureFiles& files) const override {
    script_.call([&](const py::object& object) {
      plugins_module().attr("_write")(object, capsule_of(capture, "diorama::Capture"), needs_,
                                      capsule_of(files, "diorama::CaptureFiles"));
    });
  }
  void finish(const RecordReader& records, DatasetFiles& files) override {
    script_.call([&](const py::object& object) {
      const py::cpp_function read([&records](const py::function& visit) {
        records([&](int capture, std::string_view line) { visit(capture, std::string(line)); });
      });
      plugins_module().attr("_finish")(object, read, capsule_of(files, "diorama::DatasetFiles"));
    });
  }

 private:
  Script script_;
  std::vector<std::string> needs_;
};

}  // namespace
}  // namespace diorama

DIORAMA_PLUGIN("python", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(diorama::PythonRandomizer, "python",
              "Changes the scene by a class in a Python file.");
  DIORAMA_ADD(diorama::PythonWriter, "python", "Writes files by a class in a Python file.");
}
