// SPDX-License-Identifier: Apache-2.0
#include "writer_imagefolder/image_folder_writer.h"

#include <sstream>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

TEST_CASE("every picture has a line of metadata beside it", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<ImageFolderWriter>({}, host);
  std::size_t lines = 0;
  for (const std::string folder : {"train", "validation"}) {
    std::istringstream text(files.text(folder + "/metadata.jsonl"));
    for (std::string line; std::getline(text, line); ++lines) {
      const Json json = Json::parse(line);
      const int capture = json.at("capture");
      CHECK(test::split_of(files, capture) == (folder == "train" ? "train" : "val"));
      const int camera = json.at("camera") == "cam_0" ? 0 : 1;
      CHECK(json.at("image_id") == 2 * capture + camera);
      CHECK(files.files.contains(folder + "/" + json.at("file_name").get<std::string>()));
      const Frame& frame =
          test::sample_captures()[std::size_t(capture)].frames[std::size_t(camera)];
      CHECK(json.at("width") == frame.camera.width);
      std::size_t row = 0;
      for (const Instance& instance : frame.instances) {
        if (!instance.tight_box) continue;
        const Json& objects = json.at("objects");
        const PixelBox& box = *instance.tight_box;
        CHECK(objects.at("bbox").at(row) ==
              Json({box.x_min, box.y_min, box.width(), box.height()}));
        const std::map<std::string, int> classes{{"ball", 0}, {"crate", 1}, {"mug", 2}};
        CHECK(objects.at("categories").at(row) == classes.at(instance.labels.at("class")));
        CHECK(objects.at("area").at(row) == test::visible_count(frame, instance));
        ++row;
      }
      for (const auto& [key, list] : json.at("objects").items()) CHECK(list.size() == row);
    }
  }
  CHECK(lines == 6);
  const std::string card = files.text("README.md");
  CHECK(card.starts_with("---\n"));
  CHECK(card.find("  - split: validation\n    path: \"validation/**\"\n") != std::string::npos);
  CHECK(card.find("\n2. mug\n") != std::string::npos);
}
