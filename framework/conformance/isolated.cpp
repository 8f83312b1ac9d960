// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/isolated.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include "diorama/error.h"

namespace diorama::conformance {
namespace {

namespace fs = std::filesystem;

/// Far more than any check needs, also under a sanitizer on a busy machine.
constexpr unsigned kSecondsPerCheck = 600;

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorKind::Internal, what + ": " + std::system_category().message(errno));
}

/// A folder that goes away with its owner.
class Scratch {
 public:
  Scratch() {
    std::string pattern = (fs::temp_directory_path() / "diorama_check_XXXXXX").string();
    if (!mkdtemp(pattern.data())) fail(pattern);
    path_ = pattern;
    fs::create_directory(work());
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  fs::path work() const { return path_ / "work"; }
  fs::path printed() const { return path_ / "printed"; }

 private:
  fs::path path_;
};

/// Sends what happens to the parent: four texts that end with NUL each.
class PipeJournal final : public Journal {
 public:
  explicit PipeJournal(int pipe) : pipe_(pipe) {}
  void begin(const std::string& subject, const std::string& check) override {
    alarm(kSecondsPerCheck);
    send("begun", subject, check, "");
  }
  void end(const CheckResult& result) override {
    alarm(0);
    send(outcome_name(result.outcome), result.subject, result.check, result.message);
  }

 private:
  void send(const std::string& event, const std::string& subject, const std::string& check,
            const std::string& message) const {
    std::string bytes;
    for (const std::string& text : {event, subject, check, message}) {
      bytes.append(text.c_str());  // no NUL inside
      bytes += '\0';
    }
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t count = write(pipe_, bytes.data() + sent, bytes.size() - sent);
      if (count < 0 && errno != EINTR) fail("pipe");
      if (count > 0) sent += std::size_t(count);
    }
  }
  int pipe_;
};

void enter(const Scratch& scratch) {
  if (chdir(scratch.work().c_str()) != 0) fail(scratch.work().string());
  for (const char* variable : {"HOME", "TMPDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"}) {
    setenv(variable, scratch.work().c_str(), 1);
  }
  const int printed = open(scratch.printed().c_str(), O_CREAT | O_WRONLY, 0600);
  if (printed < 0 || dup2(printed, STDOUT_FILENO) < 0) fail(scratch.printed().string());
}

[[noreturn]] void run_child(int pipe, const Scratch& scratch, const std::string& subject,
                            const std::function<void(Journal&)>& checks) {
  PipeJournal journal(pipe);
  try {
    enter(scratch);
    checks(journal);
  } catch (const std::exception& error) {
    journal.end({subject, "all checks can be made", Outcome::Failed, error.what()});
  }
  // Not _exit(): destructors run and leaks are looked for.
  std::exit(EXIT_SUCCESS);
}

std::string read_all(int pipe) {
  std::string text;
  std::array<char, 4096> buffer;
  for (;;) {
    const ssize_t count = read(pipe, buffer.data(), buffer.size());
    if (count == 0) return text;
    if (count > 0) text.append(buffer.data(), std::size_t(count));
    if (count < 0 && errno != EINTR) fail("pipe");
  }
}

/// The ended checks, and last the one that was begun and never ended.
struct Told {
  std::vector<CheckResult> ended;
  std::optional<CheckResult> open;
};

Told told_in(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < text.size();) {
    words.emplace_back(text.c_str() + at);
    at += words.back().size() + 1;
  }
  Told told;
  for (std::size_t i = 0; i + 4 <= words.size(); i += 4) {
    CheckResult result{words[i + 1], words[i + 2], Outcome::Failed, words[i + 3]};
    for (const Outcome outcome : {Outcome::Passed, Outcome::Skipped}) {
      if (words[i] == outcome_name(outcome)) result.outcome = outcome;
    }
    told.open.reset();
    if (words[i] == "begun") {
      told.open = std::move(result);
    } else {
      told.ended.push_back(std::move(result));
    }
  }
  return told;
}

/// How the child ended, if not well.
std::string fault_in(int status) {
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM) {
    return "takes longer than " + std::to_string(kSecondsPerCheck) + " s";
  }
  if (WIFSIGNALED(status)) return std::string("crashes: ") + strsignal(WTERMSIG(status));
  if (WEXITSTATUS(status) == 0) return {};
  return "ends with code " + std::to_string(WEXITSTATUS(status)) +
         "; what was printed above says why";
}

std::string printed_text(const fs::path& file) {
  std::string line;
  std::ifstream stream(file);
  std::getline(stream, line);
  return line.empty() ? "" : "prints to standard output: " + line;
}

std::string files_in(const fs::path& folder) {
  std::string names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    names += (names.empty() ? "" : ", ") + entry.path().lexically_relative(folder).string();
  }
  return names.empty() ? "" : "leaves files behind: " + names;
}

CheckResult verdict(const std::string& subject, const char* check, const std::string& failure) {
  return {subject, check, failure.empty() ? Outcome::Passed : Outcome::Failed, failure};
}

}  // namespace

std::vector<CheckResult> run_isolated(const std::string& subject,
                                      const std::function<void(Journal&)>& checks) {
  const Scratch scratch;
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) fail("pipe");
  std::fflush(stdout);  // or the child would write it again
  const pid_t child = fork();
  if (child < 0) fail("fork");
  if (child == 0) {
    close(ends[0]);
    run_child(ends[1], scratch, subject, checks);
  }
  close(ends[1]);
  Told told = told_in(read_all(ends[0]));
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) fail("waitpid");
  }

  std::string fault = fault_in(status);
  if (told.open) {
    told.open->message = std::exchange(fault, "does not get to its end");
    told.ended.push_back(*told.open);
  }
  told.ended.push_back(verdict(subject, "nothing is printed", printed_text(scratch.printed())));
  told.ended.push_back(verdict(subject, "no files are left behind", files_in(scratch.work())));
  told.ended.push_back(verdict(subject, "all is given back, the process ends well", fault));
  return std::move(told.ended);
}

}  // namespace diorama::conformance
