// SPDX-License-Identifier: Apache-2.0
#include "opencv_support/serial_opencv.h"

#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>

namespace diorama {
namespace {

/// Errors are exceptions; what OpenCV would print of them is in their text.
int print_nothing(int, const char*, const char*, const char*, int, void*) { return 0; }

}  // namespace

void use_serial_opencv() {
  [[maybe_unused]] static const bool is_done = [] {
    cv::setNumThreads(0);
    cv::redirectError(&print_nothing);
    return true;
  }();
}

}  // namespace diorama
