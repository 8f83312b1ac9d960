// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_view.h"

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>

#include "diorama/error.h"
#include "framework/app/exit_codes.h"
#include "framework/config/clean_text.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/host/scratch_folder.h"
#include "framework/jobs/assemble.h"
#include "framework/view/dataset_view.h"
#include "framework/view/http_server.h"
#include "framework/view/index_cache.h"
#include "framework/view/report.h"
#include "framework/view/unfinished_writers.h"

namespace diorama {
namespace {

/// What most servers take of attachments, which grow by a third on their way, is 25 MB.
constexpr std::size_t kMostMailBytes = 18'000'000;

std::atomic<bool> view_is_to_end = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// The first signal ends the view in good order, the second one the program.
void end_view(int signal) {
  view_is_to_end = true;
  std::signal(signal, SIG_DFL);
}

/// Starts the user's browser, if there is a desktop. The address has a secret in it, and all users
/// of a machine see the arguments of programs: the browser gets a file that only its user reads.
class BrowserStart {
 public:
  explicit BrowserStart(const std::string& address) {
    if (std::getenv("DISPLAY") == nullptr && std::getenv("WAYLAND_DISPLAY") == nullptr) return;
    try {
      folder_.emplace("view");
    } catch (const Error&) {
      return;  // the address is printed, too
    }
    const std::string page = (folder_->path() / "open.html").string();
    std::ofstream(page) << "<!DOCTYPE html><meta charset='utf-8'><meta name='referrer' "
                           "content='no-referrer'><meta http-equiv='refresh' content='0;url="
                        << address << "'><title>diorama view</title>\n";
    start(page);
  }

 private:
  static void start(const std::string& page) {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
      posix_spawn_file_actions_addopen(&files, stream, "/dev/null", O_RDWR, 0);
    }
    std::string program = "xdg-open";
    std::string argument = page;
    char* const arguments[] = {program.data(), argument.data(), nullptr};
    pid_t child = 0;
    posix_spawnp(&child, program.c_str(), &files, nullptr, arguments, environ);
    posix_spawn_file_actions_destroy(&files);
  }

  std::optional<ScratchFolder> folder_;
};

/// Before anything is put among the temporary files: it is removed in good order only.
void end_in_order(HostServices& host) {
  view_is_to_end = false;
  std::signal(SIGINT, &end_view);
  std::signal(SIGTERM, &end_view);
  std::signal(SIGHUP, &end_view);
  host.stop_on(view_is_to_end);
}

void show_until_end(const GlobalOptions& global, const ViewOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  end_in_order(*services.host);
  DatasetReaders readers(*services.registry, *services.host);
  UnfinishedWriters unfinished(global, view_is_to_end, log.sink());
  DatasetView view({.folder = options.dataset,
                    .other = options.other,
                    .tolerance = options.tolerance,
                    .reader = options.reader,
                    .cache = index_cache_folder(),
                    .unfinished = std::bind_front(&UnfinishedWriters::folders_for, &unfinished)},
                   readers, *services.host);

  HttpServer::Options server_options;
  server_options.port = options.port;
  HttpServer server(server_options, [&view](std::string_view path) { return view.answer(path); });
  std::cout << server.address() << std::endl;
  if (!std::cout) throw Error(ErrorKind::Output, "cannot write the address to standard output");
  log.write(LogLevel::Info,
            "Open the address in a browser of this machine; from another one, forward its port: "
            "ssh -L " +
                std::to_string(server.port()) + ":localhost:" + std::to_string(server.port()) +
                " THIS_MACHINE. Ctrl-C ends.");
  std::optional<BrowserStart> browser;
  if (options.opens_browser) browser.emplace(server.address());

  const std::chrono::minutes most_idle(options.idle_minutes);
  while (!view_is_to_end) {
    if (options.idle_minutes > 0 && server.idle_time() >= most_idle) {
      log.write(LogLevel::Info, "ended, as nobody has asked for " +
                                    std::to_string(options.idle_minutes) + " minutes");
      break;
    }
    if (!view.work()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

void make_report(const GlobalOptions& global, const ReportOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  end_in_order(*services.host);
  DatasetReaders readers(*services.registry, *services.host);
  UnfinishedWriters unfinished(global, view_is_to_end, log.sink());
  DatasetView view({.folder = options.dataset,
                    .reader = options.reader,
                    .most_captures = options.captures,
                    .unfinished = std::bind_front(&UnfinishedWriters::folders_for, &unfinished)},
                   readers, *services.host);
  const ReportSize size = write_report(view, options.output, options.has_all_overlays);
  log.write(LogLevel::Info, "wrote " + (options.output / "index.html").string() + ": " +
                                std::to_string(size.captures) + " captures, " +
                                std::to_string((size.bytes + (1U << 20) - 1) >> 20) + " MiB");
  if (size.bytes > kMostMailBytes) {
    std::size_t shown = 0;
    for (const auto& each : view.shown()) shown = std::max(shown, each.captures.size());
    const std::size_t fewer = std::max<std::size_t>(1, shown * kMostMailBytes / size.bytes);
    log.write(LogLevel::Info,
              "for a mail choose fewer of them: --captures " + std::to_string(fewer));
  }
}

}  // namespace

int command_view(const GlobalOptions& global, const ViewOptions& options, ConsoleLog& log) {
  try {
    show_until_end(global, options, log);
  } catch (const Stopped&) {
    // Ctrl-C while datasets were opened, or the index was made.
  }
  return 0;
}

int command_report(const GlobalOptions& global, const ReportOptions& options, ConsoleLog& log) {
  try {
    make_report(global, options, log);
  } catch (const Stopped&) {
    return kStopped;
  }
  return 0;
}

}  // namespace diorama
