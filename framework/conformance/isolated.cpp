// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/isolated.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

#include "diorama/error.h"
#include "framework/host/scratch_folder.h"

namespace diorama::conformance {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorKind::Internal, what + ": " + std::system_category().message(errno));
}

/// What a child may fill, and what it prints.
class Scratch {
 public:
  Scratch() {
    fs::create_directory(work());
    fs::create_directory(of_drivers());
  }
  fs::path work() const { return folder_.path() / "work"; }
  fs::path of_drivers() const { return folder_.path() / "drivers"; }
  fs::path printed() const { return folder_.path() / "printed"; }

 private:
  ScratchFolder folder_{"check"};
};

/// Sends what happens to the parent: four texts that end with NUL each.
class PipeJournal final : public Journal {
 public:
  explicit PipeJournal(int pipe) : pipe_(pipe) {}
  void begin(const std::string& subject, const std::string& check) override {
    send("begun", subject, check, "");
  }
  void end(const CheckResult& result) override {
    send(outcome_name(result.outcome), result.subject, result.check, result.message);
  }
  void fact(const std::string& name, const std::string& value) override {
    send("fact", name, value, "");
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
  // Drivers keep compiled kernels of their own accord, which are no files of the plugin.
  for (const char* variable : {"MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH"}) {
    setenv(variable, scratch.of_drivers().c_str(), 0);
  }
  const int printed = open(scratch.printed().c_str(), O_CREAT | O_WRONLY, 0600);
  if (printed < 0 || dup2(printed, STDOUT_FILENO) < 0) fail(scratch.printed().string());
}

/// Moves what is loaded and allocated from now on, and makes blocks of memory come in another
/// order.
void move_addresses(Surroundings number) {
  constexpr std::size_t kPage = 4096;
  // Large and small, so that no gap is left where the library lay before.
  for (std::size_t pages = 1024; pages > 0; pages /= 2) {
    for (std::uint64_t i = 0; i < 16 * number; ++i) {
      mmap(nullptr, pages * kPage, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    }
  }
  static std::vector<std::unique_ptr<char[]>> blocks;  // those that are not given back
  for (std::size_t size = 16; size <= 2048; size += 16) {
    for (int i = 0; i < 64; ++i) blocks.push_back(std::make_unique<char[]>(size));
  }
  std::uint64_t state = number;
  for (std::unique_ptr<char[]>& block : blocks) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    std::swap(block, blocks[std::size_t(state >> 33) % blocks.size()]);
  }
  blocks.resize(blocks.size() / 2);
}

void change_environment(Surroundings number) {
  const std::string text = std::to_string(number);
  for (const char* variable :
       {"USER", "LOGNAME", "HOSTNAME", "DISPLAY", "OMP_NUM_THREADS", "SHELL", "TERM", "COLUMNS",
        "EDITOR", "PWD", "CI", "SLURM_JOB_ID", "SLURM_ARRAY_TASK_ID", "SGE_TASK_ID", "JOB_ID",
        "JOB_COMPLETION_INDEX", "AWS_BATCH_JOB_ARRAY_INDEX", "SOURCE_DATE_EPOCH"}) {
    setenv(variable, text.c_str(), 1);
  }
  setenv("TZ", "Asia/Kathmandu", 1);
  for (const char* variable : {"LANG", "LC_ALL"}) setenv(variable, "C.UTF-8", 1);
}

void write_line(const char* file, const std::string& line) {
  std::ofstream stream(file);
  stream << line;
}

/// This process alone sees another name of the machine, where the system lets it: as root, or in a
/// user namespace in which this user and group stay what they are.
void change_host_name(Surroundings number) {
  if (unshare(CLONE_NEWUTS) != 0) {
    const std::string user = std::to_string(geteuid());
    const std::string group = std::to_string(getegid());
    if (unshare(CLONE_NEWUSER | CLONE_NEWUTS) != 0) return;
    write_line("/proc/self/setgroups", "deny");
    write_line("/proc/self/uid_map", user + " " + user + " 1");
    write_line("/proc/self/gid_map", group + " " + group + " 1");
  }
  const std::string name = "host-" + std::to_string(number);
  if (sethostname(name.c_str(), name.size()) != 0) return;  // it stays what it was
}

[[noreturn]] void run_child(int pipe, const Scratch& scratch, const std::string& subject,
                            const std::function<void(Journal&)>& checks,
                            Surroundings surroundings) {
  PipeJournal journal(pipe);
  try {
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    enter(scratch);
    if (surroundings > 0) {
      change_environment(surroundings);
      change_host_name(surroundings);
      move_addresses(surroundings);
    }
    checks(journal);
  } catch (const std::exception& error) {
    journal.end({subject, "all checks can be made", Outcome::Failed, error.what()});
  }
  // Not _exit(): destructors run and leaks are looked for.
  std::exit(EXIT_SUCCESS);
}

/// What the processes of a group do at the moment.
struct Activity {
  double busy_seconds = 0.0;  ///< Processor time so far.
  bool wants_to_run = false;  ///< Some thread works, or waits for a processor.
};

/// Fields of a "stat" file of /proc behind the name in brackets: state, parent, group ...
std::vector<std::string> stat_fields(const fs::path& file) {
  std::ifstream stream(file);
  std::string text;
  std::getline(stream, text);
  const std::size_t name_end = text.rfind(')');
  std::vector<std::string> fields;
  if (name_end == text.npos) return fields;
  std::istringstream words(text.substr(name_end + 1));
  for (std::string word; words >> word;) fields.push_back(word);
  return fields;
}

Activity activity_of(pid_t group) {
  constexpr std::size_t kState = 0, kGroup = 2, kUserTicks = 11, kSystemTicks = 12;
  Activity activity;
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator("/proc", gone)) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != name.npos) continue;
    const std::vector<std::string> fields = stat_fields(entry.path() / "stat");
    if (fields.size() <= kSystemTicks || fields[kGroup] != std::to_string(group)) continue;
    const double ticks =
        std::atof(fields[kUserTicks].c_str()) + std::atof(fields[kSystemTicks].c_str());
    activity.busy_seconds += ticks / double(sysconf(_SC_CLK_TCK));
    for (const auto& thread : fs::directory_iterator(entry.path() / "task", gone)) {
      const std::vector<std::string> state = stat_fields(thread.path() / "stat");
      if (state.empty()) continue;
      if (state[kState] == "R" || state[kState] == "D") activity.wants_to_run = true;
    }
  }
  return activity;
}

