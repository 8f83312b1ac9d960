// SPDX-License-Identifier: Apache-2.0
#include "python/script.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "framework/plugins/file_safety.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace diorama {
namespace {

constexpr const char* kFolders = "DIORAMA_PYTHON_PATH";

std::vector<fs::path> allowed_folders() {
  std::vector<fs::path> folders;
  const char* const list = std::getenv(kFolders);
  if (list == nullptr) return folders;
  const std::string text = list;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(':', begin), text.size());
    std::error_code failed;
    if (end > begin) {
      fs::path folder = fs::canonical(text.substr(begin, end - begin), failed);
      if (!failed) folders.push_back(std::move(folder));
    }
    begin = end + 1;
  }
  return folders;
}

bool is_below(const fs::path& file, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first ==
         folder.end();
}

/// The file that is meant, if it lies in one of the folders, links followed.
std::optional<fs::path> file_in(const std::vector<fs::path>& folders, const fs::path& place) {
  std::error_code failed;
  fs::path file = fs::canonical(place, failed);
  if (failed || !fs::is_regular_file(file, failed)) return std::nullopt;
  if (std::ranges::none_of(folders, [&](const fs::path& f) { return is_below(file, f); })) {
    return std::nullopt;
  }
  return file;
}

/// As with plugins: who else may change the file, or exchange it in a folder above it.
std::string danger_of(const fs::path& file) {
  std::error_code failed;
  return FileSafety(fs::read_symlink("/proc/self/exe", failed)).danger(file);
}

/// A job alone must not run code: it may come from anyone. Folders are chosen by the user.
std::string find_script(const std::string& name) {
  const std::vector<fs::path> folders = allowed_folders();
  std::string looked;
  for (const fs::path& folder : folders) {
    looked += (looked.empty() ? "" : ", ") + folder.string();
    const std::optional<fs::path> file = file_in(folders, folder / name);
    if (!file) continue;
    if (const std::string danger = danger_of(*file); !danger.empty()) {
      throw Error(ErrorKind::Config, "file: " + file->string() + ": is not run: " + danger);
    }
    return file->string();
  }
  throw Error(
      ErrorKind::Config,
      std::string("file: expected a Python file in a folder that the environment variable ") +
          kFolders + " lists (" + (looked.empty() ? "it lists none" : looked) + "), found " +
          Value::text(name).describe());
}

/// Fields that stay where they are while a reader fills them.
using Field = std::variant<bool, int, double, std::string, Vec3, std::vector<std::string>,
                           std::vector<double>>;

Field field_of(const std::string& type, const py::object& value) {
  if (type == "bool") return value.cast<bool>();
  if (type == "int") return value.cast<int>();
  if (type == "float") return value.cast<double>();
  if (type == "vector") {
    const auto parts = value.cast<std::array<double, 3>>();
    return Vec3(parts[0], parts[1], parts[2]);
  }
  if (type == "texts") return value.cast<std::vector<std::string>>();
  if (type == "numbers") return value.cast<std::vector<double>>();
  return value.cast<std::string>();
}

struct Declared {
  std::string key;
  std::string help;
  std::string unit;
  std::vector<std::string> choices;
  Field field;
};

/// What the class declares, shown to the visitor one by one.
std::deque<Declared> visit_declared(const py::object& type, ParamVisitor& visitor) {
  std::deque<Declared> all;
  for (const py::handle each : plugins_module().attr("_params_of")(type)) {
    const auto [key, kind, spec] = each.cast<std::tuple<std::string, std::string, py::object>>();
    all.push_back({key, spec.attr("help").cast<std::string>(),
                   spec.attr("unit").cast<std::string>(),
                   spec.attr("choices").cast<std::vector<std::string>>(),
                   field_of(kind, spec.attr("default"))});
    Declared& one = all.back();
    const ParamDoc doc{one.help.c_str(), one.unit.c_str(), spec.attr("least").cast<double>(),
                       spec.attr("most").cast<double>()};
    if (!one.choices.empty()) {
      std::vector<const char*> words;
      for (const std::string& word : one.choices) words.push_back(word.c_str());
      visitor.choice(one.key.c_str(), std::get<std::string>(one.field), words, doc);
    } else {
      std::visit([&](auto& field) { visitor.param(one.key.c_str(), field, doc); }, one.field);
    }
  }
  return all;
}

