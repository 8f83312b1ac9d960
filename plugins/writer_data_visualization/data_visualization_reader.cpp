// SPDX-License-Identifier: Apache-2.0
#include "writer_data_visualization/data_visualization_reader.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "diorama/error.h"
#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "DataVisualizationWriter";
constexpr std::string_view kProduct = "rp_";
constexpr std::string_view kMark = "_fast_";

/// "bounding_box_3d_fast_0012.png".
struct Overlay {
  std::string kind;    ///< "bounding_box_3d".
  std::string ending;  ///< "_fast_0012.png".
  int capture = 0;
};

std::optional<Overlay> overlay_of(const std::string& name) {
  const std::size_t cut = name.rfind(kMark);
  if (cut == name.npos || !name.ends_with(".png")) return std::nullopt;
  Overlay overlay{name.substr(0, cut), name.substr(cut), 0};
  const char* first = name.data() + cut + kMark.size();
  const char* last = name.data() + name.size() - 4;
  const auto [end, error] = std::from_chars(first, last, overlay.capture);
  if (error != std::errc() || end != last || overlay.capture < 0) return std::nullopt;
  return overlay;
}

class OverlayDataset final : public StoredDataset {
 public:
  OverlayDataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    StoredFiles files(folder_, host_, log_);
    std::set<int> captures;
    for (const std::string& product : names_in(folder_, true)) {
      std::size_t known = 0;
      for (const std::string& name : names_in(folder_ / product)) {
        const auto overlay = overlay_of(name);
        files.check(overlay.has_value(), kReadable, product + "/" + name, "",
                    "is no picture of a capture", "a name such as bounding_box_3d_fast_0000.png");
        if (!overlay) continue;
        kinds_.insert(overlay->kind);
        endings_[overlay->capture] = overlay->ending;
        captures.insert(overlay->capture);
        ++known;
      }
      if (known > 0) products_.push_back(product);
    }
    if (products_.empty() && metadata_writer(folder_) != kFormat) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no pictures with boxes");
    }
    if (files.has("metadata.txt")) {
      files.check(metadata_writer(folder_) == kFormat, kReadable, "metadata.txt", "",
                  "does not say that DataVisualizationWriter wrote this");
    }
    info_.format = kFormat;
    info_.captures.assign(captures.begin(), captures.end());
    for (const std::string& product : products_) {
      info_.camera_names.push_back(product.starts_with(kProduct) ? product.substr(kProduct.size())
                                                                 : product);
    }
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }

  StoredCapture read(std::size_t i, const NameSet&) const override {
    StoredCapture stored;
    const int capture = info_.captures.at(i);
    stored.capture.index = capture;
    for (std::size_t k = 0; k < products_.size(); ++k) {
      StoredFiles files(folder_, host_, stored.log, capture, info_.camera_names[k]);
      if (auto frame = read_frame(products_[k], endings_.at(capture), files)) {
        frame->camera_name = info_.camera_names[k];
        stored.capture.frames.push_back(std::move(*frame));
        stored.files.emplace_back();
      }
    }
    return stored;
  }

 private:
  std::optional<Frame> read_frame(const std::string& product, const std::string& ending,
                                  StoredFiles& files) const {
    const auto path = [&](const std::string& kind) { return product + "/" + kind + ending; };
    const auto is_there = [&](const std::string& kind) { return files.has(path(kind)); };
    // Nothing is drawn of a frame without objects.
    if (std::ranges::none_of(kinds_, is_there)) return std::nullopt;
    std::optional<Frame> frame;
    for (const std::string& kind : kinds_) {
      files.check(is_there(kind), kMissing, path(kind), "", "the file is not there",
                  "other pictures of this frame are");
      if (!is_there(kind)) continue;
      const auto picture = frame ? files.picture_of_size(path(kind), frame->camera.width,
                                                         frame->camera.height, "the frame's other")
                                 : files.picture(path(kind));
      if (!picture || frame) continue;
      frame.emplace();
      frame->camera.width = picture->width();
      frame->camera.height = picture->height();
    }
    return frame;
  }

  fs::path folder_;
  const Host& host_;
  std::vector<std::string> products_;
  std::set<std::string> kinds_;
  std::map<int, std::string> endings_;
  StoredInfo info_;
  ReadLog log_;
};

}  // namespace

std::vector<std::string> DataVisualizationReader::patterns() const {
  return {"metadata.txt", "*/*_fast_*.png"};
}

Recognition DataVisualizationReader::recognise(const fs::path& folder) const {
  const std::string said = metadata_writer(folder);
  if (said == kFormat) return Recognition::ByName;
  if (!said.empty()) return Recognition::No;
  for (const std::string& product : names_in(folder, true)) {
    for (const std::string& name : names_in(folder / product)) {
      if (overlay_of(name)) return Recognition::ByFiles;
    }
  }
  return Recognition::No;
}

std::unique_ptr<const StoredDataset> DataVisualizationReader::open(const fs::path& folder) const {
  return std::make_unique<OverlayDataset>(folder, host_);
}

}  // namespace diorama
