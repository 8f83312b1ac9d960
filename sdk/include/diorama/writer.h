// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/component.h"
#include "diorama/frame.h"

namespace diorama {

/// An environment, object or texture of the job, and what it is made of.
struct DatasetAsset {
  std::string asset;  ///< As a job would name it; files below the assets root without the root.
  /// Every distinct label set of the job's objects that are made of it, sorted; empty for what is
  /// no object: environments, textures that randomizers choose from.
  std::vector<Labels> labels;
  /// Name and SHA-256 (hex) of every file that it consists of; empty for "scheme:rest".
  std::vector<std::pair<std::string, std::string>> files;
};

/// Captures in a row that are the frames of a clip.
struct DatasetClip {
  int first = 0;  ///< Capture::index of its first frame.
  int count = 0;
  double fps = 30.0;
};
/// The place of a capture in one of the clips, which ascend.
DIORAMA_SDK_API std::optional<ClipFrame> clip_frame(std::span<const DatasetClip> clips,
                                                    int capture);

/// What a writer knows of the whole dataset before the first capture. Equal in every shard.
struct DatasetInfo {
  std::uint64_t seed = 0;
  int capture_count = 0;  ///< In the whole job.
  std::vector<std::string> camera_names;
  /// Every distinct label set that the job's objects carry, sorted; environments may add more.
  std::vector<Labels> labels;
  /// Names of the keypoints that objects with these labels are to have, in the job's order; label
  /// sets without keypoints are left out.
  std::vector<std::pair<Labels, std::vector<std::string>>> keypoints;
  std::string resolved_job;  ///< YAML text; running it gives the same dataset.
  std::string program_version;
  std::vector<std::pair<std::string, std::string>> plugin_versions;
  std::vector<DatasetAsset> assets;  ///< Sorted by name.
  std::vector<DatasetClip> clips;    ///< By ClipFrame::clip; captures may be in none of them.
  // Of data that were a dataset before: what writers would otherwise choose themselves.
  std::vector<std::string> classes;            ///< Class list in its order; empty: not settled.
  std::optional<std::vector<int>> validation;  ///< Captures kept for validation, ascending.
};

/// Where a writer's files go. The host owns the disk: a capture's files appear all together or not
/// at all, by atomic rename, and a full disk ends the run with the dataset resumable. Paths are
/// relative, '/' separated, below the writer's own output folder; ".." and absolute paths throw.
class DIORAMA_SDK_API DatasetFiles {
 public:
  virtual ~DatasetFiles();
  virtual void add(std::string_view path, std::vector<std::byte> bytes) = 0;
  void add_text(std::string_view path, std::string_view text);
  /// Puts bytes at the end of a file, which begins empty. The host keeps little of it in memory:
  /// for large files that are made piece by piece. Several may grow by turns. A path is either
  /// added or appended to.
  virtual void append(std::string_view path, std::span<const std::byte> bytes) = 0;
  void append_text(std::string_view path, std::string_view text);
  /// In finish(): puts what a capture kept (CaptureFiles::keep) at the end of a file, as append()
  /// does. Elsewhere, and for captures that kept nothing, throws.
  virtual void append_kept(std::string_view path, int capture) = 0;
};

/// The files of one capture, and one record: text (without line breaks, JSON by habit) that the
/// host keeps and hands to finish() in capture order, over resumed runs and merged shards.
class DIORAMA_SDK_API CaptureFiles : public DatasetFiles {
 public:
  ~CaptureFiles() override;
  virtual void record(std::string_view line) = 0;
  /// Puts bytes at the end of what the capture keeps for finish(): content of files that captures
  /// share. It is as safe as files are, and no part of the dataset; it goes once that is finished.
  virtual void keep(std::span<const std::byte> bytes) = 0;
};

/// The records of all captures in capture order; captures without a record are left out.
using RecordVisitor = std::function<void(int capture, std::string_view line)>;
using RecordReader = std::function<void(const RecordVisitor&)>;

/// Turns captures into files. begin() and finish() run on the main thread.
class DIORAMA_SDK_API Writer : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Writer;

  ~Writer() override;

  /// Channels that write() reads, and annotations: "instances" (Frame::instances and their tight
  /// boxes), "visibility" (Instance::visibility), "amodal_mask" (the masks therein),
  /// "occlusion_order" (Frame::occlusions).
  virtual NameSet needs() const = 0;
  /// Files that do not depend on captures: class lists, metadata. Called once per run.
  virtual void begin(const DatasetInfo& dataset, DatasetFiles& files);
  /// Called from several threads at once and in any order; names must follow from capture.index.
  virtual void write(const Capture& capture, CaptureFiles& files) const = 0;
  /// Called once all captures of the job are there.
  virtual void finish(const RecordReader& records, DatasetFiles& files);
};

}  // namespace diorama
