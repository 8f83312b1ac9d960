// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/file_safety.h"

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <deque>
#include <optional>
#include <system_error>
#include <utility>

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr int kMostLinks = 40;  // as the kernel

std::optional<struct stat> status_of(const fs::path& place) {
  struct stat status {};
  if (lstat(place.c_str(), &status) != 0) return std::nullopt;
  return status;
}

std::string user_name(uid_t user) {
  const passwd* const entry = getpwuid(user);
  return entry ? std::string("user '") + entry->pw_name + "'" : "user " + std::to_string(user);
}

std::string group_name(gid_t group) {
  const struct group* const entry = getgrgid(group);
  return entry ? std::string("group '") + entry->gr_name + "'" : "group " + std::to_string(group);
}

}  // namespace

FileSafety::FileSafety(const fs::path& program) : owners_{0, geteuid()}, groups_{0} {
  for (fs::path place = program; place != place.parent_path(); place = place.parent_path()) {
    trust(place);
  }
}

void FileSafety::trust(const fs::path& place) {
  const auto status = status_of(place);
  if (!status) return;
  owners_.insert(status->st_uid);
  if ((status->st_mode & S_IWGRP) != 0 && (status->st_mode & S_ISVTX) == 0) {
    groups_.insert(status->st_gid);
  }
}

/// The group of one user alone, as many systems give everybody one and let it write by default.
bool FileSafety::is_private_group(uid_t owner, gid_t group) const {
  const passwd* const user = getpwuid(owner);
  if (!user) return false;
  const std::string name = user->pw_name;
  const struct group* const entry = getgrgid(group);
  if (!entry || entry->gr_name != name) return false;
  for (char** member = entry->gr_mem; *member; ++member) {
    if (*member != name) return false;
  }
  return true;
}

std::string FileSafety::danger_at(const fs::path& place, bool stands_alone) {
  const auto status = status_of(place);
  if (!status) return {};
  if (!owners_.contains(status->st_uid)) {
    return place.string() + " belongs to " + user_name(status->st_uid) +
           ", who could place code there that runs with your rights; take it over (chown) or copy "
           "it to a folder of yours";
  }
  // Others may add to a sticky folder, but each entry is its owner's, who is looked at as well.
  const bool is_shared_folder =
      !stands_alone && S_ISDIR(status->st_mode) && (status->st_mode & S_ISVTX) != 0;
  if (is_shared_folder) return {};
  if ((status->st_mode & S_IWOTH) != 0) {
    return "everybody may write to " + place.string() +
           ", so anybody could place code there that runs with your rights; remove that right "
           "(chmod o-w " +
           place.string() + ")";
  }
  if ((status->st_mode & S_IWGRP) != 0 && !groups_.contains(status->st_gid) &&
      !is_private_group(status->st_uid, status->st_gid)) {
    return group_name(status->st_gid) + " may write to " + place.string() +
           ", so others could place code there that runs with your rights; remove that right "
           "(chmod g-w " +
           place.string() + ")";
  }
  return {};
}

std::string FileSafety::danger(const fs::path& path, bool is_plugin_folder) {
  std::error_code failed;
  const fs::path absolute = fs::absolute(path, failed).lexically_normal();
  std::deque<fs::path> names(absolute.begin(), absolute.end());
  fs::path place;
  for (int links = 0; !names.empty();) {
    const fs::path name = std::move(names.front());
    names.pop_front();
    if (name.empty() || name == ".") continue;
    if (name == "..") {
      place = place.parent_path();
      continue;
    }
    const fs::path next = name.is_absolute() ? name : place / name;
    const auto status = status_of(next);
    if (!status) return {};
    if (S_ISLNK(status->st_mode)) {
      // Whoever owns a link leads it where he likes.
      if (!owners_.contains(status->st_uid)) return danger_at(next, true);
      if (++links > kMostLinks) return {};
      const fs::path target = fs::read_symlink(next, failed);
      names.insert(names.begin(), target.begin(), target.end());
      continue;
    }
    place = next;
    const bool is_last = names.empty();
    const auto [known, is_new] = known_.try_emplace(place);
    if (is_new) known->second = danger_at(place, false);
    std::string danger = known->second;
    if (danger.empty() && is_last && is_plugin_folder) danger = danger_at(place, true);
    if (!danger.empty()) return danger;
  }
  return {};
}

}  // namespace diorama
