// SPDX-License-Identifier: @LICENCE@
// Marks the outlines of things: pixels whose distance differs from a neighbour's by a jump.
#include <diorama/annotator.h>
#include <diorama/plugin.h>

#include <algorithm>
#include <cmath>

namespace {

constexpr diorama::Channel<float> kOutlines{"@NAME@"};

class @CLASS@ final : public diorama::Annotator {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    double jump = 0.05;
    void visit(diorama::ParamVisitor& v) {
      v.param("jump", jump, {"Least difference, as a share of the nearer distance.", "", 0.0, 10.0});
    }
  };
  @CLASS@(Params params, diorama::Host&) : params_(params) {}

  diorama::NameSet needs() const override {
    return {std::string(diorama::kDistanceToImagePlane.name)};
  }
  diorama::NameSet provides() const override { return {std::string(kOutlines.name)}; }

 private:
  void do_annotate(const diorama::Scene&, diorama::Frame& frame) const override {
    const auto& distance = frame.get(diorama::kDistanceToImagePlane);
    diorama::Image<float> outlines(distance.width(), distance.height(), 0.0f);
    for (int y = 0; y < distance.height(); ++y) {
      for (int x = 0; x < distance.width(); ++x) {
        if (jumps(distance, x, y, x + 1, y) || jumps(distance, x, y, x, y + 1)) {
          outlines.at(x, y) = 1.0f;
        }
      }
    }
    frame.set(kOutlines, std::move(outlines));
  }

  bool jumps(const diorama::Image<float>& distance, int x, int y, int x2, int y2) const {
    if (!distance.contains(x2, y2)) return false;
    const float a = distance.at(x, y), b = distance.at(x2, y2);
    // Where nothing was hit the distance is infinite; two such neighbours are no outline.
    if (std::isinf(a) || std::isinf(b)) return std::isinf(a) != std::isinf(b);
    return std::abs(a - b) > params_.jump * std::min(a, b);
  }

  Params params_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD_ANNOTATOR(@CLASS@, "@NAME@", "Marks jumps of the distance between pixels.",
                        "distance_to_image_plane", "@NAME@");
}
