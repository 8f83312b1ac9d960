// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "diorama/reader.h"
#include "reader_support/frame_reading.h"
#include "reader_support/npy_array.h"
#include "reader_support/stored_files.h"
#include "writer_basic/basic_files.h"

namespace diorama {

/// Reads the files of one camera in one capture, checks them against each other, and makes a frame.
class BasicFrameReading {
 public:
  BasicFrameReading(const BasicFiles& names, std::string product, int number, const NameSet& wanted,
                    StoredFiles& files)
      : names_(names),
        product_(std::move(product)),
        number_(number),
        wanted_(wanted),
        files_(files) {}

  /// Nothing when no file tells the picture's size.
  std::optional<Frame> read(const std::string& camera, FrameSources& sources);

 private:
  /// A segmentation picture: ids from 2 on where its JSON file names objects, 0 background, 1
  /// unlabelled.
  struct Segmentation {
    std::string file;
    Image<std::uint32_t> ids;
    std::map<std::uint32_t, std::uint32_t> id_of_key;  ///< By the picture's own value.
    std::map<std::uint32_t, Json> entries;             ///< What the JSON file says, by id.
  };

  bool wants(std::string_view name) const { return wanted_.contains(name); }
  /// Tables alone tell boxes and labels, of what has a box.
  /// Boxes say which objects there are, without a look at any pixel.
  bool wants_pixels_of_objects() const {
    const bool tell_boxes = !path("bounding_box_2d_tight_prim_paths.json").empty() && has_size_;
    return wants(kInstanceId.name) || (wants(kHoldsInstances) && !tell_boxes);
  }
  std::string path(std::string_view kind) const { return names_.path(product_, number_, kind); }
  /// The first file that tells a size tells that of the frame; false for another one.
  bool note_size(int width, int height, const std::string& file);

  void read_camera();
  void check_camera(const Json& json, const Mat4& clip_from_camera, const std::string& file);
  void read_joints();
  void read_color();
  void read_distances();
  void check_drawn(const StoredPicture& drawn, const Image<float>& distances,
                   const std::string& file);
  void read_normals();
  void read_motion();
  void read_flows();
  void read_velocities();
  std::optional<StoredArray> pixel_array(const std::string& file, std::size_t values,
                                         const char* type = "<f4");

  std::optional<Segmentation> read_segmentation(std::string_view picture, std::string_view mapping);
  /// In the file's order.
  std::vector<std::pair<std::uint32_t, Json>> read_keys(const std::string& file);
  void read_instances();
  void read_leaves();
  void check_semantics();
  void set_ids(const Segmentation& from);

  struct BoxRows {
    StoredArray array;
    std::vector<std::string> paths;
    std::vector<Labels> labels;
    std::vector<std::optional<double>> ratios;
  };
  std::optional<BoxRows> read_rows(const std::string& name);
  void read_boxes();
  /// Calls `take` with each row's object and its box in pixels; false without rows.
  template <class Take>
  bool read_pixel_boxes(const std::string& name, Take&& take);
  void read_tight();
  void read_loose();
  void read_3d();
  void take_row(const BoxRows& rows, std::size_t row, const std::string& file, Instance& instance);
  void read_occlusion();
  void read_points();
  void check_point_places(const StoredArray& points, const std::vector<std::size_t>& pixels,
                          const std::string& file);
  void set_visibility();

  Instance& instance(const std::string& path);

  const BasicFiles& names_;
  std::string product_;
  int number_;
  const NameSet& wanted_;
  StoredFiles& files_;
  Frame frame_;
  FrameSources sources_;
  bool has_size_ = false;
  std::string size_file_;
  std::map<std::string, std::size_t> place_of_path_;  ///< In Frame::instances.
  std::map<std::string, double> ratio_of_path_;
  std::map<std::string, PixelBox> loose_of_path_;
  std::map<std::string, Labels> labels_of_path_;
  std::optional<Segmentation> instances_;
  std::map<std::uint32_t, std::int64_t> visible_;  ///< By id.
};

}  // namespace diorama
