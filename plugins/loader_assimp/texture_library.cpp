// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/texture_library.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>

#include "diorama/error.h"

namespace diorama::loader_assimp {
namespace {

namespace fs = std::filesystem;

constexpr unsigned kMaxRawSize = 16384;

std::optional<char> hexadecimal(std::string_view two) {
  int value = 0;
  const auto [end, error] = std::from_chars(two.data(), two.data() + two.size(), value, 16);
  if (error != std::errc() || end != two.data() + two.size()) return std::nullopt;
  return static_cast<char>(value);
}

// "%20" of URIs.
std::string decode_percent(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size()) {
      if (const auto byte = hexadecimal(std::string_view(text).substr(i + 1, 2))) {
        result += *byte;
        i += 2;
        continue;
      }
    }
    result += text[i];
  }
  return result;
}

// What a material says, as a path: without backslashes, the prefix of URIs and blanks around it.
std::string plain_path(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.starts_with("file://")) name.erase(0, 7);
  const std::size_t first = name.find_first_not_of(" \t\r\n\"");
  const std::size_t last = name.find_last_not_of(" \t\r\n\"");
  return first == std::string::npos ? "" : name.substr(first, last - first + 1);
}

std::shared_ptr<const Texture> unpack_raw(const aiTexture& source, const std::string& name) {
  if (source.mWidth == 0 || source.mWidth > kMaxRawSize || source.mHeight > kMaxRawSize) {
    throw Error(ErrorKind::Asset, name + ": a picture of " + std::to_string(source.mWidth) + " x " +
                                      std::to_string(source.mHeight) + " pixels");
  }
  auto texture = std::make_shared<Texture>();
  texture->name = name;
  texture->width = static_cast<int>(source.mWidth);
  texture->height = static_cast<int>(source.mHeight);
  texture->channels = 4;
  texture->color_space = ColorSpace::Srgb;
  const std::size_t count = std::size_t(source.mWidth) * source.mHeight;
  texture->bytes.reserve(count * 4);
  for (std::size_t i = 0; i < count; ++i) {
    const aiTexel& texel = source.pcData[i];
    texture->bytes.insert(texture->bytes.end(), {texel.r, texel.g, texel.b, texel.a});
  }
  return texture;
}

std::shared_ptr<const Texture> decode_embedded(const Host& host, const aiTexture& source,
                                               const std::string& name) {
  if (source.mHeight > 0) return unpack_raw(source, name);
  const auto* bytes = reinterpret_cast<const std::byte*>(source.pcData);
  return host.decode_texture({bytes, source.mWidth}, name);
}

}  // namespace

// Exporters write paths of the machine that they ran on: what they mean often lies beside the file.
std::optional<fs::path> find_picture(const fs::path& folder, const std::string& name) {
  const std::string path = plain_path(name);
  if (path.empty()) return std::nullopt;
  for (const std::string& spelling : {path, decode_percent(path)}) {
    const fs::path base = fs::path(spelling).filename();
    if (base.empty()) continue;
    for (const fs::path& place :
         {folder / spelling, folder / base, folder / "textures" / base, folder / "Textures" / base,
          folder.parent_path() / "textures" / base}) {
      std::error_code error;
      if (fs::is_regular_file(place, error)) return place;
    }
  }
  return std::nullopt;
}

std::string TextureLibrary::identify(const std::string& name) {
  if (const aiTexture* embedded = file_.scene().GetEmbeddedTexture(name.c_str())) {
    const std::string own = embedded->mFilename.C_Str();
    const std::string identifier = file_.name() + "[" + (own.empty() ? name : own) + "]";
    decoder_.announce(identifier, [this, embedded, identifier] {
      return decode_embedded(host_, *embedded, identifier);
    });
    return identifier;
  }
  const auto found = find_picture(fs::path(file_.name()).parent_path(), name);
  if (!found) return {};
  decoder_.announce(found->string(), [this, path = *found] { return host_.read_texture(path); });
  return found->string();
}

void TextureLibrary::report(const std::string& name, const std::string& why,
                            const std::string& material) {
  const std::string what = file_.name() + ": texture @" + plain_path(name) + "@ " + why;
  missing_.add(what, what, material);
}

std::shared_ptr<const Texture> TextureLibrary::read(const std::string& name, ColorSpace space,
                                                    const std::string& material) {
  const std::string identifier = identify(name);
  if (identifier.empty()) {
    report(name, "could not be found", material);
    return nullptr;
  }
  try {
    return decoder_.get(identifier, space);
  } catch (const Error& error) {
    report(name, std::string("could not be read: ") + error.what(), material);
    return nullptr;
  }
}

}  // namespace diorama::loader_assimp
