// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/gltf_animation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <vector>

#include "diorama/math.h"

namespace diorama::loader_assimp {
namespace {

using Json = nlohmann::json;

constexpr int kMostDepth = 100;
constexpr std::size_t kMostNumbers = std::size_t(1) << 26;

struct Unsupported final : std::runtime_error {
  using std::runtime_error::runtime_error;
};

void require(bool holds, const char* what) {
  if (!holds) throw Unsupported(what);
}

std::string bytes_of(const std::filesystem::path& file) {
  require(std::filesystem::is_regular_file(file), "a file is missing");
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return std::move(bytes).str();
}

std::uint32_t number_at(const std::string& bytes, std::size_t place) {
  require(place + 4 <= bytes.size(), "the file ends early");
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + place, 4);
  return number;
}

std::string from_base64(std::string_view text) {
  const auto digit = [](char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  };
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const int value = digit(c);
    if (value < 0) break;  // the padding at its end
    bits = bits << 6 | std::uint32_t(value);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes += char(bits >> count & 0xFF);
  }
  return bytes;
}

/// "%20" and the like.
std::string decoded(const std::string& uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const auto is_digit = [&](std::size_t at) {
      return at < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[at]));
    };
    if (uri[i] == '%' && is_digit(i + 1) && is_digit(i + 2)) {
      text += char(std::stoi(uri.substr(i + 1, 2), nullptr, 16));
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

/// A glTF file and its buffers. What it says is not trusted.
class GltfFile {
 public:
  explicit GltfFile(const std::string& file) : folder_(std::filesystem::path(file).parent_path()) {
    std::string text = bytes_of(file);
    if (text.starts_with("glTF")) {
      const std::size_t json_size = number_at(text, 12);
      require(20 + json_size <= text.size(), "the file ends early");
      const std::size_t next = 20 + json_size;
      if (next + 8 <= text.size()) {
        const std::size_t size =
            std::min<std::size_t>(number_at(text, next), text.size() - next - 8);
        chunk_ = text.substr(next + 8, size);
      }
      text = text.substr(20, json_size);
    }
    const auto is_shallow = [](int depth, Json::parse_event_t, Json&) {
      require(depth < kMostDepth, "it nests too deep");
      return true;
    };
    root_ = Json::parse(text, is_shallow);
  }

  const Json& root() const { return root_; }

  /// All numbers of an accessor, which has `width` per element unless that is 0.
  std::vector<double> numbers(const Json& number, std::size_t width) {
    const Json& accessor = root_.at("accessors").at(number.get<std::size_t>());
    static const std::map<std::string, std::size_t> widths{
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};
    const std::size_t own = widths.at(accessor.at("type").get<std::string>());
    require(own == width, "an accessor has another shape");
    const auto count = accessor.at("count").get<std::size_t>();
    require(count <= kMostNumbers / own, "an accessor is too long");
    std::vector<double> values(count * own, 0.0);
    if (accessor.contains("bufferView")) read(accessor, values, own);
    if (accessor.contains("sparse")) replace(accessor, values, own);
    return values;
  }

 private:
  static std::size_t size_of(int component) {
    if (component == 5120 || component == 5121) return 1;
    if (component == 5122 || component == 5123) return 2;
    require(component == 5125 || component == 5126, "an accessor has an unknown type");
    return 4;
  }
  template <class T>
  static double value(const char* bytes, bool is_normalized) {
    T number{};
    std::memcpy(&number, bytes, sizeof number);
    if constexpr (std::is_integral_v<T>) {
      const double share = double(number) / double(std::numeric_limits<T>::max());
      if (is_normalized) return std::max(share, -1.0);
    }
    return double(number);
  }
  static double value(const char* bytes, int component, bool is_normalized) {
    switch (component) {
      case 5120:
        return value<std::int8_t>(bytes, is_normalized);
      case 5121:
        return value<std::uint8_t>(bytes, is_normalized);
      case 5122:
        return value<std::int16_t>(bytes, is_normalized);
      case 5123:
        return value<std::uint16_t>(bytes, is_normalized);
      case 5125:
        return value<std::uint32_t>(bytes, is_normalized);
      default:
        return value<float>(bytes, false);
    }
  }
  /// Reads elements that begin at an accessor's, or a part's, place in its view.
  void read(const Json& part, std::vector<double>& values, std::size_t width) {
    const int component = part.at("componentType").get<int>();
    const Json& view = root_.at("bufferViews").at(part.at("bufferView").get<std::size_t>());
    const std::string& bytes = buffer(view.at("buffer").get<std::size_t>());
    const std::size_t size = size_of(component);
    const std::size_t stride = view.value("byteStride", size * width);
    const std::size_t begin =
        view.value("byteOffset", std::size_t(0)) + part.value("byteOffset", std::size_t(0));
    const std::size_t count = values.size() / width;
    require(stride >= size * width && stride < 4096 && begin <= bytes.size(), "a view is broken");
    require(count == 0 || (count - 1) * stride + size * width <= bytes.size() - begin,
            "a view reaches beyond its buffer");
    const bool is_normalized = part.value("normalized", false);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t at = begin + i / width * stride + i % width * size;
      values[i] = value(bytes.data() + at, component, is_normalized);
    }
  }
  void replace(const Json& accessor, std::vector<double>& values, std::size_t width) {
    const Json& sparse = accessor.at("sparse");
    const auto count = sparse.at("count").get<std::size_t>();
    require(count <= values.size() / width, "a sparse accessor replaces more than there is");
    std::vector<double> places(count), replaced(count * width);
    read(sparse.at("indices"), places, 1);
    Json part = sparse.at("values");
    part["componentType"] = accessor.at("componentType");
    part["normalized"] = accessor.value("normalized", false);
    read(part, replaced, width);
    for (std::size_t i = 0; i < count; ++i) {
      require(places[i] < double(values.size() / width), "a sparse accessor reaches too far");
      for (std::size_t k = 0; k < width; ++k) {
        values[std::size_t(places[i]) * width + k] = replaced[i * width + k];
      }
    }
  }
  const std::string& buffer(std::size_t number) {
    const auto known = buffers_.find(number);
    if (known != buffers_.end()) return known->second;
    const Json& said = root_.at("buffers").at(number);
    std::string bytes = chunk_;
    if (said.contains("uri")) {
      const std::string uri = said.at("uri").get<std::string>();
      const std::size_t comma = uri.find(',');
      const bool is_data = uri.starts_with("data:") && comma != std::string::npos;
      bytes = is_data ? from_base64(std::string_view(uri).substr(comma + 1))
                      : bytes_of(folder_ / decoded(uri));
    }
    return buffers_.emplace(number, std::move(bytes)).first->second;
  }

  std::filesystem::path folder_;
  std::string chunk_;  ///< Behind the JSON of a GLB file.
  Json root_;
  std::map<std::size_t, std::string> buffers_;
};

