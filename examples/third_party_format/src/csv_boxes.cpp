// SPDX-License-Identifier: Apache-2.0
// One table of all boxes of a dataset, boxes.csv, beside the pictures that it speaks of: what a
// spreadsheet or pandas.read_csv() opens. The writer makes it; the reader gives it back to lint,
// stats, convert and the like.
#include <diorama/host.h>
#include <diorama/plugin.h>
#include <diorama/reader.h>
#include <diorama/writer.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr const char* kTable = "boxes.csv";
constexpr const char* kHeader =
    "picture,width,height,phase,object,label,x_min,y_min,x_max,y_max,visibility,truncation";
constexpr double kShareStep = 0.001;  // Of visibility and truncation.

struct CsvParams {
  std::string taxonomy = "class";
  double min_visibility = 0.0;
  bool pictures = true;
  void visit(diorama::ParamVisitor& v) {
    v.param("taxonomy", taxonomy, {"Which of an object's labels to write."});
    v.param("min_visibility", min_visibility,
            {"Objects of which a smaller share can be seen are left out.", "", 0.0, 1.0});
    v.param("pictures", pictures, {"Write the pictures, too, as PNG."});
  }
};

/// RFC 4180: quotes are doubled inside quotes.
std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

/// Three decimals, with a point in every locale.
std::string decimal(double number) {
  char digits[32];
  const auto end =
      std::to_chars(digits, digits + sizeof digits, number, std::chars_format::fixed, 3);
  return {digits, end.ptr};
}

std::string picture_name(const diorama::Frame& frame, int capture) {
  char number[16];
  std::snprintf(number, sizeof number, "%06d", capture);
  return frame.camera_name + "/" + number + ".png";
}

class CsvBoxesWriter final : public diorama::Writer {
 public:
  using Params = CsvParams;
  CsvBoxesWriter(Params params, diorama::Host& host) : params_(std::move(params)), host_(host) {}

  //! [needs]
  diorama::NameSet needs() const override {
    diorama::NameSet names{"instance_id", "instances", "visibility"};
    if (params_.pictures) names.emplace(diorama::kColor.name);
    return names;
  }
  //! [needs]

  //! [write]
  // Several threads are in here at once. A capture's rows travel as its record, so that the table
  // is whole and in order after a resumed run and after merged shards.
  void write(const diorama::Capture& capture, diorama::CaptureFiles& files) const override {
    std::string rows;
    for (const diorama::Frame& frame : capture.frames) {
      const std::string picture = picture_name(frame, capture.index);
      if (params_.pictures) files.add(picture, png(frame.get(diorama::kColor)));
      for (const diorama::Instance& instance : frame.instances) {
        rows += row(picture, frame.camera, capture.phase, instance);
      }
    }
    if (!rows.empty()) files.record(rows);
  }
  //! [write]

  //! [finish]
  void finish(const diorama::RecordReader& records, diorama::DatasetFiles& files) override {
    // The table grows on disk: it may be larger than the memory.
    files.append_text(kTable, std::string(kHeader) + "\n");
    // A record is one line; its rows are told apart by tabs, which no row holds.
    records([&](int, std::string_view line) {
      std::string rows(line);
      std::ranges::replace(rows, '\t', '\n');
      files.append_text(kTable, rows);
    });
  }
  //! [finish]

 private:
  /// One row that ends with a tab; nothing for what has no label or cannot be seen well enough.
  std::string row(const std::string& picture, const diorama::Camera& camera,
                  const std::string& phase, const diorama::Instance& instance) const {
    const auto label = instance.labels.find(params_.taxonomy);
    if (label == instance.labels.end() || !instance.tight_box || !instance.visibility) return {};
    const double visible = 1.0 - instance.visibility->occlusion().value_or(1.0);
    if (visible < params_.min_visibility) return {};
    const diorama::PixelBox& box = *instance.tight_box;
    std::string text =
        picture + "," + std::to_string(camera.width) + "," + std::to_string(camera.height);
    for (const std::string& cell : {phase, instance.node_path, label->second}) {
      text += "," + one_line(quoted(cell));
    }
    for (const int edge : {box.x_min, box.y_min, box.x_max, box.y_max}) {
      text += "," + std::to_string(edge);
    }
    return text + "," + decimal(visible) + "," + decimal(instance.visibility->truncation()) + "\t";
  }

