// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>

#include <sys/types.h>

namespace diorama {

/// Who may change what is at a path: itself, a folder above it, or a symbolic link on the way. Code
/// from there runs with the rights of whoever starts the program, so nobody else may, except those
/// who could change the program itself: root, the owners of the program and of the folders above
/// it, and groups that may write there.
class FileSafety {
 public:
  /// `program` is the running program's file.
  explicit FileSafety(const std::filesystem::path& program);

  /// Who else may change it and how to mend that, for a message: "everybody may write to /a/b, so
  /// anybody ...; chmod o-w /a/b". Empty when nobody may, and for what does not exist. In a folder
  /// with the sticky bit, such as /tmp, others may add files but not exchange ours;
  /// `is_plugin_folder` says that added ones do harm.
  std::string danger(const std::filesystem::path& path, bool is_plugin_folder = false);

 private:
  void trust(const std::filesystem::path& place);
  std::string danger_at(const std::filesystem::path& place, bool stands_alone);
  bool is_private_group(uid_t owner, gid_t group) const;

  std::set<uid_t> owners_;
  std::set<gid_t> groups_;
  std::map<std::filesystem::path, std::string> known_;  ///< Folders that were looked at.
};

}  // namespace diorama
