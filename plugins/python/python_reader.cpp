// SPDX-License-Identifier: Apache-2.0
#include "python/python_reader.h"

#include <pybind11/stl.h>

#include <map>
#include <set>
#include <utility>

#include "python/interpreter.h"
#include "python/script.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace diorama {
namespace {

/// What Reader.open() of a script returned.
class PythonDataset final : public StoredDataset {
 public:
  PythonDataset(std::string file, SharedObject object, StoredInfo info, Host& host)
      : file_(std::move(file)), object_(std::move(object)), info_(std::move(info)), host_(host) {}

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    StoredCapture stored;
    call_python(file_, host_, [&] {
      const std::set<std::string> names(wanted.begin(), wanted.end());
      plugins_module().attr("_read")(object_.get(), file_, i, names,
                                     capsule_of(stored, "diorama::StoredCapture"));
    });
    return stored;
  }

 private:
  std::string file_;
  SharedObject object_;
  StoredInfo info_;
  ReadLog log_;
  Host& host_;
};

/// Of the first class that knows the folder; there is one only when nobody else does.
struct KnownBy {
  std::vector<std::string> titles;  ///< "tables.py: Tables"
  std::string file;
  SharedObject type;
};

KnownBy known_by(const fs::path& folder, Host& host) {
  KnownBy known;
  const std::vector<ScriptFile> files = script_files("Reader");
  if (files.empty()) return known;
  start_python();
  call_python("diorama.plugins", host, [&] {
    py::list given;
    for (const ScriptFile& file : files) given.append(py::make_tuple(file.name, file.path));
    for (const py::handle each : plugins_module().attr("_readers_of")(given, folder.string())) {
      auto [path, title, type] = each.cast<std::tuple<std::string, std::string, py::object>>();
      if (known.titles.empty()) {
        known.file = path;
        known.type = SharedObject(std::move(type));
      }
      known.titles.push_back(title);
    }
  });
  return known;
}

StoredInfo info_of_dataset(const py::dict& given) {
  StoredInfo info;
  info.format = given["format"].cast<std::string>();
  const auto holds = given["holds"].cast<std::vector<std::string>>();
  info.holds = NameSet(holds.begin(), holds.end());
  info.camera_names = given["cameras"].cast<std::vector<std::string>>();
  info.captures = given["captures"].cast<std::vector<int>>();
  info.classes = given["classes"].cast<std::vector<std::string>>();
  for (const auto& [name, step] : given["steps"].cast<std::map<std::string, double>>()) {
    info.steps[name] = step;
  }
  return info;
}

/// Calls the object's open(). With the interpreter's lock held.
std::unique_ptr<const StoredDataset> opened_by(const py::object& reader, const std::string& file,
                                               const fs::path& folder, Host& host) {
  const py::tuple opened = plugins_module().attr("_open")(reader, file, folder.string());
  if (!opened[1].is_none()) {
    throw Error(ErrorKind::Asset, folder.string() + ": " + opened[1].cast<std::string>());
  }
  StoredInfo info = info_of_dataset(opened[2].cast<py::dict>());
  return std::make_unique<const PythonDataset>(file, SharedObject(opened[0].cast<py::object>()),
                                               std::move(info), host);
}

}  // namespace

PythonReader::PythonReader(const Params& params, Host& host) : host_(host) {
  const bool is_named =
      !params.file.empty() || !params.class_name.empty() || params.params.kind != Value::Kind::Null;
  if (is_named) script_.emplace(params, kScriptKind, host);
}

Recognition PythonReader::recognise(const fs::path& folder) const {
  if (script_) {
    const bool knows = script_->call([&](const py::object& reader) {
      return plugins_module().attr("_knows")(reader, folder.string()).cast<bool>();
    });
    return knows ? Recognition::ByName : Recognition::No;
  }
  return known_by(folder, host_).titles.empty() ? Recognition::No : Recognition::ByName;
}

std::unique_ptr<const StoredDataset> PythonReader::open(const fs::path& folder) const {
  if (script_) {
    return script_->call([&](const py::object& reader) {
      return opened_by(reader, script_->file(), folder, host_);
    });
  }
  const KnownBy known = known_by(folder, host_);
  if (known.titles.empty()) {
    throw Error(ErrorKind::Asset, folder.string() +
                                      ": no class of a Python file in the folders that "
                                      "DIORAMA_PYTHON_PATH lists knows it");
  }
  if (known.titles.size() > 1) {
    std::string list;
    for (const std::string& title : known.titles) list += (list.empty() ? "" : ", ") + title;
    throw Error(ErrorKind::Usage,
                folder.string() + ": several classes know it (" + list +
                    "); name one: --reader '{type: python, file: FILE, class: CLASS}'");
  }
  return call_python(known.file, host_, [&] {
    return opened_by(plugins_module().attr("_with_defaults")(known.type.get()), known.file, folder,
                     host_);
  });
}

}  // namespace diorama
