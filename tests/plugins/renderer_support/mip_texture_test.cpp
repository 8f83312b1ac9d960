// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/mip_texture.h"

#include "diorama/error.h"
#include "diorama/image.h"
#include "support/catch.h"

namespace diorama {
namespace {

/// 3 x 2 texels, RGB bytes: top row 10 20 30, bottom row 40 50 60 (red), green = 100, blue = 0.
std::shared_ptr<const Texture> small_texture(ColorSpace space) {
  auto texture = std::make_shared<Texture>();
  texture->name = "small.png";
  texture->width = 3;
  texture->height = 2;
  texture->channels = 3;
  texture->color_space = space;
  for (int i = 0; i < 6; ++i) {
    texture->bytes.push_back(std::uint8_t(10 * (i + 1)));
    texture->bytes.push_back(100);
    texture->bytes.push_back(0);
  }
  return texture;
}

float red(const MipTexture& texture, float u, float v, Wrap wrap) {
  return texture.lookup({u, v}, 0.0f, wrap, wrap)[0] * 255.0f;
}

}  // namespace

TEST_CASE("texel centres give texels, with the origin at the lower left", "[texture]") {
  const auto source = small_texture(ColorSpace::Linear);
  const MipTexture texture(*source);
  CHECK(red(texture, 0.5f / 3, 0.75f, Wrap::Repeat) == Approx(10.0f).margin(1e-3));
  CHECK(red(texture, 2.5f / 3, 0.75f, Wrap::Repeat) == Approx(30.0f).margin(1e-3));
  CHECK(red(texture, 0.5f / 3, 0.25f, Wrap::Repeat) == Approx(40.0f).margin(1e-3));
  CHECK(red(texture, 1.0f / 3, 0.5f, Wrap::Repeat) == Approx(30.0f).margin(1e-3));
}

TEST_CASE("wrapping decides what lies outside", "[texture]") {
  const auto source = small_texture(ColorSpace::Linear);
  const MipTexture texture(*source);
  CHECK(red(texture, 0.5f / 3 + 2.0f, 0.75f - 3.0f, Wrap::Repeat) == Approx(10.0f).margin(1e-3));
  CHECK(red(texture, 5.0f, 9.0f, Wrap::Clamp) == Approx(30.0f).margin(1e-3));
  CHECK(red(texture, -5.0f, -9.0f, Wrap::Clamp) == Approx(40.0f).margin(1e-3));
  CHECK(red(texture, 5.0f, 0.5f, Wrap::Black) == 0.0f);
  CHECK(red(texture, 3.5f / 3, 0.75f, Wrap::Mirror) == Approx(30.0f).margin(1e-3));
  CHECK(red(texture, -0.5f / 3, 0.75f, Wrap::Mirror) == Approx(10.0f).margin(1e-3));
}

TEST_CASE("all kinds of textures are read: grey is repeated, missing alpha is 1", "[texture]") {
  const int channels = GENERATE(1, 2, 3, 4);
  const bool has_bytes = GENERATE(true, false);
  const auto space = GENERATE(ColorSpace::Linear, ColorSpace::Srgb);
  CAPTURE(channels, has_bytes, space == ColorSpace::Srgb);
  Texture source;
  source.width = source.height = 2;
  source.channels = channels;
  source.color_space = space;
  const auto byte = [&](int x, int y, int c) { return 20 * c + 70 * x + 90 * y + 11; };
  for (int i = 0; i < 4 * channels; ++i) {
    const int value = byte(i / channels % 2, i / channels / 2, i % channels);
    if (has_bytes) {
      source.bytes.push_back(std::uint8_t(value));
    } else {
      source.floats.push_back(float(value) / 255.0f);
    }
  }
  const MipTexture texture(source);
  const auto wanted = [&](int x, int y, int c) {  // Of red, green, blue and alpha.
    const bool has_alpha = channels % 2 == 0;
    if (c == 3 && !has_alpha) return 1.0f;
    const float value = float(byte(x, y, c == 3 ? channels - 1 : channels < 3 ? 0 : c)) / 255.0f;
    return space == ColorSpace::Srgb && c < 3 ? linear_from_srgb(value) : value;
  };
  for (int c = 0; c < 4; ++c) {
    CAPTURE(c);
    // A quarter of a texel right of the centre of the lower left one, and up.
    const Rgba found = texture.lookup({0.375f, 0.375f}, 0.0f, Wrap::Clamp, Wrap::Clamp);
    const float low = 0.75f * wanted(0, 1, c) + 0.25f * wanted(1, 1, c);
    const float high = 0.75f * wanted(0, 0, c) + 0.25f * wanted(1, 0, c);
    CHECK(found[c] == Approx(0.75f * low + 0.25f * high).margin(1e-5));
    // Half outside, where nothing is.
    const Rgba border = texture.lookup({0.0f, 0.25f}, 0.0f, Wrap::Black, Wrap::Clamp);
    CHECK(border[c] == Approx(0.5f * wanted(0, 1, c)).margin(1e-5));
  }
}

TEST_CASE("averages are made in linear light and reach the mean", "[texture]") {
  const auto source = small_texture(ColorSpace::Srgb);
  const MipTexture texture(*source);
  float mean = 0.0f;
  for (int i = 1; i <= 6; ++i) mean += linear_from_srgb(float(10 * i) / 255.0f) / 6.0f;
  const Rgba widest = texture.lookup({0.3f, 0.6f}, 50.0f, Wrap::Repeat, Wrap::Repeat);
  CHECK(widest[0] == Approx(mean).margin(2e-3));
  CHECK(widest[1] == Approx(linear_from_srgb(100.0f / 255.0f)).margin(2e-3));
  CHECK(widest[2] == 0.0f);
  CHECK(widest[3] == 1.0f);
}

TEST_CASE("a checkerboard fades to grey with a growing footprint", "[texture]") {
  auto board = std::make_shared<Texture>();
  board->width = board->height = 64;
  board->channels = 1;
  for (int i = 0; i < 64 * 64; ++i) board->bytes.push_back((i + i / 64) % 2 ? 255 : 0);
  const MipTexture texture(*board);
  const Vec2f centre((10 + 0.5f) / 64.0f, (20 + 0.5f) / 64.0f);
  const float sharp = texture.lookup(centre, 0.0f, Wrap::Repeat, Wrap::Repeat)[0];
  const float soft = texture.lookup(centre, 4.0f / 64.0f, Wrap::Repeat, Wrap::Repeat)[0];
  CHECK(std::abs(sharp - 0.5f) == Approx(0.5f));
  CHECK(soft == Approx(0.5f).margin(0.01));
}

TEST_CASE("an input scales, shifts and maps uv", "[texture]") {
  TextureInput input;
  input.texture = small_texture(ColorSpace::Linear);
  input.scale = {2.0f, 1.0f, 1.0f, 1.0f};
  input.bias = {0.1f, 0.0f, 0.0f, 0.0f};
  input.uv_from_mesh_uv << 2.0f, 0.0f, 0.5f / 3, 0.0f, 1.0f, 0.0f;
  const MipTexture texture(*input.texture);
  const TextureSlot slot{&input, &texture};
  CHECK(slot.at({0.5f / 3, 0.75f}, 0.0f)[0] == Approx(2.0f * 20.0f / 255.0f + 0.1f).margin(1e-4));
}

TEST_CASE("averages are as wide as the mapped uv makes them", "[texture]") {
  auto source = std::make_shared<Texture>();
  source->width = source->height = 64;
  source->channels = 1;
  for (int i = 0; i < 64 * 64; ++i) source->bytes.push_back(std::uint8_t(i * i % 251));
  TextureInput input;
  input.texture = source;
  input.uv_from_mesh_uv << 0.0f, -8.0f, 0.25f, 2.0f, 0.0f, 0.0f;  // Turned, lengths four times.
  const MipTexture texture(*source);
  const TextureSlot slot{&input, &texture};
  const Vec2f mesh_uv(0.1f, -0.01f);
  const Vec2f uv(0.33f, 0.2f);
  const Rgba wanted = texture.lookup(uv, 0.5f, Wrap::Repeat, Wrap::Repeat);
  CHECK(slot.scalar(mesh_uv, 0.125f) == Approx(wanted[0]).margin(1e-5));
  CHECK(slot.scalar(mesh_uv, 0.0f) != Approx(wanted[0]).margin(1e-2));
}

TEST_CASE("a texture whose data does not fit its size is refused by name", "[texture]") {
  auto texture = std::make_shared<Texture>(*small_texture(ColorSpace::Linear));
  texture->bytes.pop_back();
  std::string text;
  try {
    const MipTexture made(*texture);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Asset);
    text = error.what();
  }
  CHECK(text.find("small.png") == 0);
  CHECK(text.find("3 x 2 pixels and 3 channels holds 17 bytes") != std::string::npos);
}

}  // namespace diorama
