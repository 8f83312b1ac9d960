// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"

namespace diorama {

/// clip_0003.mp4: a clip as H.264 video, cameras side by side, one row per channel. For people to
/// look at: pictures lose detail, and the bytes depend on the version of the encoder, so they are
/// no part of what a dataset promises. Captures that are in no clip are left out.
class VideoWriter final : public Writer {
 public:
  struct Params {
    std::vector<std::string> channels{"color"};
    int crf = 20;
    double full_flow_px = 16.0;

    void visit(ParamVisitor& v);
  };

  VideoWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  Image<Rgba8> shown(const Frame& frame, const std::string& channel) const;
  Image<Rgba8> page(const Capture& capture) const;

  Params params_;
  Host& host_;
  std::vector<DatasetClip> clips_;
};

}  // namespace diorama
