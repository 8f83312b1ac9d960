// SPDX-License-Identifier: Apache-2.0
// One table of all boxes of a dataset, boxes.csv, beside the pictures that it speaks of: what a
// spreadsheet or pandas.read_csv() opens.
#include <diorama/host.h>
#include <diorama/plugin.h>
#include <diorama/writer.h>

#include <algorithm>
#include <charconv>
#include <cstdio>

namespace {

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

class CsvBoxes final : public diorama::Writer {
 public:
  using Params = CsvParams;
  CsvBoxes(Params params, diorama::Host& host) : params_(std::move(params)), host_(host) {}

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
        rows += row(picture, capture.phase, instance);
      }
    }
    if (!rows.empty()) files.record(rows);
  }
  //! [write]

  //! [finish]
  void finish(const diorama::RecordReader& records, diorama::DatasetFiles& files) override {
    // The table grows on disk: it may be larger than the memory.
    const char* const table = "boxes.csv";
    files.append_text(table,
                      "picture,phase,object,label,x_min,y_min,x_max,y_max,visibility,truncation\n");
    // A record is one line; its rows are told apart by tabs, which no row holds.
    records([&](int, std::string_view line) {
      std::string rows(line);
      std::ranges::replace(rows, '\t', '\n');
      files.append_text(table, rows);
    });
  }
  //! [finish]

 private:
  /// One row that ends with a tab; nothing for what has no label or cannot be seen well enough.
  std::string row(const std::string& picture, const std::string& phase,
                  const diorama::Instance& instance) const {
    const auto label = instance.labels.find(params_.taxonomy);
    if (label == instance.labels.end() || !instance.tight_box || !instance.visibility) return {};
    const double visible = 1.0 - instance.visibility->occlusion().value_or(1.0);
    if (visible < params_.min_visibility) return {};
    const diorama::PixelBox& box = *instance.tight_box;
    std::string text = picture;
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

}  // namespace

DIORAMA_PLUGIN("csv_boxes", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(CsvBoxes, "csv_boxes", "Writes one CSV table of all boxes.");
}
