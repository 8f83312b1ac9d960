// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace diorama::test {

/// A folder that goes away with its owner.
class WorkFolder {
 public:
  WorkFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "diorama_app_XXXXXX").string();
    path = mkdtemp(pattern.data());
  }
  ~WorkFolder() { std::filesystem::remove_all(path); }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(path / name, std::ios::binary) << text;
    return path / name;
  }

  std::filesystem::path path;
};

struct ProgramRun {
  int code = -1;
  std::string out;
  std::string err;
};

inline std::string read_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Runs a shell command in a folder of its own, without plugins of the user.
inline ProgramRun run_shell(const std::string& command) {
  const WorkFolder folder;
  const std::string dir = folder.path.string();
  const std::string line = "cd " + dir +
                           " && env -u DIORAMA_PLUGIN_PATH -u DIORAMA_ASSETS_ROOT HOME=" + dir +
                           " XDG_DATA_HOME= " + command + " >" + dir + "/out 2>" + dir + "/err";
  const int status = std::system(line.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder.path / "out"),
          read_file(folder.path / "err")};
}

inline ProgramRun run_program(const std::string& arguments) {
  return run_shell(DIORAMA_PROGRAM " " + arguments);
}

}  // namespace diorama::test
