// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace diorama {

/// Says, while it lives, which component this thread has called: "writer 'boxes'". The line that a
/// crash leaves names it.
class AtWork {
 public:
  explicit AtWork(std::string_view who);
  ~AtWork();
  AtWork(const AtWork&) = delete;
  AtWork& operator=(const AtWork&) = delete;

  const char* who() const { return who_; }

 private:
  char who_[128];  // read by signal handlers
  const AtWork* before_;
};

/// What the thread that makes it is at, for threads that help it.
class WorkAtHand {
 public:
  WorkAtHand();

  /// Says, while it lives, that this thread is at the same. The helped one must not go on
  /// meanwhile.
  class Helper {
   public:
    explicit Helper(const WorkAtHand& work);
    ~Helper();
    Helper(const Helper&) = delete;
    Helper& operator=(const Helper&) = delete;

   private:
    const AtWork* before_;
    int capture_before_;
  };

 private:
  const AtWork* work_;
  int capture_;
};

/// Says, while it lives, which capture this thread works on.
class AtCapture {
 public:
  explicit AtCapture(int index);
  ~AtCapture();
  AtCapture(const AtCapture&) = delete;
  AtCapture& operator=(const AtCapture&) = delete;

 private:
  int before_;
};

/// While it lives, the process does not end without a word: a crash prints one line that names
/// component and capture, then ends the process by its signal; an exit(), quick_exit() or _exit()
/// from within a component prints one, too, and the exit code is that of a broken plugin. Child
/// processes are left alone, as are builds with sanitizers, which tell more. One at a time, made by
/// the main thread.
class FatalEndReports {
 public:
  FatalEndReports();
  ~FatalEndReports();
  FatalEndReports(const FatalEndReports&) = delete;
  FatalEndReports& operator=(const FatalEndReports&) = delete;
};

}  // namespace diorama
