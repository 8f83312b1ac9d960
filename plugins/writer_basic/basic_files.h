// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace diorama {

/// The files of one Replicator dataset, told apart by their names alone: where they lie (flat, a
/// folder per camera, a folder per annotator), numbers, padding. A few bytes per frame.
class BasicFiles {
 public:
  explicit BasicFiles(const std::filesystem::path& folder);

  /// Render products in order of their names; "" when files lie flat.
  std::vector<std::string> products() const;
  /// Numbers of frames that any product has, ascending.
  std::vector<int> numbers() const;
  /// Kinds that some frame has: "rgb.png", "bounding_box_3d_labels.json".
  std::vector<std::string> kinds() const;
  bool has(std::string_view kind) const;
  /// Some file says which node an object is. Replicator's first versions wrote none.
  bool has_node_paths() const;
  /// The kind of boxes whose rows are all that is known of objects, "bounding_box_2d_tight"; empty
  /// where nodes are known.
  std::string nameless_boxes() const;

  /// Files with numbers beyond reason, the first hundred.
  const std::vector<std::string>& unnumbered() const { return unnumbered_; }

  /// Relative; empty when there is no such file.
  std::string path(const std::string& product, int number, std::string_view kind) const;
  /// Where it would lie.
  std::string expected_path(const std::string& product, int number, std::string_view kind) const;

 private:
  enum class Layout : std::uint8_t { Flat, FolderPerProduct, FolderPerAnnotator };
  struct Entry {
    std::uint64_t kinds = 0;  ///< One bit each.
    std::uint8_t digits = 0;
  };
  struct Product {
    Layout layout = Layout::Flat;
    std::map<int, Entry> frames;
  };
  void take(const std::string& product, Layout layout, const std::string& name);
  std::string path_of(const std::string& product, const Product& own, int number,
                      std::size_t kind) const;

  std::map<std::string, Product> products_;
  std::uint64_t kinds_ = 0;
  std::vector<std::string> unnumbered_;
};

}  // namespace diorama
