// SPDX-License-Identifier: Apache-2.0
#include "framework/export/crate_writer.h"

#include <lz4.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>
#include <string>

#include "diorama/rng.h"
#include "framework/export/usda_writer.h"
#include "loader_usd/usd/asset_library.h"
#include "loader_usd/usd/layer.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::usd_export;

namespace {

/// The decoder of the format's description, written for this test alone.
std::vector<std::int32_t> decode_integers(const Bytes& coded, std::size_t count) {
  REQUIRE(coded[0] == std::byte{0});
  Bytes raw(4 + (2 * count + 7) / 8 + 4 * count);
  const int size = LZ4_decompress_safe(reinterpret_cast<const char*>(coded.data()) + 1,
                                       reinterpret_cast<char*>(raw.data()), int(coded.size()) - 1,
                                       int(raw.size()));
  REQUIRE(size >= 4);
  std::int32_t common = 0;
  std::memcpy(&common, raw.data(), 4);
  const std::byte* codes = raw.data() + 4;
  const std::byte* next = codes + (2 * count + 7) / 8;
  std::vector<std::int32_t> values;
  std::uint32_t sum = 0;
  const auto take = [&next](auto zero) {
    std::memcpy(&zero, next, sizeof zero);
    next += sizeof zero;
    return std::int32_t(zero);
  };
  for (std::size_t i = 0; i < count; ++i) {
    switch (unsigned(codes[i / 4]) >> (2 * (i % 4)) & 3) {
      case 0:
        sum += std::uint32_t(common);
        break;
      case 1:
        sum += std::uint32_t(take(std::int8_t()));
        break;
      case 2:
        sum += std::uint32_t(take(std::int16_t()));
        break;
      default:
        sum += std::uint32_t(take(std::int32_t()));
        break;
    }
    values.push_back(std::int32_t(sum));
  }
  CHECK(next == raw.data() + size);
  return values;
}

/// A layer with every kind of value that the exporter writes.
Layer many_values() {
  Prim shader;
  shader.name = "Shader";
  shader.type = "Shader";
  shader.set_uniform("info:id", "token", Token{"UsdUVTexture"});
  shader.set("inputs:file", "asset", AssetPath{"./textures/a b.png"});
  shader.set("inputs:scale", "float4", Float4{2, 2, 2, 1});
  shader.set("inputs:varname", "string", std::string("say \"st\"\nor \\uv"));
  shader.connect("inputs:st", "float2", "/World/Shader.outputs:rgb");
  shader.set("outputs:rgb", "float3", Vec3f(0.1f, 0.25f, -3e-9f));
  Prim mesh;
  mesh.name = "_011_banana";
  mesh.type = "Mesh";
  mesh.api_schemas = {"MaterialBindingAPI", "PhysicsMassAPI"};
  mesh.set("points", "point3f[]", std::vector<Vec3f>{{0, 1, 2}, {3.5f, -4, 1e-7f}, {7, 8, 9}});
  mesh.set("faceVertexIndices", "int[]", std::vector<int>{0, 1, 2});
  std::vector<int> many;
  for (int i = 0; i < 5000; ++i) many.push_back((i * 7919) % 70001 - 300);
  mesh.set("indices", "int[]", std::move(many));
  mesh.set("empty", "int[]", std::vector<int>{});
  mesh.set("primvars:st", "texCoord2f[]", std::vector<Vec2f>{{0, 0}, {0.5f, 1}, {-2, 3}});
  mesh.properties.back().interpolation = "vertex";
  mesh.set("labels", "token[]", std::vector<Token>{{"banana"}, {"fruit"}});
  mesh.set("physics:mass", "float", 0.066f);
  mesh.set("exact", "double", 0.5);
  mesh.set("inexact", "double", 0.1);
  mesh.set("flag", "bool", true);
  mesh.set("number", "int", -7);
  mesh.relate("material:binding", "/World/Shader");
  Prim world;
  world.name = "World";
  world.type = "Xform";
  world.kind = "component";
  world.set("xformOp:translate", "double3", Double3{1, 2.25, -3.1});
  Matrix matrix{};
  for (std::size_t i = 0; i < 16; ++i) matrix[i] = 0.1 * double(i) - 0.7;
  world.set("xformOp:transform", "matrix4d", matrix);
  world.set_uniform("xformOpOrder", "token[]",
                    std::vector<Token>{{"xformOp:translate"}, {"xformOp:transform"}});
  Prim empty;
  empty.name = "Empty";
  world.children = {mesh, empty, shader};
  Layer layer;
  layer.roots = {world, empty};
  layer.roots[1].name = "Other";
  return layer;
}

std::shared_ptr<usd::Layer> read(const std::string& name, std::span<const std::byte> bytes) {
  return usd::read_layer(name, usd::copy_bytes(bytes));
}

/// Type and contents.
bool is_same(const usd::Value& a, const usd::Value& b) {
  if (a.type() != b.type() || a.is_array() != b.is_array() || a.size() != b.size()) return false;
  if (a.as_text()) return b.as_text() && *a.as_text() == *b.as_text();
  if (a.as_strings()) return b.as_strings() && *a.as_strings() == *b.as_strings();
  if (const auto* list = a.as_string_list_op()) {
    return b.as_string_list_op() && *list == *b.as_string_list_op();
  }
  return a.as_enumerator() == b.as_enumerator() && std::ranges::equal(a.bytes(), b.bytes());
}

}  // namespace

