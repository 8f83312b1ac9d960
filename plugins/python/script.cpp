// SPDX-License-Identifier: Apache-2.0
#include "python/script.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

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

/// A job alone must not run code: it may come from anyone. Folders are chosen by the user.
std::string find_script(const std::string& name) {
  const std::vector<fs::path> folders = allowed_folders();
  std::string looked;
  for (const fs::path& folder : folders) {
    looked += (looked.empty() ? "" : ", ") + folder.string();
    std::error_code failed;
    const fs::path file = fs::canonical(folder / name, failed);
    if (failed || !fs::is_regular_file(file, failed)) continue;
    if (std::ranges::none_of(folders, [&](const fs::path& f) { return is_below(file, f); })) {
      continue;
    }
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0 && (status.st_mode & S_IWOTH) != 0) {
      throw Error(ErrorKind::Config, "file: " + file.string() +
                                         ": everybody may write it, so it is not run (chmod o-w)");
    }
    return file.string();
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

py::dict read_params(const py::object& type, const Value& map) {
  struct Declared {
    std::string key;
    std::string help;
    std::string unit;
    std::vector<std::string> choices;
    Field field;
  };
  std::deque<Declared> all;
  Complaints complaints;
  ParamReader reader(map, "params", complaints);
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
      reader.choice(one.key.c_str(), std::get<std::string>(one.field), words, doc);
    } else {
      std::visit([&](auto& field) { reader.param(one.key.c_str(), field, doc); }, one.field);
    }
  }
  reader.finish();
  complaints.raise();
  py::dict values;
  for (const Declared& one : all) {
    values[py::str(one.key)] =
        std::visit([](const auto& field) { return py::cast(field); }, one.field);
  }
  return values;
}

}  // namespace

Script::Script(const ScriptParams& params, const char* kind, Host& host) : host_(host) {
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
