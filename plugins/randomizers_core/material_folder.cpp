// SPDX-License-Identifier: Apache-2.0
#include "material_folder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>
#include <tuple>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::pair<std::string_view, MapRole> kRoles[] = {
    {"color", MapRole::Color},
    {"basecolor", MapRole::Color},
    {"col", MapRole::Color},
    {"col1", MapRole::Color},  // the first of several colourings
    {"col01", MapRole::Color},
    {"diff", MapRole::Color},
    {"diffuse", MapRole::Color},
    {"albedo", MapRole::Color},
    {"roughness", MapRole::Roughness},
    {"rough", MapRole::Roughness},
    {"metalness", MapRole::Metalness},
    {"metallic", MapRole::Metalness},
    {"metal", MapRole::Metalness},
    {"normalgl", MapRole::NormalGl},
    {"norgl", MapRole::NormalGl},
    {"normal", MapRole::NormalGl},
    {"nor", MapRole::NormalGl},
    {"normaldx", MapRole::NormalDx},
    {"nordx", MapRole::NormalDx},
    {"opacity", MapRole::Opacity},
    {"alpha", MapRole::Opacity},
    {"emission", MapRole::Emission},
    {"emissive", MapRole::Emission},
    {"arm", MapRole::Arm},
    {"ambientocclusion", MapRole::Ignored},
    {"ao", MapRole::Ignored},
    {"displacement", MapRole::Displacement},
    {"disp", MapRole::Displacement},
    {"height", MapRole::Displacement},
};
constexpr std::string_view kPictureEndings[] = {".png", ".jpg", ".jpeg", ".exr",  ".hdr", ".tga",
                                                ".bmp", ".tif", ".tiff", ".webp", ".jp2"};

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return out;
}

std::optional<MapRole> role_of(std::string_view word) {
  for (const auto& [known, role] : kRoles) {
    if (word == known) return role;
  }
  return std::nullopt;
}

/// "1k", "2k", "4096": what tells pictures of one material apart that are of different size.
bool is_size(std::string_view word) {
  constexpr std::string_view kPixels[] = {"512", "1024", "2048", "4096", "8192", "16384"};
  if (std::ranges::find(kPixels, word) != std::end(kPixels)) return true;
  const std::size_t digits = std::min(word.find_first_not_of("0123456789"), word.size());
  return digits > 0 && word.substr(digits) == "k";
}

bool is_format(std::string_view word) {
  return word == "jpg" || word == "jpeg" || word == "png" || word == "exr" || word == "hdr" ||
         word == "tif";
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find_first_of("_- .", begin), text.size());
    if (end > begin) words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

std::vector<fs::path> files_below(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code failed;
  for (fs::recursive_directory_iterator entry(folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    std::error_code error;
    if (entry->is_regular_file(error)) files.push_back(entry->path());
  }
  if (failed) {
    throw Error(ErrorKind::Asset,
                folder.string() + ": the folder cannot be listed: " + failed.message());
  }
  std::sort(files.begin(), files.end());
  return files;
}

TextureInput input(std::shared_ptr<const Texture> texture, int channel = 0) {
  TextureInput input;
  input.channel = std::min(channel, texture->channels - 1);
  input.texture = std::move(texture);
  return input;
}

/// Takes displacement out of the materials. Most have normals of the same relief.
void tell_displacement(const std::string& folder, std::vector<MaterialMaps>& materials,
                       Host& host) {
  std::size_t with_normals = 0;
  std::size_t without = 0;
  for (MaterialMaps& maps : materials) {
    if (maps.files.erase(MapRole::Displacement) == 0) continue;
    const bool has_normals =
        maps.files.contains(MapRole::NormalGl) || maps.files.contains(MapRole::NormalDx);
    ++(has_normals ? with_normals : without);
  }
  const auto tell = [&](LogLevel level, std::size_t count, const char* instead) {
    if (count == 0) return;
    host.log(level, folder + ": materials with displacement, which moves no surface here: " +
                        std::to_string(count) + instead);
  };
  tell(LogLevel::Info, with_normals, "; their normals show the relief");
  tell(LogLevel::Warning, without, " without normals, which look flat");
}

/// 0..1 as -1..1; DirectX counts green downwards.
TextureInput normals(std::shared_ptr<const Texture> texture, bool is_directx) {
  const float green = is_directx ? -1.0f : 1.0f;
  TextureInput result = input(std::move(texture));
  result.scale = {2.0f, 2.0f * green, 2.0f, 1.0f};
  result.bias = {-1.0f, -green, -1.0f, 0.0f};
  return result;
}

}  // namespace

