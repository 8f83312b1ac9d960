// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "diorama/host.h"
#include "diorama/reader.h"

namespace diorama {

/// A picture file for the page.
struct PictureFile {
  std::string type;
  std::string bytes;
};

/// What of a frame the page can ask for as a picture, by the name in the address. Numbers stand in
/// the three bytes of a pixel, red lowest, so that the page can read them back exactly.
enum class PictureKind {
  Color,         ///< "color": as it is.
  Photo,         ///< "photo": the same as JPEG, a fifth of the size.
  Thumbnail,     ///< "thumbnail": at most kThumbnailWidth wide, JPEG.
  Ids,           ///< "ids": instance ids, their lower 24 bits.
  Depth,         ///< "depth": tenths of millimetres, 0 where nothing is.
  Normals,       ///< "normals": -1 to 1 as 0 to 255, black where nothing is.
  Motion,        ///< "motion": twice as high, x above and y below, in 1/256 pixels from -8192.
  FlowForward,   ///< "flow_forward": the same, with the FlowState of x in the highest two bits.
  FlowBackward,  ///< "flow_backward"
};
inline constexpr int kThumbnailWidth = 320;

std::optional<PictureKind> picture_kind(std::string_view name);

/// The channels that it is made of, best first.
NameSet channels_of(PictureKind kind);

/// Nothing when the frame lacks the channels.
std::optional<PictureFile> make_picture(const Frame& frame, PictureKind kind, const Host& host);

}  // namespace diorama
