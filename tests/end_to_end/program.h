// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

/// The program as a child process, and folders to run it in.
namespace diorama::test {

namespace fs = std::filesystem;

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "diorama-run-XXXXXX").string();
    path_ = fs::canonical(::mkdtemp(pattern.data()));
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const fs::path& path() const { return path_; }
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

inline std::string read_file(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

inline void write_file(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
}

struct Outcome {
  int exit_code = -1;  ///< 128 + signal when it was killed.
  std::string output;
  std::string errors;
  long max_rss_kb = 0;
};

/// A running program; its output goes to files in `folder`, which is its current folder.
class Process {
 public:
  Process(const std::vector<std::string>& arguments, const fs::path& folder) : folder_(folder) {
    std::vector<std::string> all{DIORAMA_PROGRAM, "--plugin-dir", DIORAMA_PLUGIN_DIR};
    all.insert(all.end(), arguments.begin(), arguments.end());
    std::vector<char*> pointers;
    for (std::string& argument : all) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    child_ = ::fork();
    if (child_ < 0) throw std::runtime_error("fork failed");
    if (child_ > 0) return;
    if (::chdir(folder.c_str()) != 0) ::_exit(127);
    redirect(1, out_file());
    redirect(2, error_file());
    ::execv(pointers[0], pointers.data());
    ::_exit(127);
  }

  void signal(int number) const { ::kill(child_, number); }

  Outcome wait() {
    int status = 0;
    rusage usage{};
    ::wait4(child_, &status, 0, &usage);
    Outcome outcome;
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    outcome.output = read_file(out_file());
    outcome.errors = read_file(error_file());
    outcome.max_rss_kb = usage.ru_maxrss;
    fs::remove(out_file());
    fs::remove(error_file());
    return outcome;
  }

 private:
  fs::path out_file() const { return folder_ / ".stdout"; }
  fs::path error_file() const { return folder_ / ".stderr"; }
  static void redirect(int handle, const fs::path& file) {
    const int opened = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    ::dup2(opened, handle);
  }
  fs::path folder_;
  pid_t child_ = -1;
};

inline Outcome run(const std::vector<std::string>& arguments, const fs::path& folder) {
  return Process(arguments, folder).wait();
}

/// Every file below a folder with its content, without what workers keep for themselves.
inline std::map<std::string, std::string> tree(const fs::path& root) {
  std::map<std::string, std::string> files;
  if (!fs::exists(root)) return files;
  for (auto entry = fs::recursive_directory_iterator(root); entry != fs::end(entry); ++entry) {
    if (entry->path().filename() == ".diorama") entry.disable_recursion_pending();
    if (!entry->is_regular_file()) continue;
    files[entry->path().lexically_relative(root).string()] = read_file(entry->path());
  }
  return files;
}

/// Names of files that differ between two trees; at most ten, for messages.
inline std::string difference(const std::map<std::string, std::string>& a,
                              const std::map<std::string, std::string>& b) {
  std::vector<std::string> names;
  for (const auto& [name, text] : a) {
    const auto other = b.find(name);
    if (other == b.end()) names.push_back("only first: " + name);
    if (other != b.end() && other->second != text) names.push_back("differs: " + name);
  }
  for (const auto& [name, text] : b) {
    if (!a.contains(name)) names.push_back("only second: " + name);
  }
  std::string list;
  for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 10); ++i) list += names[i] + "\n";
  return list;
}

/// Captures that the journals call done.
inline std::size_t journal_entries(const fs::path& output) {
  std::size_t count = 0;
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator(output / ".diorama" / "journal", gone)) {
    if (entry.path().extension() != ".index") continue;
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line);) count += line.starts_with("d 0");
  }
  return count;
}

/// Waits until the dataset has so many captures; false when the process has ended before.
inline bool wait_for_captures(const fs::path& output, std::size_t count) {
  for (int i = 0; i < 60000; ++i) {
    if (journal_entries(output) >= count) return true;
    ::usleep(1000);
  }
  return false;
}

/// Starts the program anew for each number, and kills it with -9 when so many captures are done;
/// false when a process was not there to be killed.
inline bool run_and_kill(const std::vector<std::string>& arguments, const fs::path& folder,
                         const fs::path& output, std::initializer_list<std::size_t> captures) {
  return std::all_of(captures.begin(), captures.end(), [&](std::size_t count) {
    Process process(arguments, folder);
    if (!wait_for_captures(output, count)) return false;
    process.signal(SIGKILL);
    return process.wait().exit_code == 128 + SIGKILL;
  });
}

inline std::string config_file(const std::string& name) {
  return std::string(DIORAMA_SOURCE_DIR "/configs/") + name;
}

}  // namespace diorama::test