/// Values over time: `width` of them per key; of splines with a tangent before and one behind.
struct Sampler {
  std::vector<double> times;
  std::vector<double> values;
  std::size_t width = 0;
  bool holds = false;
  bool is_spline = false;

  std::vector<double> key(std::size_t number, std::size_t part) const {
    const std::size_t begin = (is_spline ? 3 * number + part : number) * width;
    return {values.begin() + std::ptrdiff_t(begin), values.begin() + std::ptrdiff_t(begin + width)};
  }

  std::vector<double> at(double time, bool is_turn) const {
    constexpr std::size_t kValue = 1;
    const auto later = std::upper_bound(times.begin(), times.end(), time);
    if (later == times.begin()) return key(0, kValue);
    const auto before = std::size_t(later - times.begin()) - 1;
    std::vector<double> a = key(before, kValue);
    if (later == times.end() || holds) return a;
    std::vector<double> b = key(before + 1, kValue);
    const double length = times[before + 1] - times[before];
    const double share = length > 0.0 ? (time - times[before]) / length : 0.0;
    if (is_spline) {
      const std::vector<double> out = key(before, 2);
      const std::vector<double> in = key(before + 1, 0);
      const double t2 = share * share;
      const double t3 = t2 * share;
      for (std::size_t i = 0; i < width; ++i) {
        a[i] = (2.0 * t3 - 3.0 * t2 + 1.0) * a[i] + length * (t3 - 2.0 * t2 + share) * out[i] +
               (3.0 * t2 - 2.0 * t3) * b[i] + length * (t3 - t2) * in[i];
      }
      return a;
    }
    if (is_turn) {
      const Quat turn = Quat(a[3], a[0], a[1], a[2])
                            .normalized()
                            .slerp(share, Quat(b[3], b[0], b[1], b[2]).normalized());
      return {turn.x(), turn.y(), turn.z(), turn.w()};
    }
    for (std::size_t i = 0; i < width; ++i) a[i] += share * (b[i] - a[i]);
    return a;
  }
};

