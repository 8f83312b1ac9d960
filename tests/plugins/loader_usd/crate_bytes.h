// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace diorama::usd::test {

/// Bytes of a small crate file of version 0.1.0, whose sections are not compressed: a layer with
/// the prim /Box of type Mesh and its attribute `points` of two points. As in files with references
/// to default prims, one of the paths is the empty one, which has a number but no record.
class CrateBytes {
 public:
  template <class T>
  void add(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  /// Where the next byte goes.
  std::uint64_t size() const { return bytes_.size(); }

  template <class T>
  void patch(std::uint64_t offset, T value) {
    std::memcpy(bytes_.data() + offset, &value, sizeof(T));
  }
  const std::string& str() const { return bytes_; }

  /// Offsets that tests damage.
  struct Places {
    std::uint64_t token_count = 0;
    std::uint64_t point_count = 0;
    std::uint64_t first_field = 0;
    std::uint64_t path_count = 0;
    std::uint64_t second_path = 0;
    std::uint64_t spec_count = 0;
  };

  static CrateBytes make(Places& places) {
    CrateBytes crate;
    crate.bytes_ = "PXR-USDC";
    for (const char c : {0, 1, 0, 0, 0, 0, 0, 0}) crate.bytes_ += c;
    const std::uint64_t contents = crate.size();
    crate.add<std::int64_t>(0);
    for (int i = 0; i < 8; ++i) crate.add<std::int64_t>(0);

    const std::uint64_t points = crate.size();
    crate.add<std::uint32_t>(1);  // Rank.
    places.point_count = crate.size();
    crate.add<std::uint32_t>(2);
    for (const float x : {1.f, 2.f, 3.f, 4.f, 5.f, 6.f}) crate.add(x);

    std::vector<std::pair<std::string, std::uint64_t>> sections;
    const auto begin = [&](const char* name) { sections.emplace_back(name, crate.size()); };
    begin("TOKENS");
    places.token_count = crate.size();
    const std::string tokens("specifier\0typeName\0Mesh\0default\0point3f[]\0Box\0points\0", 53);
    crate.add<std::uint64_t>(7);
    crate.add<std::uint64_t>(tokens.size());
    crate.bytes_ += tokens;
    begin("STRINGS");
    crate.add<std::uint64_t>(0);
    begin("FIELDS");
    crate.add<std::uint64_t>(4);
    const auto field = [&](std::uint32_t token, std::uint64_t representation) {
      crate.add<std::uint32_t>(0);
      crate.add(token);
      crate.add(representation);
    };
    const std::uint64_t inlined = std::uint64_t{1} << 62;
    places.first_field = crate.size();
    field(0, inlined | (std::uint64_t{42} << 48));                            // specifier: def
    field(1, inlined | (std::uint64_t{11} << 48) | 2);                        // typeName: Mesh
    field(1, inlined | (std::uint64_t{11} << 48) | 4);                        // typeName: point3f[]
    field(3, (std::uint64_t{1} << 63) | (std::uint64_t{24} << 48) | points);  // default
    begin("FIELDSETS");
    crate.add<std::uint64_t>(7);
    for (const std::uint32_t index : {0u, 1u, ~0u, 2u, 3u, ~0u, ~0u}) crate.add(index);
    begin("PATHS");
    places.path_count = crate.size();
    crate.add<std::uint64_t>(4);
    const auto path = [&](std::uint32_t index, std::uint32_t token, std::uint8_t bits) {
      crate.add(index);
      crate.add(token);
      crate.add<std::uint32_t>(bits);
    };
    path(0, 0, 1);
    places.second_path = crate.size();
    path(1, 5, 1);
    path(2, 6, 4);
    begin("SPECS");
    places.spec_count = crate.size();
    crate.add<std::uint64_t>(3);
    for (const std::uint32_t number : {0u, 6u, 7u, 1u, 0u, 6u, 2u, 3u, 1u}) crate.add(number);

    crate.patch<std::int64_t>(contents, static_cast<std::int64_t>(crate.size()));
    crate.add<std::uint64_t>(sections.size());
    const std::uint64_t end = crate.size();
    for (std::size_t i = 0; i < sections.size(); ++i) {
      std::string name = sections[i].first;
      name.resize(16);
      crate.bytes_ += name;
      const std::uint64_t stop = i + 1 < sections.size() ? sections[i + 1].second : end - 8;
      crate.add(sections[i].second);
      crate.add(stop - sections[i].second);
    }
    return crate;
  }

 private:
  std::string bytes_;
};

}  // namespace diorama::usd::test
