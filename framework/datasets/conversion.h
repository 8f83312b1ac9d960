// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"
#include "diorama/writer.h"

namespace diorama {

/// A dataset that goes into another one.
struct ConversionSource {
  std::filesystem::path folder;
  std::unique_ptr<const StoredDataset> data;
  DatasetInfo info;  ///< See dataset_info_of().
  NameSet holds;     ///< What every capture holds, see look_through().
  /// Empty, or why captures do not hold ids of pixels, although the dataset does.
  std::string why_no_ids;
  /// Empty, or where masks overlap and what becomes of them.
  std::string overlaps;
};

/// Fills in the source's last three fields. Where writers `need` ids of pixels and somebody else
/// made the dataset, reads the masks of all its captures: they may overlap, or some object may have
/// none.
void look_through(ConversionSource& source, const NameSet& needs, Host& host);

/// The channels among `needs` that the source neither holds nor tells by others.
NameSet lacking_channels(const ConversionSource& source, const NameSet& needs);

/// Stored captures as writers want them: those of one dataset, or of several one after the other,
/// with new numbers, classes united and splits kept.
class Conversion {
 public:
  /// Sources that were looked through, and `needs` of all writers. Throws Error(Usage) when a
  /// source lacks a channel that cannot be derived, or holds nothing.
  Conversion(std::vector<ConversionSource> sources, NameSet needs);

  const DatasetInfo& info() const { return info_; }
  /// What the sources do not have and what no writer takes, a line each.
  const std::vector<std::string>& notes() const { return notes_; }

  /// Gives the captures in order to `take`; they are read on the host's threads, some at a time.
  /// Throws Error(Asset) that names the file when one does not hold what its dataset holds.
  void run(Host& host, const std::function<void(Capture)>& take) const;

 private:
  void note_clips(ConversionSource& source);
  void unite_infos();
  void note_differences(const ConversionSource& source);
  Capture converted(const ConversionSource& source, StoredCapture stored) const;

  std::vector<ConversionSource> sources_;
  NameSet needs_;
  DatasetInfo info_;
  std::vector<std::string> notes_;
};

/// Throws Error(Asset) that names the file whose fault it is that a frame lacks something: one that
/// cannot be read rather than one that is not there. `camera`, and `lacking`, the channel that is
/// not there, may be empty.
[[noreturn]] void refuse_capture(const std::filesystem::path& folder, const StoredCapture& stored,
                                 const std::string& camera, const std::string& lacking = {});

}  // namespace diorama
