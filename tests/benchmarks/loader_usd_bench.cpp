// SPDX-License-Identifier: Apache-2.0
// How fast and in how much memory the USD loader opens a crate file, beside merely reading the
// file's arrays: one line of JSON. Without a file it makes a room of a million triangles first,
// with normals and uvs per point, or per corner of the faces as Blender and Infinigen write them.
// Times are those of a copy that stands alone, without pictures and other layers: those are not
// among the file's arrays. Memory is that of the file where it is.
#include <malloc.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "framework/export/crate_writer.h"
#include "framework/export/scene_export.h"
#include "framework/export/usd_layer.h"
#include "loader_usd/usd/asset_library.h"
#include "loader_usd/usd/layer.h"
#include "loader_usd/usd_loader.h"
#include "support/render_host/render_host.h"
#include "support/temporary_folder.h"

namespace {

using namespace diorama;
/// Of the processor: other programs on the machine do not count.
double seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// Both sides get their big buffers from the system each time, as a program does that loads a file
/// once: what the allocator keeps of earlier rounds would favour now one side and now the other.
void use_fresh_memory() {
  constexpr int kThreshold = 128 << 10;
  mallopt(M_MMAP_THRESHOLD, kThreshold);
  mallopt(M_TRIM_THRESHOLD, kThreshold);
}

/// A bumpy sheet with normals and uvs.
Mesh make_sheet(int cells, double phase) {
  Mesh mesh;
  const auto width = static_cast<std::uint32_t>(cells + 1);
  for (int y = 0; y <= cells; ++y) {
    for (int x = 0; x <= cells; ++x) {
      const double u = double(x) / cells;
      const double v = double(y) / cells;
      const double height = 0.05 * std::sin(20.0 * u + phase) * std::cos(17.0 * v - phase);
      mesh.positions.emplace_back(Vec3(u, v, height).cast<float>());
      mesh.uvs.emplace_back(Vec2(u, v).cast<float>());
    }
  }
  for (std::uint32_t y = 0; y + 1 < width; ++y) {
    for (std::uint32_t x = 0; x + 1 < width; ++x) {
      const std::uint32_t a = y * width + x;
      mesh.triangles.push_back({a, a + 1, a + width + 1});
      mesh.triangles.push_back({a, a + width + 1, a + width});
    }
  }
  mesh.normals = smooth_normals(mesh);
  return mesh;
}

void write_room(const std::filesystem::path& file, const Host& host, int things, int cells) {
  Scene scene;
  const NodeId room = scene.create(scene.root(), "room");
  for (int i = 0; i < things; ++i) {
    const NodeId node = scene.create(room, "thing");
    scene.edit(node).mesh = std::make_shared<const Mesh>(make_sheet(cells, 0.3 * i));
    scene.edit(node).materials = {std::make_shared<const Material>()};
  }
  export_scene(scene, room, file, {}, host);
}

/// A textured sheet, a lamp and a camera: what a program needs once to load any file comes into
/// memory with it.
void write_small(const std::filesystem::path& file, const Host& host) {
  auto texture = std::make_shared<Texture>();
  texture->name = "checker";
  texture->width = texture->height = 2;
  texture->channels = 3;
  texture->color_space = ColorSpace::Srgb;
  texture->bytes = {255, 255, 255, 0, 0, 0, 0, 0, 0, 255, 255, 255};
  auto material = std::make_shared<Material>();
  material->base_color_texture.texture = std::move(texture);
  Scene scene;
  const NodeId room = scene.create(scene.root(), "room");
  const NodeId sheet = scene.create(room, "sheet");
  scene.edit(sheet).mesh = std::make_shared<const Mesh>(make_sheet(2, 0.0));
  scene.edit(sheet).materials = {std::move(material)};
  scene.edit(scene.create(room, "lamp")).light = Light{};
  scene.edit(scene.create(room, "camera")).camera = Camera{};
  export_scene(scene, room, file, {}, host);
}

/// Every corner's own normal; uvs in charts, so that few corners of a point differ, with or without
/// indices.
usd_export::Prim corner_mesh(const Mesh& sheet, const std::string& name, bool is_indexed) {
  constexpr int kChart = 16;  // corners of this many faces are one chart
  std::vector<int> corners;
  std::vector<Vec3f> normals;
  std::vector<Vec2f> uvs;
  std::vector<int> uv_indices;
  std::map<std::pair<std::uint32_t, std::size_t>, int> known;
  for (std::size_t face = 0; face < sheet.triangles.size(); ++face) {
    for (const std::uint32_t point : sheet.triangles[face]) {
      corners.push_back(int(point));
      normals.push_back(sheet.normals[point]);
      const std::size_t chart = face / kChart;
      const Vec2f uv = sheet.uvs[point] + Vec2f::Constant(float(chart));
      if (!is_indexed) {
        uvs.push_back(uv);
        continue;
      }
      const auto [entry, is_new] = known.try_emplace({point, chart}, int(uvs.size()));
      if (is_new) uvs.push_back(uv);
      uv_indices.push_back(entry->second);
    }
  }
  usd_export::Prim prim;
  prim.name = name;
  prim.type = "Mesh";
  prim.set("faceVertexCounts", "int[]", std::vector<int>(sheet.triangles.size(), 3));
  prim.set("faceVertexIndices", "int[]", std::move(corners));
  prim.set("points", "point3f[]", sheet.positions);
  const auto add_primvar = [&](const char* primvar, const char* type, usd_export::Value value) {
    prim.set(primvar, type, std::move(value));
    prim.properties.back().interpolation = "faceVarying";
  };
  add_primvar("normals", "normal3f[]", std::move(normals));
  add_primvar("primvars:st", "texCoord2f[]", std::move(uvs));
  if (is_indexed) prim.set("primvars:st:indices", "int[]", std::move(uv_indices));
  prim.set_uniform("subdivisionScheme", "token", usd_export::Token{"none"});
  return prim;
}

void write_corner_room(const std::filesystem::path& file, int things, int cells, bool is_indexed) {
  usd_export::Prim room;
  room.name = "room";
  room.type = "Xform";
  for (int i = 0; i < things; ++i) {
    room.children.push_back(
        corner_mesh(make_sheet(cells, 0.3 * i), "thing_" + std::to_string(i), is_indexed));
  }
  usd_export::Layer layer;
  layer.roots.push_back(std::move(room));
  const auto bytes = usd_export::write_crate(layer);
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

bool is_compressible(usd::Type type) {
  return type == usd::Type::Int || type == usd::Type::UInt || type == usd::Type::Int64 ||
         type == usd::Type::UInt64 || type == usd::Type::Half || type == usd::Type::Float ||
         type == usd::Type::Double;
}

/// Reads every array of a layer into memory: decompressed, or copied out of the file.
double read_arrays(const std::string& file) {
  const double start = seconds();
  usd::AssetLibrary library;
  const auto layer = library.open(file);
  std::vector<usd::Value> decompressed;
  std::vector<std::vector<std::byte>> copied;
  layer->for_each_array([&](const usd::Value& value) {
    const auto bytes = value.bytes();
    if (is_compressible(value.type())) {
      decompressed.push_back(value);
    } else {
      copied.emplace_back(bytes.begin(), bytes.end());
    }
  });
  return seconds() - start;
}

double median(std::vector<double> list) {
  const auto middle = list.begin() + std::ptrdiff_t(list.size() / 2);
  std::nth_element(list.begin(), middle, list.end());
  return *middle;
}

struct Load {
  double seconds = 0.0;
  std::size_t triangles = 0;
  std::size_t scene_bytes = 0;
};

template <class T>
std::size_t bytes_of(const std::vector<T>& list) {
  return list.size() * sizeof(T);
}

Load load(const std::string& file, Host& host) {
  Scene scene;
  const NodeId root = scene.create(scene.root(), "asset");
  const double start = seconds();
  loader_usd::UsdLoader({}, host).load(file, scene, root);
  Load result;
  result.seconds = seconds() - start;
  std::set<const void*> seen;
  for (const NodeId id : scene.subtree(root)) {
    const Node& node = scene[id];
    result.scene_bytes += sizeof node;
    if (!node.mesh) continue;
    const Mesh& mesh = *node.mesh;
    result.triangles += mesh.triangles.size();
    if (!seen.insert(&mesh).second) continue;
    result.scene_bytes += bytes_of(mesh.positions) + bytes_of(mesh.triangles) +
                          bytes_of(mesh.normals) + bytes_of(mesh.uvs) + bytes_of(mesh.colors) +
                          bytes_of(mesh.material_slots);
    for (const auto& material : node.materials) {
      for (const TextureInput* input : {&material->base_color_texture, &material->metallic_texture,
                                        &material->roughness_texture, &material->normal_texture,
                                        &material->opacity_texture, &material->emission_texture}) {
        if (*input && seen.insert(input->texture.get()).second) {
          result.scene_bytes += bytes_of(input->texture->bytes) + bytes_of(input->texture->floats);
        }
      }
    }
  }
  return result;
}

/// A line of /proc/self/status, in bytes.
std::size_t process_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key + ":")) return std::stoull(line.substr(key.size() + 1)) * 1024;
  }
  return 0;
}

