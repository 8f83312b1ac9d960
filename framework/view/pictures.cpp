// SPDX-License-Identifier: Apache-2.0
#include "framework/view/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

namespace diorama {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

Rgb packed(std::uint32_t value) {
  return {std::uint8_t(value), std::uint8_t(value >> 8), std::uint8_t(value >> 16)};
}

PictureFile encoded(const std::vector<Rgb>& pixels, int width, int height, ImageFormat format,
                    const Host& host) {
  const ImageView view{pixels.data(), width, height, 3, 8};
  const std::vector<std::byte> bytes = host.encode_image(view, format);
  PictureFile file;
  file.type = format == ImageFormat::Png ? "image/png" : "image/jpeg";
  file.bytes.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return file;
}

template <class Pixel, class Turn>
PictureFile picture_of(const Image<Pixel>& image, const Host& host, Turn&& turn,
                       ImageFormat format = ImageFormat::Png) {
  std::vector<Rgb> pixels;
  pixels.reserve(image.pixels().size());
  for (const Pixel& pixel : image.pixels()) pixels.push_back(turn(pixel));
  return encoded(pixels, image.width(), image.height(), format, host);
}

Rgb packed_depth(float metres) {
  if (!(metres > 0.0F) || !std::isfinite(metres)) return {0, 0, 0};
  return packed(std::uint32_t(std::clamp(std::round(double(metres) * 1e4), 1.0, 16777215.0)));
}

Rgb packed_normal(const Vec3f& normal) {
  if (!normal.allFinite() || normal.isZero()) return {0, 0, 0};
  Rgb bytes{};
  for (std::size_t i = 0; i < 3; ++i) {
    const float share = std::clamp(normal[int(i)], -1.0F, 1.0F) * 0.5F + 0.5F;
    bytes[i] = std::uint8_t(std::lround(share * 255.0F));
  }
  return bytes;
}

/// See PictureKind::Motion. `states` may be null: everything is seen.
PictureFile packed_motion(const Image<Vec2f>& motion, const Image<std::uint32_t>* states,
                          const Host& host) {
  constexpr double kMost = 8192.0;  // what 22 bits hold
  const auto steps = [](float value) {
    const double finite = std::isfinite(value) ? double(value) : 0.0;
    return std::uint32_t(std::clamp(std::round((finite + kMost) * 256.0), 0.0, 4194303.0));
  };
  const std::size_t count = motion.pixels().size();
  std::vector<Rgb> pixels(2 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t state = states ? std::min(states->pixels()[i], 3U) : 0U;
    pixels[i] = packed(steps(motion.pixels()[i].x()) | state << 22);
    pixels[count + i] = packed(steps(motion.pixels()[i].y()));
  }
  return encoded(pixels, motion.width(), 2 * motion.height(), ImageFormat::Png, host);
}

/// Means over the pixels that fall into each one.
PictureFile thumbnail(const Image<Rgba8>& image, const Host& host) {
  const int width = std::min(image.width(), kThumbnailWidth);
  const int height =
      std::max(1, int(std::lround(double(image.height()) * width / std::max(image.width(), 1))));
  std::vector<Rgb> pixels;
  for (int y = 0; y < height; ++y) {
    const int top = int(std::int64_t(y) * image.height() / height);
    const int below = std::max(top + 1, int(std::int64_t(y + 1) * image.height() / height));
    for (int x = 0; x < width; ++x) {
      const int left = int(std::int64_t(x) * image.width() / width);
      const int right = std::max(left + 1, int(std::int64_t(x + 1) * image.width() / width));
      std::array<std::uint64_t, 3> sum{};
      for (int v = top; v < below; ++v) {
        for (int u = left; u < right; ++u) {
          for (std::size_t c = 0; c < 3; ++c) sum[c] += image.at(u, v)[c];
        }
      }
      const auto count = std::uint64_t(below - top) * std::uint64_t(right - left);
      Rgb mean{};
      for (std::size_t c = 0; c < 3; ++c) mean[c] = std::uint8_t((sum[c] + count / 2) / count);
      pixels.push_back(mean);
    }
  }
  return encoded(pixels, width, height, ImageFormat::Jpeg, host);
}

template <class Pixel>
const Image<Pixel>* image_of(const Frame& frame, const Channel<Pixel>& channel) {
  if (!frame.has(channel.name)) return nullptr;
  const Image<Pixel>& image = frame.get(channel);
  return image.pixels().empty() ? nullptr : &image;
}

}  // namespace

