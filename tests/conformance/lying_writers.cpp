// SPDX-License-Identifier: Apache-2.0
// Writers that break one promise each, in ways that a single run does not show.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <clocale>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <set>
#include <thread>

#include "diorama/distribution.h"
#include "diorama/plugin.h"
#include "diorama/writer.h"

namespace diorama::test {

/// One line per capture.
class Honest : public Writer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Honest(Params, Host&) {}
  NameSet needs() const override { return {"color", "instances"}; }
  void write(const Capture& capture, CaptureFiles& files) const override {
    files.add_text(std::to_string(capture.index) + ".txt", line(capture));
  }
  virtual std::string line(const Capture& capture) const { return capture.phase; }
};

/// Honest but for `Text`, which goes into every file.
template <auto Text>
struct Says : Honest {
  using Honest::Honest;
  std::string line(const Capture& capture) const override { return capture.phase + Text(); }
};

std::string number_text(long long number) { return std::to_string(number); }
std::string process() { return number_text(getpid()); }
std::string seconds() { return number_text(std::time(nullptr)); }
std::string address() {
  static const char place = 0;
  return number_text(reinterpret_cast<long long>(&place));
}
std::string heap_order() {
  std::set<const std::string*> by_address;
  const auto a = std::make_unique<std::string>("a"), b = std::make_unique<std::string>("b"),
             c = std::make_unique<std::string>("c"), d = std::make_unique<std::string>("d");
  for (const auto& text : {a.get(), b.get(), c.get(), d.get()}) by_address.insert(text);
  std::string text;
  for (const std::string* name : by_address) text += *name;
  return text;
}
std::string user() {
  const char* const name = std::getenv("USER");
  return name ? name : "nobody";
}
std::string machine() {
  utsname names{};
  uname(&names);
  return names.nodename;
}
std::string time_zone() {
  const std::time_t noon = 43200;
  std::tm local{};
  localtime_r(&noon, &local);
  return number_text(local.tm_hour);
}
std::string batch_job() {
  const char* const task = std::getenv("SLURM_ARRAY_TASK_ID");
  return task ? task : "";
}
std::string thread() {
  return number_text((long long)(std::hash<std::thread::id>()(std::this_thread::get_id()) % 1000));
}

/// Does something once per capture, then writes honestly.
template <auto Act>
struct Does : Honest {
  using Honest::Honest;
  std::string line(const Capture& capture) const override {
    Act();
    return capture.phase;
  }
};

std::atomic<int> turns = 0;
void loop_for_ever() {
  for (;;) ++turns;
}
void sleep_for_ever() {
  for (;;) pause();
}
void stop_itself() { kill(getpid(), SIGSTOP); }
void leave() { std::exit(0); }
void leave_at_once() { _exit(0); }
void overflow(int depth) {
  volatile char room[4096];
  room[0] = char(depth);
  if (depth > 0) overflow(depth + 1);
  room[1] = room[0];  // or there would be no room to keep
}
void overflow_the_stack() { overflow(1); }
void go_elsewhere() {
  if (chdir("/") != 0) std::abort();
}
void open_rights() { umask(0); }
void speak_differently() { std::setlocale(LC_ALL, "C.UTF-8"); }
void set_variable() { setenv("DIORAMA_ASSETS_ROOT", "/elsewhere", 1); }
void block_terminations() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
}
void leave_a_file_open() {
  if (open("/proc/self/exe", O_RDONLY) < 0) std::abort();
}
void ignore_interrupts() { std::signal(SIGINT, SIG_IGN); }

/// A line that all threads build in one place.
struct SharesItsBuffer : Honest {
  using Honest::Honest;
  mutable std::string buffer;
  void write(const Capture& capture, CaptureFiles& files) const override {
    buffer = capture.phase;
    files.add_text(std::to_string(capture.index) + "_size.txt", "1");
    // However few processors there are, others have a turn here.
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    buffer += std::to_string(capture.index);
    files.add_text(std::to_string(capture.index) + ".txt", buffer);
  }
};

struct CountsFrames : Honest {
  using Honest::Honest;
  mutable int open_files = 0;
  std::string line(const Capture& capture) const override {
    const int before = ++open_files;
    std::this_thread::sleep_for(std::chrono::microseconds(20));
    const bool is_alone = before == open_files;
    --open_files;
    return capture.phase + (is_alone && before == 1 ? "" : "?");
  }
};

/// Knows of captures that it wrote itself, and of no others.
struct CountsItself : Honest {
  using Honest::Honest;
  mutable std::atomic<int> count = 0;
  std::string line(const Capture& capture) const override {
    ++count;
    return capture.phase;
  }
  void finish(const RecordReader&, DatasetFiles& files) override {
    files.add_text("count.txt", std::to_string(count));
  }
};

