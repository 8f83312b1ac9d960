// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/every_format.h"

#include "framework/datasets/frame_copy.h"
#include "plugins/writer_support/sample_dataset.h"
#include "writer_basic/basic_reader.h"
#include "writer_bop/bop_reader.h"
#include "writer_bop/bop_writer.h"
#include "writer_coco/coco_reader.h"
#include "writer_coco/coco_writer.h"
#include "writer_data_visualization/data_visualization_reader.h"
#include "writer_data_visualization/data_visualization_writer.h"
#include "writer_hdf5/hdf5_reader.h"
#include "writer_hdf5/hdf5_writer.h"
#include "writer_imagefolder/image_folder_reader.h"
#include "writer_imagefolder/image_folder_writer.h"
#include "writer_kitti/kitti_reader.h"
#include "writer_kitti/kitti_writer.h"
#include "writer_mot/mot_reader.h"
#include "writer_mot/mot_writer.h"
#include "writer_pose/pose_reader.h"
#include "writer_pose/pose_writer.h"
#include "writer_voc/voc_reader.h"
#include "writer_voc/voc_writer.h"
#include "writer_webdataset/webdataset_reader.h"
#include "writer_webdataset/webdataset_writer.h"
#include "writer_yolo/yolo_reader.h"
#include "writer_yolo/yolo_writer.h"

namespace diorama::test {
namespace {

template <class W>
SampleFormat format(std::string name, typename W::Params params = {}) {
  const auto write = [params](Host& host, const DatasetInfo& dataset,
                              const std::vector<const Capture*>& captures) {
    W writer(params, host);
    return write_dataset(writer, dataset, captures);
  };
  return {std::move(name), write};
}

template <class R>
DatasetReaders::Entry reader(const char* type, Host& host) {
  return {type, R({}, host).patterns(),
          [&host] { return std::make_unique<R>(typename R::Params(), host); }};
}

Value look_of(const char* background, const char* color) {
  Value look = Value::make_map();
  look.set("background", Value::text(background));
  look.set("fill", Value::text(color));
  look.set("width", Value::integer(1));
  return look;
}

BasicWriter::Params raw_ids() {
  BasicWriter::Params params = everything();
  params.use_common_output_dir = true;
  params.colorize_semantic_segmentation = params.colorize_instance_segmentation = false;
  params.colorize_instance_id_segmentation = false;
  return params;
}

PoseWriter::Params pose(const char* layout) {
  PoseWriter::Params params;
  params.write_debug_images = params.use_subfolders = true;
  params.format = layout;
  return params;
}

DataVisualizationWriter::Params boxes() {
  DataVisualizationWriter::Params params;
  params.bounding_box_2d_tight = params.bounding_box_2d_loose = params.bounding_box_3d = true;
  params.bounding_box_2d_tight_params = look_of("rgb", "#00ff0040");
  params.bounding_box_3d_params = look_of("rgb", "red");
  return params;
}

YoloWriter::Params yolo(const char* task) {
  YoloWriter::Params params;
  params.task = task;
  return params;
}

CocoWriter::Params polygons() {
  CocoWriter::Params params;
  params.segmentation = "polygon";
  return params;
}

BopWriter::Params one_scene() {
  BopWriter::Params params;
  params.layout = "cameras";
  return params;
}

}  // namespace

DatasetReaders every_reader(Host& host) {
  return DatasetReaders(
      {reader<BasicReader>("BasicReader", host), reader<BopReader>("BopReader", host),
       reader<CocoReader>("CocoReader", host),
       reader<DataVisualizationReader>("DataVisualizationReader", host),
       reader<Hdf5Reader>("Hdf5Reader", host), reader<ImageFolderReader>("ImageFolderReader", host),
       reader<KittiReader>("KittiReader", host), reader<MotReader>("MotReader", host),
       reader<PoseReader>("PoseReader", host), reader<VocReader>("VocReader", host),
       reader<WebDatasetReader>("WebDatasetReader", host), reader<YoloReader>("YoloReader", host)});
}

WebDatasetWriter::Params shards_of_two() {
  WebDatasetWriter::Params p;
  p.shard_captures = 2;
  return p;
}

BasicWriter::Params everything() {
  BasicWriter::Params p;
  p.rgb = p.bounding_box_2d_tight = p.bounding_box_2d_loose = p.semantic_segmentation = true;
  p.instance_id_segmentation = p.instance_segmentation = p.distance_to_camera = true;
  p.distance_to_image_plane = p.bounding_box_3d = p.occlusion = p.normals = true;
  p.motion_vectors = p.camera_params = p.pointcloud = p.colorize_depth = true;
  return p;
}

std::vector<SampleFormat> every_format() {
  return {format<BasicWriter>("basic", everything()),
          format<BasicWriter>("basic_raw", raw_ids()),
          format<PoseWriter>("pose", pose("none")),
          format<PoseWriter>("pose_dope", pose("dope")),
          format<PoseWriter>("pose_centerpose", pose("centerpose")),
          format<DataVisualizationWriter>("boxes", boxes()),
          format<CocoWriter>("coco"),
          format<CocoWriter>("coco_polygon", polygons()),
          format<YoloWriter>("yolo_detect", yolo("detect")),
          format<YoloWriter>("yolo_segment", yolo("segment")),
          format<YoloWriter>("yolo_pose", yolo("pose")),
          format<YoloWriter>("yolo_obb", yolo("obb")),
          format<KittiWriter>("kitti"),
          format<VocWriter>("voc"),
          format<BopWriter>("bop"),
          format<BopWriter>("bop_cameras", one_scene()),
          format<WebDatasetWriter>("webdataset"),
          format<WebDatasetWriter>("webdataset_shards", shards_of_two()),
          format<Hdf5Writer>("hdf5"),
          format<ImageFolderWriter>("imagefolder")};
}

SampleClip sample_clip() {
  SampleClip clip{sample_dataset(SampleScene(8, 6)), {}};
  const int count = int(sample_captures().size());
  clip.dataset.clips = {{0, count, 10.0}};
  for (const Capture& capture : sample_captures()) {
    Capture& frame = clip.frames.emplace_back();
    frame.index = capture.index;
    frame.clip = {0, int(clip.frames.size()) - 1, count, 10.0};
    for (const Frame& seen : capture.frames) {
      Frame& own = frame.frames.emplace_back(copy_of(seen));
      if (frame.clip->frame > 0) continue;
      own.set(kMotion, Image<Vec2f>(own.camera.width, own.camera.height, Vec2f::Zero()));
    }
  }
  return clip;
}

std::vector<const Capture*> SampleClip::captures() const {
  std::vector<const Capture*> list;
  for (const Capture& frame : frames) list.push_back(&frame);
  return list;
}

std::vector<SampleFormat> formats_of_clips() {
  CocoWriter::Params videos;
  videos.youtube_vis = true;
  KittiWriter::Params tracking;
  tracking.layout = "tracking";
  return {format<BasicWriter>("basic", everything()), format<CocoWriter>("coco", videos),
          format<KittiWriter>("kitti", tracking), format<MotWriter>("mot"),
          format<PoseWriter>("pose")};
}

}  // namespace diorama::test
