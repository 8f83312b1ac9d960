// SPDX-License-Identifier: Apache-2.0
// write_sample_datasets FOLDER: the sample scene by every writer, one folder each. What Python's
// readers make of it is checked by read_back.py.
#include <filesystem>
#include <fstream>
#include <iostream>

#include "framework/lint/encoding_host.h"
#include "plugins/writer_support/sample_dataset.h"
#include "writer_basic/basic_writer.h"
#include "writer_bop/bop_writer.h"
#include "writer_coco/coco_writer.h"
#include "writer_data_visualization/data_visualization_writer.h"
#include "writer_hdf5/hdf5_writer.h"
#include "writer_kitti/kitti_writer.h"
#include "writer_pose/pose_writer.h"
#include "writer_voc/voc_writer.h"
#include "writer_webdataset/webdataset_writer.h"
#include "writer_yolo/yolo_writer.h"

using namespace diorama;

namespace {

template <class W>
void write(const std::filesystem::path& folder, typename W::Params params = {}) {
  test::EncodingHost host;
  const test::MemoryFiles files = test::write_sample<W>(std::move(params), host);
  for (const auto& [path, bytes] : files.files) {
    std::filesystem::create_directories((folder / path).parent_path());
    std::ofstream out(folder / path, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    if (!out) throw std::runtime_error((folder / path).string() + ": cannot be written");
  }
}

BasicWriter::Params everything() {
  BasicWriter::Params p;
  p.rgb = p.bounding_box_2d_tight = p.bounding_box_2d_loose = p.semantic_segmentation = true;
  p.instance_id_segmentation = p.instance_segmentation = p.distance_to_camera = true;
  p.distance_to_image_plane = p.bounding_box_3d = p.occlusion = p.normals = true;
  p.motion_vectors = p.camera_params = p.pointcloud = p.colorize_depth = true;
  return p;
}

Value look_of(const char* background, const char* color) {
  Value look = Value::make_map();
  look.set("background", Value::text(background));
  look.set("fill", Value::text(color));
  look.set("width", Value::integer(1));
  return look;
}

void write_all(const std::filesystem::path& folder) {
  write<BasicWriter>(folder / "basic", everything());
  BasicWriter::Params raw = everything();
  raw.use_common_output_dir = true;
  raw.colorize_semantic_segmentation = raw.colorize_instance_segmentation = false;
  raw.colorize_instance_id_segmentation = false;
  write<BasicWriter>(folder / "basic_raw", raw);
  PoseWriter::Params pose;
  pose.write_debug_images = pose.use_subfolders = true;
  write<PoseWriter>(folder / "pose", pose);
  DataVisualizationWriter::Params boxes;
  boxes.bounding_box_2d_tight = boxes.bounding_box_2d_loose = boxes.bounding_box_3d = true;
  boxes.bounding_box_2d_tight_params = look_of("rgb", "#00ff0040");
  boxes.bounding_box_3d_params = look_of("rgb", "red");
  write<DataVisualizationWriter>(folder / "boxes", boxes);
  write<CocoWriter>(folder / "coco");
  for (const char* task : {"detect", "segment", "pose", "obb"}) {
    YoloWriter::Params yolo;
    yolo.task = task;
    write<YoloWriter>(folder / (std::string("yolo_") + task), yolo);
  }
  write<KittiWriter>(folder / "kitti");
  write<VocWriter>(folder / "voc");
  write<BopWriter>(folder / "bop");
  write<WebDatasetWriter>(folder / "webdataset");
  write<Hdf5Writer>(folder / "hdf5");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "write_sample_datasets FOLDER\n";
    return 2;
  }
  try {
    write_all(argv[1]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
