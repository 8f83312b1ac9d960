// SPDX-License-Identifier: Apache-2.0
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "framework/images/image_codecs.h"
#include "support/catch.h"

// Small files that claim to be large, and large ones that need more memory than there is.

using namespace diorama;

namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes_of(const std::string& text) {
  const auto* begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

std::string big_endian(std::uint32_t value) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) text += char(value >> shift & 255);
  return text;
}

std::uint32_t crc32(const std::string& text) {
  std::uint32_t crc = ~0u;
  for (const char c : text) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

std::string chunk(const std::string& type, const std::string& data) {
  return big_endian(std::uint32_t(data.size())) + type + data + big_endian(crc32(type + data));
}

/// RGBA of 16 bits, with pixel data of nine bytes: 66 bytes in all.
std::string tiny_png(std::uint32_t width, std::uint32_t height, bool is_interlaced) {
  const std::string header = big_endian(width) + big_endian(height) +
                             std::string{16, 6, 0, 0, char(is_interlaced ? 1 : 0)};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", std::string(9, 'x')) +
         chunk("IEND", "");
}

template <class T>
std::string encoded(ImageFormat format, int channels) {
  const std::vector<T> pixels(std::size_t(16 * 8 * channels), T(1));
  const Bytes bytes = encode_image({pixels.data(), 16, 8, channels, int(sizeof(T)) * 8}, format);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// A JPEG of 16 x 8 pixels whose header says another size.
std::string jpeg_of(std::uint16_t width, std::uint16_t height) {
  std::string file = encoded<std::uint8_t>(ImageFormat::Jpeg, 3);
  const std::size_t frame = file.find("\xff\xc0");
  REQUIRE(frame != std::string::npos);
  file.replace(frame + 5, 2, big_endian(height).substr(2));
  file.replace(frame + 7, 2, big_endian(width).substr(2));
  return file;
}

std::string exr_of(std::int32_t width, std::int32_t height) {
  std::string file = encoded<float>(ImageFormat::Exr, 3);
  for (const char* name : {"dataWindow", "displayWindow"}) {
    const std::size_t box = file.find(name) + std::strlen(name) + 1 + 6 + 4;
    const std::int32_t corner[2] = {width - 1, height - 1};
    file.replace(box + 8, 8, reinterpret_cast<const char*>(corner), 8);
  }
  return file;
}

struct Outcome {
  std::string message;
  long grown_kb = 0;
};

long resident_kb() {
  long all = 0;
  long resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

/// Decodes in a process of its own, which tells how much memory it took at most.
Outcome decode(const std::string& file, const std::string& name,
               std::uint64_t budget = kPictureBudget) {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const long before = resident_kb();
  const pid_t child = fork();
  if (child == 0) {
    std::string message = "no error";
    try {
      decode_image(bytes_of(file), name, budget);
    } catch (const Error& error) {
      message = error.what();
    } catch (const std::exception& error) {
      message = std::string("not an Error: ") + error.what();
    }
    const bool is_told = write(ends[1], message.data(), message.size()) == ssize_t(message.size());
    _exit(is_told ? 0 : 1);
  }
  close(ends[1]);
  Outcome outcome;
  char block[512];
  for (ssize_t count; (count = read(ends[0], block, sizeof block)) > 0;) {
    outcome.message.append(block, std::size_t(count));
  }
  close(ends[0]);
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) outcome.message = "crashed";
  outcome.grown_kb = usage.ru_maxrss - before;
  return outcome;
}

constexpr long kMostKb = 50 * 1024;

}  // namespace

TEST_CASE("a tiny picture that claims to be huge costs next to nothing", "[images]") {
  const std::string run_of_128("\xff\x01\x02\x03\x04", 5);
  const std::string tga =
      std::string("\0\0\x0a\0\0\0\0\0\0\0\0\0\0\x40\0\x40\x20\0", 18) + run_of_128;
  const struct {
    const char* name;
    std::string file;
  } kFiles[] = {{"wide.png", tiny_png(0x0FFFFFFF, 1, false)},
                {"laced.png", tiny_png(0x0FFFFFFF, 7, true)},
                {"square.png", tiny_png(16384, 16384, false)},
                {"square_laced.png", tiny_png(16384, 16384, true)},
                {"square.jpg", jpeg_of(16384, 16384)},
                {"huge.jpg", jpeg_of(65500, 65500)},
                {"square.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 16384\n"},
                {"square.exr", exr_of(16384, 16384)},
                {"huge.exr", exr_of(2'000'000'000, 2'000'000'000)},
                {"square.tga", tga}};
  CHECK(kFiles[0].file.size() == 66);
  for (const auto& [name, file] : kFiles) {
    const Outcome outcome = decode(file, name);
    INFO(name << ": " << outcome.message);
    CHECK(outcome.message.starts_with(std::string(name) + ": "));
    CHECK((outcome.message.find("the file is cut off") != std::string::npos ||
           outcome.message.find(" pixels; 1 to 16384 a side are read") != std::string::npos));
    CHECK(outcome.grown_kb < kMostKb);
  }
}

TEST_CASE("texts and profiles inside of a PNG are not unpacked", "[images]") {
  // Nothing but a header of zlib; libpng would complain about it if it looked.
  const std::string packed = std::string("name\0\0", 6) + "\x78\x9c";
  std::string file = encoded<std::uint8_t>(ImageFormat::Png, 3);
  const std::size_t behind_header = 8 + 25;
  std::string texts;
  for (int i = 0; i < 100; ++i) texts += chunk("iCCP", packed) + chunk("zTXt", packed);
  file.insert(behind_header, texts);
  CHECK(decode(file, "a.png").message == "no error");
}

TEST_CASE("a JPEG with scans without end is refused", "[images]") {
  std::string file = encoded<std::uint8_t>(ImageFormat::Jpeg, 1);
  const std::size_t scan = file.find("\xff\xda");
  REQUIRE(scan != std::string::npos);
  file[file.find("\xff\xc0") + 1] = '\xc2';  // progressive
  // First scan: the mean of each block; then one that says of all blocks that they are zero.
  const std::string table = std::string("\xff\xc4\0\x14\x10", 5) + std::string("\1", 1) +
                            std::string(15, '\0') + std::string(1, '\0');
  const std::string first = std::string("\xff\xda\0\x08\x01\x01\0\0\0\0", 10) + "\x0f";
  const std::string next = std::string("\xff\xda\0\x08\x01\x01\0\x01\x3f\0", 10) + "\x3f";
  file.erase(scan);
  file += table + first;
  for (int i = 0; i < 1000; ++i) file += next;
  file += "\xff\xd9";
  CHECK(decode(file, "scans.jpg").message == "scans.jpg: damaged JPEG: it has more than 100 scans");
}

TEST_CASE("decoding keeps to its budget", "[images]") {
  const struct {
    const char* name;
    std::string file;
  } kFiles[] = {{"a.png", encoded<std::uint8_t>(ImageFormat::Png, 3)},
                {"b.png", encoded<std::uint16_t>(ImageFormat::Png, 1)},
                {"c.jpg", encoded<std::uint8_t>(ImageFormat::Jpeg, 3)},
                {"d.hdr", encoded<float>(ImageFormat::Hdr, 3)},
                {"e.exr", encoded<float>(ImageFormat::Exr, 3)}};
  for (const auto& [name, file] : kFiles) {
    INFO(name);
    CHECK(decode(file, name).message == "no error");
    CHECK(decode(file, name, 100).message ==
          std::string(name) +
              ": decoding its 16 x 8 pixels takes 1 MiB, the budget is 1 MiB; make "
              "the picture smaller or raise --picture-mib");
  }
}
