// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/denoiser_network.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "renderer_support/denoiser_weights.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 64;

std::vector<std::byte> small_network() {
  return test::read_bytes(DIORAMA_SOURCE_DIR
                          "/tests/plugins/renderer_support/denoiser_network.bin");
}

/// The same formula stands in tests/denoiser_training/make_test_network.py.
ChannelBlocks features(SpareMemory& spare) {
  ChannelBlocks blocks(4 * DenoiserNetwork::kFeatures, kWidth / 2, kHeight / 2, spare);
  for (int c = 0; c < DenoiserNetwork::kFeatures; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double value = std::sin(0.37 * c + 0.11 * x + 0.23 * y) +
                             0.25 * std::cos(0.05 * x * (c % 3) - 0.31 * y);
        const int channel = 4 * c + 2 * (y % 2) + x % 2;
        blocks.at(channel / 16, x / 2, y / 2)[channel % 16] = float(value);
      }
    }
  }
  return blocks;
}

struct Expected {
  int level, channel, x, y;
  float value;
};

// Printed by make_test_network.py (PyTorch 1.13, CPU).
const std::vector<Expected> kExpected{
    {0, 0, 0, 0, 0.499587f},   {0, 0, 95, 32, -1.333804f},  {0, 0, 32, 63, -1.159049f},
    {0, 17, 0, 0, -0.056828f}, {0, 17, 95, 32, 1.037715f},  {0, 17, 32, 63, 0.325316f},
    {0, 43, 0, 0, 0.233942f},  {0, 43, 95, 32, 0.657048f},  {0, 43, 32, 63, -0.155238f},
    {0, 44, 0, 0, 0.160340f},  {0, 44, 95, 32, -0.502975f}, {0, 44, 32, 63, 1.179653f},
    {0, 45, 0, 0, -0.421162f}, {0, 45, 95, 32, 0.196461f},  {0, 45, 32, 63, 2.571720f},
    {0, 46, 0, 0, 1.412105f},  {0, 46, 95, 32, -1.057423f}, {0, 46, 32, 63, 0.488765f},
    {1, 0, 0, 0, -1.875049f},  {1, 0, 47, 16, -0.901436f},  {1, 0, 16, 31, -0.448292f},
    {1, 17, 0, 0, -2.056533f}, {1, 17, 47, 16, 0.548075f},  {1, 17, 16, 31, -1.380395f},
    {1, 34, 0, 0, -2.042945f}, {1, 34, 47, 16, 0.382191f},  {1, 34, 16, 31, 0.371357f},
    {1, 35, 0, 0, -1.331837f}, {1, 35, 47, 16, 0.394619f},  {1, 35, 16, 31, 1.837185f},
    {2, 0, 0, 0, -0.324544f},  {2, 0, 23, 8, -0.503147f},   {2, 0, 8, 15, 0.128294f},
    {2, 17, 0, 0, -0.522850f}, {2, 17, 23, 8, -1.798542f},  {2, 17, 8, 15, -0.729763f},
    {2, 34, 0, 0, 0.248488f},  {2, 34, 23, 8, -0.703872f},  {2, 34, 8, 15, 0.002244f},
    {2, 35, 0, 0, -1.413851f}, {2, 35, 23, 8, -0.027493f},  {2, 35, 8, 15, -0.049836f},
    {3, 0, 0, 0, 1.139075f},   {3, 0, 11, 4, 0.563644f},    {3, 0, 4, 7, 0.014076f},
    {3, 17, 0, 0, 0.707925f},  {3, 17, 11, 4, -0.210924f},  {3, 17, 4, 7, -0.040447f},
    {3, 34, 0, 0, 1.390082f},  {3, 34, 11, 4, 0.244666f},   {3, 34, 4, 7, 0.832376f},
    {3, 35, 0, 0, 0.167138f},  {3, 35, 11, 4, -0.392811f},  {3, 35, 4, 7, -0.723713f},
    {4, 0, 0, 0, -0.016438f},  {4, 0, 5, 2, -0.581769f},    {4, 0, 2, 3, -0.771636f},
    {4, 17, 0, 0, -1.385733f}, {4, 17, 5, 2, -1.122678f},   {4, 17, 2, 3, -0.122244f},
    {4, 34, 0, 0, -0.038887f}, {4, 34, 5, 2, 0.231117f},    {4, 34, 2, 3, -0.575749f},
    {4, 35, 0, 0, 0.770564f},  {4, 35, 5, 2, 0.351547f},    {4, 35, 2, 3, -0.030233f},
    {5, 0, 0, 0, 0.124707f},   {5, 0, 2, 1, 0.357264f},     {5, 0, 1, 1, 0.972753f},
    {5, 17, 0, 0, -0.328117f}, {5, 17, 2, 1, 0.489426f},    {5, 17, 1, 1, 0.835338f},
    {5, 34, 0, 0, -0.513156f}, {5, 34, 2, 1, -1.155849f},   {5, 34, 1, 1, -1.890082f},
    {5, 35, 0, 0, -0.138226f}, {5, 35, 2, 1, -0.975241f},   {5, 35, 1, 1, -1.628819f},
};

