// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/image.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// An object as JSON without a fixed schema says it.
struct ListedBox {
  std::string label;            ///< Empty: none is said.
  std::optional<PixelBox> box;  ///< Pixels that it touches.
};

/// Objects of {"bbox": [[x, y, width, height], ...], "categories": [...]} or of [{"bbox": ...,
/// "category": ...}, ...]; labels may be called category, label, class and so on, and be numbers,
/// which are places in `classes` where that has so many. Throws std::runtime_error or a JSON
/// exception when lists have other lengths or boxes are none.
std::vector<ListedBox> listed_boxes(const Json& objects, const std::vector<std::string>& classes);

/// A text, or a number as the place of a name in `classes`; empty for anything else.
std::string label_of_json(const Json& value, const std::vector<std::string>& classes);

/// x, y, width, height in pixels; half a pixel and more counts where numbers are not whole.
PixelBox box_of_json(const Json& bbox);

}  // namespace diorama
