// SPDX-License-Identifier: Apache-2.0
#include <stdexcept>

#include "test_writer.h"

namespace diorama::test {

class ThrowsInFactory final : public QuietWriter {
 public:
  ThrowsInFactory(Params params, Host& host) : QuietWriter(params, host) {
    throw std::runtime_error("out of pencils");
  }
};

class RefusesInFactory final : public QuietWriter {
 public:
  RefusesInFactory(Params params, Host& host) : QuietWriter(params, host) {
    throw Error(ErrorKind::Asset, "font.ttf: not found");
  }
};

class ThrowsNumber final : public QuietWriter {
 public:
  ThrowsNumber(Params params, Host& host) : QuietWriter(params, host) { throw 42; }
};

class ThrowsInCall final : public QuietWriter {
 public:
  using QuietWriter::QuietWriter;
  NameSet needs() const override { throw std::logic_error("do not ask"); }
};

class NotAWriter final : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Writer;
  using Params = QuietWriter::Params;
  NotAWriter(Params, Host&) {}
};

}  // namespace diorama::test

DIORAMA_PLUGIN("faulty_components", "1.0.0", "MIT") {
  using namespace diorama;
  DIORAMA_ADD(test::ThrowsInFactory, "throws_in_factory", "Throws when it is made.");
  DIORAMA_ADD(test::RefusesInFactory, "refuses_in_factory", "Throws our own error.");
  DIORAMA_ADD(test::ThrowsNumber, "throws_number", "Throws what is no exception.");
  DIORAMA_ADD(test::ThrowsInCall, "throws_in_call", "Throws when it is used.");
  DIORAMA_ADD(test::NotAWriter, "not_a_writer", "Is of another kind.");
  DIORAMA_ADD(test::QuietWriter, "works", "Has no fault.");
  __attribute__((section(".diorama_components"), used)) static const DioramaComponentEntry entry{
      std::uint32_t(ComponentKind::Writer), 0, "returns_null", "Makes nothing.", "", "", ""};
  registrar.add(
      {ComponentKind::Writer,
       "returns_null",
       "Makes nothing.",
       {},
       nullptr,
       [](const void*) { return std::vector<ParamSpec>(); },
       [](const void*, const Value&, const std::string&, std::span<const std::string_view>,
          Diagnostics&, Host&) { return std::unique_ptr<Component>(); }});
}
