// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/opencv_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <utility>

namespace diorama::lint {
namespace {

int print_nothing(int, const char*, const char*, const char*, int, void*) { return 0; }

/// A lens in OpenCV's terms.
struct CvLens {
  cv::Matx33d matrix = cv::Matx33d::eye();
  cv::Mat distortion;
  double max_angle = kPi / 2.0;  ///< Off the axis.
  bool is_fisheye = false;
};

double angle_at(const Lens& lens, double radius) {
  double angle = 0.0;
  double power = 1.0;
  for (const double factor : lens.polynomial) {
    angle += factor * power;
    power *= radius;
  }
  return angle;
}

/// OpenCV's fisheye says the radius by odd powers of the angle, ours the angle by powers of the
/// radius: fitted. Nothing when the two do not meet.
std::optional<CvLens> fitted_fisheye(const Lens& lens) {
  constexpr int kSamples = 200;
  constexpr double kWidest = 1.4;  // cv::fisheye divides by z
  constexpr double kSlack = 0.1;   // pixels
  if (lens.polynomial[0] != 0.0 || !(lens.polynomial[1] > 0.0)) return std::nullopt;
  CvLens result;
  result.is_fisheye = true;
  result.max_angle = std::min(kWidest, lens.max_angle);
  const double focal = 1.0 / lens.polynomial[1];
  // As far as the picture goes.
  const double reach = std::hypot(lens.width, lens.height);
  Eigen::Matrix<double, kSamples, 4> powers;
  Eigen::Matrix<double, kSamples, 1> excess;
  Eigen::Matrix<double, kSamples, 1> angles;
  double before = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const double radius = reach * (i + 1) / kSamples;
    const double angle = std::min(angle_at(lens, radius), 10.0);
    if (angle <= before) return std::nullopt;
    before = angle;
    const bool counts = angle <= result.max_angle;
    const double weight = counts ? 1.0 : 0.0;
    angles[i] = counts ? angle : -1.0;
    for (int k = 0; k < 4; ++k) powers(i, k) = weight * std::pow(angle, 3 + 2 * k);
    excess[i] = weight * (radius / focal - angle);
  }
  const Eigen::Vector4d k = powers.colPivHouseholderQr().solve(excess);
  if (!k.allFinite() || focal * (powers * k - excess).cwiseAbs().maxCoeff() > kSlack) {
    return std::nullopt;
  }
  result.max_angle = std::min(result.max_angle, angles.maxCoeff());
  result.matrix(0, 0) = result.matrix(1, 1) = focal;
  result.matrix(0, 2) = lens.centre.x();
  result.matrix(1, 2) = lens.centre.y();
  result.distortion = (cv::Mat_<double>(4, 1) << k[0], k[1], k[2], k[3]);
  return result;
}

std::optional<CvLens> cv_lens(const Lens& lens) {
  if (lens.model == Lens::Model::Fisheye) return fitted_fisheye(lens);
  CvLens result;
  result.matrix(0, 0) = lens.focal.x();
  result.matrix(1, 1) = lens.focal.y();
  result.matrix(0, 2) = lens.centre.x();
  result.matrix(1, 2) = lens.centre.y();
  if (lens.model == Lens::Model::Opencv) {
    result.distortion = cv::Mat(8, 1, CV_64F);
    for (int i = 0; i < 8; ++i) {
      result.distortion.at<double>(i) = lens.distortion[std::size_t(i)];
    }
  }
  return result;
}

bool is_seen(const CvLens& lens, const Vec3& point) {
  return point.allFinite() && point.z() > 1e-6 &&
         std::atan2(point.head<2>().norm(), point.z()) < lens.max_angle;
}

class Geometry final : public OpencvGeometry {
 public:
  Geometry() {
    // The host shares out threads; errors are exceptions.
    cv::setNumThreads(0);
    cv::redirectError(&print_nothing);
  }

  std::vector<std::optional<Vec2>> project(const Lens& lens,
                                           std::span<const Vec3> points) const override {
    std::vector<std::optional<Vec2>> result(points.size());
    const std::optional<CvLens> model = cv_lens(lens);
    if (!model) return result;
    std::vector<cv::Point3d> seen;
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!is_seen(*model, points[i])) continue;
      seen.emplace_back(points[i].x(), points[i].y(), points[i].z());
      places.push_back(i);
    }
    if (seen.empty()) return result;
    std::vector<cv::Point2d> pixels;
    const cv::Vec3d none(0.0, 0.0, 0.0);
    try {
      if (model->is_fisheye) {
        cv::fisheye::projectPoints(seen, pixels, none, none, model->matrix, model->distortion);
      } else {
        cv::projectPoints(seen, none, none, model->matrix, model->distortion, pixels);
      }
    } catch (const cv::Exception&) {
      return result;
    }
    for (std::size_t i = 0; i < places.size(); ++i) {
      result[places[i]] = Vec2(pixels[i].x, pixels[i].y);
    }
    return result;
  }

  std::optional<Affine> solve_pose(const Lens& lens, std::span<const Vec3> points,
                                   std::span<const Vec2> pixels) const override {
    std::optional<CvLens> model = cv_lens(lens);
    if (!model || points.size() < 6 || points.size() != pixels.size()) return std::nullopt;
    std::vector<cv::Point3d> local;
    std::vector<cv::Point2d> image;
    for (std::size_t i = 0; i < points.size(); ++i) {
      local.emplace_back(points[i].x(), points[i].y(), points[i].z());
      image.emplace_back(pixels[i].x(), pixels[i].y());
    }
    cv::Vec3d rotation;
    cv::Vec3d translation;
    try {
      if (model->is_fisheye) {
        std::vector<cv::Point2d> flat;
        cv::fisheye::undistortPoints(image, flat, model->matrix, model->distortion);
        image = std::move(flat);
        model->matrix = cv::Matx33d::eye();
        model->distortion = cv::Mat();
      }
      const bool is_solved = cv::solvePnP(local, image, model->matrix, model->distortion, rotation,
                                          translation, false, cv::SOLVEPNP_SQPNP);
      if (!is_solved) return std::nullopt;
      cv::solvePnPRefineLM(local, image, model->matrix, model->distortion, rotation, translation);
    } catch (const cv::Exception&) {
      return std::nullopt;
    }
    const Vec3 turn(rotation[0], rotation[1], rotation[2]);
    Affine pose = Affine::Identity();
    const double angle = turn.norm();
    if (angle > 0.0) pose.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    pose.translation() = Vec3(translation[0], translation[1], translation[2]);
    if (!pose.matrix().allFinite()) return std::nullopt;
    return pose;
  }
};

}  // namespace
}  // namespace diorama::lint

extern "C" __attribute__((visibility("default"))) const void* diorama_opencv_geometry() {
  static const diorama::lint::Geometry geometry;
  return static_cast<const diorama::lint::OpencvGeometry*>(&geometry);
}
