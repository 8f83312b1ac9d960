// SPDX-License-Identifier: Apache-2.0
#include "reader_support/stored_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <span>
#include <stdexcept>
#include <system_error>

#include "diorama/error.h"

namespace diorama {

namespace fs = std::filesystem;

namespace {

class FileDescriptor {
 public:
  // Without O_NONBLOCK a pipe would be waited for before it can be refused.
  explicit FileDescriptor(const fs::path& file)
      : descriptor_(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  ~FileDescriptor() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace

std::ifstream open_stored(const fs::path& file) {
  std::error_code error;
  if (fs::is_regular_file(file, error)) return std::ifstream(file, std::ios::binary);
  std::ifstream refused;
  refused.setstate(std::ios::failbit);
  return refused;
}

std::string read_whole_file(const fs::path& file, std::uintmax_t most) {
  const FileDescriptor opened(file);
  std::error_code ignored;
  if (opened.get() < 0 && fs::is_regular_file(file, ignored)) {
    throw std::runtime_error("cannot be read");
  }
  struct stat status {};
  const bool is_there = opened.get() >= 0 && ::fstat(opened.get(), &status) == 0;
  if (!is_there || !S_ISREG(status.st_mode)) throw std::runtime_error("the file is not there");
  const auto size = std::uintmax_t(status.st_size);
  if (size > most) {
    throw std::runtime_error("has " + std::to_string(size) + " bytes; at most " +
                             std::to_string(most) + " are read");
  }
  // What a block is filled with before it is read is still near the processor then.
  constexpr std::size_t kBlock = std::size_t(128) << 10;
  std::string content;
  content.reserve(std::size_t(size));
  while (content.size() < size) {
    const std::size_t begin = content.size();
    content.resize(std::min(begin + kBlock, std::size_t(size)));
    const ssize_t count = ::read(opened.get(), content.data() + begin, content.size() - begin);
    const bool is_interrupted = count < 0 && errno == EINTR;
    if (count <= 0 && !is_interrupted) throw std::runtime_error("cannot be read");
    content.resize(begin + (is_interrupted ? 0 : std::size_t(count)));
  }
  return content;
}

Json parse_stored_json(std::string_view text) {
  constexpr int kMostDepth = 100;
  int depth = 0;
  bool is_quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (is_quoted && c == '\\') {
      ++i;
    } else if (c == '"') {
      is_quoted = !is_quoted;
    } else if (!is_quoted && (c == '[' || c == '{')) {
      if (++depth > kMostDepth) throw std::runtime_error("nests deeper than 100 levels");
    } else if (!is_quoted && (c == ']' || c == '}')) {
      --depth;
    }
  }
  return Json::parse(text);
}

std::uint32_t StoredPicture::at(int x, int y, int c) const {
  const std::size_t i =
      (std::size_t(y) * std::size_t(width()) + std::size_t(x)) * std::size_t(channels()) +
      std::size_t(c);
  if (texture->floats.empty()) return texture->bytes[i];
  return std::uint32_t(std::lround(std::clamp(double(texture->floats[i]), 0.0, 1.0) * 65535.0));
}

Image<Rgba8> StoredPicture::color() const {
  const int used = std::min(channels(), 4);
  if (used == channels() && used == 4 && texture->floats.empty()) {  // as nearly all are
    Image<Rgba8> image(width(), height(), {});
    std::memcpy(image.pixels().data(), texture->bytes.data(), image.pixels().size_bytes());
    return image;
  }
  Image<Rgba8> image(width(), height(), {0, 0, 0, 255});
  if (used >= 3 && texture->floats.empty()) {
    const std::uint8_t* from = texture->bytes.data();
    for (Rgba8& pixel : image.pixels()) {
      for (std::size_t c = 0; c < std::size_t(used); ++c) pixel[c] = from[c];
      from += channels();
    }
    return image;
  }
  for (int y = 0; y < height(); ++y) {
    for (int x = 0; x < width(); ++x) {
      Rgba8& pixel = image.at(x, y);
      for (int c = 0; c < used; ++c) {
        const std::uint32_t value = at(x, y, c);
        pixel[std::size_t(used == 2 && c == 1 ? 3 : c)] =
            std::uint8_t(texture->floats.empty() ? value : value >> 8);
      }
      if (used < 3) pixel[1] = pixel[2] = pixel[0];
    }
  }
  return image;
}

bool StoredFiles::has(const std::string& file) const {
  std::error_code error;
  return fs::is_regular_file(root_ / file, error);
}

void StoredFiles::check(bool holds, const char* rule, const std::string& file,
                        const std::string& object, const std::string& found,
                        const std::string& expected) {
  ++log_.checks;
  if (!holds) find(rule, file, object, found, expected);
}

void StoredFiles::find(const char* rule, const std::string& file, const std::string& object,
                       const std::string& found, const std::string& expected) {
  log_.findings.push_back({rule, file, capture_, camera_, object, found, expected});
}

std::optional<std::string> StoredFiles::text(const std::string& file) {
  if (!has(file)) {
    find(kMissing, file, "", "the file is not there");
    return std::nullopt;
  }
  try {
    ++log_.files;
    return read_whole_file(root_ / file);
  } catch (const std::runtime_error& error) {
    find(kReadable, file, "", error.what());
    return std::nullopt;
  }
}

std::optional<Json> StoredFiles::json(const std::string& file) {
  const auto content = text(file);
  if (!content) return std::nullopt;
  try {
    return parse_stored_json(*content);
  } catch (const std::exception& error) {
    find(kReadable, file, "", error.what());
    return std::nullopt;
  }
}

std::optional<StoredPicture> StoredFiles::picture(const std::string& file) {
  const auto content = text(file);
  if (!content) return std::nullopt;
  try {
    return StoredPicture{
        host_.decode_texture(std::as_bytes(std::span(content->data(), content->size())), file)};
  } catch (const std::exception& error) {
    // The codecs put the name in front, findings have it anyway.
    const std::string said = error.what();
    const bool is_named = said.starts_with(file + ": ");
    find(kReadable, file, "", is_named ? said.substr(file.size() + 2) : said);
    return std::nullopt;
  }
}

std::optional<StoredPicture> StoredFiles::picture_of_size(const std::string& file, int width,
                                                          int height, const std::string& says) {
  auto decoded = picture(file);
  if (!decoded) return std::nullopt;
  const auto size = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
  const bool fits = decoded->width() == width && decoded->height() == height;
  check(fits, kCounts, file, "", "is " + size(decoded->width(), decoded->height()) + " pixels",
        says + " says " + size(width, height));
  if (!fits) return std::nullopt;
  return decoded;
}

void StoredFiles::reading(const std::string& file, const std::function<void()>& body) {
  try {
    body();
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    find(kReadable, file, "", error.what());
  }
}

std::vector<std::string> names_in(const fs::path& folder, bool of_folders) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    const bool fits = of_folders ? at->is_directory(ignored) : at->is_regular_file(ignored);
    std::string name = at->path().filename().string();
    if (fits && !name.starts_with(".diorama")) names.push_back(std::move(name));
  }
  std::ranges::sort(names);
  return names;
}

std::vector<std::string> possible_places(std::string said) {
  constexpr std::size_t kMostPlaces = 32;
  std::ranges::replace(said, '\\', '/');
  std::vector<std::string> parts;
  for (const fs::path& part : fs::path(said)) {
    const std::string name = part.generic_string();
    if (name == "..") {
      parts.clear();
    } else if (name != "." && name != "/" && !name.empty()) {
      parts.push_back(name);
    }
  }
  if (parts.size() > kMostPlaces) parts.erase(parts.begin(), parts.end() - kMostPlaces);
  std::vector<std::string> places;
  for (std::size_t first = 0; first < parts.size(); ++first) {
    std::string place = parts[first];
    for (std::size_t i = first + 1; i < parts.size(); ++i) place += "/" + parts[i];
    places.push_back(std::move(place));
  }
  return places;
}

std::string box_text(const PixelBox& box) {
  return "[" + std::to_string(box.x_min) + ", " + std::to_string(box.y_min) + ", " +
         std::to_string(box.x_max) + ", " + std::to_string(box.y_max) + ")";
}

}  // namespace diorama
