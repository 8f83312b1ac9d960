// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "framework/output/file_system.h"

namespace diorama {

/// A process that works on a dataset.
struct WorkerIdentity {
  std::string name;     ///< Unique, a plain name: of its journal, its stage and its lease.
  std::string host;     ///< For people.
  std::string machine;  ///< The kernel's boot: what file locks hold between.
  int process = 0;      ///< For people.
};

/// This process on this machine, with a name that no other has.
WorkerIdentity this_worker();

/// Somebody else has what this process wants; later it may be free.
class Busy final : public std::exception {
 public:
  explicit Busy(std::string text) : text_(std::move(text)) {}
  ~Busy() override;
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  std::string text_;
};

/// The workers of a dataset and what each has taken. A lease says that a worker lives: it holds a
/// lock of the file (or says in it that the file system has none), and changes the file's time
/// every few seconds. Claims say who does what. They
/// save work and give clear messages; nothing is lost where they fail, as every worker has a stage
/// and a journal of its own.
///
/// Files below `.diorama`: `workers/<role>~<name>`, `claims/<task>.<generation>` with the name of a
/// lease in it. Of several generations of a claim the last counts: a claim of a dead worker is
/// taken over by creating the next one, which only one can.
class Workers {
 public:
  /// A lease of another machine that has not changed for `timeout` belongs to nobody.
  Workers(FileSystem& file_system, std::filesystem::path folder, WorkerIdentity self,
          std::chrono::seconds timeout);

  /// Takes part. `role`, a plain name: "shard-3-of-16", "auto", "overwrite".
  void join(const std::string& role);
  /// Gives back claims and lease, removes what is empty. Nothing happens when it has not joined.
  void leave();
  /// Shows that this worker lives. False when others have taken it for dead.
  bool beat();
  /// Whether beat() was told, or is told now, that others have taken over.
  bool is_member();

  struct Lease {
    std::string role;
    std::string worker;
    std::string file_name() const { return role + "~" + worker; }
  };
  /// Of all others, dead ones, too.
  std::vector<Lease> others() const;
  bool is_alive(const Lease& lease);
  /// "host n07, process 4211, last sign of life 12 s ago".
  std::string describe(const Lease& lease);
  /// After its work was settled.
  void remove(const Lease& lease);

  /// Takes a task for itself; the owner when another living worker has it. `task`: plain names
  /// joined by '/'.
  std::optional<Lease> claim(const std::string& task);
  void release(const std::string& task);
  bool has_claimed(const std::string& task) const { return claimed_.contains(task); }
  /// The tasks in one folder (below claims/) that anybody has, or had when it died.
  std::set<std::string> claims_in(const std::string& folder) const;
  /// Every claim in a folder ("" for the one of all), whoever has it.
  void remove_claims(const std::string& folder);
  /// What dead workers left, once there is nothing to do: claims and drafts. Nothing happens while
  /// others have leases.
  void sweep();

  const WorkerIdentity& self() const { return self_; }
  std::chrono::seconds timeout() const { return timeout_; }

 private:
  std::filesystem::path lease_file(const Lease& lease) const;
  std::filesystem::path new_draft();
  std::optional<std::int64_t> age_ns(const Lease& lease);
  std::filesystem::path claim_file(const std::string& task, int generation) const;

  FileSystem& file_system_;
  std::filesystem::path folder_;
  WorkerIdentity self_;
  std::chrono::seconds timeout_;
  std::optional<Lease> lease_;
  std::filesystem::path draft_;  ///< Of the lease; empty once it has its name.
  std::unique_ptr<FileLock> lock_;
  std::map<std::string, int> claimed_;  ///< Task to generation.
  int drafts_ = 0;
};

}  // namespace diorama