  static std::string one_line(std::string text) {
    for (char& c : text) {
      if (c == '\t' || c == '\n' || c == '\r') c = ' ';
    }
    return text;
  }

  std::vector<std::byte> png(const diorama::Image<diorama::Rgba8>& picture) const {
    const diorama::ImageView view{picture.pixels().data(), picture.width(), picture.height(), 4, 8};
    return host_.encode_image(view, diorama::ImageFormat::Png);
  }

  Params params_;
  diorama::Host& host_;
};

/// Cells of a row; nothing when a quote is left open.
std::optional<std::vector<std::string>> cells_of(std::string_view row) {
  std::vector<std::string> cells(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (row[i] == '"' && is_quoted && i + 1 < row.size() && row[i + 1] == '"') {
      cells.back() += row[i++];
    } else if (row[i] == '"') {
      is_quoted = !is_quoted;
    } else if (row[i] == ',' && !is_quoted) {
      cells.emplace_back();
    } else if (row[i] != '\r') {
      cells.back() += row[i];
    }
  }
  if (is_quoted) return std::nullopt;
  return cells;
}

template <class Number>
bool read_number(const std::string& text, Number& number) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return error == std::errc() && stop == end;
}

/// A picture's name says who took it and when: "cam_1/000007.png".
struct PictureName {
  std::string camera;
  int capture = 0;

  static std::optional<PictureName> parse(std::string_view text) {
    const std::size_t slash = text.find('/');
    if (slash == 0 || slash == text.npos || !text.ends_with(".png")) return std::nullopt;
    PictureName name{std::string(text.substr(0, slash)), 0};
    const std::string number(text.substr(slash + 1, text.size() - slash - 5));
    if (name.camera == ".." || !read_number(number, name.capture) || name.capture < 0) {
      return std::nullopt;
    }
    return name;
  }
};

struct Row {
  PictureName picture;
  int width = 0;
  int height = 0;
  std::string phase;
  diorama::Instance instance;

  static std::optional<Row> parse(std::string_view text) {
    const auto cells = cells_of(text);
    if (!cells || cells->size() != 12) return std::nullopt;
    const auto& cell = *cells;
    Row row;
    diorama::PixelBox& box = row.instance.tight_box.emplace();
    double visible = 0.0;
    double truncation = 0.0;
    const auto picture = PictureName::parse(cell[0]);
    if (!picture || !read_number(cell[1], row.width) || !read_number(cell[2], row.height) ||
        !read_number(cell[6], box.x_min) || !read_number(cell[7], box.y_min) ||
        !read_number(cell[8], box.x_max) || !read_number(cell[9], box.y_max) ||
        !read_number(cell[10], visible) || !read_number(cell[11], truncation)) {
      return std::nullopt;
    }
    if (row.width < 1 || row.height < 1 || !(visible >= 0.0 && visible <= 1.0) ||
        !(truncation >= 0.0 && truncation <= 1.0)) {
      return std::nullopt;
    }
    row.picture = *picture;
    row.phase = cell[3];
    row.instance.node_path = cell[4];
    row.instance.labels = {{"class", cell[5]}};
    // Shares are held, not counts: of a million pixels.
    diorama::Visibility& visibility = row.instance.visibility.emplace();
    visibility.outside_pixels = std::llround(1e6 * truncation);
    visibility.amodal_pixels = 1'000'000 - visibility.outside_pixels;
    visibility.visible_pixels = std::llround(visible * double(visibility.amodal_pixels));
    return row;
  }
};

/// A table and its pictures. Where a capture's rows lie is kept, the rows are not.
class CsvBoxesDataset final : public diorama::StoredDataset {
 public:
  CsvBoxesDataset(fs::path folder, const diorama::Host& host)
      : folder_(std::move(folder)), host_(host) {
    std::set<std::string> cameras;
    list_rows(cameras);
    list_pictures(cameras);
    info_.format = "csv_boxes";
    info_.camera_names.assign(cameras.begin(), cameras.end());
    for (const auto& [capture, spans] : rows_) info_.captures.push_back(capture);
    // Nobody looks at what is not named here.
    for (const std::string_view name :
         {diorama::kHoldsInstances, diorama::kHoldsLabels, diorama::kHoldsNodePaths,
          diorama::kHoldsTightBoxes, diorama::kHoldsOcclusion, diorama::kHoldsTruncation}) {
      info_.holds.emplace(name);
    }
    info_.steps[std::string(diorama::kHoldsOcclusion)] = kShareStep;
    info_.steps[std::string(diorama::kHoldsTruncation)] = kShareStep;
  }

