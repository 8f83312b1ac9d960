// SPDX-License-Identifier: Apache-2.0
#include "writer_data_visualization/data_visualization_writer.h"

#include <algorithm>

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/memory_files.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"

using namespace diorama;
using test::FakeHost;
using test::MemoryFiles;
using test::RawImage;
using test::SampleScene;

namespace {

const Capture& sample_capture() {
  static const Capture capture = test::ray_cast_capture(SampleScene(96, 64, 1), 1);
  return capture;
}

MemoryFiles write(const DataVisualizationWriter::Params& params) {
  FakeHost host;
  DataVisualizationWriter writer(params, host);
  return test::write_dataset(writer, test::sample_dataset(SampleScene(8, 6)), {&sample_capture()});
}

Value params_of(std::initializer_list<std::pair<const char*, Value>> entries) {
  Value map = Value::make_map();
  for (const auto& [key, value] : entries) map.set(key, value);
  return map;
}

bool is_color(const RawImage& image, int x, int y, const Rgba8& color) {
  for (int c = 0; c < 4; ++c) {
    if (image.at(x, y, c) != color[std::size_t(c)]) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("pictures lie in the camera's folder with the reference's names", "[writers]") {
  DataVisualizationWriter::Params params;
  params.bounding_box_2d_tight = params.bounding_box_2d_loose = params.bounding_box_3d = true;
  const MemoryFiles files = write(params);
  CHECK(files.paths() == std::set<std::string>{"metadata.txt",
                                               "rp_cam_0/bounding_box_2d_tight_fast_0001.png",
                                               "rp_cam_0/bounding_box_2d_loose_fast_0001.png",
                                               "rp_cam_0/bounding_box_3d_fast_0001.png"});
  CHECK(files.text("metadata.txt") == R"({"name": "DataVisualizationWriter", "version": "0.1.0", )"
                                      R"("replicator_global_seed:": 12})");
}

TEST_CASE("a 2-D box is drawn on the outermost pixels of its object", "[writers]") {
  DataVisualizationWriter::Params params;
  params.bounding_box_2d_tight = true;
  params.bounding_box_2d_tight_params = params_of({{"outline", Value::text("#010203")}});
  params.labels = false;
  const RawImage image =
      test::raw_image(write(params).bytes("rp_cam_0/bounding_box_2d_tight_fast_0001.png"));
  const Rgba8 ink{1, 2, 3, 255};
  const Frame& frame = sample_capture().frames[0];
  int boxes = 0;
  for (const Instance& instance : frame.instances) {
    if (!instance.tight_box) continue;
    ++boxes;
    const PixelBox& box = *instance.tight_box;
    CHECK(is_color(image, box.x_min, box.y_min, ink));
    CHECK(is_color(image, box.x_max - 1, box.y_max - 1, ink));
    CHECK(is_color(image, box.x_max - 1, box.y_min, ink));
  }
  CHECK(boxes == 3);
  CHECK(is_color(image, 0, 0, Rgba8{}));
}

TEST_CASE("a 3-D box runs through its projected corners over the background", "[writers]") {
  DataVisualizationWriter::Params params;
  params.bounding_box_3d = true;
  params.bounding_box_3d_params = params_of({{"background", Value::text("rgb")},
                                             {"fill", Value::text("red")},
                                             {"width", Value::integer(3)}});
  const RawImage image =
      test::raw_image(write(params).bytes("rp_cam_0/bounding_box_3d_fast_0001.png"));
  const Frame& frame = sample_capture().frames[0];
  for (const Instance& instance : frame.instances) {
    for (int i = 0; i < 8; ++i) {
      const Vec3 corner = frame.world_from_camera.inverse() *
                          (instance.world_from_node * instance.bounds_node.corner(i));
      const Vec2 pixel = project(frame.camera, corner).value();
      const int x = int(std::floor(pixel.x()));
      const int y = int(std::floor(pixel.y()));
      if (x < 1 || y < 1 || x > 94 || y > 62) continue;
      bool is_near = false;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          is_near = is_near || is_color(image, x + dx, y + dy, {255, 0, 0, 255});
        }
      }
      CHECK(is_near);
    }
  }
  const Rgba8 behind = frame.get(kColor).at(0, 0);
  CHECK(is_color(image, 0, 0, behind));
}

TEST_CASE("bad drawing parameters are named, foreign ones warned about", "[writers]") {
  FakeHost host;
  DataVisualizationWriter::Params params;
  params.bounding_box_3d = true;
  params.bounding_box_3d_params = params_of({{"fill", Value::text("grun")}});
  CHECK_THROWS_WITH(DataVisualizationWriter(params, host),
                    ContainsSubstring("bounding_box_3d_params.fill: expected a colour name"));
  params.bounding_box_3d_params = params_of({{"background", Value::text("depth")}});
  CHECK_THROWS_WITH(DataVisualizationWriter(params, host),
                    ContainsSubstring("expected rgb, normals or null, found"));
  params.bounding_box_3d_params = params_of({{"fill_color", Value::text("red")}});
  DataVisualizationWriter writer(params, host);
  REQUIRE(host.messages.size() == 1);
  CHECK(host.messages[0].find("bounding_box_3d_params.fill_color has no effect") !=
        std::string::npos);
}
