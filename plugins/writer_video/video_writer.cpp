// SPDX-License-Identifier: Apache-2.0
#include "writer_video/video_writer.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <variant>
#include <vector>

#include "diorama/error.h"
#include "opencv_support/color_maps.h"
#include "writer_support/python_json.h"
#include "writer_support/replicator.h"
#include "writer_support/segmentation_colors.h"
#include "writer_video/h264_encoder.h"
#include "writer_video/mp4_file.h"

namespace diorama {
namespace {

constexpr std::array kShown{kColor.name, kInstanceId.name, kMotion.name, kFlowForward.name,
                            kFlowBackward.name};

void draw(const Image<Rgba8>& from, int left, int top, Image<Rgba8>& into) {
  for (int y = 0; y < from.height(); ++y) {
    std::ranges::copy(from.row(y), into.row(top + y).begin() + left);
  }
}

}  // namespace

void VideoWriter::Params::visit(ParamVisitor& v) {
  v.param("channels", channels,
          {"Rows of the video: color, instance_id (one colour per track), motion, flow_forward, "
           "flow_backward."});
  v.param("crf", crf, {"Loss: 0 none, 18 hardly to be seen, 51 worst.", "", 0, 51});
  v.param("full_flow_px", full_flow_px, {"What moves so far is of full colour.", "px", 0.1, 1e4});
}

VideoWriter::VideoWriter(Params params, Host& host) : params_(std::move(params)), host_(host) {
  for (const std::string& channel : params_.channels) {
    if (std::ranges::find(kShown, channel) != kShown.end()) continue;
    throw Error(ErrorKind::Config,
                "channels: expected color, instance_id, motion, flow_forward or "
                "flow_backward, found '" +
                    channel + "'");
  }
  if (params_.channels.empty()) {
    throw Error(ErrorKind::Config, "channels: expected one at least, such as color");
  }
}

NameSet VideoWriter::needs() const { return {params_.channels.begin(), params_.channels.end()}; }

void VideoWriter::begin(const DatasetInfo& dataset, DatasetFiles&) {
  clips_ = dataset.clips;
  if (clips_.empty()) {
    host_.log(LogLevel::Warning,
              "VideoWriter: the dataset has no clips, so there are no videos; a step 'record' of "
              "the timeline makes them");
  }
}

Image<Rgba8> VideoWriter::shown(const Frame& frame, const std::string& channel) const {
  if (channel == kColor.name) return frame.get(kColor);
  if (channel != kInstanceId.name) {
    const auto& flow = std::get<Image<Vec2f>>(frame.image_named(channel));
    return motion_colors(flow, float(params_.full_flow_px));
  }
  const auto& ids = frame.get(kInstanceId);
  Image<Rgba8> picture(ids.width(), ids.height(), Rgba8{});
  std::ranges::transform(ids.pixels(), picture.pixels().begin(), segmentation_color);
  return picture;
}

/// Of even width and height, as colours have half the resolution.
Image<Rgba8> VideoWriter::page(const Capture& capture) const {
  int width = 0;
  int height = 0;
  for (const Frame& frame : capture.frames) {
    width += frame.camera.width;
    height = std::max(height, frame.camera.height);
  }
  const int rows = int(params_.channels.size());
  Image<Rgba8> page(width + width % 2, height * rows + height * rows % 2, Rgba8{0, 0, 0, 255});
  for (int row = 0; row < rows; ++row) {
    int left = 0;
    for (const Frame& frame : capture.frames) {
      draw(shown(frame, params_.channels[std::size_t(row)]), left, row * height, page);
      left += frame.camera.width;
    }
  }
  return page;
}

void VideoWriter::write(const Capture& capture, CaptureFiles& files) const {
  if (!capture.clip || capture.frames.empty()) return;
  const Image<Rgba8> picture = page(capture);
  const H264Picture encoded = encode_h264(picture, params_.crf, capture.clip->frame % 2 != 0);
  files.keep(encoded.data);
  Json record{{"size", encoded.data.size()}};
  if (capture.clip->frame == 0) {
    record["width"] = picture.width();
    record["height"] = picture.height();
    record["config"] = encoded.config;
  }
  files.record(record.dump());
}

void VideoWriter::finish(const RecordReader& records, DatasetFiles& files) {
  std::vector<Mp4Track> tracks(clips_.size());
  records([&](int capture, std::string_view line) {
    const auto at = clip_frame(clips_, capture);
    if (!at) return;
    Mp4Track& track = tracks[std::size_t(at->clip)];
    const Json record = Json::parse(line);
    track.sizes.push_back(record.at("size").get<std::uint32_t>());
    if (!record.contains("config")) return;
    track.width = record.at("width").get<int>();
    track.height = record.at("height").get<int>();
    track.fps = at->fps;
    track.config = record.at("config").get<std::vector<std::byte>>();
  });
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (tracks[i].config.empty()) continue;
    const std::string path = "clip_" + padded(int(i), 4) + ".mp4";
    files.append(path, mp4_front(tracks[i]));
    for (int k = 0; k < int(tracks[i].sizes.size()); ++k) {
      files.append_kept(path, clips_[i].first + k);
    }
    files.append(path, mp4_index(tracks[i]));
  }
}

}  // namespace diorama