  const diorama::StoredInfo& info() const override { return info_; }
  const diorama::ReadLog& log() const override { return log_; }
  diorama::StoredCapture read(std::size_t i, const diorama::NameSet& wanted) const override;

 private:
  struct Span {
    std::streamoff begin = 0;
    std::streamoff end = 0;
  };

  void list_rows(std::set<std::string>& cameras) {
    std::ifstream in(folder_ / kTable, std::ios::binary);
    std::string line;
    if (!std::getline(in, line) || line != kHeader) {
      throw diorama::Error(diorama::ErrorKind::Asset,
                           (folder_ / kTable).string() + ": begins with '" + line +
                               "', a table of boxes with '" + kHeader + "'");
    }
    ++log_.files;
    for (std::streamoff begin = in.tellg(); std::getline(in, line);) {
      const std::streamoff end =
          in.eof() ? begin + std::streamoff(line.size()) : std::streamoff(in.tellg());
      const auto row = Row::parse(line);
      log_.check(row.has_value(), {"every file can be read",
                                   kTable,
                                   {},
                                   "",
                                   "",
                                   "the row " + line,
                                   "cells as the first line has them"});
      if (row) {
        cameras.insert(row->picture.camera);
        std::vector<Span>& spans = rows_[row->picture.capture];
        if (spans.empty() || spans.back().end != begin) spans.push_back({begin, begin});
        spans.back().end = end;
      }
      begin = end;
    }
  }

  /// Pictures in which nothing can be seen have no row.
  void list_pictures(std::set<std::string>& cameras) {
    for (const auto& camera : fs::directory_iterator(folder_)) {
      if (!camera.is_directory()) continue;
      const std::string below = camera.path().filename().string() + "/";
      for (const auto& file : fs::directory_iterator(camera.path())) {
        const auto name = PictureName::parse(below + file.path().filename().string());
        if (!name) continue;
        rows_[name->capture];
        cameras.insert(name->camera);
        info_.holds.emplace(diorama::kColor.name);
      }
    }
  }

  std::vector<Row> rows_of(int capture, diorama::StoredCapture& stored) const {
    std::vector<Row> rows;
    std::ifstream in(folder_ / kTable, std::ios::binary);
    for (const Span& span : rows_.at(capture)) {
      std::string line;
      in.seekg(span.begin);
      for (std::streamoff at = span.begin; at < span.end && std::getline(in, line);) {
        at += std::streamoff(line.size()) + 1;
        if (auto row = Row::parse(line)) rows.push_back(std::move(*row));
      }
    }
    stored.log.check(
        std::ranges::all_of(rows, [&](const Row& row) { return row.phase == rows[0].phase; }),
        {"files agree", kTable, capture, "", "", "its rows are of several phases", ""});
    return rows;
  }

  /// The picture as 8-bit RGBA; what is wrong with it is a finding.
  std::optional<diorama::Image<diorama::Rgba8>> picture(const std::string& file, int capture,
                                                        diorama::ReadLog& log) const {
    ++log.files;
    try {
      const auto texture = host_.read_texture(folder_ / file);
      diorama::Image<diorama::Rgba8> image(texture->width, texture->height, {});
      const std::size_t channels = std::size_t(texture->channels);
      if (channels < 3 || texture->bytes.empty())
        throw std::runtime_error("it has no 8-bit colour");
      for (std::size_t i = 0; i < image.pixels().size(); ++i) {
        const std::uint8_t* from = texture->bytes.data() + i * channels;
        image.pixels()[i] = {from[0], from[1], from[2], channels > 3 ? from[3] : std::uint8_t{255}};
      }
      return image;
    } catch (const std::exception& error) {
      log.check(false,
                {"every file can be read", file, capture, "", "", error.what(), "a picture"});
      return std::nullopt;
    }
  }

  std::optional<diorama::Frame> read_frame(const std::string& camera, int capture,
                                           const std::vector<Row>& rows,
                                           const diorama::NameSet& wanted,
                                           diorama::StoredCapture& stored) const;

