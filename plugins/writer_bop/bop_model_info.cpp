// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_model_info.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "reader_support/camera_json.h"
#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"
#include "writer_bop/point_diameter.h"

namespace diorama {
namespace {

/// The number behind a line "element NAME" of a PLY file's header.
std::size_t ply_count(const std::string& header, const std::string& element) {
  const std::string line = "\nelement " + element + " ";
  const std::size_t at = header.find(line);
  if (at == std::string::npos) throw std::runtime_error("has no element " + element);
  std::size_t count = 0;
  const char* begin = header.data() + at + line.size();
  if (std::from_chars(begin, header.data() + header.size(), count).ec != std::errc()) {
    throw std::runtime_error("has no number of elements " + element);
  }
  return count;
}

/// Of more vertices the diameter is not looked at: that would take seconds.
constexpr std::size_t kMostMeasured = 100'000;

struct PlyMeasures {
  Aabb box;
  std::optional<double> diameter;
  std::vector<Vec3f> points;  ///< As long as the diameter is looked at.
};

/// Of a model of our writer's: vertices begin with three floats and take 27 bytes each, faces 13.
PlyMeasures measure_ply(const std::filesystem::path& file) {
  constexpr std::string_view kEnd = "\nend_header\n";
  constexpr std::size_t kVertex = 27;
  constexpr std::size_t kFace = 13;
  std::ifstream in = open_stored(file);
  std::string front(4096, '\0');
  in.read(front.data(), std::streamsize(front.size()));
  front.resize(std::size_t(in.gcount()));
  const std::size_t end = front.find(kEnd);
  if (!front.starts_with("ply\nformat binary_little_endian 1.0\n") || end == std::string::npos) {
    throw std::runtime_error("is not a binary PLY file");
  }
  const std::string header = front.substr(0, end);
  const std::size_t data = end + kEnd.size();
  const std::size_t vertices = ply_count(header, "vertex");
  const std::size_t size = std::filesystem::file_size(file);
  if ((size - data) / kVertex < vertices ||
      size - data - kVertex * vertices != kFace * ply_count(header, "face")) {
    throw std::runtime_error("is cut short");
  }
  in.clear();
  in.seekg(std::streamoff(data));
  PlyMeasures measures;
  bool is_measured = vertices > 0 && vertices <= kMostMeasured;
  std::vector<Vec3f>& points = measures.points;
  std::vector<char> block(kVertex * 4096);
  for (std::size_t left = vertices; left > 0;) {
    const std::size_t now = std::min<std::size_t>(left, 4096);
    in.read(block.data(), std::streamsize(now * kVertex));
    if (!in) throw std::runtime_error("has become shorter");
    for (std::size_t i = 0; i < now; ++i) {
      Vec3f position;
      std::memcpy(position.data(), block.data() + kVertex * i, 12);
      measures.box.add(position.cast<double>());
      is_measured = is_measured && position.allFinite();
      if (is_measured) points.push_back(position);
    }
    left -= now;
  }
  if (is_measured) {
    measures.diameter = point_diameter(points);
  } else {
    points.clear();
  }
  return measures;
}

/// How far turned models may be off, as a share of their diameters: what the page says, or else the
/// most that writers take.
double symmetry_tolerance(const DatasetPage& page) {
  constexpr double kMost = 0.2;
  const auto said = page.conventions.find("symmetry_tolerance");
  const bool is_told = said != page.conventions.end() && said->is_number();
  return is_told ? std::clamp(said->get<double>(), 0.0, kMost) : kMost;
}

/// Models reach equally far in all directions when they are turned.
class SymmetryChecks {
 public:
  SymmetryChecks(const std::vector<Vec3f>& points, double slack) : slack_(slack) {
    for (const Vec3f& point : points) points_.push_back(point.cast<double>());
    for (int i = 0; i < 27; ++i) {
      const Vec3 way(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      if (!way.isZero()) ways_.push_back(way.normalized());
    }
    for (const Vec3& way : ways_) reaches_.push_back(reach(way, Affine::Identity()));
  }

  bool holds(const Affine& map) const {
    const Mat3 turn = map.linear();
    const bool is_rotation =
        (turn * turn.transpose() - Mat3::Identity()).norm() < 1e-4 && turn.determinant() > 0.0;
    if (!is_rotation || !map.matrix().allFinite()) return false;
    for (std::size_t i = 0; i < ways_.size(); ++i) {
      if (std::abs(reach(ways_[i], map) - reaches_[i]) > slack_) return false;
    }
    return true;
  }

 private:
  double reach(const Vec3& way, const Affine& map) const {
    const Vec3 before = map.linear().transpose() * way;
    double most = -std::numeric_limits<double>::infinity();
    for (const Vec3& point : points_) most = std::max(most, before.dot(point));
    return most + way.dot(map.translation());
  }

  double slack_;
  std::vector<Vec3> points_;
  std::vector<Vec3> ways_;
  std::vector<double> reaches_;
};

/// Matrices and axes that a table lists for a model.
std::vector<Affine> symmetries_of(const Json& model) {
  std::vector<Affine> maps;
  for (const Json& rows : model.value("symmetries_discrete", Json::array())) {
    Affine& map = maps.emplace_back();
    for (std::size_t i = 0; i < 16; ++i) {
      map.matrix()(Eigen::Index(i / 4), Eigen::Index(i % 4)) = rows.at(i).get<double>();
    }
  }
  for (const Json& each : model.value("symmetries_continuous", Json::array())) {
    const Vec3 axis = vector_of_json(each.at("axis"));
    const Vec3 offset = vector_of_json(each.at("offset"));
    if (std::abs(axis.norm() - 1.0) > 1e-4) {
      throw std::runtime_error("an axis of symmetry has not the length 1");
    }
    for (const double angle : {0.7, 1.6, 2.9}) {
      maps.push_back(Eigen::Translation3d(offset) * Eigen::AngleAxisd(angle, axis) *
                     Eigen::Translation3d(-offset));
    }
  }
  return maps;
}

}  // namespace

std::string bop_model_file(int id) { return "models/obj_" + zero_padded(id, 6) + ".ply"; }

BopModelBoxes read_bop_models(StoredFiles& files, const std::optional<DatasetPage>& own) {
  BopModelBoxes boxes;
  std::string page = "models/models_info.json";
  for (const char* folder : {"models", "models_eval", "models_cad", "models_reconst"}) {
    const std::string file = std::string(folder) + "/models_info.json";
    if (!files.has(file)) continue;
    page = file;
    break;
  }
  if (!own && !files.has(page)) return boxes;
  const auto json = files.json(page);
  if (!json) return boxes;
  const double tolerance = own ? symmetry_tolerance(*own) : 0.0;
  files.reading(page, [&] {
    for (const auto& item : json->items()) {
      const std::string& key = item.key();
      const Json& model = item.value();
      int id = 0;
      if (std::from_chars(key.data(), key.data() + key.size(), id).ec != std::errc()) {
        throw std::runtime_error("'" + key + "' is no obj_id");
      }
      const auto number = [&](const char* name) { return model.at(name).get<double>(); };
      const Vec3 low(number("min_x"), number("min_y"), number("min_z"));
      const Vec3 size(number("size_x"), number("size_y"), number("size_z"));
      const Aabb box{low, low + size};
      boxes[id] = box;
      const std::string who = "obj_id " + key;
      const double diameter = number("diameter");
      // Meshes of the benchmark were measured on fewer points.
      const double slack = own ? 1e-5 : 0.02;
      files.check(size.allFinite() && low.allFinite() && (size.array() >= 0.0).all() &&
                      diameter <= size.norm() * (1.0 + slack) &&
                      diameter >= size.maxCoeff() * (1.0 - slack),
                  kCounts, page, who, "its diameter is " + std::to_string(diameter),
                  "one that goes with its size");
      const std::string file = bop_model_file(id);
      if (!own) continue;
      if (!files.has(file)) {
        // A box is all that is known of such an object.
        files.check(std::abs(diameter - size.norm()) <= 1e-5 * size.norm(), kCounts, page, who,
                    "its diameter is " + std::to_string(diameter), "the diagonal of its size");
        continue;
      }
      files.reading(file, [&] {
        const auto [extent, measured, points] = measure_ply(files.root() / file);
        const double near = 1e-5 * size.norm();
        files.check(!measured || std::abs(*measured - diameter) <= near, kCounts, page, who,
                    "its diameter is " + std::to_string(diameter),
                    std::to_string(measured.value_or(0.0)) + ", of the vertices of " + file);
        files.check((extent.min - box.min).norm() <= near && (extent.max - box.max).norm() <= near,
                    kCounts, file, "", "is not as large as " + page + " says");
        const std::vector<Affine> symmetries = symmetries_of(model);
        if (points.empty() || symmetries.empty()) return;
        const SymmetryChecks checks(points, (tolerance + 1e-3) * diameter);
        for (std::size_t i = 0; i < symmetries.size(); ++i) {
          files.check(checks.holds(symmetries[i]), kCounts, page, who,
                      "turned by its symmetry " + std::to_string(i) + " it is another shape",
                      "the same");
        }
      });
    }
  });
  return boxes;
}

}  // namespace diorama