TEST_CASE("integers survive the coding, whatever their steps", "[export]") {
  std::vector<std::int32_t> values{0,
                                   1,
                                   2,
                                   3,
                                   3,
                                   -200,
                                   40000,
                                   40001,
                                   std::numeric_limits<std::int32_t>::max(),
                                   std::numeric_limits<std::int32_t>::min(),
                                   -1,
                                   0};
  CHECK(decode_integers(code_integers(values), values.size()) == values);
  Rng rng(3);
  for (const double spread : {3.0, 300.0, 100000.0, 4e9}) {
    std::vector<std::int32_t> list;
    for (int i = 0; i < 999; ++i)
      list.push_back(std::int32_t(std::int64_t(rng.uniform(-0.5, 0.5) * spread)));
    INFO(spread);
    CHECK(decode_integers(code_integers(list), list.size()) == list);
  }
  CHECK(decode_integers(code_integers(std::vector<std::int32_t>(1000, 3)), 1000) ==
        std::vector<std::int32_t>(1000, 3));
  CHECK(code_integers(std::vector<std::int32_t>(1000, 3)).size() < 40);
}

TEST_CASE("a crate file begins and ends as the format says", "[export]") {
  const Bytes bytes = write_crate(many_values());
  CHECK(std::memcmp(bytes.data(), "PXR-USDC\0\x08\0", 11) == 0);
  std::int64_t contents = 0;
  std::memcpy(&contents, bytes.data() + 16, sizeof contents);
  std::uint64_t sections = 0;
  REQUIRE(contents + 8 < std::int64_t(bytes.size()));
  std::memcpy(&sections, bytes.data() + contents, sizeof sections);
  CHECK(sections == 6);
  CHECK(bytes.size() == std::size_t(contents) + 8 + 6 * 32);
  std::int64_t end = 0;
  for (int i = 0; i < 6; ++i) {
    std::int64_t start = 0, size = 0;
    std::memcpy(&start, bytes.data() + contents + 8 + 32 * i + 16, 8);
    std::memcpy(&size, bytes.data() + contents + 8 + 32 * i + 24, 8);
    if (i > 0) CHECK(start == end);
    end = start + size;
  }
  CHECK(end == contents);
  CHECK(write_crate(many_values()) == bytes);
}

TEST_CASE("text and crate hold the same specs and values", "[export]") {
  const Layer layer = many_values();
  const Bytes crate = write_crate(layer);
  const std::string text = write_usda(layer);
  const auto a = read("a.usdc", crate);
  const auto b = read("b.usda", std::as_bytes(std::span(text)));
  CHECK(a->prim_count() == b->prim_count());
  const auto compare = [&](const usd::FieldSet& fa, const usd::FieldSet& fb, const char* field) {
    INFO(field);
    REQUIRE(a->has(fa, field) == b->has(fb, field));
    CHECK(is_same(a->get(fa, field), b->get(fb, field)));
  };
  for (const char* field : {"defaultPrim", "metersPerUnit", "upAxis"}) {
    compare(a->root().fields, b->root().fields, field);
  }
  for (const char* path :
       {"/World", "/World/_011_banana", "/World/Empty", "/World/Shader", "/Other"}) {
    INFO(path);
    const usd::PrimSpec* pa = a->prim(path);
    const usd::PrimSpec* pb = b->prim(path);
    REQUIRE(pa);
    REQUIRE(pb);
    for (const char* field : {"specifier", "typeName", "kind", "apiSchemas"})
      compare(pa->fields, pb->fields, field);
    REQUIRE(pa->properties.size() == pb->properties.size());
    for (std::size_t i = 0; i < pa->properties.size(); ++i) {
      INFO(pa->properties[i].name);
      CHECK(pa->properties[i].name == pb->properties[i].name);
      CHECK(pa->properties[i].type == pb->properties[i].type);
      for (const char* field :
           {"typeName", "default", "interpolation", "connectionPaths", "targetPaths"}) {
        compare(pa->properties[i].fields, pb->properties[i].fields, field);
      }
    }
  }
}

TEST_CASE("equal arrays are stored once", "[export]") {
  Layer layer = many_values();
  const std::size_t once = write_crate(layer).size();
  std::vector<Vec3f> points(10000);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = Vec3f(float(i), 0.1f, 2);
  Prim mesh;
  mesh.type = "Mesh";
  mesh.set("points", "point3f[]", points);
  for (int i = 0; i < 5; ++i) {
    mesh.name = "copy_" + std::to_string(i);
    layer.roots[0].children.push_back(mesh);
  }
  CHECK(write_crate(layer).size() < once + 10000 * 12 + 2000);
}
