// SPDX-License-Identifier: Apache-2.0
#include "framework/view/index_cache.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>
#include <tuple>
#include <vector>

#include "framework/host/regular_file.h"
#include "framework/jobs/assemble.h"
#include "framework/output/journal.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// Changes whenever CaptureIndex::bytes() or what is counted does.
std::string index_head() { return "diorama index 2, version " + program_version() + "\n"; }

void add_text(std::string_view text, Digest& digest) {
  const std::uint64_t length = text.size();
  digest.add(std::as_bytes(std::span(&length, 1)));
  digest.add(std::as_bytes(std::span(text)));
}

void add_file(const fs::path& file, Digest& digest) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return;
  add_text(file.native(), digest);
  const std::array<std::int64_t, 4> facts{
      std::int64_t(found.st_size), std::int64_t(found.st_mtim.tv_sec),
      std::int64_t(found.st_mtim.tv_nsec), std::int64_t(found.st_ino)};
  digest.add(std::as_bytes(std::span(facts)));
}

/// False where a folder cannot be read, or is a link: what changes behind it would not be seen.
bool add_files_below(const fs::path& folder, Digest& digest) {
  std::error_code error;
  fs::recursive_directory_iterator at(folder, error);
  for (const fs::recursive_directory_iterator end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    const bool is_folder = at->is_directory(ignored);
    if (at->path().filename().native().starts_with(".diorama")) {
      if (is_folder) at.disable_recursion_pending();
    } else if (!is_folder) {
      add_file(at->path(), digest);
    } else if (at->is_symlink(ignored)) {
      return false;
    }
  }
  return !error;
}

}  // namespace

fs::path index_cache_folder() {
  const auto absolute = [](const char* variable) {
    const char* const value = std::getenv(variable);
    return fs::path(value && *value == '/' ? value : "");
  };
  if (const fs::path cache = absolute("XDG_CACHE_HOME"); !cache.empty()) {
    return cache / "diorama" / "view";
  }
  const fs::path home = absolute("HOME");
  return home.empty() ? fs::path() : home / ".cache" / "diorama" / "view";
}

std::optional<IndexCache::Key> IndexCache::key_of(const fs::path& dataset,
                                                  const StoredInfo& info) const {
  std::error_code error;
  const fs::path folder = fs::canonical(dataset, error);
  if (folder_.empty() || error) return std::nullopt;
  Digest digest;
  add_text(info.format, digest);
  // Formats may take words from the page of the run.
  add_file(folder.parent_path() / "dataset.json", digest);
  if (!add_files_below(folder, digest)) return std::nullopt;
  return Key{digest_of(folder.native()), digest.text()};
}

bool IndexCache::find(const Key& key, std::size_t captures, CaptureIndex& index) const {
  const fs::path file = file_of(key);
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error || size > most_bytes_) return false;
  std::string text(std::size_t(size), '\0');
  open_regular_file(file).read(text.data(), std::streamsize(size));
  const std::string head = index_head() + key.content + "\n";
  if (!text.starts_with(head)) return false;
  std::string_view rest = std::string_view(text).substr(head.size());
  const std::size_t cut = rest.find('\n');
  if (cut == rest.npos || rest.substr(0, cut) != digest_of(rest.substr(cut + 1))) return false;
  if (!index.take_bytes(rest.substr(cut + 1), captures)) return false;
  fs::last_write_time(file, fs::file_time_type::clock::now(), error);
  return true;
}

void IndexCache::keep(const Key& key, const CaptureIndex& index) const {
  const std::string bytes = index.bytes();
  if (bytes.size() > most_bytes_) return;
  std::error_code error;
  fs::create_directories(folder_, error);
  // Its files tell what others need not know.
  fs::permissions(folder_, fs::perms::owner_all, error);
  const fs::path draft = folder_ / (key.place + "." + std::to_string(::getpid()) + ".draft");
  {
    std::ofstream out(draft, std::ios::binary);
    out << index_head() << key.content << '\n' << digest_of(bytes) << '\n' << bytes;
    out.close();
    if (!out) {
      fs::remove(draft, error);
      return;
    }
  }
  fs::rename(draft, file_of(key), error);
  remove_oldest(file_of(key));
}

void IndexCache::remove_oldest(const fs::path& newest) const {
  std::vector<std::tuple<fs::file_time_type, std::uintmax_t, fs::path>> files;
  std::uintmax_t all = 0;
  std::error_code error;
  for (fs::directory_iterator at(folder_, error), end; !error && at != end; at.increment(error)) {
    const std::string kind = at->path().extension().string();
    std::error_code failed;
    if ((kind != ".index" && kind != ".draft") || !at->is_regular_file(failed)) continue;
    const std::uintmax_t size = at->file_size(failed);
    const fs::file_time_type time = at->last_write_time(failed);
    if (failed) continue;
    all += size;
    // Clocks of files are too coarse to tell that it is.
    if (at->path() == newest) continue;
    files.emplace_back(time, size, at->path());
  }
  std::ranges::sort(files);
  for (const auto& [time, size, path] : files) {
    if (all <= most_bytes_) break;
    std::error_code ignored;
    fs::remove(path, ignored);
    all -= size;
  }
}

}  // namespace diorama