struct DefaultTooLarge : Honest {
  struct Params {
    double size_m = 3.0;
    void visit(ParamVisitor& v) { v.param("size_m", size_m, {"Size.", "m", 0.0, 2.0}); }
  };
  DefaultTooLarge(Params, Host& host) : Honest({}, host) {}
};

struct DrawsTooLarge : Honest {
  struct Params {
    Distribution size_m = Range{1.0, 3.0};
    void visit(ParamVisitor& v) { v.param("size_m", size_m, {"Size.", "m", 0.0, 2.0}); }
  };
  DrawsTooLarge(Params, Host& host) : Honest({}, host) {}
};

struct ItemTooLarge : Honest {
  struct Item {
    double size_m = 3.0;
    void visit(ParamVisitor& v) { v.param("size_m", size_m, {"Size.", "m", 0.0, 2.0}); }
  };
  struct Params {
    std::vector<Item> items;
    void visit(ParamVisitor& v) { v.list("items", items, {"Items."}); }
  };
  ItemTooLarge(Params, Host& host) : Honest({}, host) {}
};

struct DefaultNotAmongWords : Honest {
  struct Params {
    std::string colour = "purple";
    void visit(ParamVisitor& v) {
      static constexpr const char* kWords[]{"red", "green"};
      v.choice("colour", colour, kWords, {"Colour."});
    }
  };
  DefaultNotAmongWords(Params, Host& host) : Honest({}, host) {}
};

struct SaysItTwice : Honest {
  struct Params {
    double size_m = 1.0;
    void visit(ParamVisitor& v) {
      v.param("size_m", size_m, {"Size.", "m", 0.0, 2.0});
      v.param("size_m", size_m, {"Size.", "m", 0.0, 2.0});
    }
  };
  SaysItTwice(Params, Host& host) : Honest({}, host) {}
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_writers", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(Honest, "honest", "Breaks nothing.");
  DIORAMA_ADD(Says<process>, "says_process", "Writes its process id.");
  DIORAMA_ADD(Says<seconds>, "says_seconds", "Writes the time.");
  DIORAMA_ADD(Says<address>, "says_address", "Writes an address of its library.");
  DIORAMA_ADD(Says<heap_order>, "says_heap_order", "Sorts by addresses.");
  DIORAMA_ADD(Says<user>, "says_user", "Writes the user's name.");
  DIORAMA_ADD(Says<machine>, "says_machine", "Writes the machine's name.");
  DIORAMA_ADD(Says<time_zone>, "says_time_zone", "Writes local time.");
  DIORAMA_ADD(Says<batch_job>, "says_batch_job", "Writes its number among the tasks of a job.");
  DIORAMA_ADD(Says<thread>, "says_thread", "Writes its thread.");
  DIORAMA_ADD(Does<loop_for_ever>, "loops", "Never returns, busily.");
  DIORAMA_ADD(Does<sleep_for_ever>, "sleeps", "Never returns, asleep.");
  DIORAMA_ADD(Does<stop_itself>, "stops", "Stops its process.");
  DIORAMA_ADD(Does<leave>, "leaves", "Ends the process well.");
  DIORAMA_ADD(Does<leave_at_once>, "leaves_at_once", "Ends the process well and at once.");
  DIORAMA_ADD(Does<overflow_the_stack>, "overflows", "Has no end of calls.");
  DIORAMA_ADD(Does<go_elsewhere>, "goes_elsewhere", "Changes the working folder.");
  DIORAMA_ADD(Does<open_rights>, "opens_rights", "Lets everybody write to new files.");
  DIORAMA_ADD(Does<speak_differently>, "speaks_differently", "Changes the locale.");
  DIORAMA_ADD(Does<set_variable>, "sets_variable", "Changes the environment.");
  DIORAMA_ADD(Does<ignore_interrupts>, "ignores_interrupts", "Changes what Ctrl-C does.");
  DIORAMA_ADD(Does<block_terminations>, "blocks_terminations", "Does not hear SIGTERM any more.");
  DIORAMA_ADD(Does<leave_a_file_open>, "leaves_a_file_open", "Opens a file and forgets it.");
  DIORAMA_ADD(CountsItself, "counts_itself", "Finishes without the records.");
  DIORAMA_ADD(SharesItsBuffer, "shares_its_buffer", "Builds all lines in one place.");
  DIORAMA_ADD(CountsFrames, "counts_frames", "Expects to be alone.");
  DIORAMA_ADD(DefaultTooLarge, "default_too_large", "Has a default beyond its range.");
  DIORAMA_ADD(DrawsTooLarge, "draws_too_large", "Draws from beyond its range by default.");
  DIORAMA_ADD(ItemTooLarge, "item_too_large", "Has items with a default beyond their range.");
  DIORAMA_ADD(DefaultNotAmongWords, "default_not_among_words", "Has a default that is no word.");
  DIORAMA_ADD(SaysItTwice, "says_it_twice", "Declares a key twice.");
}
