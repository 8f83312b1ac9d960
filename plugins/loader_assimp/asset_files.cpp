// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/asset_files.h"

#include <assimp/material.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cstring>
#include <set>
#include <sstream>
#include <string_view>

#include "diorama/error.h"
#include "loader_assimp/regular_files.h"
#include "loader_assimp/scene_file.h"
#include "loader_assimp/texture_library.h"

namespace diorama::loader_assimp {
namespace {

namespace fs = std::filesystem;

// What the child answers begins with it, unless something went wrong.
constexpr std::string_view kAnswer = "files:\n";

using Paths = std::set<std::string>;

// Keeps the names of the files that are opened.
class RecordingFiles final : public RegularFiles {
 public:
  explicit RecordingFiles(Paths& opened) : opened_(opened) {}
  using RegularFiles::Open;
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    Assimp::IOStream* stream = RegularFiles::Open(file, mode);
    if (stream) opened_.insert(fs::path(file).lexically_normal().string());
    return stream;
  }

 private:
  Paths& opened_;
};

void add_pictures(const aiScene& scene, const fs::path& folder, Paths& paths) {
  for (unsigned m = 0; m < scene.mNumMaterials; ++m) {
    const aiMaterial& material = *scene.mMaterials[m];
    for (unsigned p = 0; p < material.mNumProperties; ++p) {
      const aiMaterialProperty& property = *material.mProperties[p];
      aiString name;
      if (std::strcmp(property.mKey.C_Str(), _AI_MATKEY_TEXTURE_BASE) != 0 ||
          material.Get(_AI_MATKEY_TEXTURE_BASE, property.mSemantic, property.mIndex, name) !=
              AI_SUCCESS ||
          scene.GetEmbeddedTexture(name.C_Str())) {
        continue;
      }
      if (const auto picture = find_picture(folder, name.C_Str())) {
        paths.insert(picture->lexically_normal().string());
      }
    }
  }
}

std::string list_files(const std::string& file) {
  Paths paths;
  Assimp::Importer importer;
  importer.SetIOHandler(new RecordingFiles(paths));
  const aiScene* scene = importer.ReadFile(file, 0);
  if (!scene) return importer.GetErrorString();
  add_pictures(*scene, fs::path(file).parent_path(), paths);
  std::string answer(kAnswer);
  for (const std::string& path : paths) answer += path + '\n';
  return answer;
}

}  // namespace

std::vector<fs::path> files_of(const std::string& file) {
  const std::string answer = read_in_child(file, [&] { return list_files(file); });
  if (!answer.starts_with(kAnswer)) throw unreadable(file, answer);
  std::vector<fs::path> files{file};
  const std::string self = fs::path(file).lexically_normal().string();
  std::istringstream lines(answer.substr(kAnswer.size()));
  for (std::string line; std::getline(lines, line);) {
    if (line != self) files.emplace_back(line);
  }
  return files;
}

}  // namespace diorama::loader_assimp
