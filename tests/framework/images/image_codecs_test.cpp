// SPDX-License-Identifier: Apache-2.0
#include "framework/images/image_codecs.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "diorama/error.h"
#include "diorama/rng.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

using Bytes = std::vector<std::byte>;

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "diorama_images_XXXXXX").string();
    path = mkdtemp(pattern.data());
  }
  ~TemporaryFolder() { fs::remove_all(path); }
  fs::path path;
};

Bytes read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

void write(const fs::path& file, const Bytes& bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

/// Runs the other codecs; false (and a warning) where Python lacks them.
bool run_reference(const std::string& command, const fs::path& folder) {
  if (std::system("/usr/bin/python3 -c 'import cv2, numpy' 2>/dev/null") != 0) {
    WARN("/usr/bin/python3 with cv2 and numpy is not there; comparison skipped");
    return false;
  }
  const std::string script = DIORAMA_SOURCE_DIR "/tests/framework/images/reference_images.py ";
  REQUIRE(std::system(("/usr/bin/python3 " + script + command + " " + folder.string()).c_str()) ==
          0);
  return true;
}

/// Half noise, half smooth, different in every channel.
template <class T>
std::vector<T> picture(int width, int height, int channels, double scale) {
  Rng rng = Rng(5).fork(std::uint64_t(width * 1000 + height * 10 + channels));
  std::vector<T> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        const double smooth = 0.5 + 0.5 * std::sin(0.1 * x * (c + 1) + 0.2 * y);
        pixels.push_back(T(scale * (y < height / 2 ? smooth : rng.uniform())));
      }
    }
  }
  return pixels;
}

template <class T>
ImageView view(const std::vector<T>& pixels, int width, int height, int channels) {
  return {pixels.data(), width, height, channels, int(sizeof(T)) * 8};
}

const std::vector<std::pair<int, int>> kSizes{{1, 1}, {1, 7}, {9, 1}, {33, 5}, {64, 48}, {7, 3}};

std::string decode_error(const Bytes& bytes, std::string_view name) {
  try {
    decode_image(bytes, name);
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Asset);
    CHECK(std::string(error.what()).starts_with(std::string(name) + ": "));
    return error.what();
  }
  return "no error";
}

struct Encoded {
  std::string name;
  Bytes bytes;
};

/// One file per format; small, as each of their prefixes is decoded.
std::vector<Encoded> samples() {
  const auto rgb = picture<std::uint8_t>(17, 11, 3, 255);
  const auto deep = picture<std::uint16_t>(13, 5, 1, 65535);
  const auto light = picture<float>(19, 7, 3, 40);
  return {{"a.png", encode_image(view(rgb, 17, 11, 3), ImageFormat::Png)},
          {"b.png", encode_image(view(deep, 13, 5, 1), ImageFormat::Png)},
          {"c.jpg", encode_image(view(rgb, 17, 11, 3), ImageFormat::Jpeg)},
          {"d.hdr", encode_image(view(light, 19, 7, 3), ImageFormat::Hdr)},
          {"e.exr", encode_image(view(light, 19, 7, 3), ImageFormat::Exr)}};
}

}  // namespace

TEST_CASE("PNG keeps every bit, for all kinds and odd sizes", "[images]") {
  for (const auto& [width, height] : kSizes) {
    for (const int channels : {1, 3, 4}) {
      const auto pixels = picture<std::uint8_t>(width, height, channels, 255);
      const Bytes bytes = encode_image(view(pixels, width, height, channels), ImageFormat::Png);
      const auto texture = decode_image(bytes, "t.png");
      CHECK(texture->width == width);
      CHECK(texture->height == height);
      CHECK(texture->channels == channels);
      CHECK(texture->bytes == pixels);
      CHECK(texture->color_space == (channels == 1 ? ColorSpace::Linear : ColorSpace::Srgb));
      CHECK(texture->name == "t.png");
      CHECK(bytes == encode_image(view(pixels, width, height, channels), ImageFormat::Png));
    }
    const auto deep = picture<std::uint16_t>(width, height, 1, 65535);
    const auto texture =
        decode_image(encode_image(view(deep, width, height, 1), ImageFormat::Png), "t");
    REQUIRE(texture->floats.size() == deep.size());
    CHECK(texture->color_space == ColorSpace::Linear);
    for (std::size_t i = 0; i < deep.size(); ++i) {
      CHECK(std::lround(texture->floats[i] * 65535.0f) == deep[i]);
    }
  }
}

