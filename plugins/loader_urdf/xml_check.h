// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string_view>

namespace diorama::loader_urdf {

inline constexpr std::size_t kMaxXmlBytes = std::size_t{32} << 20;
inline constexpr int kMaxXmlDepth = 64;
inline constexpr std::size_t kMaxXmlElements = 500'000;
inline constexpr int kMaxAttributes = 100;  ///< Of an element.
inline constexpr std::size_t kMaxLinks = 10'000;
inline constexpr std::size_t kMaxShapes = 10'000;

/// Throws Error(Asset) "FILE:LINE: what was found, what would be right" unless the text is XML of
/// elements that are closed, with quoted attributes, without a document type, and within the limits
/// above. The library that reads URDF takes the stack for nesting and for chains of links, compares
/// each attribute with all others of its element, and guesses at what is broken.
void check_xml(std::string_view file, std::string_view text);

}  // namespace diorama::loader_urdf
