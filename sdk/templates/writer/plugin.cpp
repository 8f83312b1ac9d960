// SPDX-License-Identifier: @LICENCE@
// One CSV file per picture: the box of every labelled object that can be seen in it.
#include <diorama/plugin.h>
#include <diorama/writer.h>

#include <cstdio>
#include <string>

namespace {

class @CLASS@ final : public diorama::Writer {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    std::string taxonomy = "class";
    int min_pixels = 1;
    void visit(diorama::ParamVisitor& v) {
      v.param("taxonomy", taxonomy, {"Which of an object's labels to write."});
      v.param("min_pixels", min_pixels, {"Smaller boxes are left out.", "px", 1, 1e6});
    }
  };
  @CLASS@(Params params, diorama::Host&) : params_(std::move(params)) {}

  // Only what is asked for here is computed.
  diorama::NameSet needs() const override { return {"instance_id", "instances"}; }

  // Runs on several threads at once, hence const; names follow from the capture's index alone.
  void write(const diorama::Capture& capture, diorama::CaptureFiles& files) const override {
    for (const diorama::Frame& frame : capture.frames) {
      char number[16];
      std::snprintf(number, sizeof number, "%06d", capture.index);
      files.add_text(frame.camera_name + "/" + number + ".csv", table(frame));
    }
  }

 private:
  std::string table(const diorama::Frame& frame) const {
    std::string text = "label,x_min,y_min,x_max,y_max\n";
    for (const diorama::Instance& instance : frame.instances) {
      const auto label = instance.labels.find(params_.taxonomy);
      if (label == instance.labels.end() || !instance.tight_box) continue;
      const diorama::PixelBox& box = *instance.tight_box;
      if (box.width() < params_.min_pixels || box.height() < params_.min_pixels) continue;
      text += quoted(label->second) + "," + std::to_string(box.x_min) + "," +
              std::to_string(box.y_min) + "," + std::to_string(box.x_max) + "," +
              std::to_string(box.y_max) + "\n";
    }
    return text;
  }

  // RFC 4180: quotes are doubled inside quotes.
  static std::string quoted(const std::string& label) {
    if (label.find_first_of(",\"\r\n") == std::string::npos) return label;
    std::string text = "\"";
    for (const char c : label) text += c == '"' ? std::string("\"\"") : std::string(1, c);
    return text + "\"";
  }

  Params params_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD(@CLASS@, "@NAME@", "Writes the boxes of each picture as CSV.");
}
