// SPDX-License-Identifier: Apache-2.0
#include "writer_support/npy.h"

#include <fstream>
#include <string>

#include "support/catch.h"
#include "support/shared_data.h"

using namespace diorama;

namespace {

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

TEST_CASE("an npy file holds header and data as NumPy writes them", "[writers]") {
  PackedBytes data;
  data.add_f32(1.0f);
  data.add_i32(-2);
  const std::string file = text_of(npy_file("'<f4'", {2, 1}, data.bytes));
  const std::string expected_header = std::string("\x93NUMPY\x01\x00\x76\x00", 10) +
                                      "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 1), }";
  CHECK(file.substr(0, expected_header.size()) == expected_header);
  CHECK(file.size() == 128 + 8);
  CHECK(file[127] == '\n');
  CHECK(file.substr(expected_header.size(), 127 - expected_header.size()) ==
        std::string(127 - expected_header.size(), ' '));
  CHECK(file.substr(128) == std::string("\x00\x00\x80\x3f\xfe\xff\xff\xff", 8));
}

TEST_CASE("one-dimensional shapes carry Python's trailing comma", "[writers]") {
  CHECK(text_of(npy_file("'|u1'", {0}, {})).find("'shape': (0,), }") != std::string::npos);
}

TEST_CASE("a golden depth header comes out byte by byte", "[writers][golden]") {
  const auto shared = test::shared_folder();
  if (!shared) {
    WARN("shared data is absent: golden header not compared");
    return;
  }
  std::ifstream in(
      *shared / "data/replicator_golden/behaviors_sdg/distance_to_image_plane_0000.npy",
      std::ios::binary);
  std::string golden(128, '\0');
  REQUIRE(in.read(golden.data(), 128));
  CHECK(text_of(npy_file("'<f4'", {512, 512}, {})) == golden);
}