struct Memory {
  std::size_t peak = 0;
  std::size_t scene = 0;
};

/// Loads in a process of its own, so that the peak is this file's alone. `small` is loaded first,
/// because the program and its libraries come into memory with the first file.
Memory measure_memory(const std::string& file, const std::string& small) {
  int ends[2];
  Memory memory;
  if (pipe(ends) != 0) return memory;
  const pid_t child = fork();
  if (child == 0) {
    test::RenderHost host{1};
    load(small, host);
    const std::size_t before = process_bytes("VmHWM");
    memory.scene = load(file, host).scene_bytes;
    memory.peak = process_bytes("VmHWM") - before;
    const bool is_told = write(ends[1], &memory, sizeof memory) == sizeof memory;
    _exit(is_told ? 0 : 1);
  }
  if (read(ends[0], &memory, sizeof memory) != sizeof memory) memory = {};
  waitpid(child, nullptr, 0);
  close(ends[0]);
  close(ends[1]);
  return memory;
}

/// In a folder without the pictures and layers that it names.
std::string copy_alone(const std::string& file, const std::filesystem::path& folder) {
  std::filesystem::create_directory(folder);
  const std::filesystem::path copy = folder / std::filesystem::path(file).filename();
  std::filesystem::copy_file(file, copy);
  return copy.string();
}

}  // namespace

