// SPDX-License-Identifier: Apache-2.0
#include "framework/bench/picture_error.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace diorama::bench {

PictureError picture_error(const Image<Vec3f>& image, const Image<Vec3f>& reference) {
  std::vector<double> errors;
  errors.reserve(image.pixels().size());
  double squares = 0.0;
  double sum = 0.0;
  double expected = 0.0;
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    double error = 0.0;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double v = double(image.pixels()[i][k]);
      const double r = double(reference.pixels()[i][k]);
      squares += (v - r) * (v - r);
      error += (v - r) * (v - r) / (r * r + 0.01) / 3.0;
      sum += v;
      expected += r;
    }
    errors.push_back(error);
  }
  PictureError result;
  if (errors.empty()) return result;
  const double count = double(errors.size());
  std::sort(errors.begin(), errors.end());
  const auto kept = std::ptrdiff_t(std::max<std::size_t>(1, errors.size() * 999 / 1000));
  result.rmse = std::sqrt(squares / (3.0 * count));
  result.relative_mse = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  result.trimmed_mse = std::accumulate(errors.begin(), errors.begin() + kept, 0.0) / double(kept);
  result.bias = expected != 0.0 ? sum / expected - 1.0 : 0.0;
  return result;
}

}  // namespace diorama::bench
