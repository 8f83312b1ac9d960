// SPDX-License-Identifier: Apache-2.0
#include "plugins/writer_support/fake_host.h"

#include <array>
#include <stdexcept>

#include "plugins/writer_support/sample_capture.h"

namespace diorama::test {
namespace {

constexpr std::int32_t kMagic = 0x57415249;

[[noreturn]] void unused() { throw std::logic_error("FakeHost: not expected to be called"); }

}  // namespace

int RawImage::at(int x, int y, int c) const {
  const std::size_t sample =
      (std::size_t(y) * std::size_t(width) + std::size_t(x)) * std::size_t(channels) +
      std::size_t(c);
  if (bits_per_channel == 8) return int(samples.at(sample));
  std::uint16_t value = 0;
  std::memcpy(&value, &samples.at(2 * sample), 2);
  return value;
}

void FakeHost::log(LogLevel, std::string_view message) { messages.emplace_back(message); }
std::filesystem::path FakeHost::resolve(std::string_view) const { unused(); }
std::vector<std::filesystem::path> FakeHost::list_assets(std::string_view,
                                                         std::span<const std::string>) const {
  unused();
}
NodeId FakeHost::load_asset(std::string_view asset, Scene& scene, NodeId parent) {
  if (asset != "/props/mug.usd") unused();
  const SampleScene sample(8, 6);
  const NodeId mug = sample.scene.require("/Assets/mug");
  const NodeId root = scene.create(parent, "mug");
  for (const NodeId part : sample.scene[mug].children) {
    const NodeId node = scene.create(root, sample.scene[part].name);
    scene.set_pose(node, sample.scene[part].parent_from_node);
    scene.edit(node).mesh = sample.scene[part].mesh;
  }
  return root;
}
std::shared_ptr<const Texture> FakeHost::decode_texture(std::span<const std::byte>,
                                                        std::string_view) const {
  unused();
}
std::shared_ptr<const Texture> FakeHost::read_texture(const std::filesystem::path&) const {
  unused();
}

std::vector<std::byte> FakeHost::encode_image(const ImageView& image, ImageFormat format) const {
  const std::array<std::int32_t, 6> header{kMagic,         std::int32_t(format),
                                           image.width,    image.height,
                                           image.channels, image.bits_per_channel};
  const std::size_t size = std::size_t(image.width) * std::size_t(image.height) *
                           std::size_t(image.channels) * std::size_t(image.bits_per_channel / 8);
  std::vector<std::byte> bytes(sizeof header + size);
  std::memcpy(bytes.data(), header.data(), sizeof header);
  std::memcpy(bytes.data() + sizeof header, image.data, size);
  return bytes;
}

void FakeHost::parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

RawImage raw_image(std::span<const std::byte> bytes) {
  std::array<std::int32_t, 6> header{};
  if (bytes.size() < sizeof header) throw std::logic_error("not a picture of FakeHost");
  std::memcpy(header.data(), bytes.data(), sizeof header);
  if (header[0] != kMagic) throw std::logic_error("not a picture of FakeHost");
  return {ImageFormat(header[1]),
          header[2],
          header[3],
          header[4],
          header[5],
          {bytes.begin() + sizeof header, bytes.end()}};
}

}  // namespace diorama::test