TEST_CASE("PNG keeps pictures with few values, whatever was written before", "[images]") {
  constexpr int kWidth = 640;  // rows of several parts
  constexpr int kHeight = 24;
  const auto noise = picture<std::uint8_t>(kWidth, 2 * kHeight, 4, 255);
  for (const int channels : {1, 4}) {
    std::vector<std::uint8_t> pixels(std::size_t(kWidth * kHeight * channels));
    for (int y = 8; y < kHeight; ++y) {  // nothing, then a bar, then one that is wider
      for (int x = 100; x < (y < 16 ? 200 : 300); ++x) {
        for (int k = 0; k < channels; ++k) {
          pixels[std::size_t((y * kWidth + x) * channels + k)] = std::uint8_t(200 + k);
        }
      }
    }
    const Bytes bytes = encode_image(view(pixels, kWidth, kHeight, channels), ImageFormat::Png);
    CHECK(decode_image(bytes, "t.png")->bytes == pixels);
    CHECK(bytes.size() < 400);
    encode_image(view(noise, kWidth, 2 * kHeight, 4), ImageFormat::Png);
    CHECK(bytes == encode_image(view(pixels, kWidth, kHeight, channels), ImageFormat::Png));
  }
}

TEST_CASE("EXR keeps every bit of a float", "[images]") {
  for (const auto& [width, height] : kSizes) {
    for (const int channels : {1, 3, 4}) {
      auto pixels = picture<float>(width, height, channels, 1e4);
      pixels.front() = std::numeric_limits<float>::infinity();
      pixels.back() = -1e-30f;
      const auto texture = decode_image(
          encode_image(view(pixels, width, height, channels), ImageFormat::Exr), "t.exr");
      CHECK(texture->channels == channels);
      CHECK(texture->floats == pixels);
      CHECK(texture->color_space == ColorSpace::Linear);
    }
  }
}

TEST_CASE("HDR keeps each pixel within 1/256 of its largest channel", "[images]") {
  for (const auto& [width, height] : kSizes) {
    auto pixels = picture<float>(width, height, 3, 1.0);
    Rng rng(3);
    for (std::size_t i = 0; i < pixels.size(); i += 3) {
      const auto scale = float(std::exp2(rng.uniform(-60, 60)));
      for (std::size_t c = 0; c < 3; ++c) pixels[i + c] *= scale;
    }
    const auto texture =
        decode_image(encode_image(view(pixels, width, height, 3), ImageFormat::Hdr), "t.hdr");
    REQUIRE(texture->floats.size() == pixels.size());
    for (std::size_t i = 0; i < pixels.size(); i += 3) {
      const float largest = std::max({pixels[i], pixels[i + 1], pixels[i + 2]});
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(std::abs(texture->floats[i + c] - pixels[i + c]) <= largest / 255);
      }
    }
  }
}

TEST_CASE("HDR values at the edges stay what they are", "[images]") {
  // A mantissa that rounds up to 256, zero, tiny, negative and not a number.
  std::vector<float> pixels{0.9999f, 0.5f, 0.25f, 0, 0, 0, 1e-39f, 0, 0, -3, 1, NAN};
  const auto texture = decode_image(encode_image(view(pixels, 4, 1, 3), ImageFormat::Hdr), "t.hdr");
  const std::vector<float> expected{1.0f, 0.5f, 0.25f, 0, 0, 0, 0, 0, 0, 0, 1, 0};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CHECK(texture->floats[i] == Approx(expected[i]).margin(0.005));
  }
}

TEST_CASE("exposures of an HDR file are undone and rows from the bottom are turned", "[images]") {
  const std::string text =
      "#?RADIANCE\nEXPOSURE=2\nEXPOSURE= 0.25\nFORMAT=32-bit_rle_rgbe\n\n+Y 2 +X 1\n";
  Bytes bytes;
  for (const char c : text) bytes.push_back(std::byte(c));
  for (const int byte : {128, 64, 32, 129, 0, 0, 128, 128}) bytes.push_back(std::byte(byte));
  const auto texture = decode_image(bytes, "t.hdr");
  CHECK(texture->floats == std::vector<float>{0, 0, 1.0f, 2.0f, 1.0f, 0.5f});
}

TEST_CASE("JPEG is near the picture", "[images]") {
  for (const int channels : {1, 3}) {
    std::vector<std::uint8_t> pixels;
    for (int i = 0; i < 45 * 31 * channels; ++i) {
      const int x = i / channels % 45;
      const int y = i / channels / 45;
      pixels.push_back(std::uint8_t(60 + 3 * x + y * (1 + i % channels)));
    }
    const auto texture =
        decode_image(encode_image(view(pixels, 45, 31, channels), ImageFormat::Jpeg), "t.jpg");
    REQUIRE(texture->bytes.size() == pixels.size());
    double sum = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      sum += std::abs(int(texture->bytes[i]) - int(pixels[i]));
    }
    CHECK(sum / double(pixels.size()) < 3.0);
  }
}

