// SPDX-License-Identifier: Apache-2.0
#include "simulated_disk.h"

#include <algorithm>
#include <utility>

#include "diorama/error.h"

namespace diorama::test {
namespace {

namespace fs = std::filesystem;

thread_local int t_process = -1;

std::string key(const fs::path& path) {
  std::string text = path.lexically_normal().string();
  if (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

[[noreturn]] void fail(const std::string& what, const fs::path& path, const char* reason) {
  const std::string text = what + " " + path.string() + ": " + reason;
  if (std::string_view(reason) == "No such file or directory") {
    throw NotThere(ErrorKind::Output, text);
  }
  throw Error(ErrorKind::Output, text);
}

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::map<std::string, std::string> SimulatedDisk::tree(const fs::path& root) const {
  const std::lock_guard lock(mutex_);
  std::map<std::string, std::string> files;
  const std::string start = key(root) + "/";
  for (const auto& [path, node] : now_) {
    if (node.content && path.starts_with(start)) {
      files[path.substr(start.size())] = node.content->now;
    }
  }
  return files;
}

void SimulatedDisk::put(const fs::path& file, const std::string& content) {
  const std::lock_guard lock(mutex_);
  for (fs::path folder = fs::path(key(file)).parent_path(); folder != folder.parent_path();
       folder = folder.parent_path()) {
    now_.emplace(folder.string(), Node{});
    synced_.emplace(folder.string(), Node{});
  }
  const Node node{std::make_shared<Content>(Content{content, content, now_ns_, nullptr})};
  now_[key(file)] = node;
  synced_[key(file)] = node;
}

void SimulatedDisk::erase(const fs::path& file) {
  const std::lock_guard lock(mutex_);
  now_.erase(key(file));
  synced_.erase(key(file));
}

void SimulatedDisk::cut_power() {
  const std::lock_guard lock(mutex_);
  Names left = synced_;
  const auto by_chance = [&] { return random_() % 2 == 0; };
  // Each change of a name may have got there by itself; so a file that was moved may be at both
  // places, or at none.
  for (const auto& [path, node] : now_) {
    const auto old = synced_.find(path);
    const bool is_new = old == synced_.end() || old->second.content != node.content;
    if (is_new && by_chance()) left[path] = node;
  }
  for (const auto& [path, node] : synced_) {
    if (!now_.contains(path) && by_chance()) left.erase(path);
  }
  // What lies in folders that are gone is gone.
  std::erase_if(left, [&](const auto& entry) {
    const fs::path parent = fs::path(entry.first).parent_path();
    return parent != parent.parent_path() && !left.contains(parent.string());
  });
  for (auto& [path, node] : left) {
    if (!node.content) continue;
    Content& content = *node.content;
    content.lock_holder = nullptr;
    if (content.now == content.synced) continue;
    switch (random_() % 4) {
      case 0:
        content.now = content.synced;
        break;
      case 1:
        content.now.resize(std::max(content.synced.size(), content.now.size() / 2));
        break;
      case 2:  // The length got there, the content did not.
        if (content.now.size() > content.synced.size()) {
          std::fill(content.now.begin() + std::ptrdiff_t(content.synced.size()), content.now.end(),
                    '\0');
        }
        break;
      default:
        break;
    }
    content.synced = content.now;
  }
  now_ = left;
  synced_ = left;
}

void SimulatedDisk::pick_next() {
  turn_ = -1;
  if (runnable_.empty()) return;
  auto next = runnable_.begin();
  std::advance(next, std::ptrdiff_t(random_() % runnable_.size()));
  turn_ = *next;
}

void SimulatedDisk::take_turn(std::unique_lock<std::mutex>& lock) {
  now_ns_ += step_ns_;
  if (!is_scheduling_ || t_process < 0) return;
  pick_next();
  turn_changed_.notify_all();
  turn_changed_.wait(lock, [this] { return turn_ == t_process; });
}

void SimulatedDisk::run(const std::vector<std::function<void()>>& processes) {
  {
    const std::lock_guard lock(mutex_);
    is_scheduling_ = true;
    for (int i = 0; i < int(processes.size()); ++i) runnable_.insert(i);
    pick_next();
  }
  std::vector<std::thread> threads;
  for (int i = 0; i < int(processes.size()); ++i) {
    threads.emplace_back([this, i, &processes] {
      t_process = i;
      {
        std::unique_lock lock(mutex_);
        turn_changed_.wait(lock, [&] { return turn_ == i; });
      }
      processes[std::size_t(i)]();
      const std::lock_guard lock(mutex_);
      runnable_.erase(i);
      pick_next();
      turn_changed_.notify_all();
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::lock_guard lock(mutex_);
  is_scheduling_ = false;
}

class SimulatedProcess::Lock final : public FileLock {
 public:
  Lock(SimulatedDisk& disk, const void* holder, std::shared_ptr<SimulatedDisk::Content> content)
      : disk_(disk), holder_(holder), content_(std::move(content)) {}
  ~Lock() override {
    const std::lock_guard lock(disk_.mutex_);
    if (content_->lock_holder == holder_) content_->lock_holder = nullptr;
  }

 private:
  SimulatedDisk& disk_;
  const void* holder_;
  std::shared_ptr<SimulatedDisk::Content> content_;
};

class SimulatedProcess::Append final : public AppendFile {
 public:
  Append(SimulatedProcess& process, std::shared_ptr<SimulatedDisk::Content> content)
      : process_(process), content_(std::move(content)) {}
  void append(std::span<const std::byte> bytes) override {
    process_.act("append", [&](bool is_half) {
      const std::string text = text_of(bytes);
      content_->now += text.substr(0, is_half ? text.size() / 2 : text.size());
      content_->modified_ns = process_.disk_.now_ns_;
    });
  }
  void sync() override {
    process_.act("sync", [&](bool) { content_->synced = content_->now; });
  }

 private:
  SimulatedProcess& process_;
  std::shared_ptr<SimulatedDisk::Content> content_;
};

SimulatedProcess::~SimulatedProcess() {
  const std::lock_guard lock(disk_.mutex_);
  for (auto& [path, node] : disk_.now_) {
    if (node.content && node.content->lock_holder == this) node.content->lock_holder = nullptr;
  }
}

void SimulatedProcess::act(const char* kind, const Change& change) {
  std::unique_lock lock(disk_.mutex_);
  if (is_dead_) throw Killed();
  disk_.take_turn(lock);
  ++steps_;
  ++counts_[kind];
  if (steps_ == kill_at_) {
    is_dead_ = true;
    for (auto& [path, node] : disk_.now_) {
      if (node.content && node.content->lock_holder == this) node.content->lock_holder = nullptr;
    }
    if (disk_.random_() % 2 == 0) change(true);
    throw Killed();
  }
  if (steps_ == fail_at_) {
    change(true);
    throw Error(ErrorKind::Output, "injected: No space left on device");
  }
  change(false);
}

std::shared_ptr<SimulatedDisk::Content> SimulatedProcess::file(const fs::path& path) const {
  const auto found = disk_.now_.find(key(path));
  return found == disk_.now_.end() ? nullptr : found->second.content;
}

void SimulatedProcess::require_parent(const fs::path& path) const {
  const auto parent = disk_.now_.find(fs::path(key(path)).parent_path().string());
  if (parent == disk_.now_.end()) fail("cannot create", path, "No such file or directory");
}

std::vector<fs::path> SimulatedProcess::make_folders(const fs::path& folder) {
  std::vector<fs::path> created;
  std::vector<fs::path> missing;
  act("look", [&](bool) {
    for (fs::path place = key(folder); place != place.parent_path(); place = place.parent_path()) {
      const auto found = disk_.now_.find(place.string());
      if (found == disk_.now_.end())
        missing.push_back(place);
      else if (found->second.content)
        fail("cannot create the folder", folder, "Not a directory");
    }
  });
  for (auto next = missing.rbegin(); next != missing.rend(); ++next) {
    bool is_orphan = false;
    act("make folder", [&](bool is_half) {
      const fs::path parent = next->parent_path();
      is_orphan = parent != parent.parent_path() && !disk_.now_.contains(parent.string());
      if (!is_half && !is_orphan &&
          disk_.now_.emplace(next->string(), SimulatedDisk::Node{}).second)
        created.push_back(*next);
    });
    if (is_orphan) {
      const auto rest = make_folders(folder);
      created.insert(created.end(), rest.begin(), rest.end());
      break;
    }
  }
  return created;
}

void SimulatedProcess::write(const fs::path& path, std::span<const std::byte> bytes) {
  act("write", [&](bool is_half) {
    require_parent(path);
    auto content = file(path);
    if (!content) {
      content = std::make_shared<SimulatedDisk::Content>();
      disk_.now_[key(path)] = {content};
    }
    const std::string text = text_of(bytes);
    content->now = text.substr(0, is_half ? text.size() / 2 : text.size());
    content->modified_ns = disk_.now_ns_;
  });
}

void SimulatedProcess::sync(const fs::path& path) {
  act("sync", [&](bool is_half) {
    const auto content = file(path);
    if (!content) fail("cannot write", path, "No such file or directory");
    if (!is_half) content->synced = content->now;
  });
}

void SimulatedProcess::sync_folder(const fs::path& folder) {
  act("sync folder", [&](bool is_half) {
    if (is_half) return;
    const std::string start = key(folder) == "/" ? "/" : key(folder) + "/";
    const auto is_in = [&](const std::string& path) {
      return path.find('/', start.size()) == std::string::npos;
    };
    auto& synced = disk_.synced_;
    for (auto entry = synced.lower_bound(start);
         entry != synced.end() && entry->first.starts_with(start);) {
      const bool is_gone = is_in(entry->first) && !disk_.now_.contains(entry->first);
      entry = is_gone ? synced.erase(entry) : std::next(entry);
    }
    for (auto entry = disk_.now_.lower_bound(start);
         entry != disk_.now_.end() && entry->first.starts_with(start); ++entry) {
      if (is_in(entry->first)) synced[entry->first] = entry->second;
    }
  });
}

bool SimulatedProcess::move_new(const fs::path& from, const fs::path& to) {
  bool is_moved = false;
  act("move", [&](bool is_half) {
    if (is_half) return;
    require_parent(to);
    if (disk_.now_.contains(key(to))) return;
    const auto found = disk_.now_.find(key(from));
    if (found == disk_.now_.end()) {
      fail("cannot move a finished file to", to, "No such file or directory");
    }
    const SimulatedDisk::Node node = found->second;
    disk_.now_.erase(found);
    disk_.now_[key(to)] = node;
    is_moved = true;
  });
  return is_moved;
}

bool SimulatedProcess::remove_file(const fs::path& path) {
  bool was_there = false;
  act("remove", [&](bool is_half) {
    const auto found = disk_.now_.find(key(path));
    was_there = found != disk_.now_.end();
    if (was_there && !found->second.content) fail("cannot remove", path, "Is a directory");
    if (was_there && !is_half) disk_.now_.erase(found);
  });
  return was_there;
}

void SimulatedProcess::remove_if_empty(const fs::path& folder) {
  act("remove folder", [&](bool is_half) {
    const std::string place = key(folder);
    const auto found = disk_.now_.find(place);
    if (is_half || found == disk_.now_.end() || found->second.content) return;
    const auto next = disk_.now_.upper_bound(place + "/");
    if (next != disk_.now_.end() && next->first.starts_with(place + "/")) return;
    disk_.now_.erase(found);
  });
}

bool SimulatedProcess::touch(const fs::path& path) {
  bool is_there = false;
  act("touch", [&](bool) {
    const auto content = file(path);
    is_there = content != nullptr;
    if (is_there) content->modified_ns = disk_.now_ns_;
  });
  return is_there;
}

std::unique_ptr<AppendFile> SimulatedProcess::append_to(const fs::path& path) {
  std::unique_ptr<AppendFile> opened;
  act("open", [&](bool is_half) {
    require_parent(path);
    auto content = file(path);
    if (!content) {
      content = std::make_shared<SimulatedDisk::Content>();
      disk_.now_[key(path)] = {content};
    }
    if (!is_half) opened = std::make_unique<Append>(*this, content);
  });
  return opened;
}

std::optional<FileStatus> SimulatedProcess::status(const fs::path& path) {
  std::optional<FileStatus> status;
  act("look", [&](bool) {
    const auto found = disk_.now_.find(key(path));
    if (found == disk_.now_.end()) return;
    const auto& content = found->second.content;
    status = FileStatus{content ? FileStatus::Kind::File : FileStatus::Kind::Folder,
                        content ? content->now.size() : 0, content ? content->modified_ns : 0};
  });
  return status;
}

std::string SimulatedProcess::read(const fs::path& path) {
  std::string text;
  act("read", [&](bool) {
    const auto content = file(path);
    if (!content) fail("cannot read", path, "No such file or directory");
    text = content->now;
  });
  return text;
}

std::string SimulatedProcess::read_part(const fs::path& path, std::uint64_t offset,
                                        std::uint64_t length) {
  std::string text;
  act("read", [&](bool) {
    const auto content = file(path);
    if (content && offset < content->now.size()) {
      text = content->now.substr(std::size_t(offset), std::size_t(length));
    }
  });
  return text;
}

std::vector<std::string> SimulatedProcess::list(const fs::path& folder) {
  std::vector<std::string> names;
  act("list", [&](bool) {
    const std::string start = key(folder) + "/";
    for (auto entry = disk_.now_.lower_bound(start);
         entry != disk_.now_.end() && entry->first.starts_with(start); ++entry) {
      const std::string name = entry->first.substr(start.size());
      if (name.find('/') == std::string::npos) names.push_back(name);
    }
  });
  std::sort(names.begin(), names.end());
  return names;
}

std::unique_ptr<FileLock> SimulatedProcess::lock(const fs::path& path) {
  std::unique_ptr<FileLock> taken;
  act("lock", [&](bool is_half) {
    const auto content = file(path);
    if (!content) fail("cannot lock", path, "No such file or directory");
    if (is_half || !has_locks_ || content->lock_holder) return;
    content->lock_holder = this;
    taken = std::make_unique<Lock>(disk_, this, content);
  });
  return taken;
}

bool SimulatedProcess::is_locked(const fs::path& path) {
  bool is_held = false;
  act("look", [&](bool) {
    const auto content = file(path);
    is_held = content && content->lock_holder && has_locks_;
  });
  return is_held;
}

}  // namespace diorama::test