  fs::path folder_;
  const diorama::Host& host_;
  std::map<int, std::vector<Span>> rows_;  ///< By capture.
  diorama::StoredInfo info_;
  diorama::ReadLog log_;
};

//! [read]
// Runs on several threads at once.
diorama::StoredCapture CsvBoxesDataset::read(std::size_t i, const diorama::NameSet& wanted) const {
  diorama::StoredCapture stored;
  const int capture = info_.captures.at(i);
  stored.capture.index = capture;
  ++stored.log.files;
  const std::vector<Row> rows = rows_of(capture, stored);
  if (!rows.empty()) stored.capture.phase = rows[0].phase;
  for (const std::string& camera : info_.camera_names) {
    auto frame = read_frame(camera, capture, rows, wanted, stored);
    if (!frame) continue;
    stored.capture.frames.push_back(std::move(*frame));
    auto& files = stored.files.emplace_back();
    files.emplace(diorama::kHoldsInstances, kTable);
    const diorama::Frame& made = stored.capture.frames.back();
    if (made.has(diorama::kColor.name)) {
      files.emplace(diorama::kColor.name, picture_name(made, capture));
    }
  }
  return stored;
}
//! [read]

std::optional<diorama::Frame> CsvBoxesDataset::read_frame(const std::string& camera, int capture,
                                                          const std::vector<Row>& rows,
                                                          const diorama::NameSet& wanted,
                                                          diorama::StoredCapture& stored) const {
  const auto check = [&](bool holds, const char* rule, const std::string& file,
                         const std::string& found, const std::string& expected) {
    stored.log.check(holds, {rule, file, capture, camera, "", found, expected});
  };
  diorama::Frame frame;
  frame.camera_name = camera;
  std::set<std::string> known;
  for (const Row& row : rows) {
    if (row.picture.camera != camera) continue;
    if (frame.instances.empty()) {
      frame.camera.width = row.width;
      frame.camera.height = row.height;
    }
    check(row.width == frame.camera.width && row.height == frame.camera.height, "files agree",
          kTable, "its rows say several sizes of the picture", "");
    check(known.insert(row.instance.node_path).second, "everything is there once", kTable,
          "two rows are of " + row.instance.node_path, "");
    frame.instances.push_back(row.instance);
    frame.instances.back().id = std::uint32_t(frame.instances.size());
  }
  const bool has_rows = !frame.instances.empty();
  if (info_.holds.contains(diorama::kColor.name) &&
      (!has_rows || wanted.contains(diorama::kColor.name))) {
    const std::string file = picture_name(frame, capture);
    if (!has_rows && !fs::exists(folder_ / file)) return std::nullopt;
    if (auto image = picture(file, capture, stored.log)) {
      check(!has_rows ||
                (image->width() == frame.camera.width && image->height() == frame.camera.height),
            "files agree", file, "its size is not that of the table", "");
      frame.camera.width = image->width();
      frame.camera.height = image->height();
      frame.set(diorama::kColor, std::move(*image));
    } else if (!has_rows) {
      return std::nullopt;
    }
  } else if (!has_rows) {
    return std::nullopt;
  }
  return frame;
}

class CsvBoxesReader final : public diorama::Reader {
 public:
  struct Params {
    void visit(diorama::ParamVisitor&) {}
  };
  CsvBoxesReader(Params, diorama::Host& host) : host_(host) {}

  //! [recognise]
  std::vector<std::string> patterns() const override { return {kTable}; }

  // Other tables may have this name; none begins like ours.
  diorama::Recognition recognise(const fs::path& folder) const override {
    std::ifstream in(folder / kTable, std::ios::binary);
    std::string line(std::string_view(kHeader).size(), '\0');
    in.read(line.data(), std::streamsize(line.size()));
    return in && line == kHeader ? diorama::Recognition::ByName : diorama::Recognition::No;
  }

  std::unique_ptr<const diorama::StoredDataset> open(const fs::path& folder) const override {
    return std::make_unique<CsvBoxesDataset>(folder, host_);
  }
  //! [recognise]

 private:
  diorama::Host& host_;
};

}  // namespace

DIORAMA_PLUGIN("csv_boxes", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(CsvBoxesWriter, "csv_boxes", "Writes one CSV table of all boxes.");
  DIORAMA_ADD_READER(CsvBoxesReader, "csv_boxes_reader", "Reads tables of csv_boxes.", "boxes.csv");
}
