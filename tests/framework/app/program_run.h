// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pty.h>
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

/// What the program prints on a terminal that is so wide; lines end as terminals end them.
inline std::string run_in_terminal(const std::string& arguments, int columns) {
  winsize size{};
  size.ws_row = 50;
  size.ws_col = static_cast<unsigned short>(columns);
  int ours = -1;
  const pid_t child = forkpty(&ours, nullptr, nullptr, &size);
  if (child == 0) {
    execl("/bin/sh", "sh", "-c", (DIORAMA_PROGRAM " " + arguments).c_str(), nullptr);
    _exit(127);
  }
  std::string text;
  char part[4096];
  for (ssize_t count = 0; (count = read(ours, part, sizeof part)) > 0;)
    text.append(part, std::size_t(count));
  close(ours);
  int status = 0;
  waitpid(child, &status, 0);
  return text;
}

}  // namespace diorama::test
