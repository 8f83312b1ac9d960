// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diorama/config.h"
#include "diorama/params.h"
#include "diorama/rng.h"

/// What a job demands of the views of a capture series: its section `views`.
namespace diorama {

/// An interval that may be open on either side; without bounds everything is inside.
struct Limits {
  std::optional<double> min;
  std::optional<double> max;
  double least = 0.0;  ///< Of what makes sense, for the key's documentation.
  double most = 1e9;
  const char* unit = "";

  void visit(ParamVisitor& v);
  bool is_set() const { return min || max; }
  bool hold(double value) const { return !(min && value < *min) && !(max && value > *max); }
  /// 0 inside; how far outside, in parts of the bound that is missed, up to 1.
  double shortfall(double value) const;
};

/// Parts of the views of a whole dataset, by a quantity of each view's main target.
struct Quota {
  std::string of = "label";
  std::vector<std::string> labels;
  std::vector<double> edges;
  int columns = 8;
  int rows = 4;
  std::vector<double> shares;

  void visit(ParamVisitor& v);
  std::size_t bin_count() const;
  /// The bin's name for people: "banana", "0.5 to 1".
  std::string bin_name(std::size_t bin) const;
  /// Of a number; nothing outside of all of them.
  std::optional<std::size_t> bin_of(double value) const;
  std::optional<std::size_t> bin_of_label(const std::string& label) const;
};

/// One entry of `views`.
struct ViewRule {
  std::string name;
  std::vector<std::string> on;
  std::string cameras = "/Cameras/*";
  std::string targets = "/**";
  std::string taxonomy = "class";
  std::vector<std::string> labels;
  Limits count{1.0, std::nullopt, 0.0, 1e6};
  bool every_target = false;
  Limits visible_pixels{std::nullopt, std::nullopt, 0.0, 1e9, "px"};
  Limits visible_share{std::nullopt, std::nullopt, 0.0, 1.0};
  Limits occlusion{std::nullopt, std::nullopt, 0.0, 1.0};
  Limits truncation{std::nullopt, std::nullopt, 0.0, 1.0};
  Limits size_px{std::nullopt, std::nullopt, 0.0, 65536.0, "px"};
  Limits size_share{std::nullopt, std::nullopt, 0.0, 1.0};
  Limits distance_m{std::nullopt, std::nullopt, 0.0, 1e6, "m"};
  Limits azimuth_deg{std::nullopt, std::nullopt, -360.0, 360.0, "deg"};
  Limits elevation_deg{std::nullopt, std::nullopt, -90.0, 90.0, "deg"};
  std::string direction_space = "target";
  Limits occluders{std::nullopt, std::nullopt, 0.0, 1e6};
  Limits brightness{std::nullopt, std::nullopt, 0.0, 1.0};
  std::vector<Quota> quotas;
  bool together = false;
  int max_tries = 100;
  std::string at_limit = "keep_best";

  Value map;         ///< The whole entry, for messages.
  std::string path;  ///< For messages: "views[0]".

  void visit(ParamVisitor& v);
  bool is_on(const std::string& series) const;
  /// The cell of a direction from the target, as far as the rule's limits let it be.
  std::optional<std::size_t> direction_bin(const Quota& quota, double azimuth_deg,
                                           double elevation_deg) const;
};

/// Azimuths are the same every 360 degrees: the one that the limits hold, if any.
double turned_into(const Limits& limits, double azimuth_deg);

/// Complains about what the keys alone cannot tell: bounds the wrong way round, quotas without
/// bins. `series` are those of the job.
void check_view_rule(const ViewRule& rule, const std::vector<std::string>& series,
                     Diagnostics& diagnostics);

/// The bin that the view with this number (from 0, over the whole dataset) has to fall into. Of
/// every so many views as the shares add up to, each bin gets its share exactly, in an order that
/// `rng` shuffles anew each time; so no view has to know of any other.
std::size_t quota_bin(const Quota& quota, const Rng& rng, std::uint64_t view);

}  // namespace diorama
