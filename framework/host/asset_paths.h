// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/params.h"

namespace diorama {

/// Names that begin so are looked up in a folder below the assets root.
struct AssetPrefix {
  std::string prefix;
  std::string below;
  void visit(ParamVisitor& v);
};

/// How names of assets in jobs and scenes become files. An existing local path and file:// are used
/// as they are; everything else is looked up below the assets root, and URLs (omniverse://,
/// https:// ...) there alone: where the prefixes lead, the longest first; the whole path; what
/// begins with /Isaac/ or /NVIDIA/ in it, wherever that is.
class AssetPaths {
 public:
  /// Without a root only local paths resolve.
  explicit AssetPaths(std::optional<std::filesystem::path> root,
                      std::vector<AssetPrefix> prefixes = {});

  /// A file or folder that exists. Throws Error(Asset) listing what was tried; URLs get a message
  /// that says to mirror them.
  std::filesystem::path resolve(std::string_view asset) const;

  /// Regular files at any depth below the folder whose name ends (any case) with one of `endings`,
  /// sorted by path. Names that contain one of `skip` (any case) are left out, folders with all
  /// that is in them. Symbolic links are followed, loops are cut. Throws like resolve(), and when
  /// the folder is none.
  std::vector<std::filesystem::path> list(std::string_view folder,
                                          std::span<const std::string> endings,
                                          std::span<const std::string> skip) const;

  const std::optional<std::filesystem::path>& root() const { return root_; }

 private:
  std::vector<std::filesystem::path> places_below(std::string_view asset) const;

  std::optional<std::filesystem::path> root_;
  std::vector<AssetPrefix> prefixes_;  // the longest first
};

/// The first that is given of: command line, DIORAMA_ASSETS_ROOT (`environment`), the job, the
/// sample pack that belongs to the program (if it is there). Throws Error(Asset) when a given one
/// is no folder.
std::optional<std::filesystem::path> choose_assets_root(
    const std::optional<std::filesystem::path>& command_line, const char* environment,
    const std::optional<std::filesystem::path>& job,
    const std::optional<std::filesystem::path>& sample_pack);

/// The file beside an asset that says its keypoints: mug.keypoints.yaml for mug.usd. Empty for
/// what is no file.
std::filesystem::path keypoints_file(std::string_view asset);

/// A name without the variants behind it, and these: "mug.usd" and "{look=red}{size=big}". A file
/// that is really called so has none.
std::pair<std::string_view, std::string_view> split_variants(std::string_view asset);

/// True for "scheme:rest" with a scheme of two letters or more ("dining_room:7", "file:///a").
bool has_scheme(std::string_view asset);

}  // namespace diorama