py::dict read_params(const py::object& type, const Value& map) {
  Diagnostics diagnostics;
  ParamReader reader(map, "params", diagnostics);
  const std::deque<Declared> all = visit_declared(type, reader);
  reader.finish();
  diagnostics.raise();
  py::dict values;
  for (const Declared& one : all) {
    values[py::str(one.key)] =
        std::visit([](const auto& field) { return py::cast(field); }, one.field);
  }
  return values;
}

/// The parameters of a class as one of the things that `params` may be.
ParamSpec variant_for(const std::string& file, const std::string& name, const std::string& help,
                      const py::object& type) {
  ParamLister lister;
  visit_declared(type, lister);
  ParamSpec spec;
  spec.key = name + " of " + file;
  spec.type = ParamType::Group;
  spec.help = help;
  spec.default_value = Value::make_map();
  spec.choices = {"file=" + file, "class=" + name};
  spec.children = lister.take();
  return spec;
}

}  // namespace

std::vector<ScriptFile> script_files(std::string_view word) {
  const std::vector<fs::path> folders = allowed_folders();
  std::vector<ScriptFile> files;
  for (const fs::path& folder : folders) {
    std::vector<ScriptFile> here;
    std::error_code failed;
    for (fs::directory_iterator at(folder, failed), end; !failed && at != end;
         at.increment(failed)) {
      const std::string name = at->path().filename().string();
      const bool is_taken =
          std::ranges::find(files, name, &ScriptFile::name) != files.end();  // as find_script()
      if (at->path().extension() != ".py" || is_taken) continue;
      const std::optional<fs::path> file = file_in(folders, at->path());
      if (!file || !danger_of(*file).empty()) continue;
      std::ifstream in(*file);
      const std::string text{std::istreambuf_iterator<char>(in), {}};
      if (text.find("diorama.plugins") == text.npos || text.find(word) == text.npos) continue;
      here.push_back({name, file->string()});
    }
    std::ranges::sort(here, {}, &ScriptFile::name);
    files.insert(files.end(), here.begin(), here.end());
  }
  return files;
}

std::vector<ParamSpec> describe_scripts(const char* kind) {
  ScriptParams params;
  ParamLister lister;
  params.visit(lister);
  std::vector<ParamSpec> specs = lister.take();
  const std::vector<ScriptFile> files = script_files("");
  if (files.empty()) return specs;
  start_python();
  const py::gil_scoped_acquire lock;
  try {
    py::list given;
    for (const ScriptFile& file : files) given.append(py::make_tuple(file.name, file.path));
    for (const py::handle each : plugins_module().attr("_classes")(kind, given)) {
      const auto [file, name, help, type] =
          each.cast<std::tuple<std::string, std::string, std::string, py::object>>();
      specs.back().children.push_back(variant_for(file, name, help, type));
    }
  } catch (const py::error_already_set& error) {
    throw Error(ErrorKind::Plugin, message_of(error, "diorama.plugins"));
  }
  return specs;
}

Script::Script(const ScriptParams& params, const char* kind, Host& host)
    : host_(host), class_name_(params.class_name) {
  file_ = find_script(params.file);
  start_python();
  call_python(file_, host, [&] {
    const py::module_ plugins = plugins_module();
    py::object type;
    try {
      type = plugins.attr("_load")(file_, params.class_name, kind);
    } catch (const py::error_already_set& error) {
      if (!error.matches(plugins.attr("NoSuchClass"))) throw;
      throw Error(ErrorKind::Config,
                  "class: " + file_ + ": " + py::str(error.value()).cast<std::string>());
    }
    const py::dict values = read_params(type, params.params);
    object_ = SharedObject(plugins.attr("_make")(type, values));
  });
}

}  // namespace diorama
