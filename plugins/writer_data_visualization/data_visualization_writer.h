// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "diorama/config.h"
#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/semantic_filter.h"

namespace diorama {

/// Pictures of 2-D and 3-D boxes, named as Replicator's DataVisualizationWriter 0.1.0 names them,
/// and of masks, distances and motion, which that one does not have.
class DataVisualizationWriter final : public Writer {
 public:
  struct Params {
    bool bounding_box_2d_tight = false;
    bool bounding_box_2d_loose = false;
    bool bounding_box_3d = false;
    bool instance_masks = false;
    bool distance_to_image_plane = false;
    bool motion = false;
    bool labels = true;
    Value bounding_box_2d_tight_params;
    Value bounding_box_2d_loose_params;
    Value bounding_box_3d_params;
    Value instance_masks_params;
    int frame_padding = 4;

    void visit(ParamVisitor& v);
  };

  /// How one kind of picture is drawn.
  struct Look {
    enum class Background { None, Rgb, Normals };
    Background background = Background::None;
    std::optional<Rgba8> fill;
    std::optional<Rgba8> outline;
    int width = 1;
  };

  DataVisualizationWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  /// A null optional when this kind of picture is not wanted.
  std::optional<Look> tight_;
  std::optional<Look> loose_;
  std::optional<Look> cuboid_;
  std::optional<Look> masks_;
  bool has_distance_ = false;
  bool has_motion_ = false;
  bool has_labels_ = true;
  Host& host_;
  SemanticFilter filter_;
  int frame_padding_;
};

}  // namespace diorama
