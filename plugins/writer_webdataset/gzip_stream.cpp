// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/gzip_stream.h"

#include <algorithm>
#include <new>
#include <stdexcept>
#include <utility>

namespace diorama {
namespace {

constexpr int kGzip = 16 + MAX_WBITS;
constexpr int kRaw = -MAX_WBITS;
constexpr std::size_t kTrailer = 8;  ///< Checksum and size behind a member.
constexpr unsigned char kMagic[] = {0x1f, 0x8b};

}  // namespace

bool is_gzip(std::ifstream& file) {
  unsigned char first[2] = {};
  file.read(reinterpret_cast<char*>(first), sizeof first);
  const bool is_packed = bool(file) && std::ranges::equal(first, kMagic);
  file.clear();
  file.seekg(0);
  return is_packed;
}

bool GzipPlaces::is_wanted(std::uint64_t at) const {
  return at - (places_.empty() ? 0 : places_.back().at) >= spacing_;
}

void GzipPlaces::add(Place place) {
  places_.push_back(std::move(place));
  if (places_.size() > kMost) thin(2 * spacing_);
}

const GzipPlaces::Place* GzipPlaces::before(std::uint64_t at) const {
  const auto next = std::ranges::upper_bound(places_, at, {}, &Place::at);
  return next == places_.begin() ? nullptr : &*(next - 1);
}

void GzipPlaces::thin(std::uint64_t spacing) {
  spacing_ = spacing;
  std::uint64_t last = 0;
  std::erase_if(places_, [&](const Place& place) {
    if (place.at - last < spacing_) return true;
    last = place.at;
    return false;
  });
  places_.shrink_to_fit();
}

GzipStream::GzipStream(std::ifstream file, GzipPlaces& to_learn)
    : std::istream(nullptr), buffer_(std::move(file), to_learn, &to_learn) {
  rdbuf(&buffer_);
  exceptions(std::ios::badbit);
}

GzipStream::GzipStream(std::ifstream file, const GzipPlaces& known)
    : std::istream(nullptr), buffer_(std::move(file), known, nullptr) {
  rdbuf(&buffer_);
  exceptions(std::ios::badbit);
}

GzipStream::Buffer::Buffer(std::ifstream file, const GzipPlaces& known, GzipPlaces* to_learn)
    : file_(std::move(file)), known_(known), to_learn_(to_learn) {
  if (inflateInit2(&state_, kGzip) != Z_OK) throw std::bad_alloc();
}

GzipStream::Buffer::~Buffer() { inflateEnd(&state_); }

bool GzipStream::Buffer::refill() {
  file_.clear();
  file_.read(reinterpret_cast<char*>(packed_.data()), std::streamsize(packed_.size()));
  const auto count = std::size_t(file_.gcount());
  file_at_ += count;
  state_.next_in = packed_.data();
  state_.avail_in = uInt(count);
  return count > 0;
}

void GzipStream::Buffer::begin() {
  file_.clear();
  file_.seekg(0);
  file_at_ = at_ = 0;
  state_.avail_in = 0;
  is_raw_ = is_at_end_ = false;
  inflateReset2(&state_, kGzip);
}

void GzipStream::Buffer::begin_at(const GzipPlaces::Place& place) {
  file_.clear();
  file_at_ = place.packed - (place.bits > 0 ? 1 : 0);
  file_.seekg(std::streamoff(file_at_));
  at_ = place.at;
  state_.avail_in = 0;
  is_raw_ = true;
  is_at_end_ = false;
  inflateReset2(&state_, kRaw);
  if (place.bits > 0) {
    if (!refill()) throw std::runtime_error("has become shorter");
    inflatePrime(&state_, place.bits, *state_.next_in >> (8 - place.bits));
    ++state_.next_in;
    --state_.avail_in;
  }
  inflateSetDictionary(&state_, place.window.data(), uInt(place.window.size()));
}

/// Files may hold several members one after the other; what is behind the last one does not count.
void GzipStream::Buffer::end_member() {
  // Read one by one, as the block may end anywhere.
  const auto next_byte = [&]() -> int {
    if (state_.avail_in == 0 && !refill()) return -1;
    --state_.avail_in;
    return *state_.next_in++;
  };
  for (std::size_t i = 0; is_raw_ && i < kTrailer; ++i) next_byte();
  is_raw_ = false;
  is_at_end_ = (state_.avail_in == 0 && !refill()) || *state_.next_in != kMagic[0];
  if (!is_at_end_) inflateReset2(&state_, kGzip);
}

void GzipStream::Buffer::learn() {
  constexpr int kBehindBlock = 128;
  constexpr int kLastBlock = 64;
  if ((state_.data_type & kBehindBlock) == 0 || (state_.data_type & kLastBlock) != 0) return;
  if (!to_learn_->is_wanted(at_)) return;
  GzipPlaces::Place place{at_, file_at_ - state_.avail_in, state_.data_type & 7, {}};
  place.window.resize(std::size_t(1) << MAX_WBITS);
  uInt size = 0;
  inflateGetDictionary(&state_, place.window.data(), &size);
  place.window.resize(size);
  to_learn_->add(std::move(place));
}

GzipStream::Buffer::int_type GzipStream::Buffer::underflow() {
  while (!is_at_end_) {
    state_.next_out = reinterpret_cast<unsigned char*>(content_.data());
    state_.avail_out = uInt(content_.size());
    if (state_.avail_in == 0 && !refill()) {
      throw std::runtime_error("its packed content ends too early");
    }
    const int result = inflate(&state_, to_learn_ ? Z_BLOCK : Z_NO_FLUSH);
    if (result == Z_MEM_ERROR) throw std::bad_alloc();
    if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR) {
      throw std::runtime_error("its packed content is damaged");
    }
    const std::size_t count = content_.size() - state_.avail_out;
    at_ += count;
    if (result == Z_STREAM_END) {
      end_member();
    } else if (to_learn_) {
      learn();
    }
    if (count == 0) continue;
    setg(content_.data(), content_.data(), content_.data() + count);
    return traits_type::to_int_type(content_.front());
  }
  setg(nullptr, nullptr, nullptr);
  return traits_type::eof();
}

GzipStream::Buffer::pos_type GzipStream::Buffer::seekpos(pos_type to, std::ios_base::openmode) {
  const auto wanted = std::uint64_t(std::streamoff(to));
  if (wanted > at_ || wanted < at_ - std::uint64_t(egptr() - eback())) {
    const GzipPlaces::Place* place = known_.before(wanted);
    if (wanted < at_ || (place && place->at > at_)) {
      setg(nullptr, nullptr, nullptr);
      if (place) {
        begin_at(*place);
      } else {
        begin();
      }
    }
    while (at_ < wanted) {
      setg(nullptr, nullptr, nullptr);
      if (traits_type::eq_int_type(underflow(), traits_type::eof())) return pos_type(off_type(-1));
    }
  }
  setg(eback(), egptr() - (at_ - wanted), egptr());
  return to;
}

}  // namespace diorama
