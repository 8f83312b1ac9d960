// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/writer.h"
#include "writer_bop/bop_model.h"
#include "writer_support/training_data.h"

namespace diorama {

/// The BOP format (bop.felk.cvut.cz, "bop_toolkit" docs/bop_datasets_format.md):
///
///     dataset.json camera.json objects.json test_targets_bop19.json test_targets_bop24.json
///     models/models_info.json models/obj_000001.ply
///     {train_pbr,test}/000000/rgb/000012.png  depth/  mask/000012_000000.png  mask_visib/
///     {train_pbr,test}/000000/scene_camera.json  scene_gt.json  scene_gt_info.json
///
/// An image id is one capture; validation captures form the split "test". With several cameras each
/// is a scene of its own (`layout: scenes`), or they are sensors of scene 0 and their names stand
/// behind those of folders and files: rgb_cam_0/, scene_gt_cam_0.json (`layout: cameras`, the
/// format's [_CAMTYPE]). Beside camera.json, which is that of the first camera, there is then a
/// camera_cam_0.json of each.
///
/// Millimetres; camera axes x right, y down, z forward; rotations row by row. Counts and bbox_obj
/// are those of the toolkit: of the whole silhouette, as far as one image size outside of the
/// picture; widths of boxes are differences of first and last pixel. Depth is 16 bit in units of
/// depth_scale millimetres, 0: nothing or out of range.
///
/// obj_id counts from 1 over classes and, where objects of one class have several models, over
/// those. BOP's poses know no scale, so a model is as large as its objects: the first scale that
/// occurs has the model's own obj_id, each further one an id behind all others, `unscaled_as` in
/// models_info says of which. A class of the environment has no model: its entry in models_info is
/// the box of all its instances, whose own ones are `bounds_min` and `bounds_max` in scene_gt.
/// Lenses other than pinholes stand under `lens` in scene_camera. Symmetries are those of the
/// shape, see find_symmetries().
class BopWriter final : public Writer {
 public:
  struct Params {
    TrainingParams training;
    double depth_scale = 0.1;
    std::string layout = "scenes";
    int max_models = 1000;
    double symmetry_tolerance = 0.01;

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
  };

  /// Which objects came in which sizes, over all captures that this writer has seen.
  struct Sizes {
    std::mutex mutex;
    std::set<std::pair<int, std::array<double, 3>>> seen;
  };
  class Finish;

  void find_objects(const DatasetInfo& dataset);
  BopModel load_model(const std::string& asset) const;
  int object_id(const TrainingObject& object) const;
  void note_size(int id, const Vec3& scale) const;
  /// "test/000001/" or "train_pbr/000000/", and what stands behind names in it.
  std::string scene_folder(int capture, std::size_t camera) const;
  std::string camera_suffix(std::size_t camera) const;
  Json write_frame(const Capture& capture, std::size_t camera, CaptureFiles& files) const;
  void add_masks(const Frame& frame, const Instance& instance, const std::string& folder,
                 const std::string& suffix, const std::string& name, CaptureFiles& files) const;

  Params params_;
  Host& host_;
  TrainingData training_;
  std::vector<Object> objects_;  ///< By obj_id, from 1.
  std::vector<std::string> cameras_;
  std::unique_ptr<Sizes> sizes_;
};

}  // namespace diorama
