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
    {0, 0, 0, 0, -0.688825f},  {0, 0, 95, 32, -0.468136f},  {0, 0, 32, 63, 0.177425f},
    {0, 17, 0, 0, 0.256571f},  {0, 17, 95, 32, -0.327292f}, {0, 17, 32, 63, 1.089429f},
    {0, 43, 0, 0, 0.062965f},  {0, 43, 95, 32, 0.734501f},  {0, 43, 32, 63, -0.662997f},
    {0, 44, 0, 0, -0.387416f}, {0, 44, 95, 32, 0.339180f},  {0, 44, 32, 63, 0.567956f},
    {1, 0, 0, 0, 0.146164f},   {1, 0, 47, 16, -0.062453f},  {1, 0, 16, 31, -0.172112f},
    {1, 17, 0, 0, 0.096277f},  {1, 17, 47, 16, 0.747998f},  {1, 17, 16, 31, -0.197951f},
    {1, 34, 0, 0, 0.088169f},  {1, 34, 47, 16, -0.145639f}, {1, 34, 16, 31, -1.007102f},
    {1, 35, 0, 0, 0.136312f},  {1, 35, 47, 16, -0.060608f}, {1, 35, 16, 31, 0.740735f},
    {2, 0, 0, 0, 0.850547f},   {2, 0, 23, 8, 0.479867f},    {2, 0, 8, 15, 0.368462f},
    {2, 17, 0, 0, -0.074741f}, {2, 17, 23, 8, 0.291839f},   {2, 17, 8, 15, -0.072729f},
    {2, 34, 0, 0, 0.635159f},  {2, 34, 23, 8, 0.329390f},   {2, 34, 8, 15, -0.200750f},
    {2, 35, 0, 0, -0.141919f}, {2, 35, 23, 8, -0.152949f},  {2, 35, 8, 15, 0.026697f},
    {3, 0, 0, 0, 0.299366f},   {3, 0, 11, 4, 0.210878f},    {3, 0, 4, 7, 0.164730f},
    {3, 17, 0, 0, -0.198601f}, {3, 17, 11, 4, -0.157373f},  {3, 17, 4, 7, -0.158372f},
    {3, 34, 0, 0, -0.254834f}, {3, 34, 11, 4, 0.013471f},   {3, 34, 4, 7, -0.076361f},
    {3, 35, 0, 0, -0.206479f}, {3, 35, 11, 4, -0.063595f},  {3, 35, 4, 7, -0.350109f},
    {4, 0, 0, 0, -0.538550f},  {4, 0, 5, 2, -1.140458f},    {4, 0, 2, 3, -0.512774f},
    {4, 17, 0, 0, 0.054741f},  {4, 17, 5, 2, 0.212935f},    {4, 17, 2, 3, 1.077330f},
    {4, 34, 0, 0, 0.505798f},  {4, 34, 5, 2, -0.118144f},   {4, 34, 2, 3, 0.339319f},
    {4, 35, 0, 0, -0.027861f}, {4, 35, 5, 2, -0.206706f},   {4, 35, 2, 3, 0.154662f},
    {5, 0, 0, 0, 0.018157f},   {5, 0, 2, 1, 0.510180f},     {5, 0, 1, 1, 0.042271f},
    {5, 17, 0, 0, -0.238587f}, {5, 17, 2, 1, 0.158599f},    {5, 17, 1, 1, -0.115846f},
    {5, 34, 0, 0, -0.289065f}, {5, 34, 2, 1, -0.433603f},   {5, 34, 1, 1, -0.035422f},
    {5, 35, 0, 0, 0.299259f},  {5, 35, 2, 1, 0.186127f},    {5, 35, 1, 1, 0.486082f},
};

/// Of the channels that PyTorch has: those of single pixels come from two places here.
float logit(const DenoiserNetwork& network, const DenoiserNetwork::Logits& logits,
            const Expected& e, Isa isa) {
  if (e.level > 0) {
    return logits.levels[std::size_t(e.level - 1)].at(e.channel / 16, e.x, e.y)[e.channel % 16];
  }
  const int part = 2 * (e.y % 2) + e.x % 2;
  constexpr int kKeep = DenoiserNetwork::kPixelLogits - 1;  // before the share that stays
  if (e.channel == kKeep) {
    const int channel = DenoiserNetwork::kPixelKeep + part;
    return logits.levels[0].at(channel / 16, e.x / 2, e.y / 2)[channel % 16];
  }
  const int channel = 4 * std::min(e.channel, kKeep) + part;
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
  CHECK(denoiser_network().pixel_blocks() == 11);
}

}  // namespace diorama
