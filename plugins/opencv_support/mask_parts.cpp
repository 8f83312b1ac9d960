// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/mask_parts.h"

#include <opencv2/imgproc.hpp>

#include "opencv_support/serial_opencv.h"

namespace diorama {

MaskParts connected_parts(std::span<const std::uint8_t> bits, int width, int height) {
  MaskParts result;
  if (width <= 0 || height <= 0) return result;
  use_serial_opencv();
  result.part.resize(bits.size());
  // OpenCV's headers know no constant pixels; these are read only.
  const cv::Mat mask(height, width, CV_8UC1, const_cast<std::uint8_t*>(bits.data()));
  cv::Mat part(height, width, CV_32SC1, result.part.data());
  cv::Mat stats;
  cv::Mat centroids;
  const int count =
      cv::connectedComponentsWithStats(mask, part, stats, centroids, 4, CV_32S, cv::CCL_WU);
  for (int i = 1; i < count; ++i) {
    const int x = stats.at<int>(i, cv::CC_STAT_LEFT);
    const int y = stats.at<int>(i, cv::CC_STAT_TOP);
    result.boxes.push_back(
        {x, y, x + stats.at<int>(i, cv::CC_STAT_WIDTH), y + stats.at<int>(i, cv::CC_STAT_HEIGHT)});
    result.sizes.push_back(stats.at<int>(i, cv::CC_STAT_AREA));
  }
  return result;
}

}  // namespace diorama
