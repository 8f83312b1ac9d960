// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace diorama {

/// An element of an XML text: what it is called, its text without that of its children, and its
/// children. Attributes, comments and declarations are passed over.
struct XmlElement {
  std::string name;
  std::string text;
  std::vector<XmlElement> children;

  /// The first child of this name; null when there is none.
  const XmlElement* child(std::string_view name) const;
  /// Its text without blanks at the ends. Throws std::runtime_error when there is no such child.
  std::string text_of(std::string_view name) const;
};

/// The outermost element. Throws std::runtime_error: not well formed, cut short, nested deeper than
/// 64 elements.
XmlElement parse_xml(std::string_view text);

}  // namespace diorama
