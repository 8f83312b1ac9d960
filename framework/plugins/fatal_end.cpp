// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/fatal_end.h"

#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include "diorama/abi.h"
#include "diorama/error.h"

namespace diorama {
namespace {

// A diorama::Error of kind Plugin ends with this code, too (framework/docs/exit_codes.md).
constexpr int kBrokenPlugin = int(ErrorKind::Plugin) + 1;
constexpr int kNoCapture = -1;

struct Fatal {
  int number;
  const char* name;
};
constexpr Fatal kFatal[]{{SIGSEGV, "segmentation fault"},
                         {SIGBUS, "bus error"},
                         {SIGFPE, "arithmetic error"},
                         {SIGILL, "illegal instruction"},
                         {SIGABRT, "abort"}};

std::atomic<pid_t> watched_process = 0;  // 0: none

thread_local const AtWork* at_work = nullptr;
thread_local int at_capture = kNoCapture;
// Threads that a component has started say nothing of themselves. They are those of what the main
// thread is at, or else, while visits overlap, most likely of what was begun last.
std::atomic<const AtWork*> main_at_work = nullptr;
std::atomic<int> main_at_capture = kNoCapture;
std::atomic<const AtWork*> last_at_work = nullptr;

bool is_watched() { return watched_process == getpid(); }
bool is_main_thread() { return gettid() == getpid(); }

/// One line of text, made without allocating.
class Line {
 public:
  Line& operator<<(const char* text) {
    const std::size_t count = std::min(std::strlen(text), sizeof text_ - 1 - size_);
    std::memcpy(text_ + size_, text, count);
    size_ += count;
    return *this;
  }
  Line& operator<<(int number) {
    char digits[12];
    char* at = digits + sizeof digits - 1;
    *at = '\0';
    unsigned rest = unsigned(std::max(number, 0));
    do *--at = char('0' + rest % 10);
    while ((rest /= 10) != 0);
    return *this << at;
  }
  void print() {
    text_[size_++] = '\n';
    for (std::size_t at = 0; at < size_;) {
      const ssize_t count = write(STDERR_FILENO, text_ + at, size_ - at);
      if (count <= 0) return;
      at += std::size_t(count);
    }
  }

 private:
  char text_[400];
  std::size_t size_ = 0;
};

/// "writer 'boxes' at capture 3".
void name_work(Line& line) {
  const AtWork* const own = at_work;
  const AtWork* const of_main = main_at_work.load();
  const AtWork* const work = own ? own : of_main ? of_main : last_at_work.load();
  if (!work) {
    line << "the program";
    return;
  }
  line << work->who();
  const int capture = own ? at_capture : of_main ? main_at_capture.load() : kNoCapture;
  if (capture != kNoCapture) line << " at capture " << capture;
  if (!own) line << " (or a thread of its libraries)";
}

void on_crash(int number) {
  if (is_watched()) {
    Line line;
    line << "error: crash in ";
    name_work(line);
    for (const Fatal& fatal : kFatal) {
      if (fatal.number == number) line << ": " << fatal.name;
    }
    line << " (signal " << number << ")";
    line.print();
  }
  std::signal(number, SIG_DFL);
  std::raise(number);
}

[[noreturn]] void end_process(int code) {
  while (true) syscall(SYS_exit_group, code);
}

[[noreturn]] void end_for_component(const char* call) {
  Line line;
  line << "error: ";
  name_work(line);
  line << " ended the program with " << call << ", which components must not";
  line.print();
  end_process(kBrokenPlugin);
}

void on_exit() {
  if (is_watched()) end_for_component("exit()");
}

void on_quick_exit() {
  if (is_watched()) end_for_component("quick_exit()");
}

/// Room for the handler where the stack has none left.
class HandlerStack {
 public:
  HandlerStack() {
    stack_t now{};
    if (sigaltstack(nullptr, &now) != 0 || !(now.ss_flags & SS_DISABLE)) return;
    void* const room =
        mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room == MAP_FAILED) return;
    stack_t own{};
    own.ss_sp = room_ = room;
    own.ss_size = kBytes;
    sigaltstack(&own, nullptr);
  }
  ~HandlerStack() {
    if (!room_) return;
    stack_t none{};
    none.ss_flags = SS_DISABLE;
    sigaltstack(&none, nullptr);
    munmap(room_, kBytes);
  }

 private:
  static constexpr std::size_t kBytes = std::size_t(1) << 16;
  void* room_ = nullptr;
};

#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
constexpr bool kHandlesSignals = false;
#else
constexpr bool kHandlesSignals = true;
#endif

void make_handler_stack() {
  if (!kHandlesSignals || !is_watched()) return;
  thread_local const HandlerStack stack;
}

}  // namespace

AtWork::AtWork(std::string_view who) : before_(at_work) {
  const std::size_t count = std::min(who.size(), sizeof who_ - 1);
  std::memcpy(who_, who.data(), count);
  who_[count] = '\0';
  make_handler_stack();
  at_work = this;
  last_at_work = this;
  if (is_main_thread()) main_at_work = this;
}

AtWork::~AtWork() {
  at_work = before_;
  const AtWork* self = this;
  last_at_work.compare_exchange_strong(self, before_);
  if (is_main_thread()) main_at_work = before_;
}

WorkAtHand::WorkAtHand() : work_(at_work), capture_(at_capture) {}

WorkAtHand::Helper::Helper(const WorkAtHand& work) : before_(at_work), capture_before_(at_capture) {
  make_handler_stack();
  at_work = work.work_;
  at_capture = work.capture_;
}

WorkAtHand::Helper::~Helper() {
  at_work = before_;
  at_capture = capture_before_;
}

AtCapture::AtCapture(int index) : before_(at_capture) {
  at_capture = index;
  if (is_main_thread()) main_at_capture = index;
}

AtCapture::~AtCapture() {
  at_capture = before_;
  if (is_main_thread()) main_at_capture = before_;
}

FatalEndReports::FatalEndReports() {
  // Handlers of exit() cannot be taken back.
  [[maybe_unused]] static const int registered =
      std::atexit(on_exit) | std::at_quick_exit(on_quick_exit);
  watched_process = getpid();
  make_handler_stack();
  if (!kHandlesSignals) return;
  struct sigaction action {};
  action.sa_handler = on_crash;
  action.sa_flags = SA_ONSTACK | SA_NODEFER | int(SA_RESETHAND);
  for (const Fatal& fatal : kFatal) sigaction(fatal.number, &action, nullptr);
}

FatalEndReports::~FatalEndReports() {
  watched_process = 0;
  if (!kHandlesSignals) return;
  for (const Fatal& fatal : kFatal) std::signal(fatal.number, SIG_DFL);
}

}  // namespace diorama

// No handler hears of these two. The program exports them (framework/app/CMakeLists.txt), so that
// they come before the C library's for every component; the C library's own exit() does not pass
// through here.
#if !DIORAMA_DETAIL_ADDRESS_SANITIZER && !DIORAMA_DETAIL_THREAD_SANITIZER
extern "C" {
[[gnu::visibility("default")]] void _exit(int code) {
  if (diorama::is_watched()) diorama::end_for_component("_exit()");
  diorama::end_process(code);
}
[[gnu::visibility("default")]] void _Exit(int code) noexcept { _exit(code); }
}
#endif
