// SPDX-License-Identifier: Apache-2.0
#include "framework/output/workers.h"

#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "framework/config/json_text.h"
#include "framework/output/journal.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

/// Of a lease's or a claim's file, before it gets its name.
const std::string kDraft = "draft-";

std::string plain(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return !is_plain_name(std::string("x") + c); }, '-');
  return text.substr(0, 80);
}

std::string host_name() {
  char name[256] = "";
  if (::gethostname(name, sizeof name - 1) != 0 || name[0] == '\0') return "unknown";
  return name;
}

std::string boot_of_this_machine() {
  std::ifstream stream("/proc/sys/kernel/random/boot_id");
  std::string text;
  std::getline(stream, text);
  return text.empty() ? host_name() : text;
}

std::optional<Workers::Lease> lease_named(std::string_view name) {
  const std::size_t middle = name.find('~');
  if (middle == std::string_view::npos) return std::nullopt;
  Workers::Lease lease{std::string(name.substr(0, middle)), std::string(name.substr(middle + 1))};
  if (!is_plain_name(lease.role) || !is_plain_name(lease.worker)) return std::nullopt;
  return lease;
}

/// A claim's file: "visit-000041.2".
std::optional<std::pair<std::string, int>> task_and_generation(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos || !is_plain_name(name)) return std::nullopt;
  int generation = 0;
  const char* const end = name.data() + name.size();
  const auto [last, code] = std::from_chars(name.data() + dot + 1, end, generation);
  if (code != std::errc() || last != end || generation < 0) return std::nullopt;
  return std::pair(name.substr(0, dot), generation);
}

}  // namespace

Busy::~Busy() = default;

WorkerIdentity this_worker() {
  // Names of workers are no part of a dataset, so they may differ from run to run.
  unsigned number = 0;
  if (::getrandom(&number, sizeof number, 0) != sizeof number) number = unsigned(::getpid());
  char random[16];
  std::snprintf(random, sizeof random, "%08x", number);
  WorkerIdentity self;
  self.host = host_name();
  self.machine = boot_of_this_machine();
  self.process = int(::getpid());
  self.name = plain(self.host) + "-" + std::to_string(self.process) + "-" + random;
  if (!is_plain_name(self.name)) self.name = "w" + self.name;
  return self;
}

Workers::Workers(FileSystem& file_system, fs::path folder, WorkerIdentity self,
                 std::chrono::seconds timeout)
    : file_system_(file_system),
      folder_(std::move(folder)),
      self_(std::move(self)),
      timeout_(timeout) {}

fs::path Workers::lease_file(const Lease& lease) const {
  return folder_ / "workers" / lease.file_name();
}

void Workers::join(const std::string& role) {
  lease_ = Lease{role, self_.name};
  OrderedJson content{{"host", self_.host}, {"process", self_.process}, {"machine", self_.machine}};
  const fs::path file = lease_file(*lease_);
  // The lock comes with the name: a lease without it would be taken for a dead worker's.
  draft_ = new_draft();
  const auto write = [&] {
    const std::string text =
        content.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
    file_system_.write(draft_, std::as_bytes(std::span(text)));
  };
  const bool is_new = in_folder(file_system_, file.parent_path(), [&] {
    write();
    lock_ = file_system_.lock(draft_);
    if (!lock_) {
      content["locked"] = false;
      write();
    }
    return file_system_.move_new(draft_, file);
  });
  if (!is_new) throw Error(ErrorKind::Output, file.string() + ": exists already");
  draft_.clear();
}

fs::path Workers::new_draft() {
  return folder_ / "workers" / (kDraft + self_.name + "-" + std::to_string(drafts_++));
}

void Workers::leave() {
  if (!lease_) return;
  // Tasks in folders (visits) stay marked until the dataset is finished: who has not read our
  // journal yet would make them again.
  for (const auto& [task, generation] : std::map(claimed_)) {
    if (task.find('/') == std::string::npos) release(task);
  }
  claimed_.clear();
  file_system_.remove_file(draft_.empty() ? lease_file(*lease_) : draft_);
  draft_.clear();
  lock_.reset();
  lease_.reset();
  for (const char* name : {"claims", "workers"}) file_system_.remove_if_empty(folder_ / name);
}

bool Workers::beat() { return lease_ && file_system_.touch(lease_file(*lease_)); }

bool Workers::is_member() { return lease_ && file_system_.exists(lease_file(*lease_)); }

std::vector<Workers::Lease> Workers::others() const {
  std::vector<Lease> leases;
  for (const std::string& name : file_system_.list(folder_ / "workers")) {
    auto lease = lease_named(name);
    if (lease && lease->worker != self_.name) leases.push_back(std::move(*lease));
  }
  return leases;
}

