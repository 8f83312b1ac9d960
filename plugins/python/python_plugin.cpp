// SPDX-License-Identifier: Apache-2.0
// Components that are classes in Python files; framework/docs/python.md says how to write them.
// Their base classes stand in framework/python/diorama/plugins.py.
#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <string>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/plugin.h"
#include "diorama/randomizer.h"
#include "diorama/writer.h"
#include "python/python_reader.h"
#include "python/script.h"

namespace py = pybind11;

namespace diorama {
namespace {

std::vector<std::string> names_of(const py::object& component, const char* attribute) {
  return plugins_module().attr("_names")(component, attribute).cast<std::vector<std::string>>();
}

class PythonRandomizer final : public Randomizer {
 public:
  static constexpr const char* kScriptKind = "randomizer";
  using Params = ScriptParams;
  PythonRandomizer(const Params& params, Host& host)
      : script_(params, kScriptKind, host), host_(host) {}

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

class PythonAnnotator final : public Annotator {
 public:
  static constexpr const char* kScriptKind = "annotator";
  using Params = ScriptParams;
  PythonAnnotator(const Params& params, Host& host) : script_(params, kScriptKind, host) {
    script_.call([&](const py::object& object) {
      needs_ = names_of(object, "needs");
      provides_ = names_of(object, "provides");
    });
    if (provides_.empty()) refuse("provides nothing; list the channels that annotate() makes");
    for (const std::string& name : provides_) {
      if (is_annotation(name)) refuse("provides '" + name + "', which is no channel");
      if (needs().contains(name)) refuse("needs '" + name + "', which it provides itself");
    }
  }

  NameSet needs() const override { return {needs_.begin(), needs_.end()}; }
  NameSet provides() const override { return {provides_.begin(), provides_.end()}; }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw Error(ErrorKind::Plugin, script_.title() + " " + why);
  }
  void do_annotate(const Scene&, Frame& frame) const override {
    script_.call([&](const py::object& object) {
      plugins_module().attr("_annotate")(object, capsule_of(frame, "diorama::Frame"), needs_,
                                         provides_);
    });
  }

  Script script_;
  std::vector<std::string> needs_;
  std::vector<std::string> provides_;
};

class PythonWriter final : public Writer {
 public:
  static constexpr const char* kScriptKind = "writer";
  using Params = ScriptParams;
  PythonWriter(const Params& params, Host& host) : script_(params, kScriptKind, host) {
    script_.call([&](const py::object& object) { needs_ = names_of(object, "needs"); });
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

/// As diorama::add(), with the parameters of the classes that the user's folders hold.
template <class T>
void add_script(Registrar& registrar, const char* help, const Listing& listing) {
  ComponentInfo info = detail::info_of<T>("python", help, listing, nullptr,
                                          [](const void*) { return ScriptParams(); });
  info.describe = [](const void*) { return describe_scripts(T::kScriptKind); };
  registrar.add(info);
}

}  // namespace
}  // namespace diorama

#define DIORAMA_ADD_SCRIPT(T, HELP, CLAIMS, PROVIDES)                                   \
  do {                                                                                  \
    DIORAMA_DETAIL_LIST(std::uint32_t(T::kKind), "python", HELP, CLAIMS, "", PROVIDES); \
    diorama::add_script<T>(registrar, HELP, {CLAIMS, "", PROVIDES});                    \
  } while (false)

DIORAMA_PLUGIN("python", "1.2.0", "Apache-2.0") {
  DIORAMA_ADD_SCRIPT(diorama::PythonRandomizer, "Changes the scene by a class in a Python file.",
                     "", "");
  // What it makes depends on its class: it works where a job lists it.
  DIORAMA_ADD_SCRIPT(diorama::PythonAnnotator, "Makes channels by a class in a Python file.", "",
                     "*");
  DIORAMA_ADD_SCRIPT(diorama::PythonWriter, "Writes files by a class in a Python file.", "", "");
  DIORAMA_ADD_SCRIPT(diorama::PythonReader,
                     "Opens datasets by classes in Python files of the user's folders.", "*.* */*",
                     "");
}
