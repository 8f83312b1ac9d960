// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/channel_list.h"
#include "writer_support/training_data.h"

namespace diorama {

/// One HDF5 file per picture with the data set names of BlenderProc (Denninger et al., JOSS 2023):
///
///     dataset.json {train,val}/000012_cam_0.hdf5
///
/// colors (h, w, 3) uint8; depth (h, w) float32, metres along the viewing axis, infinity: nothing;
/// normals (h, w, 3) float32, world space, (n + 1) / 2; instance_segmaps (h, w) uint16, the
/// object's place in instance_attribute_maps (JSON text) + 1; category_id_segmaps (h, w) uint16,
/// class index + 1; cam_K (3, 3), world_from_camera (4, 4) float64; lens: JSON text, see
/// lens_json(). 0 is background in both segmentations. Each of `channels` is a data set of its own
/// name, as the channel has it.
class Hdf5Writer final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    bool depth = true;
    bool normals = true;
    ChannelList channels;

    void visit(ParamVisitor& v);
  };

  Hdf5Writer(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;

 private:
  void write_frame(const Capture& capture, const Frame& frame, CaptureFiles& files,
                   const std::string& path) const;

  Params params_;
  TrainingData training_;
};

}  // namespace diorama