std::optional<std::int64_t> Workers::age_ns(const Lease& lease) {
  const auto then = file_system_.status(lease_file(lease));
  if (!then) return std::nullopt;
  std::int64_t now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
  // Who has a lease, too, asks the file system's clock: those of machines may differ.
  if (lease_) {
    if (!beat()) return std::nullopt;
    const auto own = file_system_.status(lease_file(*lease_));
    if (!own) return std::nullopt;
    now_ns = own->modified_ns;
  }
  return std::max<std::int64_t>(0, now_ns - then->modified_ns);
}

bool Workers::is_alive(const Lease& lease) {
  const fs::path file = lease_file(lease);
  const auto found = file_system_.status(file);
  if (!found || found->kind != FileStatus::Kind::File) return false;
  if (file_system_.is_locked(file)) return true;
  const std::string text = file_system_.read_part(file, 0, 4096);
  const OrderedJson content = parse_json_or_nothing<OrderedJson>(text);
  // Within one machine locks are certain, where there are any, and nobody holds this one.
  const bool has_no_locks = content.is_object() && content.value("locked", OrderedJson()) == false;
  if (!has_no_locks && content.is_object() &&
      content.value("machine", OrderedJson()) == self_.machine) {
    return false;
  }
  const auto age = age_ns(lease);
  return age && *age <= std::int64_t(timeout_.count()) * 1'000'000'000;
}

std::string Workers::describe(const Lease& lease) {
  const std::string text = file_system_.read_part(lease_file(lease), 0, 4096);
  const OrderedJson content = parse_json_or_nothing<OrderedJson>(text);
  std::string who = "worker " + lease.worker;
  if (content.is_object() && content.contains("host") && content["host"].is_string() &&
      content.contains("process") && content["process"].is_number_integer()) {
    who = "host " + clean_name(content["host"].get<std::string>()) + ", process " +
          std::to_string(content["process"].get<std::int64_t>());
  }
  if (const auto age = age_ns(lease)) {
    who += ", last sign of life " + std::to_string(*age / 1'000'000'000) + " s ago";
  }
  return who;
}

void Workers::remove(const Lease& lease) { file_system_.remove_file(lease_file(lease)); }

fs::path Workers::claim_file(const std::string& task, int generation) const {
  return folder_ / "claims" / (task + "." + std::to_string(generation));
}

std::set<std::string> Workers::claims_in(const std::string& folder) const {
  std::set<std::string> tasks;
  for (const std::string& name : file_system_.list(folder_ / "claims" / folder)) {
    if (const auto found = task_and_generation(name)) tasks.insert(folder + "/" + found->first);
  }
  return tasks;
}

std::optional<Workers::Lease> Workers::claim(const std::string& task) {
  if (has_claimed(task)) return std::nullopt;
  const fs::path folder = (folder_ / "claims" / task).parent_path();
  const std::string own_name = fs::path(task).filename().string();
  for (;;) {
    int next = 0;
    for (const std::string& name : file_system_.list(folder)) {
      const auto found = task_and_generation(name);
      if (found && found->first == own_name) next = std::max(next, found->second + 1);
    }
    if (next > 0) {
      const auto owner = lease_named(file_system_.read_part(claim_file(task, next - 1), 0, 1024));
      if (owner && is_alive(*owner)) return owner;
    }
    // The content comes with the name, so nobody sees a claim without its owner.
    const fs::path draft = new_draft();
    const std::string text = lease_->file_name();
    const bool is_mine = in_folder(file_system_, folder, [&] {
      // Whoever found no worker when we joined may sweep drafts away.
      file_system_.write(draft, std::as_bytes(std::span(text)));
      return file_system_.move_new(draft, claim_file(task, next));
    });
    if (is_mine) {
      claimed_[task] = next;
      return std::nullopt;
    }
    file_system_.remove_file(draft);
  }
}

void Workers::release(const std::string& task) {
  const auto claim = claimed_.find(task);
  if (claim == claimed_.end()) return;
  // Earlier generations, of dead workers, would count again.
  for (int generation = 0; generation <= claim->second; ++generation) {
    file_system_.remove_file(claim_file(task, generation));
  }
  claimed_.erase(claim);
}

void Workers::remove_claims(const std::string& folder) {
  const fs::path place = folder_ / "claims" / folder;
  for (const std::string& name : file_system_.list(place)) {
    const auto status = file_system_.status(place / name);
    if (status && status->kind == FileStatus::Kind::File) file_system_.remove_file(place / name);
  }
  file_system_.remove_if_empty(place);
}

void Workers::sweep() {
  if (!others().empty()) return;
  for (const std::string& name : file_system_.list(folder_ / "claims")) {
    const auto status = file_system_.status(folder_ / "claims" / name);
    if (status && status->kind == FileStatus::Kind::Folder) remove_claims(name);
  }
  remove_claims("");
  for (const std::string& name : file_system_.list(folder_ / "workers")) {
    if (name.starts_with(kDraft)) file_system_.remove_file(folder_ / "workers" / name);
  }
}

}  // namespace diorama
