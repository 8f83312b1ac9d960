// SPDX-License-Identifier: Apache-2.0
#include "plugins/writer_support/fake_host.h"

#include <array>
#include <stdexcept>

#include "plugins/writer_support/sample_capture.h"

namespace diorama::test {
namespace {

constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";
constexpr std::string_view kSamples = "saMp";

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

// The chunks of a PNG file with one of our own for the samples: writers may put chunks between. Of
// its header's bytes, the one for the method of compression is the format.
std::vector<std::byte> FakeHost::encode_image(const ImageView& image, ImageFormat format) const {
  const std::size_t size = std::size_t(image.width) * std::size_t(image.height) *
                           std::size_t(image.channels) * std::size_t(image.bits_per_channel / 8);
  std::vector<std::byte> bytes(kSignature.size());
  std::memcpy(bytes.data(), kSignature.data(), kSignature.size());
  const auto put_u32 = [&bytes](std::size_t value) {
    for (int shift = 24; shift >= 0; shift -= 8)
      bytes.push_back(std::byte((value >> shift) & 0xFF));
  };
  const auto begin_chunk = [&](std::size_t length, std::string_view name) {
    put_u32(length);
    for (const char c : name) bytes.push_back(std::byte(c));
  };
  begin_chunk(13, "IHDR");
  put_u32(std::size_t(image.width));
  put_u32(std::size_t(image.height));
  const int color_type = image.channels == 1 ? 0 : image.channels == 3 ? 2 : 6;
  for (const int value : {image.bits_per_channel, color_type, int(format), 0, 0}) {
    bytes.push_back(std::byte(value));
  }
  put_u32(0);
  begin_chunk(size, kSamples);
  const auto* samples = static_cast<const std::byte*>(image.data);
  bytes.insert(bytes.end(), samples, samples + size);
  put_u32(0);
  return bytes;
}

void FakeHost::parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

RawImage raw_image(std::span<const std::byte> bytes) {
  const auto fail = [] { throw std::logic_error("not a picture of FakeHost"); };
  const auto u32 = [&](std::size_t at) {
    if (at + 4 > bytes.size()) fail();
    std::size_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | std::size_t(bytes[at + i]);
    return value;
  };
  RawImage image;
  if (u32(0) != 0x89504E47) fail();
  for (std::size_t at = kSignature.size(); at < bytes.size(); at += u32(at) + 12) {
    const std::string name(reinterpret_cast<const char*>(&bytes[at + 4]), 4);
    const std::size_t content = at + 8;
    if (name == "IHDR") {
      image.width = int(u32(content));
      image.height = int(u32(content + 4));
      image.bits_per_channel = int(bytes[content + 8]);
      const int color_type = int(bytes[content + 9]);
      image.channels = color_type == 2 ? 3 : color_type == 6 ? 4 : 1;
      image.format = ImageFormat(bytes[content + 10]);
    } else if (name == "PLTE") {
      image.palette.assign(bytes.begin() + std::ptrdiff_t(content),
                           bytes.begin() + std::ptrdiff_t(content + u32(at)));
    } else if (name == kSamples) {
      image.samples.assign(bytes.begin() + std::ptrdiff_t(content),
                           bytes.begin() + std::ptrdiff_t(content + u32(at)));
    }
  }
  return image;
}

}  // namespace diorama::test