int main(int argc, char** argv) {
  std::string file;
  int repetitions = 15;
  int things = 20;
  int cells = 158;
  int threads = 1;
  std::string values = "point";
  CLI::App app{"Times the USD loader against reading the file's arrays"};
  app.add_option("file", file, "A crate file; without one a room is made");
  app.add_option("--repetitions", repetitions)->check(CLI::PositiveNumber);
  app.add_option("--things", things, "Meshes of the room");
  app.add_option("--cells", cells, "Cells along an edge of each mesh");
  app.add_option("--threads", threads);
  app.add_option("--values", values, "Of the room's meshes: point, corner or indexed_corner")
      ->check(CLI::IsMember({"point", "corner", "indexed_corner"}));
  CLI11_PARSE(app, argc, argv);
  use_fresh_memory();

  const test::TemporaryFolder folder;
  const std::string small = folder.path("small.usdc");
  const bool is_made = file.empty();
  if (is_made) file = folder.path("room.usdc");
  // The child that loads must begin without the rooms that are made here.
  const pid_t child = fork();
  if (child == 0) {
    test::RenderHost host{1};
    write_small(small, host);
    if (is_made && values == "point") write_room(file, host, things, cells);
    if (is_made && values != "point") {
      write_corner_room(file, things, cells, values == "indexed_corner");
    }
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  const Memory memory = measure_memory(file, small);
  const std::string alone = copy_alone(file, folder.path("alone"));
  test::RenderHost host{threads};
  std::vector<double> arrays;
  std::vector<double> loads;
  std::size_t triangles = 0;
  for (int i = 0; i < repetitions; ++i) {
    arrays.push_back(read_arrays(alone));
    const Load one = load(alone, host);
    loads.push_back(one.seconds);
    triangles = one.triangles;
  }
  const double arrays_s = median(std::move(arrays));
  const double load_s = median(std::move(loads));
  const nlohmann::ordered_json line{
      {"triangles", triangles},
      {"file_mib", double(std::filesystem::file_size(alone)) / (1 << 20)},
      {"arrays_s", arrays_s},
      {"load_s", load_s},
      {"ratio", load_s / arrays_s},
      {"scene_mib", double(memory.scene) / (1 << 20)},
      {"peak_mib", double(memory.peak) / (1 << 20)},
      {"peak_over_scene", double(memory.peak) / double(memory.scene)}};
  std::printf("%s\n", line.dump().c_str());
}