TEST_CASE("what we write, others read", "[images]") {
  const TemporaryFolder folder;
  const auto rgba = picture<std::uint8_t>(33, 5, 4, 255);
  const auto rgb = picture<std::uint8_t>(41, 23, 3, 255);
  const auto grey = picture<std::uint16_t>(7, 3, 1, 65535);
  const auto light = picture<float>(29, 13, 3, 90);
  write(folder.path / "a.png", encode_image(view(rgba, 33, 5, 4), ImageFormat::Png));
  write(folder.path / "b.png", encode_image(view(grey, 7, 3, 1), ImageFormat::Png));
  write(folder.path / "c.jpg", encode_image(view(rgb, 41, 23, 3), ImageFormat::Jpeg));
  write(folder.path / "d.hdr", encode_image(view(light, 29, 13, 3), ImageFormat::Hdr));
  write(folder.path / "e.exr", encode_image(view(light, 29, 13, 3), ImageFormat::Exr));
  if (!run_reference("decode", folder.path)) return;
  const auto raw = [&](const char* name) {
    return read(folder.path / (std::string(name) + ".raw"));
  };
  const auto equals = [](const Bytes& bytes, const auto& pixels) {
    const std::size_t size = pixels.size() * sizeof pixels[0];
    return bytes.size() == size && std::memcmp(bytes.data(), pixels.data(), size) == 0;
  };
  CHECK(equals(raw("a.png"), rgba));
  CHECK(equals(raw("b.png"), grey));
  CHECK(equals(raw("c.jpg"), decode_image(read(folder.path / "c.jpg"), "c.jpg")->bytes));
  CHECK(equals(raw("e.exr"), light));
  const Bytes hdr = raw("d.hdr");
  const auto ours = decode_image(read(folder.path / "d.hdr"), "d.hdr");
  REQUIRE(hdr.size() == ours->floats.size() * 4);
  for (std::size_t i = 0; i < ours->floats.size(); ++i) {
    float other;
    std::memcpy(&other, hdr.data() + 4 * i, 4);
    CHECK(other == Approx(ours->floats[i]).epsilon(1e-6));
  }
}

TEST_CASE("what others write, we read", "[images]") {
  const TemporaryFolder folder;
  if (!run_reference("make", folder.path)) return;
  int count = 0;
  for (const auto& entry : fs::directory_iterator(folder.path)) {
    if (entry.path().extension() != ".raw") continue;
    const fs::path file = folder.path / entry.path().stem();
    INFO(file.string());
    const auto texture = decode_image(read(file), file.string());
    int width = 0, height = 0, channels = 0, is_float = 0;
    std::ifstream(file.string() + ".txt") >> width >> height >> channels >> is_float;
    CHECK(texture->width == width);
    CHECK(texture->height == height);
    CHECK(texture->channels == channels);
    const Bytes raw = read(entry.path());
    if (is_float) {
      REQUIRE(raw.size() == texture->floats.size() * 4);
      for (std::size_t i = 0; i < texture->floats.size(); ++i) {
        float other;
        std::memcpy(&other, raw.data() + 4 * i, 4);
        CHECK(texture->floats[i] == Approx(other).epsilon(1e-6));
      }
    } else {
      REQUIRE(raw.size() == texture->bytes.size());
      CHECK(std::memcmp(raw.data(), texture->bytes.data(), raw.size()) == 0);
    }
    ++count;
  }
  CHECK(count == 37);
}

TEST_CASE("every truncated image is refused with its name", "[images]") {
  for (const Encoded& sample : samples()) {
    INFO(sample.name);
    for (std::size_t size = 0; size < sample.bytes.size(); ++size) {
      const Bytes cut(sample.bytes.begin(), sample.bytes.begin() + std::ptrdiff_t(size));
      INFO(size << " of " << sample.bytes.size());
      CHECK(decode_error(cut, sample.name) != "no error");
    }
  }
}

TEST_CASE("damaged images never crash", "[images]") {
  for (const Encoded& sample : samples()) {
    for (std::size_t at = 0; at < sample.bytes.size(); ++at) {
      for (const int damage : {0x00, 0xff, 0x80}) {
        Bytes bytes = sample.bytes;
        bytes[at] = std::byte(damage);
        // Some damage is not noticed (a pixel's colour); it must not do more than that.
        decode_error(bytes, sample.name);
      }
    }
  }
}

TEST_CASE("TGA is known by its name, also inside of a package", "[images]") {
  // One pixel, plain, blue first.
  const std::uint8_t tga[] = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, 30, 20, 10};
  for (const char* name : {"a.tga", "A.TGA", "a.usdz[b/c.tga]"}) {
    const auto texture = decode_image(std::as_bytes(std::span(tga)), name);
    CHECK(texture->bytes == std::vector<std::uint8_t>{10, 20, 30});
  }
}

