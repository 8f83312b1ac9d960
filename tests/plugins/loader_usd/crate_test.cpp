// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "loader_usd/usd/crate_reader.h"
#include "loader_usd/usd/error.h"
#include "plugins/loader_usd/crate_bytes.h"
#include "support/catch.h"

namespace diorama::usd {
namespace {

using test::CrateBytes;

std::shared_ptr<Layer> read(const std::string& bytes) {
  return read_crate("test.usdc", copy_bytes(std::as_bytes(std::span(bytes))));
}

std::string error_of(const CrateBytes& crate) {
  try {
    read(crate.str())->for_each_value([](const usd::Value&) {});
  } catch (const FormatError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a crate gives prims, types and arrays without copying them", "[usdc]") {
  CrateBytes::Places places;
  const CrateBytes crate = CrateBytes::make(places);
  const auto view = copy_bytes(std::as_bytes(std::span(crate.str())));
  const auto layer = read_crate("test.usdc", view);
  const PrimSpec* box = layer->prim("/Box");
  REQUIRE(box);
  CHECK(layer->get(*box, "specifier").as_enumerator() == 0);
  CHECK(*layer->get(*box, "typeName").as_text() == "Mesh");
  const PropertySpec* points = box->property("points");
  REQUIRE(points);
  const Value value = layer->get(points->fields, "default");
  CHECK(value.size() == 2);
  CHECK(value.component(4) == 5.0);
  const auto* first = reinterpret_cast<const std::byte*>(value.storage_key());
  CHECK(first > view.bytes.data());
  CHECK(first < view.bytes.data() + view.bytes.size());
}

TEST_CASE("a crate that lies about its sizes is refused at the place of the lie", "[usdc]") {
  CrateBytes::Places places;
  const CrateBytes sound = CrateBytes::make(places);
  CHECK(error_of(sound) == "no error");

  CrateBytes crate = sound;
  crate.patch<std::uint64_t>(places.token_count, 0xFFFFFFFFFFFFull);
  CHECK(error_of(crate) ==
        "test.usdc: 281474976710655 tokens do not fit into 53 bytes at byte "
        "offset " +
            std::to_string(places.token_count));
  crate = sound;
  crate.patch<std::uint32_t>(places.point_count, 0xFFFFFFFFu);
  CHECK(error_of(crate).starts_with(
      "test.usdc: an array of 4294967295 elements is longer than the file at byte offset"));
  crate = sound;
  crate.patch<std::uint64_t>(places.path_count, 1u << 30);
  CHECK(error_of(crate).find("paths do not fit into") != std::string::npos);
  crate = sound;
  crate.patch<std::uint64_t>(places.spec_count, 1ull << 40);
  CHECK(error_of(crate).find("specs do not fit into") != std::string::npos);
  crate = sound;
  // A path that is its own ancestor.
  crate.patch<std::uint32_t>(places.second_path, 0u);
  CHECK(error_of(crate).find("the path tree holds path 0 twice") != std::string::npos);
  crate = sound;
  crate.patch<std::uint32_t>(places.first_field + 4, 77u);
  CHECK(error_of(crate).find("token index 77 is not below 7") != std::string::npos);
  crate = sound;
  crate.patch<std::uint8_t>(9, 13);
  CHECK(error_of(crate) ==
        "test.usdc: crate version 0.13.0 is not supported; the newest supported one is 0.12 at "
        "byte offset 8");
}

TEST_CASE("every cut and every changed byte of a crate is survived", "[usdc]") {
  CrateBytes::Places places;
  const std::string bytes = CrateBytes::make(places).str();
  const auto survives = [](const std::string& damaged) {
    try {
      read(damaged)->for_each_value([](const usd::Value&) {});
    } catch (const FormatError&) {
      // Refusing is fine, crashing is not.
    }
    return true;
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    REQUIRE(survives(bytes.substr(0, i)));
    for (const char value : {'\x00', '\x01', '\x7F', '\xFF'}) {
      std::string changed = bytes;
      changed[i] = value;
      REQUIRE(survives(changed));
    }
  }
}

}  // namespace diorama::usd
