// SPDX-License-Identifier: Apache-2.0
#include "loader_urdf/xml_check.h"

#include <algorithm>
#include <string>
#include <vector>

#include "diorama/error.h"

namespace diorama::loader_urdf {
namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

bool is_name_start(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

bool is_name(char c) {
  return is_name_start(c) || (c >= '0' && c <= '9') || c == ':' || c == '-' || c == '.';
}

class XmlCheck {
 public:
  XmlCheck(std::string_view file, std::string_view text) : file_(file), text_(text) {}

  void run() {
    while (at_ < text_.size()) {
      const std::size_t next = text_.find('<', at_);
      if (next == std::string_view::npos) break;
      at_ = next;
      read_tag();
    }
    if (!open_.empty()) fail("the end of the file", "</" + std::string(open_.back()) + ">");
    if (elements_ == 0) fail("no element", "<robot>");
  }

 private:
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    const auto line =
        std::count(text_.begin(), text_.begin() + long(std::min(at_, text_.size())), '\n') + 1;
    throw Error(ErrorKind::Asset, std::string(file_) + ":" + std::to_string(line) + ": found " +
                                      found + ", expected " + expected);
  }
  bool begins(std::string_view word) const { return text_.substr(at_).starts_with(word); }
  void skip_to(std::string_view end) {
    const std::size_t found = text_.find(end, at_);
    if (found == std::string_view::npos) fail("the end of the file", "'" + std::string(end) + "'");
    at_ = found + end.size();
  }
  void skip_spaces() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  }
  std::string_view read_name() {
    const std::size_t start = at_;
    if (at_ < text_.size() && is_name_start(text_[at_])) {
      while (at_ < text_.size() && is_name(text_[at_])) ++at_;
    }
    if (at_ == start) fail("'" + here() + "'", "a name");
    return text_.substr(start, at_ - start);
  }
  std::string here() const {
    if (at_ >= text_.size()) return "the end of the file";
    const char c = text_[at_];
    return c >= ' ' && c <= '~' ? std::string(1, c) : "a byte that is no text";
  }

  void read_tag() {
    if (begins("<!--")) {
      at_ += 4;
      skip_to("-->");
    } else if (begins("<?")) {
      skip_to("?>");
    } else if (begins("<!")) {
      fail("a document type or raw text ('<!')", "elements and comments only");
    } else if (begins("</")) {
      at_ += 2;
      const std::string_view name = read_name();
      skip_spaces();
      if (open_.empty() || open_.back() != name) {
        fail("</" + std::string(name.substr(0, 60)) + ">",
             open_.empty() ? "no such end" : "</" + std::string(open_.back()) + ">");
      }
      open_.pop_back();
      if (!begins(">")) fail("'" + here() + "'", "'>'");
      ++at_;
    } else {
      ++at_;
      read_element();
    }
  }

  void read_element() {
    const std::string_view name = read_name();
    if (++elements_ > kMaxXmlElements) {
      fail("more than " + std::to_string(kMaxXmlElements) + " elements", "less");
    }
    if (name == "link" && ++links_ > kMaxLinks) {
      fail("more than " + std::to_string(kMaxLinks) + " links", "less");
    }
    if (name == "geometry" && ++shapes_ > kMaxShapes) {
      fail("more than " + std::to_string(kMaxShapes) + " shapes", "less");
    }
    if (open_.size() >= std::size_t(kMaxXmlDepth)) {
      fail("elements in more than " + std::to_string(kMaxXmlDepth) + " others", "less");
    }
    for (int attributes = 0;; ++attributes) {
      skip_spaces();
      if (begins("/>")) {
        at_ += 2;
        return;
      }
      if (begins(">")) {
        ++at_;
        if (name.size() > 60) fail("a name of more than 60 letters", "a shorter one");
        open_.push_back(name);
        return;
      }
      if (attributes == kMaxAttributes) {
        fail("more than " + std::to_string(kMaxAttributes) + " attributes", "less");
      }
      read_name();
      skip_spaces();
      if (!begins("=")) fail("'" + here() + "'", "'='");
      ++at_;
      skip_spaces();
      const char quote = at_ < text_.size() ? text_[at_] : ' ';
      if (quote != '"' && quote != '\'') fail("'" + here() + "'", "a value in quotes");
      ++at_;
      const std::size_t end = text_.find(quote, at_);
      if (end == std::string_view::npos) fail("the end of the file", "a quote");
      if (text_.substr(at_, end - at_).find('<') != std::string_view::npos) {
        fail("'<' in a value", "'&lt;'");
      }
      at_ = end + 1;
    }
  }

  std::string_view file_;
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t elements_ = 0;
  std::size_t links_ = 0;
  std::size_t shapes_ = 0;
  std::vector<std::string_view> open_;
};

}  // namespace

void check_xml(std::string_view file, std::string_view text) {
  const std::string name(file);
  if (text.size() > kMaxXmlBytes) {
    throw Error(ErrorKind::Asset, name + ": has " + std::to_string(text.size()) +
                                      " bytes, expected at most " + std::to_string(kMaxXmlBytes));
  }
  if (text.find('\0') != std::string_view::npos) {
    throw Error(ErrorKind::Asset, name + ": holds a zero byte, expected text");
  }
  XmlCheck(file, text).run();
}

}  // namespace diorama::loader_urdf
