// SPDX-License-Identifier: Apache-2.0
#include "writer_video/mp4_file.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>

namespace diorama {
namespace {

constexpr std::uint32_t kTicksPerFrame = 1000;

/// Bytes in network order; boxes get their sizes when they end.
class Boxes {
 public:
  std::vector<std::byte> bytes;

  void put(std::uint64_t value, int count) {
    for (int i = count - 1; i >= 0; --i) bytes.push_back(std::byte(value >> (8 * i)));
  }
  void put(std::string_view text) {
    for (const char c : text) bytes.push_back(std::byte(c));
  }
  void zeros(int count) { bytes.insert(bytes.end(), std::size_t(count), std::byte(0)); }

  template <class Content>
  void box(std::string_view name, const Content& content) {
    const std::size_t begin = bytes.size();
    put(0, 4);
    put(name);
    content();
    const auto size = std::uint32_t(bytes.size() - begin);
    for (std::size_t i = 0; i < 4; ++i) bytes[begin + i] = std::byte(size >> (24 - 8 * i));
  }
  /// With a version of 0 and flags.
  template <class Content>
  void full_box(std::string_view name, std::uint32_t flags, const Content& content) {
    box(name, [&] {
      put(flags, 4);
      content();
    });
  }
  /// Nothing is turned or scaled.
  void identity() {
    for (const std::uint32_t value : {0x10000u, 0u, 0u, 0u, 0x10000u, 0u, 0u, 0u, 0x40000000u}) {
      put(value, 4);
    }
  }
};

std::uint32_t ticks_per_second(const Mp4Track& track) {
  // Converted datasets may say any rate.
  return std::uint32_t(std::clamp(std::round(track.fps * kTicksPerFrame), 1.0, 4294967295.0));
}

std::uint64_t data_size(const Mp4Track& track) {
  return std::accumulate(track.sizes.begin(), track.sizes.end(), std::uint64_t(0));
}

void put_sample_entry(Boxes& out, const Mp4Track& track) {
  out.box("avc1", [&] {
    out.zeros(6);
    out.put(1, 2);  // data reference
    out.zeros(16);
    out.put(std::uint64_t(track.width), 2);
    out.put(std::uint64_t(track.height), 2);
    out.put(0x480000, 4);  // 72 dots per inch
    out.put(0x480000, 4);
    out.zeros(4);
    out.put(1, 2);  // one picture per sample
    out.zeros(32);
    out.put(24, 2);
    out.put(0xFFFF, 2);
    out.box("avcC",
            [&] { out.bytes.insert(out.bytes.end(), track.config.begin(), track.config.end()); });
  });
}

void put_sample_table(Boxes& out, const Mp4Track& track) {
  const auto count = std::uint32_t(track.sizes.size());
  out.box("stbl", [&] {
    out.full_box("stsd", 0, [&] {
      out.put(1, 4);
      put_sample_entry(out, track);
    });
    out.full_box("stts", 0, [&] {
      out.put(1, 4);
      out.put(count, 4);
      out.put(kTicksPerFrame, 4);
    });
    out.full_box("stsc", 0, [&] {
      out.put(1, 4);
      out.put(1, 4);
      out.put(count, 4);
      out.put(1, 4);
    });
    out.full_box("stsz", 0, [&] {
      out.put(0, 4);
      out.put(count, 4);
      for (const std::uint32_t size : track.sizes) out.put(size, 4);
    });
    out.full_box("co64", 0, [&] {
      out.put(1, 4);
      out.put(mp4_front(track).size(), 8);
    });
  });
}

void put_media(Boxes& out, const Mp4Track& track, std::uint32_t duration) {
  out.box("mdia", [&] {
    out.full_box("mdhd", 0, [&] {
      out.zeros(8);
      out.put(ticks_per_second(track), 4);
      out.put(duration, 4);
      out.put(0x55C4, 2);  // no language
      out.zeros(2);
    });
    out.full_box("hdlr", 0, [&] {
      out.zeros(4);
      out.put("vide");
      out.zeros(13);
    });
    out.box("minf", [&] {
      out.full_box("vmhd", 1, [&] { out.zeros(8); });
      out.box("dinf", [&] {
        out.full_box("dref", 0, [&] {
          out.put(1, 4);
          out.full_box("url ", 1, [] {});
        });
      });
      put_sample_table(out, track);
    });
  });
}

}  // namespace

std::vector<std::byte> mp4_front(const Mp4Track& track) {
  Boxes out;
  out.box("ftyp", [&] {
    out.put("isom");
    out.put(0x200, 4);
    out.put("isomiso2avc1mp41");
  });
  // Its size follows its name where it may not fit into four bytes.
  out.put(1, 4);
  out.put("mdat");
  out.put(16 + data_size(track), 8);
  return std::move(out.bytes);
}

std::vector<std::byte> mp4_index(const Mp4Track& track) {
  const auto duration = std::uint32_t(track.sizes.size() * kTicksPerFrame);
  Boxes out;
  out.box("moov", [&] {
    out.full_box("mvhd", 0, [&] {
      out.zeros(8);
      out.put(ticks_per_second(track), 4);
      out.put(duration, 4);
      out.put(0x10000, 4);
      out.put(0x100, 2);
      out.zeros(10);
      out.identity();
      out.zeros(24);
      out.put(2, 4);  // the next track's number
    });
    out.box("trak", [&] {
      out.full_box("tkhd", 3, [&] {
        out.zeros(8);
        out.put(1, 4);
        out.zeros(4);
        out.put(duration, 4);
        out.zeros(16);
        out.identity();
        out.put(std::uint64_t(track.width) << 16, 4);
        out.put(std::uint64_t(track.height) << 16, 4);
      });
      put_media(out, track, duration);
    });
  });
  return std::move(out.bytes);
}

}  // namespace diorama