std::optional<MapName> map_name(std::string_view file_name) {
  const std::size_t dot = file_name.rfind('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const std::string ending = lower(file_name.substr(dot));
  if (std::ranges::find(kPictureEndings, ending) == std::end(kPictureEndings)) return std::nullopt;
  std::vector<std::string> words = words_of(lower(file_name.substr(0, dot)));
  std::erase_if(words, [](const std::string& word) { return is_size(word) || is_format(word); });
  // A material may be called after what it shows: of "metal_plate_rough" the last words count.
  MapName name;
  for (const std::size_t count : {2u, 1u}) {
    if (words.size() <= count) continue;
    std::string last;
    for (std::size_t i = words.size() - count; i < words.size(); ++i) last += words[i];
    const auto role = role_of(last);
    if (!role) continue;
    for (std::size_t i = 0; i + count < words.size(); ++i) {
      name.material += (i > 0 ? "_" : "") + words[i];
    }
    name.role = *role;
    return name;
  }
  return std::nullopt;
}

std::vector<MaterialMaps> find_materials(const std::string& folder, Host& host) {
  const fs::path place = host.resolve(folder);
  std::error_code error;
  if (!fs::is_directory(place, error)) {
    throw Error(ErrorKind::Asset, folder + ": is a file, expected a folder of materials");
  }
  std::map<std::pair<fs::path, std::string>, MaterialMaps> found;
  for (const fs::path& file : files_below(place)) {
    const auto name = map_name(file.filename().string());
    if (!name || name->role == MapRole::Ignored) continue;
    MaterialMaps& maps = found[{file.parent_path(), name->material}];
    maps.name = name->material;
    maps.files.emplace(name->role, file);
  }
  std::vector<MaterialMaps> materials;
  for (auto& [key, maps] : found) {
    if (maps.files.contains(MapRole::Color)) materials.push_back(std::move(maps));
  }
  if (materials.empty()) {
    throw Error(ErrorKind::Asset,
                folder +
                    ": holds no material, expected pictures named as those of ambientCG or "
                    "Poly Haven: 'Wood051_1K-JPG_Color.jpg', 'brick_wall_diff_1k.png'");
  }
  tell_displacement(folder, materials, host);
  // Datasets name what they are made of.
  for (const MaterialMaps& maps : materials) {
    for (const auto& [role, file] : maps.files) (void)host.resolve(file.string());
  }
  return materials;
}

std::shared_ptr<const Texture> MaterialReader::texture(const fs::path& file, ColorSpace space) {
  std::weak_ptr<const Texture>& known = read_[file];
  if (auto texture = known.lock()) return texture;
  std::shared_ptr<const Texture> texture = host_.read_texture(file);
  if (texture->color_space != space && texture->floats.empty()) {
    auto copy = std::make_shared<Texture>(*texture);
    copy->color_space = space;
    texture = std::move(copy);
  }
  known = texture;
  return texture;
}

Material MaterialReader::read(const MaterialMaps& maps) {
  const auto map = [&](MapRole role, ColorSpace space) -> std::shared_ptr<const Texture> {
    const auto file = maps.files.find(role);
    return file == maps.files.end() ? nullptr : texture(file->second, space);
  };
  constexpr ColorSpace kLinear = ColorSpace::Linear;
  Material material;
  material.name = maps.name;
  material.base_color = Vec3f::Ones();
  material.base_color_texture = input(map(MapRole::Color, ColorSpace::Srgb));
  if (auto arm = map(MapRole::Arm, kLinear)) {
    material.roughness_texture = input(arm, 1);
    material.metallic_texture = input(std::move(arm), 2);
  }
  if (auto roughness = map(MapRole::Roughness, kLinear)) {
    material.roughness_texture = input(std::move(roughness));
  }
  if (auto metalness = map(MapRole::Metalness, kLinear)) {
    material.metallic_texture = input(std::move(metalness));
  }
  if (auto normal = map(MapRole::NormalGl, kLinear)) {
    material.normal_texture = normals(std::move(normal), false);
  } else if (auto directx = map(MapRole::NormalDx, kLinear)) {
    material.normal_texture = normals(std::move(directx), true);
  }
  if (auto opacity = map(MapRole::Opacity, kLinear)) {
    material.opacity_texture = input(std::move(opacity));
    material.opacity_threshold = 0.5f;
  }
  if (auto emission = map(MapRole::Emission, ColorSpace::Srgb)) {
    material.emission = Vec3f::Ones();
    material.emission_texture = input(std::move(emission));
  }
  return material;
}

}  // namespace diorama