std::optional<PictureKind> picture_kind(std::string_view name) {
  if (name == "color") return PictureKind::Color;
  if (name == "photo") return PictureKind::Photo;
  if (name == "thumbnail") return PictureKind::Thumbnail;
  if (name == "ids") return PictureKind::Ids;
  if (name == "depth") return PictureKind::Depth;
  if (name == "normals") return PictureKind::Normals;
  if (name == "motion") return PictureKind::Motion;
  if (name == "flow_forward") return PictureKind::FlowForward;
  if (name == "flow_backward") return PictureKind::FlowBackward;
  return std::nullopt;
}

NameSet channels_of(PictureKind kind) {
  const auto names = [](std::initializer_list<std::string_view> list) {
    return NameSet(list.begin(), list.end());
  };
  switch (kind) {
    case PictureKind::Color:
    case PictureKind::Photo:
    case PictureKind::Thumbnail:
      return names({kColor.name});
    case PictureKind::Ids:
      return names({kInstanceId.name, kHoldsInstances});
    case PictureKind::Depth:
      return names({kDistanceToImagePlane.name, kDistanceToCamera.name});
    case PictureKind::Normals:
      return names({kNormals.name});
    case PictureKind::Motion:
      return names({kMotion.name});
    case PictureKind::FlowForward:
      return names({kFlowForward.name, kFlowForwardState.name});
    case PictureKind::FlowBackward:
      return names({kFlowBackward.name, kFlowBackwardState.name});
  }
  return {};
}

std::optional<PictureFile> make_picture(const Frame& frame, PictureKind kind, const Host& host) {
  if (const auto* color = image_of(frame, kColor)) {
    if (kind == PictureKind::Thumbnail) return thumbnail(*color, host);
    if (kind == PictureKind::Color || kind == PictureKind::Photo) {
      const bool is_exact = kind == PictureKind::Color;
      return picture_of(
          *color, host,
          [](const Rgba8& p) {
            return Rgb{p[0], p[1], p[2]};
          },
          is_exact ? ImageFormat::Png : ImageFormat::Jpeg);
    }
  }
  if (kind == PictureKind::Ids) {
    if (const auto* ids = image_of(frame, kInstanceId)) return picture_of(*ids, host, packed);
  }
  if (kind == PictureKind::Depth) {
    for (const Channel<float>& channel : {kDistanceToImagePlane, kDistanceToCamera}) {
      if (const auto* depth = image_of(frame, channel))
        return picture_of(*depth, host, packed_depth);
    }
  }
  if (kind == PictureKind::Normals) {
    if (const auto* normals = image_of(frame, kNormals)) {
      return picture_of(*normals, host, packed_normal);
    }
  }
  if (kind == PictureKind::Motion) {
    if (const auto* motion = image_of(frame, kMotion)) return packed_motion(*motion, nullptr, host);
  }
  for (const auto& [flow, channel, state] :
       {std::tuple{PictureKind::FlowForward, kFlowForward, kFlowForwardState},
        std::tuple{PictureKind::FlowBackward, kFlowBackward, kFlowBackwardState}}) {
    if (kind != flow) continue;
    if (const auto* motion = image_of(frame, channel)) {
      return packed_motion(*motion, image_of(frame, state), host);
    }
  }
  return std::nullopt;
}

}  // namespace diorama
