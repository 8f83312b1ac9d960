// SPDX-License-Identifier: Apache-2.0
#include "writer_video/h264_encoder.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "diorama/error.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
}

namespace diorama {
namespace {

struct FreeAv {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
template <class Object>
using Av = std::unique_ptr<Object, FreeAv>;

[[noreturn]] void fail(const std::string& what) { throw Error(ErrorKind::Plugin, what); }

void require(int result, const char* what) {
  if (result >= 0) return;
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(result, text.data(), text.size());
  fail(std::string("libavcodec: ") + what + ": " + text.data());
}

std::uint8_t byte_of(double value) { return std::uint8_t(std::clamp(value + 0.5, 0.0, 255.0)); }

/// Rec. 709 in its narrow range; colour at half the resolution.
void fill(AVFrame& frame, const Image<Rgba8>& picture) {
  const auto plane = [&](int index, int x, int y) -> std::uint8_t& {
    return frame.data[index][std::ptrdiff_t(y) * frame.linesize[index] + x];
  };
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const Rgba8& p = picture.at(x, y);
      plane(0, x, y) = byte_of(16.0 + 0.1826 * p[0] + 0.6142 * p[1] + 0.0620 * p[2]);
    }
  }
  for (int y = 0; y < picture.height(); y += 2) {
    for (int x = 0; x < picture.width(); x += 2) {
      std::array<double, 3> sum{};
      for (int k = 0; k < 4; ++k) {
        const Rgba8& p = picture.at(x + k % 2, y + k / 2);
        for (std::size_t c = 0; c < 3; ++c) sum[c] += 0.25 * p[c];
      }
      plane(1, x / 2, y / 2) = byte_of(128.0 - 0.1006 * sum[0] - 0.3386 * sum[1] + 0.4392 * sum[2]);
      plane(2, x / 2, y / 2) = byte_of(128.0 + 0.4392 * sum[0] - 0.3989 * sum[1] - 0.0403 * sum[2]);
    }
  }
}

using Unit = std::span<const std::uint8_t>;

/// What stands between start codes 00 00 01.
std::vector<Unit> units_of(Unit stream) {
  std::vector<Unit> units;
  std::size_t begin = stream.size();
  for (std::size_t i = 0; i + 3 <= stream.size(); ++i) {
    if (stream[i] != 0 || stream[i + 1] != 0 || stream[i + 2] != 1) continue;
    if (begin < i) units.push_back(stream.subspan(begin, i - begin));
    begin = i + 3;
  }
  if (begin < stream.size()) units.push_back(stream.subspan(begin));
  for (Unit& unit : units) {
    while (!unit.empty() && unit.back() == 0) unit = unit.first(unit.size() - 1);
  }
  return units;
}

int type_of(Unit unit) { return unit.empty() ? 0 : unit[0] & 31; }
constexpr int kSequenceSet = 7;
constexpr int kPictureSet = 8;

void put(std::vector<std::byte>& bytes, std::uint64_t value, int count) {
  for (int i = count - 1; i >= 0; --i) bytes.push_back(std::byte(value >> (8 * i)));
}
void put(std::vector<std::byte>& bytes, Unit unit) {
  const auto more = std::as_bytes(unit);
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// ISO 14496-15, 5.3.3.1.
std::vector<std::byte> config_of(Unit headers) {
  std::vector<std::byte> config;
  Unit sequence, picture;
  for (const Unit unit : units_of(headers)) {
    if (type_of(unit) == kSequenceSet) sequence = unit;
    if (type_of(unit) == kPictureSet) picture = unit;
  }
  if (sequence.size() < 4 || picture.empty()) fail("libavcodec: an H.264 stream without headers");
  put(config, 1, 1);
  put(config, sequence.subspan(1, 3));
  put(config, 0xFFE1, 2);  // lengths of four bytes; one sequence set
  put(config, sequence.size(), 2);
  put(config, sequence);
  put(config, 1, 1);
  put(config, picture.size(), 2);
  put(config, picture);
  return config;
}

Av<AVCodecContext> open_encoder(int width, int height, int crf) {
  const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
  if (!codec) fail("libavcodec on this machine has no encoder 'libx264', which videos need");
  Av<AVCodecContext> context(avcodec_alloc_context3(codec));
  if (!context) fail("libavcodec: no memory");
  context->width = width;
  context->height = height;
  context->time_base = {1, 25};  // MP4's own times count
  context->pix_fmt = AV_PIX_FMT_YUV420P;
  context->gop_size = 1;
  context->max_b_frames = 0;
  context->thread_count = 1;
  context->log_level_offset = AV_LOG_TRACE;  // it would tell of every picture
  context->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  context->color_range = AVCOL_RANGE_MPEG;
  context->colorspace = AVCOL_SPC_BT709;
  context->color_primaries = AVCOL_PRI_BT709;
  context->color_trc = AVCOL_TRC_IEC61966_2_1;
  const std::string quality = std::to_string(crf);
  require(av_opt_set(context->priv_data, "crf", quality.c_str(), 0), "crf");
  require(av_opt_set(context->priv_data, "preset", "veryfast", 0), "preset");
  require(av_opt_set(context->priv_data, "tune", "zerolatency", 0), "tune");
  require(avcodec_open2(context.get(), codec, nullptr), "opening the encoder");
  return context;
}

}  // namespace

H264Picture encode_h264(const Image<Rgba8>& picture, int crf, bool is_odd) {
  const Av<AVCodecContext> context = open_encoder(picture.width(), picture.height(), crf);
  const Av<AVFrame> frame(av_frame_alloc());
  const Av<AVPacket> packet(av_packet_alloc());
  if (!frame || !packet) fail("libavcodec: no memory");
  frame->format = context->pix_fmt;
  frame->width = picture.width();
  frame->height = picture.height();
  require(av_frame_get_buffer(frame.get(), 0), "a picture's memory");
  fill(*frame, picture);
  // Two pictures in a row that stand alone have different numbers, which encoders count by turns.
  for (int i = 0; i <= (is_odd ? 1 : 0); ++i) {
    av_packet_unref(packet.get());
    frame->pts = i;
    require(avcodec_send_frame(context.get(), frame.get()), "encoding");
    require(avcodec_receive_packet(context.get(), packet.get()), "encoding");
  }
  H264Picture encoded;
  encoded.config =
      config_of({context->extradata, std::size_t(std::max(context->extradata_size, 0))});
  for (const Unit unit : units_of({packet->data, std::size_t(packet->size)})) {
    if (type_of(unit) == kSequenceSet || type_of(unit) == kPictureSet) continue;
    put(encoded.data, unit.size(), 4);
    put(encoded.data, unit);
  }
  return encoded;
}

}  // namespace diorama
