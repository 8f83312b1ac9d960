// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The BOP format (bop.felk.cvut.cz, BOP-Webcam "bop_toolkit" docs/bop_datasets_format.md):
///
///     dataset.json camera.json objects.json test_targets_bop19.json
///     models/models_info.json models/obj_000001.ply
///     {train_pbr,test}/000000/rgb/000012.png  depth/  mask/000012_000000.png  mask_visib/
///     {train_pbr,test}/000000/scene_camera.json  scene_gt.json  scene_gt_info.json
///
/// A scene is one camera, an image id one capture; validation captures form the split "test".
/// Millimetres; camera axes x right, y down, z forward; rotations row by row. Poses map the model's
/// own space; where an object is scaled, `scale` holds the factors, to be applied first. Depth is
/// 16 bit in units of depth_scale millimetres, 0: nothing or out of range. obj_id counts
/// from 1 over classes and, where objects of one class have several models, over those. A class of
/// the environment has no model: its entry in models_info is the box of all its instances, whose
/// own ones are `bounds_min` and `bounds_max` in scene_gt. Lenses other than pinholes stand under
/// `lens` in scene_camera.
class BopWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    double depth_scale = 0.1;

    void visit(ParamVisitor& v);
  };

  BopWriter(Params params, Host& host);

  NameSet needs() const override;
  void begin(const DatasetInfo& dataset, DatasetFiles& files) override;
  void write(const Capture& capture, CaptureFiles& files) const override;
  void finish(const RecordReader& records, DatasetFiles& files) override;

 private:
  /// What an obj_id stands for.
  struct Object {
    int class_index = 0;
    std::string asset;  ///< Empty: without a model.
    Aabb bounds;        ///< Of the model, metres.
    Json info;          ///< Its entry in models_info; null without a model.
  };

  void add_objects(const DatasetInfo& dataset, DatasetFiles& files);
  int object_id(const TrainingObject& object) const;
  const char* split_folder(int capture) const;
  Json write_frame(const Capture& capture, std::size_t camera, CaptureFiles& files) const;
  void add_masks(const Frame& frame, const Instance& instance, const std::string& scene,
                 const std::string& name, CaptureFiles& files) const;

  Params params_;
  Host& host_;
  TrainingData training_;
  std::vector<Object> objects_;  ///< By obj_id, from 1.
};

}  // namespace diorama
