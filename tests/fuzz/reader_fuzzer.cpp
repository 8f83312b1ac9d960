// SPDX-License-Identifier: Apache-2.0
//
// The readers of datasets and the checks on what they give. An input is a small dataset: its first
// byte chooses the reader, then come files, each a name, a line break and its content, ended by the
// byte 0x1e. Findings and Error(Asset) are fine; crashing, hanging, taking much memory and other
// exceptions are not.
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>

#include "diorama/error.h"
#include "framework/datasets/frame_checks.h"
#include "framework/images/image_codecs.h"
#include "writer_basic/basic_reader.h"
#include "writer_bop/bop_reader.h"
#include "writer_coco/coco_reader.h"
#include "writer_data_visualization/data_visualization_reader.h"
#include "writer_hdf5/hdf5_reader.h"
#include "writer_imagefolder/image_folder_reader.h"
#include "writer_kitti/kitti_reader.h"
#include "writer_mot/mot_reader.h"
#include "writer_pose/pose_reader.h"
#include "writer_voc/voc_reader.h"
#include "writer_webdataset/webdataset_reader.h"
#include "writer_yolo/yolo_reader.h"

namespace {

using namespace diorama;
namespace fs = std::filesystem;

/// Decodes pictures within a small budget; readers need nothing else of a host.
class DecodingHost final : public Host {
 public:
  void log(LogLevel, std::string_view) override {}
  fs::path resolve(std::string_view asset) const override { return asset; }
  std::vector<fs::path> list_assets(std::string_view, std::span<const std::string>) const override {
    return {};
  }
  NodeId load_asset(std::string_view, Scene&, NodeId) override { std::abort(); }
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte> bytes,
                                                std::string_view name) const override {
    return decode_image(bytes, name, std::size_t(64) << 20);
  }
  std::shared_ptr<const Texture> read_texture(const fs::path&) const override { std::abort(); }
  std::vector<std::byte> encode_image(const ImageView&, ImageFormat) const override {
    std::abort();
  }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }
};

template <class R>
std::unique_ptr<Reader> make(Host& host) {
  return std::make_unique<R>(typename R::Params(), host);
}

// Seeds begin with places in this list.
constexpr std::array kReaders{
    &make<BasicReader>, &make<CocoReader>,        &make<DataVisualizationReader>,
    &make<KittiReader>, &make<VocReader>,         &make<YoloReader>,
    &make<PoseReader>,  &make<BopReader>,         &make<WebDatasetReader>,
    &make<Hdf5Reader>,  &make<ImageFolderReader>, &make<MotReader>};

/// One folder for all inputs of this process.
const fs::path& scratch() {
  static const fs::path folder =
      fs::temp_directory_path() / ("diorama_reader_fuzzer_" + std::to_string(getpid()));
  return folder;
}

/// Relative, of plain parts; at most four deep.
bool is_usable(const fs::path& name) {
  int depth = 0;
  for (const fs::path& part : name) {
    const std::string text = part.string();
    if (text.empty() || text.starts_with('.') || text.size() > 60 || ++depth > 4) return false;
    if (text.find('\0') != text.npos) return false;
  }
  return depth > 0 && name.is_relative();
}

void write_files(std::string_view text) {
  while (!text.empty()) {
    const std::string_view file = text.substr(0, text.find('\x1e'));
    text.remove_prefix(std::min(file.size() + 1, text.size()));
    const std::size_t cut = file.find('\n');
    if (cut == file.npos) continue;
    const fs::path name(file.substr(0, cut));
    if (!is_usable(name)) continue;
    std::error_code failed;
    fs::create_directories((scratch() / name).parent_path(), failed);
    std::ofstream(scratch() / name, std::ios::binary) << file.substr(cut + 1);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  DecodingHost host;
  const auto reader = kReaders[data[0] % kReaders.size()](host);
  fs::remove_all(scratch());
  fs::create_directories(scratch());
  write_files({reinterpret_cast<const char*>(data) + 1, size - 1});
  reader->recognise(scratch());
  try {
    const auto dataset = reader->open(scratch());
    const StoredInfo& info = dataset->info();
    CaptureComparison comparison(info, true);
    ReadLog log;
    for (std::size_t i = 0; i < std::min<std::size_t>(info.captures.size(), 4); ++i) {
      dataset->read(i, {});
      StoredCapture stored = dataset->read(i, info.holds);
      if (stored.capture.index != info.captures[i]) std::abort();
      check_frames(info, stored);
      comparison.add(stored, log);
    }
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::Asset) std::abort();
  }
  fs::remove_all(scratch());
  return 0;
}