TEST_CASE("hostile headers of BMP and TGA files are refused", "[images]") {
  const TemporaryFolder folder;
  if (!run_reference("make", folder.path)) return;
  for (const char* name : {"picture.bmp", "grey.bmp", "plain.tga", "upward.tga", "runs.tga"}) {
    const Bytes good = read(folder.path / name);
    for (std::size_t size = 0; size < good.size(); ++size) {
      CHECK(decode_error({good.begin(), good.begin() + std::ptrdiff_t(size)}, name) != "no error");
    }
    for (std::size_t at = 0; at < std::min<std::size_t>(good.size(), 60); ++at) {
      for (int damage = 0; damage < 256; damage += 15) {
        Bytes bytes = good;
        bytes[at] = std::byte(damage);
        decode_error(bytes, name);
      }
    }
  }
}

TEST_CASE("hostile pictures for OpenCV are one message each", "[images]") {
  const TemporaryFolder folder;
  if (!run_reference("make", folder.path)) return;
  for (const char* name : {"deep.tif", "light.tif", "grey.tif", "picture.webp", "picture.jp2"}) {
    const Bytes good = read(folder.path / name);
    INFO(name);
    CHECK_THROWS_WITH(decode_image(good, name, 300), ContainsSubstring("MiB, the budget is"));
    // What ends a file may be missing.
    for (std::size_t size = 0; size + 8 < good.size(); size += size < 300 ? 1 : 37) {
      INFO(size << " of " << good.size());
      CHECK(decode_error({good.begin(), good.begin() + std::ptrdiff_t(size)}, name) != "no error");
    }
    for (std::size_t at = 0; at < std::min<std::size_t>(good.size(), 150); ++at) {
      for (const int damage : {0x00, 0x01, 0x7f, 0xff}) {
        Bytes bytes = good;
        bytes[at] = std::byte(damage);
        decode_error(bytes, name);
      }
    }
  }
}

TEST_CASE("Sizes that TIFF, WebP and JPEG 2000 claim are checked before they are believed",
          "[images]") {
  const TemporaryFolder folder;
  if (!run_reference("make", folder.path)) return;
  const auto with = [&](const char* name, std::size_t at, std::initializer_list<int> values) {
    Bytes bytes = read(folder.path / name);
    for (const int value : values) bytes[at++] = std::byte(value);
    return decode_error(bytes, name);
  };
  // Width: the value of the first of ten fields of 12 bytes.
  CHECK(with("deep.tif", 18, {0x7f, 0xff}) ==
        "deep.tif: the image has 32767 x 7 pixels; 1 to 16384 a side are read");
  CHECK(with("deep.tif", 18, {0x00, 0x00}) == "deep.tif: damaged TIFF: it does not say its size");
  CHECK(with("picture.webp", 12, {'V', 'P', '9', 'L'}) ==
        "picture.webp: damaged WebP: it holds no picture");
  const Bytes jp2 = read(folder.path / "picture.jp2");
  const std::string text(reinterpret_cast<const char*>(jp2.data()), jp2.size());
  const std::size_t sizes = text.find("\xff\x4f\xff\x51");
  REQUIRE(sizes != text.npos);
  CHECK(with("picture.jp2", sizes + 8, {0x7f, 0xff, 0xff, 0xff}) ==
        "picture.jp2: the image has 2147483647 x 40 pixels; 1 to 16384 a side are read");
  CHECK(with("picture.jp2", sizes + 40, {0xff, 0xff}).find("MiB") == std::string::npos);
}

TEST_CASE("messages say what is wrong with an image", "[images]") {
  CHECK(decode_error({}, "a.png") == "a.png: the image file is empty");
  const Bytes text(40, std::byte('x'));
  CHECK(decode_error(text, "b.dat") ==
        "b.dat: is no image of a known format; PNG, JPEG, Radiance HDR, OpenEXR, TIFF, WebP, "
        "JPEG 2000, BMP and TGA are read");
  Bytes png = samples()[0].bytes;
  png[16] = std::byte(0x7f);  // a width of 2 000 million with a wrong check sum
  CHECK(decode_error(png, "c.png").starts_with("c.png: damaged PNG: "));
  const auto pixels = picture<std::uint8_t>(3, 3, 2, 255);
  CHECK_THROWS_WITH(encode_image(view(pixels, 3, 3, 2), ImageFormat::Jpeg),
                    "JPEG cannot hold an image of 3 x 3 pixels with 2 channels of 8 bits");
}
