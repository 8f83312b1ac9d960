// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/scene_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>

#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/LogStream.hpp>
#include <cctype>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "loader_assimp/child_process.h"
#include "loader_assimp/gltf_animation.h"
#include "loader_assimp/posing.h"
#include "loader_assimp/regular_files.h"

namespace diorama::loader_assimp {
namespace {

namespace fs = std::filesystem;

// Enough for every honest file seen so far, tens of times over.
constexpr int kLeastSeconds = 5;
// By the clock for each second of the processor: other programs may be busy.
constexpr int kClockPerSecond = 24;
constexpr std::uint64_t kBytesPerSecond = 250'000;
constexpr std::uint64_t kLeastMemory = std::uint64_t(1) << 30;
constexpr std::uint64_t kMemoryPerByte = 200;
constexpr std::size_t kMostComplaints = 8;
// Edges that are sharper than this stay edges when normals are made up.
constexpr float kSmoothingAngle = 45.0f;

Format format_of(const std::string& file) {
  std::string ending = fs::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".gltf" || ending == ".glb") return Format::Gltf;
  if (ending == ".fbx") return Format::Fbx;
  if (ending == ".dae" || ending == ".zae") return Format::Collada;
  if (ending == ".3mf") return Format::ThreeMf;
  if (ending == ".obj" || ending == ".ply" || ending == ".stl" || ending == ".off") {
    return Format::Plain;
  }
  return Format::Other;
}

unsigned steps_for(Format format) {
  unsigned steps = aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_RemoveComponent;
  // glTF says that what has no normals is flat, and its vertices are shared already.
  if (format != Format::Gltf) steps |= aiProcess_GenSmoothNormals | aiProcess_JoinIdenticalVertices;
  return steps;
}

// Empty when the file was read.
std::string read(Assimp::Importer& importer, const std::string& file, Format format) {
  importer.SetIOHandler(new RegularFiles);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, kSmoothingAngle);
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_TANGENTS_AND_BITANGENTS);
  const aiScene* scene = importer.ReadFile(file, steps_for(format));
  if (!scene || !scene->mRootNode) {
    const std::string why = importer.GetErrorString();
    return why.empty() ? "it holds no scene" : why;
  }
  // Some text formats read anything, and find nothing in it.
  const bool is_empty = !scene->HasMeshes() && !scene->HasLights() && !scene->HasCameras();
  return is_empty ? "it holds neither meshes nor lights nor cameras" : "";
}

ChildLimits limits_for(const std::string& file) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  ChildLimits limits;
  limits.cpu_seconds = kLeastSeconds;
  limits.added_bytes = kLeastMemory;
  if (!error) {
    limits.cpu_seconds += static_cast<int>(std::min<std::uintmax_t>(size / kBytesPerSecond, 3600));
    limits.added_bytes += size * kMemoryPerByte;
  }
  limits.clock_seconds = kClockPerSecond * limits.cpu_seconds;
  return limits;
}

// Files that a child has read without harm, as they were then: an animated one is read again for
// each of its times.
class HarmlessFiles {
 public:
  bool contains(const std::string& file) {
    const std::lock_guard lock(mutex_);
    const auto known = files_.find(file);
    return known != files_.end() && known->second == state_of(file);
  }
  void add(const std::string& file) {
    const std::lock_guard lock(mutex_);
    files_[file] = state_of(file);
  }

 private:
  using State = std::pair<std::uintmax_t, fs::file_time_type>;
  static std::optional<State> state_of(const std::string& file) {
    std::error_code error;
    const State state{fs::file_size(file, error), fs::last_write_time(file, error)};
    return error ? std::nullopt : std::optional(state);
  }
  std::mutex mutex_;
  std::map<std::string, std::optional<State>> files_;
};

HarmlessFiles& harmless_files() {
  static HarmlessFiles files;
  return files;
}

// Collects what assimp reports as an error and goes on after.
class Diagnostics final : public Assimp::LogStream {
 public:
  explicit Diagnostics(std::vector<std::string>& lines) : lines_(lines) {}
  void write(const char* message) override {
    std::string line = message;
    while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back()))) line.pop_back();
    // "Error, T1: OBJ: ...": the thread tells a reader nothing.
    if (const std::size_t colon = line.find(": "); colon != std::string::npos) {
      line.erase(0, colon + 2);
    }
    const bool is_known = std::find(lines_.begin(), lines_.end(), line) != lines_.end();
    if (!is_known && lines_.size() < kMostComplaints) lines_.push_back(line);
  }

 private:
  std::vector<std::string>& lines_;
};

// assimp's log is one for the process; it is ours while this lives.
class AssimpLog {
 public:
  explicit AssimpLog(std::vector<std::string>& diagnostics) {
    Assimp::Logger* log = Assimp::DefaultLogger::create(nullptr, Assimp::Logger::NORMAL, 0);
    log->attachStream(new Diagnostics(diagnostics), Assimp::Logger::Err);
  }
  ~AssimpLog() { Assimp::DefaultLogger::kill(); }
  AssimpLog(const AssimpLog&) = delete;
  AssimpLog& operator=(const AssimpLog&) = delete;
};

}  // namespace

std::string read_in_child(const std::string& file, const std::function<std::string()>& body) {
  std::error_code error;
  // A pipe would be waited for.
  if (fs::exists(file, error) && !fs::is_regular_file(file, error)) {
    return "it is not a regular file";
  }
  return run_in_child(limits_for(file), body);
}

Error unreadable(const std::string& file, const std::string& why) {
  return Error(ErrorKind::Asset, file + ": assimp cannot read it: " + why);
}

SceneFile::SceneFile(const loader_support::TimedAsset& asset, Host& host)
    : name_(asset.file), format_(format_of(asset.file)) {
  const std::string& file = name_;
  if (!harmless_files().contains(file)) {
    const std::string trial = read_in_child(file, [&] {
      Assimp::Importer importer;
      return read(importer, file, format_);
    });
    if (!trial.empty()) throw unreadable(file, trial);
    harmless_files().add(file);
  }
  std::vector<std::string> diagnostics;
  {
    const AssimpLog log(diagnostics);
    const std::string why = read(importer_, file, format_);
    if (!why.empty()) throw unreadable(file, why);
  }
  if (asset.animation) animation_ = find_animation(scene(), *asset.animation, asset.timeless());
  // The importer's scene is nobody else's.
  if (asset.seconds && animation_ < scene().mNumAnimations) {
    auto& scene = const_cast<aiScene&>(*importer_.GetScene());
    pose_at(scene, animation_, *asset.seconds);
    const std::string why = format_ == Format::Gltf
                                ? pose_gltf_at(scene, file, animation_, *asset.seconds)
                                : std::string();
    if (!why.empty()) {
      host.log(LogLevel::Warning,
               file + ": its animation runs straight from key to key, as what it says of " +
                   "steps and splines cannot be read: " + why);
    }
  }
  for (const std::string& line : diagnostics) {
    host.log(LogLevel::Warning, file + ": assimp: " + line);
  }
}

}  // namespace diorama::loader_assimp