std::string seconds_text(double seconds) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, seconds).ptr;
  return std::string(digits, end) + " s";
}

/// Watches over a child's checks; time counts from the last word of the child.
class Watch {
 public:
  Watch(pid_t child, const CheckLimits& limits) : child_(child), limits_(limits) { restart(); }

  void restart() {
    busy_at_start_ = activity_of(child_).busy_seconds;
    last_busy_ = Clock::now();
    last_seconds_ = busy_at_start_;
  }

  /// Why the child must be killed; empty as long as it may go on.
  std::string complaint() {
    const Activity now = activity_of(child_);
    if (now.wants_to_run || now.busy_seconds != last_seconds_) last_busy_ = Clock::now();
    last_seconds_ = now.busy_seconds;
    if (now.busy_seconds - busy_at_start_ > limits_.busy_seconds) {
      return "takes longer than " + seconds_text(limits_.busy_seconds) + " of processor time";
    }
    const std::chrono::duration<double> idle = Clock::now() - last_busy_;
    if (idle.count() > limits_.idle_seconds) {
      return "hangs: nothing happens for " + seconds_text(limits_.idle_seconds);
    }
    return {};
  }

 private:
  using Clock = std::chrono::steady_clock;
  pid_t child_;
  CheckLimits limits_;
  double busy_at_start_ = 0.0;
  double last_seconds_ = 0.0;
  Clock::time_point last_busy_;
};

/// All that the child says until it ends or is killed; `complaint` says why it was.
std::string hear_out(int pipe, pid_t child, const CheckLimits& limits, std::string& complaint) {
  constexpr int kLookEveryMs = 200;
  std::string text;
  std::array<char, 4096> buffer;
  Watch watch(child, limits);
  for (;;) {
    pollfd ready{pipe, POLLIN, 0};
    const int found = poll(&ready, 1, kLookEveryMs);
    if (found < 0 && errno != EINTR) fail("poll");
    if (found <= 0) {
      complaint = watch.complaint();
      if (complaint.empty()) continue;
      kill(-child, SIGKILL);
      return text;
    }
    const ssize_t count = read(pipe, buffer.data(), buffer.size());
    if (count == 0) return text;
    if (count > 0) text.append(buffer.data(), std::size_t(count));
    if (count < 0 && errno != EINTR) fail("pipe");
    watch.restart();
  }
}

/// The child's end, which may hang as well.
int wait_for(pid_t child, const CheckLimits& limits, std::string& complaint) {
  constexpr useconds_t kLongestPause = 200'000;
  Watch watch(child, limits);
  int status = 0;
  for (useconds_t pause = 500;; pause = std::min(2 * pause, kLongestPause)) {
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR) fail("waitpid");
    usleep(pause);
    if (pause < kLongestPause || !complaint.empty()) continue;
    complaint = watch.complaint();
    if (!complaint.empty()) kill(-child, SIGKILL);
  }
}

/// The ended checks, and last the one that was begun and never ended.
struct Told {
  std::vector<CheckResult> ended;
  std::optional<CheckResult> open;
  std::map<std::string, std::string> facts;
};

Told told_in(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < text.size();) {
    words.emplace_back(text.c_str() + at);
    at += words.back().size() + 1;
  }
  Told told;
  for (std::size_t i = 0; i + 4 <= words.size(); i += 4) {
    if (words[i] == "fact") {
      told.facts[words[i + 1]] = words[i + 2];
      continue;
    }
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

Trial run_isolated(const std::string& subject, const std::function<void(Journal&)>& checks,
                   Surroundings surroundings, const CheckLimits& limits) {
  const Scratch scratch;
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) fail("pipe");
  std::fflush(stdout);  // or the child would write it again
  const pid_t child = fork();
  if (child < 0) fail("fork");
  if (child == 0) {
    close(ends[0]);
    run_child(ends[1], scratch, subject, checks, surroundings);
  }
  close(ends[1]);
  setpgid(child, child);  // whoever of both comes first
  std::string fault;
  Told told = told_in(hear_out(ends[0], child, limits, fault));
  close(ends[0]);
  const int status = wait_for(child, limits, fault);
  kill(-child, SIGKILL);  // what it left running

  if (fault.empty()) fault = fault_in(status);
  if (told.open) {
    const std::string unfinished = "does not get to its end: the process was ended from within";
    told.open->message = fault.empty() ? unfinished : std::exchange(fault, unfinished);
    told.ended.push_back(*told.open);
  }
  told.ended.push_back(verdict(subject, "nothing is printed", printed_text(scratch.printed())));
  told.ended.push_back(verdict(subject, "no files are left behind", files_in(scratch.work())));
  told.ended.push_back(verdict(subject, "all is given back, the process ends well", fault));
  return {std::move(told.ended), std::move(told.facts)};
}

}  // namespace diorama::conformance
