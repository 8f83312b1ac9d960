// SPDX-License-Identifier: Apache-2.0
// Dependencies point one way. What CONTRIBUTING asks for is read off the sources here.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/catch.h"

namespace fs = std::filesystem;

namespace {

struct Include {
  std::string file;
  bool is_quoted = false;
};

struct Source {
  fs::path path;  ///< Below the repository.
  std::string text;
  std::string code;  ///< Without comments.
  std::vector<Include> includes;

  bool is_below(const std::string& folder) const {
    return path.generic_string().starts_with(folder + "/");
  }
};

const std::vector<std::string> kFolders = {"sdk", "framework", "plugins"};

std::string without_comments(const std::string& text) {
  // Raw and ordinary literals come first, so that a "//" inside stays.
  static const std::regex kTokens(
      R"re(("(?:\\.|[^"\\\n])*")|('(?:\\.|[^'\\\n])')|(//[^\n]*)|(/\*[\s\S]*?\*/))re");
  std::string code;
  auto from = text.cbegin();
  for (std::sregex_iterator it(text.begin(), text.end(), kTokens), end; it != end; ++it) {
    code.append(from, (*it)[0].first);
    if ((*it)[1].matched || (*it)[2].matched) code += it->str();
    from = (*it)[0].second;
  }
  return code.append(from, text.cend());
}

Source read_source(const fs::path& root, const fs::path& file) {
  Source source;
  source.path = fs::relative(file, root);
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  source.text = text.str();
  source.code = without_comments(source.text);
  std::istringstream lines(source.code);
  static const std::regex kInclude(R"re(^\s*#\s*include\s*([<"])([^>"]+)[>"])re");
  for (std::string line; std::getline(lines, line);) {
    std::smatch found;
    if (std::regex_search(line, found, kInclude))
      source.includes.push_back({found[2], found[1] == "\""});
  }
  return source;
}

std::vector<Source> read_sources() {
  std::vector<Source> sources;
  const fs::path root = DIORAMA_SOURCE_DIR;
  for (const std::string& folder : kFolders) {
    if (!fs::is_directory(root / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string ending = entry.path().extension().string();
      if (entry.is_regular_file() && (ending == ".h" || ending == ".cpp")) {
        sources.push_back(read_source(root, entry.path()));
      }
    }
  }
  std::sort(sources.begin(), sources.end(),
            [](const Source& a, const Source& b) { return a.path < b.path; });
  return sources;
}

const std::vector<Source>& sources() {
  static const std::vector<Source> all = read_sources();
  return all;
}

/// "path: include" of every include for which the rule says no.
template <class Rule>
std::vector<std::string> offending_includes(const std::string& folder, Rule&& is_allowed) {
  std::vector<std::string> offences;
  for (const Source& source : sources()) {
    if (!source.is_below(folder)) continue;
    for (const Include& include : source.includes) {
      if (!is_allowed(source, include)) {
        offences.push_back(source.path.generic_string() + ": " + include.file);
      }
    }
  }
  return offences;
}

std::vector<std::string> files_including(const std::string& prefix) {
  std::vector<std::string> files;
  for (const Source& source : sources()) {
    const bool found = std::any_of(source.includes.begin(), source.includes.end(),
                                   [&](const Include& i) { return i.file.starts_with(prefix); });
    if (found) files.push_back(source.path.generic_string());
  }
  return files;
}

template <class Where>
std::vector<std::string> files_with_code(const std::string& pattern, Where&& where) {
  const std::regex regex(pattern);
  std::vector<std::string> files;
  for (const Source& source : sources()) {
    if (where(source) && std::regex_search(source.code, regex)) {
      files.push_back(source.path.generic_string());
    }
  }
  return files;
}

/// Templates leave the licence to whoever uses them.
std::string licence_line(const Source& source) {
  const bool is_template = source.is_below("sdk/templates");
  return std::string("// SPDX-License-Identifier: ") + (is_template ? "@LICENCE@" : "Apache-2.0") +
         "\n";
}

bool is_standard_header(const std::string& file) {
  return file.find('/') == std::string::npos && file.find('.') == std::string::npos;
}

/// "renderer_embree" of plugins/renderer_embree/a/b.cpp.
std::string folder_below_plugins(const Source& source) { return *std::next(source.path.begin()); }

/// Folders that make a plugin; the others below plugins/ are libraries that plugins share.
std::set<std::string> plugin_folders() {
  std::set<std::string> folders;
  for (const Source& source : sources()) {
    if (source.is_below("plugins") && source.code.find("DIORAMA_PLUGIN(") != std::string::npos) {
      folders.insert(folder_below_plugins(source));
    }
  }
  return folders;
}

bool stands_in(const Source& source, const std::string& include, const fs::path& top) {
  const fs::path root = DIORAMA_SOURCE_DIR;
  const auto is_inside = [&](const fs::path& file) {
    const fs::path plain = file.lexically_normal();
    const auto [end, mismatch] = std::mismatch(top.begin(), top.end(), plain.begin(), plain.end());
    return end == top.end() && fs::exists(root / plain);
  };
  return is_inside(source.path.parent_path() / include) || is_inside(top / include);
}

using None = std::vector<std::string>;

}  // namespace

TEST_CASE("The checks see the sources", "[architecture]") {
  CHECK(sources().size() > 40);
  CHECK(without_comments("a // x\n\"//\" /* \n */ '\"' b // \"") == "a \n\"//\"  '\"' b ");
  CHECK_FALSE(files_including("diorama/scene.h").empty());
}

TEST_CASE("The SDK includes the standard library, Eigen and itself", "[architecture]") {
  const auto is_allowed = [](const Source&, const Include& include) {
    return is_standard_header(include.file) || include.file.starts_with("Eigen/") ||
           include.file.starts_with("diorama/");
  };
  CHECK(offending_includes("sdk/include", is_allowed) == None{});
  CHECK(offending_includes("sdk/src", is_allowed) == None{});
}

TEST_CASE("The framework includes the SDK and itself, no plugin", "[architecture]") {
  const auto is_allowed = [](const Source& source, const Include& include) {
    if (!include.is_quoted) return true;
    return include.file.starts_with("diorama/") || stands_in(source, include.file, "framework") ||
           (include.file.starts_with("framework/") &&
            fs::exists(fs::path(DIORAMA_SOURCE_DIR) / include.file));
  };
  CHECK(offending_includes("framework", is_allowed) == None{});
}

TEST_CASE("The engine includes nothing of the program", "[architecture]") {
  const std::vector<std::string> program = {"app",  "bench",  "conformance", "inspect",
                                            "lint", "replay", "view"};
  const auto is_allowed = [&](const Source&, const Include& include) {
    return std::ranges::none_of(program, [&](const std::string& folder) {
      return include.file.starts_with("framework/" + folder + "/");
    });
  };
  for (const char* folder : {"annotators", "config", "datasets", "export", "host", "images", "jobs",
                             "library", "output", "pipeline", "plugins", "python", "replicator"}) {
    CHECK(offending_includes(std::string("framework/") + folder, is_allowed) == None{});
  }
  CHECK_FALSE(offending_includes("framework/app", is_allowed).empty());
}

TEST_CASE("A plugin includes the SDK, its engine, itself and shared libraries", "[architecture]") {
  const std::set<std::string> plugins = plugin_folders();
  CHECK(plugins.contains("renderer_embree"));
  const auto is_allowed = [&](const Source& source, const Include& include) {
    const std::string& file = include.file;
    // Scripts are looked at as libraries are; its source is compiled into the plugin.
    if (file == "framework/plugins/file_safety.h") return source.is_below("plugins/python");
    if (file.starts_with("framework/") || file.starts_with("plugins/")) return false;
    if (!include.is_quoted || file.starts_with("diorama/")) return true;
    const std::string own = folder_below_plugins(source);
    if (stands_in(source, file, fs::path("plugins") / own)) return true;
    const std::string named = file.substr(0, file.find('/'));
    return (named == own || !plugins.contains(named)) &&
           fs::exists(fs::path(DIORAMA_SOURCE_DIR) / "plugins" / file);
  };
  CHECK(offending_includes("plugins", is_allowed) == None{});
}

TEST_CASE("What path tracers share knows no engine that traces rays", "[architecture]") {
  const std::string folder = "plugins/renderer_support";
  const auto is_allowed = [&](const Source& source, const Include& include) {
    const std::string& file = include.file;
    if (include.is_quoted) {
      return file.starts_with("diorama/") || stands_in(source, file, fs::path(folder));
    }
    return is_standard_header(file) || file.starts_with("Eigen/") || file.starts_with("sys/") ||
           file.starts_with("OpenImageDenoise/");
  };
  CHECK(offending_includes(folder, is_allowed) == None{});
  CHECK_FALSE(offending_includes("plugins/renderer_embree", is_allowed).empty());
  const auto is_inside = [&](const Source& source) { return source.is_below(folder); };
  CHECK(files_with_code(R"(\b[Ee]mbree|\bRTC[A-Z]|\brtc[A-Z])", is_inside) == None{});
}

TEST_CASE("One file each knows yaml-cpp, Boost.DLL and Boost.Beast", "[architecture]") {
  CHECK(files_including("yaml-cpp/").size() == 1);
  CHECK(files_including("boost/dll").size() == 1);
  CHECK(files_including("boost/beast").size() == 1);
}

TEST_CASE("OpenCV is known to libraries that are mapped on demand", "[architecture]") {
  const auto is_allowed = [](const Source& source, const Include& include) {
    return !include.file.starts_with("opencv2/") || source.is_below("plugins/opencv_support") ||
           source.path == "framework/lint/opencv_geometry.cpp" ||
           source.path == "framework/images/opencv_pictures.cpp";
  };
  CHECK(offending_includes("sdk", is_allowed) == None{});
  CHECK(offending_includes("framework", is_allowed) == None{});
  CHECK(offending_includes("plugins", is_allowed) == None{});
  CHECK(files_including("opencv2/").size() > 3);
}

TEST_CASE("Nothing but the program writes to the standard streams", "[architecture]") {
  // One shuts std::cerr while OpenCV is at work.
  const auto is_elsewhere = [](const Source& s) {
    return !s.is_below("framework/app") && s.path != "framework/images/opencv_pictures.cpp";
  };
  CHECK(files_with_code(R"(\bstd::c(out|err|log)\b|\b(std::)?printf\s*\()", is_elsewhere) ==
        None{});
}

TEST_CASE("No namespace is opened to all of std", "[architecture]") {
  CHECK(files_with_code(R"(using\s+namespace\s+std\b)", [](const Source&) { return true; }) ==
        None{});
}

TEST_CASE("Chance comes from diorama::Rng alone", "[architecture]") {
  // Distributions and shuffles of the standard library differ between its versions.
  const auto is_code = [](const Source&) { return true; };
  CHECK(
      files_with_code(
          R"(_distribution\s*<|\bstd::(shuffle|sample|random_device|mt19937|default_random_engine)\b)",
          is_code) == None{});
  CHECK(files_with_code(R"((\bstd::|[^\w:.>])s?rand\s*\()", is_code) == None{});
}

namespace {

/// Of formats, and the types of their writers and readers as the plugins register them.
std::set<std::string> names_of_formats() {
  std::set<std::string> names{"BOP",  "COCO", "HDF5",  "Hugging Face", "KITTI",      "MOT",
                              "MOTS", "VOC",  "YOLO",  "YouTube",      "WebDataset", "bop",
                              "coco", "hdf5", "kitti", "voc",          "webdataset", "yolo"};
  static const std::regex kType(
      R"re(DIORAMA_ADD(?:_READER)?\([\w:]*(?:Writer|Reader),\s*"(\w+)")re");
  for (const Source& source : sources()) {
    if (!source.is_below("plugins")) continue;
    for (std::sregex_iterator it(source.code.begin(), source.code.end(), kType), end; it != end;
         ++it) {
      names.insert((*it)[1]);
    }
  }
  names.erase("python");  // a language first of all
  return names;
}

std::string any_of(const std::set<std::string>& names) {
  std::string any;
  for (const std::string& name : names) any += (any.empty() ? "" : "|") + name;
  return "\\b(" + any + ")\\b";
}

}  // namespace

TEST_CASE("The framework knows no format's name", "[architecture]") {
  const std::set<std::string> names = names_of_formats();
  CHECK(names.size() > 15);
  const auto knows_none = [](const Source& source) {
    // The dialect of Replicator names its writers.
    return source.is_below("framework") && !source.is_below("framework/replicator");
  };
  CHECK(files_with_code(any_of(names), knows_none) == None{});

  // The page, the package and scripts, with their comments.
  static const std::set<std::string> kEndings{".py",  ".pyi", ".ts",  ".mjs",  ".html",
                                              ".css", ".in",  ".txt", ".cmake"};
  const std::regex any(any_of(names));
  std::set<std::string> others = names;
  others.erase("COCO");  // Dataset.to_coco() of the package
  const std::regex any_other(any_of(others));
  const fs::path root = DIORAMA_SOURCE_DIR;
  std::size_t looked = 0;
  None knowing;
  for (const auto& entry : fs::recursive_directory_iterator(root / "framework")) {
    const std::string path = fs::relative(entry.path(), root).generic_string();
    if (path.find("node_modules") != path.npos || !kEndings.contains(entry.path().extension())) {
      continue;
    }
    std::ostringstream text;
    text << std::ifstream(entry.path()).rdbuf();
    const bool is_package = path == "framework/python/diorama/__init__.py";
    ++looked;
    if (std::regex_search(text.str(), is_package ? any_other : any)) knowing.push_back(path);
  }
  CHECK(looked > 20);
  CHECK(knowing == None{});
}

TEST_CASE("Messages quote in one way", "[architecture]") {
  // 'like this'; these write JSON, YAML, HTML, USD, man pages or shell.
  static const std::set<std::string> kOtherLanguages{
      "framework/app/completion_scripts.cpp",
      "framework/app/reference_pages.cpp",
      "framework/config/value_text.cpp",
      "framework/export/usda_writer.cpp",
      "framework/host/progress_lines.cpp",
      "framework/view/capture_index.cpp",
      "framework/view/report.cpp",
      "plugins/loader_assimp/texture_library.cpp",
      "plugins/writer_bop/bop_writer.cpp",
      "plugins/writer_coco/coco_writer.cpp",
      "plugins/writer_imagefolder/image_folder_writer.cpp",
      "plugins/writer_support/python_json.cpp",
      "plugins/writer_support/training_data.cpp"};
  const auto speaks = [](const Source& source) {
    return (source.is_below("framework") || source.is_below("plugins") ||
            source.is_below("sdk/src")) &&
           !kOtherLanguages.contains(source.path.generic_string());
  };
  CHECK(files_with_code(R"(\\")", speaks) == None{});
}

TEST_CASE("Tests name what both versions of Catch2 have", "[architecture]") {
  // Debian 12 has the second, Debian 13 the third.
  CHECK(files_with_code(R"(Catch::(Contains|StartsWith|EndsWith|Equals|VectorContains)\()",
                        [](const Source& source) { return source.is_below("tests"); }) == None{});
}

TEST_CASE("Every source says its licence first", "[architecture]") {
  None missing;
  for (const Source& source : sources()) {
    if (!source.text.starts_with(licence_line(source))) {
      missing.push_back(source.path.generic_string());
    }
  }
  CHECK(missing == None{});
}
