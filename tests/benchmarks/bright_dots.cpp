// SPDX-License-Identifier: Apache-2.0
// How many bright dots denoised pictures have: groups of one to four pixels that stand out of flat
// surroundings, per million pixels with such surroundings. One line of JSON per picture, then one
// for all of them.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/render_host/render_host.h"

namespace {

using namespace diorama;

// The ring around a pixel: a square of 9 x 9 pixels. Steps of 8-bit values.
constexpr int kReach = 4;
constexpr int kFlat = 16;       // the ring's brightest value over its darkest
constexpr int kStandsOut = 10;  // over the ring's brightest
constexpr std::size_t kLargest = 4;

struct Count {
  long dots = 0;
  long flat_pixels = 0;
  double per_million() const {
    return flat_pixels == 0 ? 0.0 : 1e6 * double(dots) / double(flat_pixels);
  }
};

/// The brightest of the three channels: dots may be coloured.
std::vector<int> values_of(const Texture& picture) {
  std::vector<int> values;
  const auto channels = std::size_t(picture.channels);
  for (std::size_t i = 0; i < picture.bytes.size(); i += channels) {
    int most = 0;
    for (std::size_t k = 0; k < std::min<std::size_t>(channels, 3); ++k) {
      most = std::max(most, int(picture.bytes[i + k]));
    }
    values.push_back(most);
  }
  return values;
}

Count count_dots(const Texture& picture) {
  const int width = picture.width;
  const int height = picture.height;
  const std::vector<int> values = values_of(picture);
  const auto at = [&](int x, int y) {
    return std::size_t(y) * std::size_t(width) + std::size_t(x);
  };
  std::vector<bool> is_dot(values.size(), false);
  Count count;
  for (int y = kReach; y < height - kReach; ++y) {
    for (int x = kReach; x < width - kReach; ++x) {
      int low = 255;
      int high = 0;
      const auto see = [&](int u, int v) {
        low = std::min(low, values[at(u, v)]);
        high = std::max(high, values[at(u, v)]);
      };
      for (int i = -kReach; i <= kReach; ++i) {
        see(x + i, y - kReach);
        see(x + i, y + kReach);
        see(x - kReach, y + i);
        see(x + kReach, y + i);
      }
      if (high - low > kFlat) continue;
      ++count.flat_pixels;
      is_dot[at(x, y)] = values[at(x, y)] > high + kStandsOut;
    }
  }
  for (std::size_t i = 0; i < is_dot.size(); ++i) {
    if (!is_dot[i]) continue;
    // The group of neighbours that this one belongs to.
    std::vector<std::size_t> group{i};
    is_dot[i] = false;
    for (std::size_t k = 0; k < group.size(); ++k) {
      const int x = int(group[k] % std::size_t(width));
      const int y = int(group[k] / std::size_t(width));
      for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) {
        for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u) {
          if (!is_dot[at(u, v)]) continue;
          is_dot[at(u, v)] = false;
          group.push_back(at(u, v));
        }
      }
    }
    count.dots += group.size() <= kLargest ? 1 : 0;
  }
  return count;
}

void print(const std::string& name, const Count& count) {
  const nlohmann::ordered_json line{{"picture", name},
                                    {"dots", count.dots},
                                    {"flat_pixels", count.flat_pixels},
                                    {"dots_per_million", count.per_million()}};
  std::printf("%s\n", line.dump().c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Counts bright dots in pictures."};
  std::vector<std::string> files;
  app.add_option("pictures", files, "8-bit pictures")->required()->check(CLI::ExistingFile);
  CLI11_PARSE(app, argc, argv);
  const test::RenderHost host(1);
  Count all;
  for (const std::string& file : files) {
    const auto picture = host.read_texture(file);
    if (picture->bytes.empty()) {
      std::fprintf(stderr, "%s: expected a picture of 8 bits per channel\n", file.c_str());
      return 1;
    }
    const Count count = count_dots(*picture);
    print(file, count);
    all.dots += count.dots;
    all.flat_pixels += count.flat_pixels;
  }
  print("all", all);
}