/// `elements` of `width` numbers each make a value; 0: as many as there are (weights).
Sampler read_sampler(GltfFile& file, const Json& said, std::size_t width) {
  Sampler sampler;
  const std::string kind = said.value("interpolation", "LINEAR");
  require(kind == "LINEAR" || kind == "STEP" || kind == "CUBICSPLINE", "unknown interpolation");
  sampler.holds = kind == "STEP";
  sampler.is_spline = kind == "CUBICSPLINE";
  sampler.times = file.numbers(said.at("input"), 1);
  sampler.values = file.numbers(said.at("output"), width > 0 ? width : 1);
  const std::size_t keys = sampler.times.size() * (sampler.is_spline ? 3 : 1);
  require(keys > 0 && sampler.values.size() % keys == 0, "keys without values");
  sampler.width = sampler.values.size() / keys;
  require(sampler.width > 0 && (width == 0 || sampler.width == width), "values of another shape");
  const auto is_finite = [](double number) { return std::isfinite(number); };
  require(std::ranges::all_of(sampler.times, is_finite) &&
              std::ranges::all_of(sampler.values, is_finite) &&
              std::ranges::is_sorted(sampler.times),
          "keys that are no numbers, or not in order");
  return sampler;
}

/// By their numbers in the file, for as much of its tree as assimp's has the same shape as.
class Nodes {
 public:
  Nodes(const Json& root, aiScene& scene) : nodes_(root.at("nodes")), found_(nodes_.size()) {
    const Json& roots = root.at("scenes").at(root.value("scene", std::size_t(0))).at("nodes");
    aiNode& top = *scene.mRootNode;
    if (roots.size() == 1) {
      add(roots[0].get<std::size_t>(), top, 0);
    } else if (top.mNumChildren == roots.size()) {
      for (unsigned i = 0; i < top.mNumChildren; ++i) {
        add(roots[i].get<std::size_t>(), *top.mChildren[i], 0);
      }
    }
  }
  aiNode* at(std::size_t number) const { return number < found_.size() ? found_[number] : nullptr; }

 private:
  void add(std::size_t number, aiNode& node, int depth) {
    require(depth < 1000, "nodes nest too deep");
    if (number >= found_.size() || found_[number]) return;
    found_[number] = &node;
    const Json& said = nodes_[number];
    if (!said.contains("children") || said["children"].size() != node.mNumChildren) return;
    for (unsigned i = 0; i < node.mNumChildren; ++i) {
      add(said["children"][i].get<std::size_t>(), *node.mChildren[i], depth + 1);
    }
  }

  const Json& nodes_;
  std::vector<aiNode*> found_;
};

void set_part(aiNode& node, const std::string& path, const std::vector<double>& value) {
  aiVector3D size, place;
  aiQuaternion turn;
  node.mTransformation.Decompose(size, turn, place);
  const auto real = [&](std::size_t i) { return static_cast<ai_real>(value[i]); };
  if (path == "translation") place = {real(0), real(1), real(2)};
  if (path == "scale") size = {real(0), real(1), real(2)};
  if (path == "rotation") {
    turn = aiQuaternion(real(3), real(0), real(1), real(2));
    turn.Normalize();
  }
  node.mTransformation = aiMatrix4x4(size, turn, place);
}

void set_weights(aiScene& scene, const aiNode& node, const std::vector<double>& weights) {
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    if (node.mMeshes[m] >= scene.mNumMeshes) continue;
    aiMesh& mesh = *scene.mMeshes[node.mMeshes[m]];
    for (unsigned i = 0; i < mesh.mNumAnimMeshes; ++i) {
      mesh.mAnimMeshes[i]->mWeight = i < weights.size() ? static_cast<float>(weights[i]) : 0.0f;
    }
  }
}

}  // namespace

std::string pose_gltf_at(aiScene& scene, const std::string& name, unsigned number, double seconds) {
  try {
    GltfFile file(name);
    const Json& root = file.root();
    const Nodes nodes(root, scene);
    const Json& animation = root.at("animations").at(number);
    for (const Json& channel : animation.at("channels")) {
      const Json& target = channel.at("target");
      if (!target.contains("node")) continue;
      const std::string path = target.at("path").get<std::string>();
      aiNode* const node = nodes.at(target.at("node").get<std::size_t>());
      static const std::map<std::string, std::size_t> widths{
          {"translation", 3}, {"scale", 3}, {"rotation", 4}, {"weights", 0}};
      const auto width = widths.find(path);
      if (!node || width == widths.end()) continue;
      const Json& said = animation.at("samplers").at(channel.at("sampler").get<std::size_t>());
      const std::vector<double> value =
          read_sampler(file, said, width->second).at(seconds, path == "rotation");
      if (path == "weights") {
        set_weights(scene, *node, value);
      } else {
        set_part(*node, path, value);
      }
    }
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

}  // namespace diorama::loader_assimp
