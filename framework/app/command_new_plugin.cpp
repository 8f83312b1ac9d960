// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_new_plugin.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <iostream>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

#include "diorama/abi.h"
#include "diorama/config.h"
#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

using Replacements = std::vector<std::pair<std::string, std::string>>;

struct Kind {
  const char* name;
  const char* class_suffix;
};
constexpr std::array kTemplateKinds{Kind{"loader", "Loader"},
                                    Kind{"physics", "Physics"},
                                    Kind{"randomizer", "Randomizer"},
                                    Kind{"renderer", "Renderer"},
                                    Kind{"annotator", "Annotator"},
                                    Kind{"writer", "Writer"},
                                    Kind{"format", ""}};

[[noreturn]] void refuse(const std::string& text) {
  throw Error(ErrorKind::Usage, "new-plugin: " + text);
}

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

const Kind& kind_called(const std::string& name) {
  std::vector<std::string> names;
  for (const Kind& kind : kTemplateKinds) {
    if (name == kind.name) return kind;
    names.emplace_back(kind.name);
  }
  const std::string near = nearest_name(name, names);
  refuse("there is no kind '" + name + "'" +
         (near.empty() ? "" : ", did you mean '" + near + "'?") + " Kinds: " + listed(names));
}

void check_name(const std::string& name) {
  const bool is_word = !name.empty() && name.size() <= 60 && std::islower(name[0]) &&
                       std::all_of(name.begin(), name.end(), [](unsigned char c) {
                         return std::islower(c) || std::isdigit(c) || c == '_';
                       });
  if (!is_word) {
    refuse(
        "expected a name of lower case letters, digits and '_' that begins with a letter, such as "
        "my_boxes, found '" +
        name + "'");
  }
  // CMake makes targets of these names itself.
  for (const char* taken : {"all", "clean", "help", "install", "package", "test"}) {
    if (name == taken) refuse("the name '" + name + "' is taken by CMake, choose another one");
  }
}

/// "my_boxes", "Writer" -> "MyBoxesWriter"; a suffix that is there already is not repeated.
std::string class_name(const std::string& name, const std::string& suffix) {
  std::string text;
  bool is_start = true;
  for (const char c : name) {
    if (c != '_') text += is_start ? char(std::toupper(static_cast<unsigned char>(c))) : c;
    is_start = c == '_';
  }
  return text.ends_with(suffix) ? text : text + suffix;
}

std::string read_text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream || !text) {
    throw Error(ErrorKind::Asset, file.string() +
                                      ": the template cannot be read; is the program "
                                      "installed completely?");
  }
  return std::move(text).str();
}

std::string filled_in(std::string text, const Replacements& replacements) {
  for (const auto& [key, value] : replacements) {
    const std::string mark = "@" + key + "@";
    for (std::size_t at = text.find(mark); at != text.npos;
         at = text.find(mark, at + value.size())) {
      text.replace(at, mark.size(), value);
    }
  }
  return text;
}

std::vector<std::string> licences(const fs::path& templates) {
  std::vector<std::string> names;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(templates / "common/licences", failed)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

void write_file(const fs::path& file, const std::string& text) {
  std::error_code failed;
  fs::create_directories(file.parent_path(), failed);
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw Error(ErrorKind::Output, file.string() + ": cannot be written");
}

void check_folder(const fs::path& folder) {
  std::error_code failed;
  if (!fs::exists(folder, failed)) return;
  if (fs::is_directory(folder, failed) && fs::is_empty(folder, failed)) return;
  throw Error(ErrorKind::Output, folder.string() +
                                     ": expected a new or empty folder; choose "
                                     "another one with --dir");
}

}  // namespace

fs::path template_folder(const fs::path& program) {
  return program.parent_path().parent_path() / "share/diorama/templates";
}

int command_new_plugin(const GlobalOptions& global, const NewPluginOptions& options) {
  const Kind& kind = kind_called(options.kind);
  const std::string& name = options.name;
  check_name(name);
  const fs::path templates = template_folder(global.program);
  const std::vector<std::string> known = licences(templates);
  if (std::find(known.begin(), known.end(), options.licence) == known.end()) {
    refuse("there is no text of the licence '" + options.licence +
           "'; there are: " + listed(known));
  }
  const fs::path project = options.dir.empty() ? fs::path(name) : options.dir;
  check_folder(project);

  const fs::path common = templates / "common", own = templates / kind.name;
  std::string dashed = name;
  std::replace(dashed.begin(), dashed.end(), '_', '-');
  std::string summary = read_text(own / "summary.txt");
  while (summary.ends_with('\n')) summary.pop_back();
  // The summary first: it holds marks itself.
  const Replacements replacements{{"SUMMARY", summary},
                                  {"NAME", name},
                                  {"CLASS", class_name(name, kind.class_suffix)},
                                  {"KIND", kind.name},
                                  {"DASHED", dashed},
                                  {"LICENCE", options.licence},
                                  {"ABI", DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI)}};
  const std::vector<std::pair<fs::path, fs::path>> files{
      {common / "CMakeLists.txt", "CMakeLists.txt"},
      {common / "README.md", "README.md"},
      {common / "gitignore", ".gitignore"},
      {common / "licences" / options.licence, "LICENSE"},
      {common / "tests/plugin_under_test.h", "tests/plugin_under_test.h"},
      {own / "plugin.cpp", "src/" + name + ".cpp"},
      {own / "test.cpp", "tests/" + name + "_test.cpp"},
      {own / "job.yaml", "job.yaml"}};
  for (const auto& [from, to] : files) {
    write_file(project / to, filled_in(read_text(from), replacements));
  }

  std::cout << "wrote the " << kind.name << " plugin " << name << " to " << project.string()
            << "; next:\n"
            << "  cmake -S " << project.string() << " -B " << (project / "build").string() << "\n"
            << "  cmake --build " << (project / "build").string() << "\n"
            << "  ctest --test-dir " << (project / "build").string() << "\n"
            << "  diorama --plugin-dir " << (project / "build/plugins").string()
            << " plugins describe " << name << "\n";
  return 0;
}

}  // namespace diorama
