// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_writer.h"

#include <hdf5.h>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::MemoryFiles;

namespace {

/// Opens bytes as a file.
class OpenFile {
 public:
  explicit OpenFile(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_fapl_core(access, 1 << 16, false);
    H5Pset_file_image(access, bytes_.data(), bytes_.size());
    id = H5Fopen("in_memory", H5F_ACC_RDONLY, access);
    H5Pclose(access);
    REQUIRE(id >= 0);
  }
  ~OpenFile() { H5Fclose(id); }

  template <class T>
  std::vector<T> read(const char* name, hid_t type, const std::vector<hsize_t>& shape) const {
    const hid_t set = H5Dopen2(id, name, H5P_DEFAULT);
    REQUIRE(set >= 0);
    const hid_t space = H5Dget_space(set);
    std::vector<hsize_t> extent(std::size_t(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, extent.data(), nullptr);
    CHECK(extent == shape);
    std::vector<T> values(std::size_t(H5Sget_simple_extent_npoints(space)));
    CHECK(H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) >= 0);
    H5Sclose(space);
    H5Dclose(set);
    return values;
  }

  hid_t id = -1;

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace

TEST_CASE("an HDF5 file gives back the frame", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<Hdf5Writer>({}, host);
  const OpenFile file(files.bytes(test::split_of(files, 2) + "/000002_cam_1.hdf5"));
  const Frame& frame = test::sample_captures()[2].frames[1];
  const hsize_t h = 48, w = 54;
  const auto colors = file.read<std::uint8_t>("colors", H5T_NATIVE_UINT8, {h, w, 3});
  const auto depth = file.read<float>("depth", H5T_NATIVE_FLOAT, {h, w});
  const auto instances = file.read<std::uint16_t>("instance_segmaps", H5T_NATIVE_UINT16, {h, w});
  const auto classes = file.read<std::uint16_t>("category_id_segmaps", H5T_NATIVE_UINT16, {h, w});
  const auto pose = file.read<double>("world_from_camera", H5T_NATIVE_DOUBLE, {4, 4});
  CHECK(pose[7] == frame.world_from_camera.translation().y());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    CHECK(depth[i] == frame.get(kDistanceToImagePlane).pixels()[i]);
    CHECK(colors[3 * i + 1] == frame.get(kColor).pixels()[i][1]);
    CHECK((instances[i] != 0) == (frame.get(kInstanceId).pixels()[i] != 0));
    CHECK((classes[i] != 0) == (instances[i] != 0));
  }
}

TEST_CASE("equal frames give equal HDF5 bytes", "[writers]") {
  test::FakeHost host;
  const MemoryFiles first = test::write_sample<Hdf5Writer>({}, host);
  const MemoryFiles second = test::write_sample<Hdf5Writer>({}, host);
  CHECK(first.files == second.files);
}

TEST_CASE("channels of other plugins are data sets of their names", "[writers]") {
  test::FakeHost host;
  Hdf5Writer::Params params;
  params.channels.names = {"flow", "parts"};
  Hdf5Writer writer(params, host);
  CHECK(writer.needs().contains("flow"));
  const test::SampleScene sample(24, 16, 1);
  Capture capture = test::ray_cast_capture(sample, 0);
  Image<Vec2f> flow(24, 16, Vec2f(1.0f, 2.0f));
  flow.at(3, 2) = {7.25f, -1.0f};
  capture.frames[0].set(Channel<Vec2f>{"flow"}, flow);
  Image<std::uint32_t> parts(24, 16, 70000);
  capture.frames[0].set(Channel<std::uint32_t>{"parts"}, parts);
  const MemoryFiles files = test::write_dataset(writer, test::sample_dataset(sample), {&capture});
  const OpenFile file(files.bytes(test::split_of(files, 0) + "/000000_cam_0.hdf5"));
  const auto values = file.read<float>("flow", H5T_NATIVE_FLOAT, {16, 24, 2});
  CHECK(values[2 * (2 * 24 + 3)] == 7.25f);
  CHECK(values[2 * (2 * 24 + 3) + 1] == -1.0f);
  CHECK(file.read<std::uint32_t>("parts", H5T_NATIVE_UINT32, {16, 24})[5] == 70000);
  Hdf5Writer::Params taken;
  taken.channels.names = {"lens"};
  CHECK_THROWS_WITH(Hdf5Writer(taken, host), ContainsSubstring("channels: 'lens'"));
}
