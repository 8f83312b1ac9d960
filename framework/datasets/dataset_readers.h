// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"
#include "framework/plugins/registry.h"

namespace diorama {

/// The readers of this process. A reader is made, and its library loaded, for the first folder in
/// which one of its patterns is found. Main thread only.
class DatasetReaders {
 public:
  struct Entry {
    std::string type;
    std::vector<std::string> patterns;
    std::function<std::unique_ptr<Reader>()> make;
    /// With parameters, as a mapping of a job has them. Empty: it takes none.
    std::function<std::unique_ptr<Reader>(const Value&)> make_with = {};
  };

  explicit DatasetReaders(std::vector<Entry> entries) : entries_(std::move(entries)) {}
  /// All that plugins provide. Registry and host must outlive the object.
  DatasetReaders(Registry& registry, Host& host);

  /// Type of the reader that knows the folder best; empty when none does. Throws Error(Usage) that
  /// names the readers when two know it equally well.
  std::string recognise(const std::filesystem::path& folder);
  /// Makes the reader that open() takes for `named`, so that what is wrong with the name or the
  /// parameters is told apart from what is wrong with a dataset. Throws as open() does.
  void make(const std::string& named) { opener(named); }
  /// What becomes of a capture in which a reader throws: see guarded(), or its caller sees it.
  enum class LostCaptures : std::uint8_t { Findings, Throw };
  /// Opens the folder with a reader of this type, or of a mapping in YAML with its parameters:
  /// "{type: python, file: mine.py, class: Mine}". Throws Error(Usage) for an unknown type, naming
  /// the nearest one, Error(Config) for wrong parameters and Error(Asset) when the folder cannot be
  /// read.
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder,
                                            const std::string& named,
                                            LostCaptures lost = LostCaptures::Findings);
  std::vector<std::string> types() const;

 private:
  Reader& reader(const Entry& entry);
  const Entry& entry_of(const std::string& type) const;
  Reader& reader_with(const std::string& mapping);
  Reader& opener(const std::string& named);

  std::vector<Entry> entries_;
  std::map<std::string, std::unique_ptr<Reader>> made_;  ///< By type, or mapping.
};

/// The folders of a run: those that its dataset.json names and those right below, sorted.
std::vector<std::filesystem::path> folders_of_run(const std::filesystem::path& run);

/// A dataset's folder, and who reads it.
struct FoundDataset {
  std::filesystem::path folder;
  std::string reader;  ///< As DatasetReaders::open() takes it.
};

/// The folder itself; else the folders that a run's dataset.json names and those right below that
/// some reader knows, sorted. `reader`, when given, is taken for the folder whatever it looks like.
/// Throws Error(Usage) when there is no folder.
std::vector<FoundDataset> find_datasets(const std::filesystem::path& folder,
                                        DatasetReaders& readers, const std::string& reader = {});

/// The one dataset that a command is about. Throws Error(Usage) when there is none, or several; the
/// text lists what there is.
FoundDataset find_dataset(const std::filesystem::path& folder, DatasetReaders& readers,
                          const std::string& reader = {});

/// True when the folder has a file of this name: '*' stands for any text within one part.
bool has_file_like(const std::filesystem::path& folder, std::string_view pattern);

}  // namespace diorama
