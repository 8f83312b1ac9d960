// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <zlib.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <istream>
#include <memory>
#include <optional>
#include <streambuf>
#include <vector>

namespace diorama {

/// Places of a gzip file from which its content can be had without what is before them. Each keeps
/// the 32 KiB in front of it.
class GzipPlaces {
 public:
  struct Place {
    std::uint64_t at = 0;      ///< In the content.
    std::uint64_t packed = 0;  ///< In the file; of the byte that begins there, or the next one.
    int bits = 0;              ///< Of the byte before, which belong to what follows.
    std::vector<unsigned char> window;
  };
  static constexpr std::size_t kMost = 512;

  /// Places are at least so many bytes of content apart; more, once there are kMost.
  explicit GzipPlaces(std::uint64_t spacing) : spacing_(spacing) {}

  bool is_wanted(std::uint64_t at) const;
  void add(Place place);
  /// The last one that is not behind `at`; null: the beginning.
  const Place* before(std::uint64_t at) const;
  std::size_t count() const { return places_.size(); }
  /// Leaves those that are so far apart.
  void thin(std::uint64_t spacing);

 private:
  std::uint64_t spacing_;
  std::vector<Place> places_;
};

/// The content of a gzip file, of several members too, as a stream that can go to any place: back
/// by beginning anew at one of `places`. What is wrong with the file is thrown from reading as
/// std::runtime_error. Holds some 200 KiB.
class GzipStream final : public std::istream {
 public:
  /// Learns places while it goes on; checks the members' checksums.
  GzipStream(std::ifstream file, GzipPlaces& to_learn);
  GzipStream(std::ifstream file, const GzipPlaces& known);
  /// Of content that has come so far.
  std::uint64_t seen() const { return buffer_.seen(); }

 private:
  class Buffer final : public std::streambuf {
   public:
    Buffer(std::ifstream file, const GzipPlaces& known, GzipPlaces* to_learn);
    ~Buffer() override;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    std::uint64_t seen() const { return at_; }

   private:
    int_type underflow() override;
    pos_type seekpos(pos_type to, std::ios_base::openmode which) override;

    bool refill();
    void begin();
    void begin_at(const GzipPlaces::Place& place);
    void end_member();
    void learn();

    std::ifstream file_;
    const GzipPlaces& known_;
    GzipPlaces* to_learn_;
    z_stream state_{};
    std::array<unsigned char, std::size_t(1) << 16> packed_{};
    std::array<char, std::size_t(1) << 16> content_{};
    std::uint64_t file_at_ = 0;  ///< Behind what lies in packed_.
    std::uint64_t at_ = 0;       ///< In the content, behind what lies in content_.
    bool is_raw_ = false;        ///< Within a member whose header was passed over.
    bool is_at_end_ = false;
  };

  Buffer buffer_;
};

/// Whether a file begins as gzip files do.
bool is_gzip(std::ifstream& file);

}  // namespace diorama