/// Of the channels that PyTorch has: those of single pixels come from two places here.
float logit(const DenoiserNetwork& network, const DenoiserNetwork::Logits& logits,
            const Expected& e, Isa isa) {
  if (e.level > 0) {
    return logits.levels[std::size_t(e.level - 1)].at(e.channel / 16, e.x, e.y)[e.channel % 16];
  }
  const int part = 2 * (e.y % 2) + e.x % 2;
  constexpr int kKeep = DenoiserNetwork::kKernels;  // after the taps
  if (e.channel == kKeep) {
    const int channel = DenoiserNetwork::kPixelKeep + part;
    return logits.levels[0].at(channel / 16, e.x / 2, e.y / 2)[channel % 16];
  }
  const int channel = 4 * (e.channel - (e.channel > kKeep ? 1 : 0)) + part;
  std::vector<float> row(std::size_t(network.pixel_blocks()) * (kWidth / 2) * 16);
  network.pixel_logits(logits, e.y / 2, isa, row.data());
  return row[std::size_t((channel / 16 * (kWidth / 2) + e.x / 2) * 16 + channel % 16)];
}

}  // namespace

TEST_CASE("the network says what PyTorch says", "[denoiser]") {
  const DenoiserNetwork network(small_network());
  test::RenderHost host(2);
  for (std::size_t i = 0; i < kIsaNames.size(); ++i) {
    const auto isa = Isa(i);
    try {
      isa_by_name(kIsaNames[i]);
    } catch (const Error&) {
      continue;  // not of this machine
    }
    INFO(kIsaNames[i]);
    SpareMemory spare;
    const auto logits = network.run(features(spare), isa, host, spare);
    for (const Expected& e : kExpected) {
      INFO("level " << e.level << " channel " << e.channel << " at " << e.x << ", " << e.y);
      // Sums of some thousand products, in another order.
      CHECK(logit(network, logits, e, isa) == Approx(e.value).margin(2e-4));
    }
  }
}

TEST_CASE("damaged weights are refused", "[denoiser]") {
  std::vector<std::byte> bytes = small_network();
  CHECK_THROWS_WITH(DenoiserNetwork(std::span(bytes).first(bytes.size() - 2)),
                    ContainsSubstring("weights end too early"));
  bytes.resize(bytes.size() + 2);
  CHECK_THROWS_WITH(DenoiserNetwork(bytes), ContainsSubstring("too many"));
  bytes[0] = std::byte{0};
  CHECK_THROWS_WITH(DenoiserNetwork(bytes), ContainsSubstring("no weights"));
  CHECK_THROWS_AS(DenoiserNetwork(std::span<const std::byte>()), Error);
}

TEST_CASE("the renderer's network can be read", "[denoiser]") {
  CHECK(denoiser_network().pixel_blocks() == 12);
}

}  // namespace diorama
