// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/xml_tree.h"

#include <algorithm>
#include <stdexcept>

namespace diorama {
namespace {

constexpr int kMostDepth = 64;
constexpr std::string_view kBlanks = " \t\r\n";

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  XmlElement document() {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
    skip_what_is_no_element();
    XmlElement root = element(0);
    skip_what_is_no_element();
    if (!text_.empty()) throw std::runtime_error("goes on behind its last element");
    return root;
  }

 private:
  void take_to(std::string_view end) {
    const std::size_t at = text_.find(end);
    if (at == text_.npos) throw std::runtime_error("is cut short");
    text_.remove_prefix(at + end.size());
  }

  void skip_what_is_no_element() {
    while (true) {
      const std::size_t first = text_.find_first_not_of(kBlanks);
      text_.remove_prefix(first == text_.npos ? text_.size() : first);
      if (text_.starts_with("<!--")) {
        take_to("-->");
      } else if (text_.starts_with("<?") || text_.starts_with("<!")) {
        take_to(">");
      } else {
        return;
      }
    }
  }

  XmlElement element(int depth) {
    if (depth > kMostDepth) throw std::runtime_error("its elements are nested too deep");
    if (!text_.starts_with('<')) throw std::runtime_error("is no XML: an element is missing");
    const std::size_t end = text_.find('>');
    if (end == text_.npos) throw std::runtime_error("is cut short");
    std::string_view tag = text_.substr(1, end - 1);
    text_.remove_prefix(end + 1);
    const bool is_empty = tag.ends_with('/');
    if (is_empty) tag.remove_suffix(1);
    XmlElement result;
    result.name = std::string(tag.substr(0, tag.find_first_of(kBlanks)));
    if (result.name.empty()) throw std::runtime_error("is no XML: an element has no name");
    if (!is_empty) content(result, depth);
    return result;
  }

  void content(XmlElement& element_in, int depth) {
    while (true) {
      const std::size_t next = text_.find('<');
      if (next == text_.npos) throw std::runtime_error("is cut short");
      element_in.text += unescaped(text_.substr(0, next));
      text_.remove_prefix(next);
      if (text_.starts_with("<!--")) {
        take_to("-->");
      } else if (text_.starts_with("</")) {
        const std::string_view rest = text_.substr(2);
        take_to(">");
        if (!rest.starts_with(element_in.name)) {
          throw std::runtime_error("<" + element_in.name + "> is not closed");
        }
        return;
      } else {
        element_in.children.push_back(element(depth + 1));
      }
    }
  }

  static std::string unescaped(std::string_view text) {
    constexpr std::pair<std::string_view, char> kEntities[] = {
        {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&amp;", '&'}};
    std::string result;
    while (!text.empty()) {
      const auto entity = std::ranges::find_if(
          kEntities, [&](const auto& each) { return text.starts_with(each.first); });
      if (entity != std::end(kEntities)) {
        result += entity->second;
        text.remove_prefix(entity->first.size());
      } else {
        result += text.front();
        text.remove_prefix(1);
      }
    }
    return result;
  }

  std::string_view text_;
};

}  // namespace

const XmlElement* XmlElement::child(std::string_view wanted) const {
  const auto found = std::ranges::find(children, wanted, &XmlElement::name);
  return found == children.end() ? nullptr : &*found;
}

std::string XmlElement::text_of(std::string_view wanted) const {
  const XmlElement* found = child(wanted);
  if (!found) throw std::runtime_error("<" + name + "> has no <" + std::string(wanted) + ">");
  const std::size_t first = found->text.find_first_not_of(kBlanks);
  if (first == std::string::npos) return {};
  return found->text.substr(first, found->text.find_last_not_of(kBlanks) - first + 1);
}

XmlElement parse_xml(std::string_view text) { return Parser(text).document(); }

}  // namespace diorama
